# SPDX-License-Identifier: BSD-3-Clause
"""What it costs equations (1) and (2) that nobody measured the pose: the particle filter's path through the scans.

The same simulated drives, identified once by a reference pose and once by scans and odometry alone, on a chair that is
its model and on one that is not: a filter that believed its odometry would find the model's law again.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from kurumaisu._core import integrate
from kurumaisu.bench.table import Table, share
from kurumaisu.critic.experiment.rehearse import Rehearsal, manner
from kurumaisu.critic.values.recording import Recording, Run, Series
from kurumaisu.paper.chair import drive, identify
from kurumaisu.paper.chair.law import BranchFit
from kurumaisu.paper.options import PaperOptions, load_options
from kurumaisu.params import EffectSetting, Model, load_model, shipped
from kurumaisu.sim.settings import load_dynamics
from kurumaisu.world import load_world

WORLD = "worlds/laboratory.world"
# Chairs: by what factor v and w differ from the model's.
CHAIRS = {"as its model": (1.0, 1.0), "15 % slower, turns 10 % more": (0.85, 1.10)}


@dataclass(frozen=True)
class Found:
    """Of one drive: whether each interval holds the truth; half widths, relative to the slope or [V]; refused sides."""

    held: list[bool]
    half: list[float]
    refused: int


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the table; return 1 where the intervals by scans hold the truth clearly less often than they say."""
    parser = argparse.ArgumentParser(prog="scripts/bench paper_scans", description=__doc__)
    parser.add_argument("--drives", type=int, default=10, help="of each chair")
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args(arguments)
    settings = load_options()
    title = f"{options.drives} drives each: intervals ({100 * settings.bootstrap.level:.0f} %) that hold the truth"
    table = Table(title, "chair", "reference", "held, exact 90 %", "refused", "slope [%]", "intercept [mV]")
    worst = 1.0
    for name, factors in CHAIRS.items():
        drives = [recorded(factors, options.seed + n) for n in range(options.drives)]
        for words, change in (("5 mm, 5 mrad", lambda r: r), ("scans, odometry", blind)):
            told = [judge(change(one), factors, settings) for one in drives]
            held = np.concatenate([one.held for one in told])
            half = np.array([one.half for one in told if not one.refused]).reshape(-1, 4, 2)
            slope, intercept = np.median(half[..., 0]), np.median(half[..., 1])
            sides = sum(one.refused for one in told) / (4 * len(told))
            row = share(int(held.sum()), len(held)), sides, 100 * float(slope), 1e3 * float(intercept)
            table.row(name, words, *row)
            worst = min(worst, float(held.mean()))
    return int(worst < settings.bootstrap.level - 0.05 - 1 / np.sqrt(options.drives))


def recorded(factors: tuple[float, float], seed: int, file: str = drive.IDENTIFICATION) -> Recording:
    """Return a drive of launch/paper in a room, with scans, odometry by the model, and reference poses."""
    model = drive.uneven(load_model(shipped("launch/md100.yaml")))
    names = ("base.gain_v", "base.gain_w")
    own = [EffectSetting(i, {"gain": by - 1}) for i, by in zip(names, factors, strict=True) if by != 1]
    chair: Model = replace(model, effects=(*model.effects, *own))
    rehearsal = Rehearsal(chair, load_world(shipped(WORLD)), load_dynamics(shipped("launch/physical.yaml")), manner())
    recording = rehearsal.run(drive.script(file), np.random.default_rng(seed))
    (run,) = recording.runs
    return replace(recording, runs=(replace(run, odom=_odometry(run)),))


def _odometry(run: Run) -> Series:
    """Return what base_node makes of the rates that the voltages stand for."""
    assert run.voltage is not None
    t, v, w = run.voltage.t, run.voltage.column("v"), run.voltage.column("w")
    path = integrate(v[:-1].copy(), w[:-1].copy(), np.diff(t))
    return Series(t, np.column_stack([path, v, w]), ("x", "y", "theta", "v", "w"))


def blind(recording: Recording) -> Recording:
    """Return it as a chair records it that nobody watches."""
    return replace(recording, truth=None, runs=tuple(replace(run, pose=None) for run in recording.runs))


def judge(recording: Recording, factors: tuple[float, float], options: PaperOptions) -> Found:
    """Return what identification makes of a drive of recorded()."""
    found = identify.identify(recording, options, lambda _: None)
    model = load_model(shipped("launch/md100.yaml"))
    held, half, refused = [], [], 0
    for fit, law, factor in zip(found.fits, (model.translation, model.steering), factors, strict=True):
        for side, branch in fit.branches().items():
            own = getattr(law, side)
            refused += bool(branch.refused)
            if not branch.refused:
                held += _held(branch, own.slope / factor, own.intercept)
                half += _half(branch)
    return Found(held, half, refused)


def _held(branch: BranchFit, slope: float, intercept: float) -> list[bool]:
    pairs = ((branch.slope, slope), (branch.intercept, intercept))
    return [c is not None and c.low <= true <= c.high for c, true in pairs]


def _half(branch: BranchFit) -> list[float]:
    assert branch.slope is not None
    assert branch.intercept is not None
    return [branch.slope.half / abs(branch.slope.value), branch.intercept.half]
