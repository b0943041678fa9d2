# SPDX-License-Identifier: BSD-3-Clause
"""Equation (2): its intercepts have the sign that makes both branches overlap; they are as printed, or corrected."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from kurumaisu._core import AxisLaw, Branch
from kurumaisu.critic import pipeline
from kurumaisu.critic.values.criticism import Criticism
from kurumaisu.critic.values.recording import Recording
from kurumaisu.params import EffectSetting, Model, shipped
from kurumaisu.riddles import lab

_DRIVE = "spin_three_speeds"  # turns in both ways at several rates, as a joystick drive has them


@dataclass(frozen=True)
class _Truth:
    name: str
    chair: Model


def tell(seed: int) -> Iterator[str]:
    """Yield the riddle, line by line."""
    yield "equation (2): as printed, or with both intercepts of the other sign?"
    chair = lab.chair()
    flipped = replace(chair, effects=(EffectSetting("base.steering_law", {"flip": 1.0, "meant": 0.0}),))
    truths = (_Truth("published", chair), _Truth("corrected", flipped))
    yield ""
    yield "standing, V_s swept over +-0.3 V; what the chair does in the middle, |V_s| < 0.1 V:"
    sweeps = {
        truth.name: lab.measured(truth.chair, "steering_sweep", chair.laser, seed, taped=False) for truth in truths
    }
    for name, recording in sweeps.items():
        yield f"  {name:10s} {_middle(recording)}"
    yield ""
    yield f"the critic, from commands and poses alone ({_DRIVE}; velocity follows command):"
    # A base that turns commands into voltages by the law that the chair has.
    for name, own in (("published", chair), ("corrected", replace(chair, steering=_flipped(chair)))):
        drive = lab.measured(own, _DRIVE, chair.laser, seed, taped=False)
        yield f"  {name:10s} {_answer(_without_volts(drive))}"
    yield ""
    yield "the critic, from steering_sweep (voltages and poses):"
    for name, recording in sweeps.items():
        yield f"  {name:10s} {_answer(recording)}"


def _middle(recording: Recording) -> str:
    """Return the yaw rates at small voltages, on the way up and on the way down."""
    run = recording.runs[0]
    assert run.voltage is not None
    assert run.pose is not None
    t = np.arange(run.pose.t[0] + 0.5, run.pose.t[-1] - 0.5, 0.5)
    heading = np.interp(np.append(t, t[-1] + 0.5), run.pose.t, run.pose.values[:, 2])
    rate = np.diff(heading) / 0.5
    volts = np.interp(t + 0.25, run.voltage.t, run.voltage.column("v_s"))
    rising = np.gradient(volts) > 0
    told = []
    for name, some in (("V_s rising", rising), ("falling", ~rising)):
        inside = some & (np.abs(volts) < 0.1)
        told.append(f"{name}: w {np.min(rate[inside]):+.2f} to {np.max(rate[inside]):+.2f} rad/s")
    return ", ".join(told)


def _flipped(chair: Model) -> AxisLaw:
    """Return the steering law with both intercepts of the other sign."""
    sides = chair.steering.positive, chair.steering.negative
    return AxisLaw(*(Branch(side.slope, -side.intercept) for side in sides))


def _without_volts(recording: Recording) -> Recording:
    return replace(recording, runs=tuple(replace(run, voltage=None, scan=None) for run in recording.runs))


def _answer(recording: Recording) -> str:
    """Return what the critic says against the shipped model (as printed)."""
    base = replace(recording, world=None, runs=tuple(replace(run, scan=None) for run in recording.runs))
    found: Criticism = pipeline.criticise(base, shipped("launch/md100.yaml"), lambda _: None)
    verdict = found.verdict
    said = [f"{cause.id} (p {cause.p:.2f})" for cause in verdict.causes]
    said += [" or ".join(group) for group in verdict.confounded]
    said += [f"unknown: {each.channel} over {each.covariate}" for each in verdict.unknown]
    said += verdict.problems if verdict.verdict == "invalid_data" else ()
    return f"{verdict.verdict}: {'; '.join(said)}" if said else verdict.verdict
