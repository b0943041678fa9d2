# SPDX-License-Identifier: BSD-3-Clause
"""A clock that runs fast or slow is one fault: neither a delay besides, nor the laser's if it is the reference's.

Nobody knows from when on it does: if clocks agreed later than at 0, a delay is a part of it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from kurumaisu import effects
from kurumaisu.critic.values.laser_finding import LaserFinding
from kurumaisu.critic.values.recording import Recording, Run
from kurumaisu.critic.values.settings import Settings
from kurumaisu.critic.values.verdict import Cause
from kurumaisu.effects import BeamEffect, Beams, Context, Reference, ReferenceEffect
from kurumaisu.params import Model
from kurumaisu.types import FloatArray

_NEAR = 5.0  # [s] of the first scan: so long before or after it a recording may have begun
_SURE = 1.8  # times half of a 90 % interval: three standard deviations
_LATER = 1000.0  # [s] at which a clock's drift is looked at
_NONE = 1e-9  # [s] a shift that is none

Look = Callable[[Recording], LaserFinding]
_Times = Callable[[FloatArray, float], FloatArray]


@dataclass(frozen=True)
class _Clock:
    """By how much a cause moves the time of a scan: at [s] time 0; growth [1] since then; half of its interval [s]."""

    at: float
    growth: float
    half: float


def without_double_delay(finding: LaserFinding, stamps: FloatArray) -> LaserFinding:
    """Return a finding without a cause of its own for a delay that only says that the clocks agreed at the first scan.

    stamps [s] of the scans, since time 0 of the laser. The model keeps the delay: its clocks agree at time 0.
    """
    first = float(stamps.min())
    if first < _NEAR:
        return finding
    clocks = {cause.id: _clock(cause) for cause in finding.causes}
    running = [(name, clock) for name, clock in clocks.items() if clock and abs(clock.growth) * _LATER > _NONE]
    delays = [(name, clock) for name, clock in clocks.items() if clock and abs(clock.growth) * _LATER <= _NONE]
    if len(running) != 1 or len(delays) != 1:
        return finding
    (drifting, drift), (late, delay) = *running, *delays
    agreed = -(delay.at + drift.at) / drift.growth
    if abs(agreed - first) > _NEAR + _SURE * delay.half / abs(drift.growth):
        return finding
    told = f"{drifting}: the clocks agreed {agreed:.3g} s after time 0; the model has this as a delay."
    return replace(finding, causes=tuple(c for c in finding.causes if c.id != late), details=(*finding.details, told))


def _drifts(name: str) -> bool:
    """Return whether an effect of a usual size lets the time of a scan drift."""
    effect = effects.by_id(name)
    if not issubclass(effect, BeamEffect):
        return False
    usual = effect({p.name: p.null + p.scale for p in effect.parameters}, np.random.default_rng(0))
    early, late = (float(usual.apply(Beams.single(stamp)).times[0]) - stamp for stamp in (0.0, _LATER))
    return abs(late - early) > _NONE


def _clock(cause: Cause) -> _Clock | None:
    """Return what a cause does to the time of a whole scan; None if that is nothing."""
    effect = effects.by_id(cause.id)
    if not issubclass(effect, BeamEffect):
        return None

    def shift(stamp: float, end: str = "estimate") -> float:
        values = {p.name: p.null for p in effect.parameters}
        values |= {name: float(getattr(one, end)) for name, one in cause.parameters.items()}
        return float(effect(values, np.random.default_rng(0)).apply(Beams.single(stamp)).times[0]) - stamp

    at, growth = shift(0.0), (shift(_LATER) - shift(0.0)) / _LATER
    half = abs(shift(0.0, "hi90") - shift(0.0, "lo90")) / 2
    return _Clock(at, growth, half) if max(abs(at), abs(growth) * _LATER) > _NONE else None


def by_its_clock(
    causes: Sequence[Cause], finding: LaserFinding, recording: Recording, model: Model, look: Look
) -> tuple[LaserFinding, Recording]:
    """Return what the scans say of a recording whose reference is stamped by the commands' clock, and that recording.

    causes: of the drives; finding: of the scans as they are; look: criticises the scans of a recording. If the laser's
    clock still drifts then, it does so by itself, and the finding is what it was.
    """
    known = [(cause.id, {name: one.estimate for name, one in cause.parameters.items()}) for cause in causes]
    told = next(((name, times) for name, v in known if (times := _stamped_by(name, v, model)) is not None), None)
    if told is None or not _drifting(finding):
        return finding, recording
    name, times = told
    first = min((float(run.pose.t[0]) for run in recording.runs if run.pose is not None), default=0.0)
    stamped = replace(recording, runs=tuple(_restamped(run, times, first) for run in recording.runs))
    again = look(stamped)
    if again.refused is not None or again.wrong is not None or _drifting(again):
        return finding, recording
    words = f"laser: by the reference its clock seems to drift; the cause is {name}, not the laser's clock."
    return replace(again, details=(*again.details, words)), stamped


def _drifting(finding: LaserFinding) -> bool:
    named = [cause.id for cause in finding.causes]
    return any(_drifts(name) for name in (*named, *(name for group in finding.confounded for name in group)))


def by_commands(settings: Settings, model: Model) -> Settings:
    """Return settings for a reference that is stamped by the commands' clock."""
    return tuple(one for one in settings if _stamped_by(one.id, one.parameters, model) is None)


def _stamped_by(name: str, values: Mapping[str, float], model: Model) -> _Times | None:
    """Return the stamps that a reference gives to times, as its drive began at a time; None if they are the same."""
    effect = effects.by_id(name)
    if not issubclass(effect, ReferenceEffect):
        return None
    context = Context(model.translation, model.steering, np.random.default_rng(0))
    values = {p.name: p.null for p in effect.parameters} | dict(values)

    def stamped(times: FloatArray, start: float) -> FloatArray:
        none = np.zeros((*times.shape, 3))
        return effect(values, context).apply(Reference(times, none, none, start)).times

    return stamped if abs(stamped(np.array([0.0, _LATER]), 0.0)[1] - _LATER) > _NONE else None


def _restamped(run: Run, times: _Times, first: float) -> Run:
    """Return a run whose reference has the stamps of the others' clock; first [s]: of all runs."""
    if run.pose is None:
        return run
    since = run.pose.t - first
    ends = np.array([since[0], since[-1] + 1.0])
    low, high = times(ends, float(since[0]))
    slope = (high - low) / (ends[1] - ends[0])
    return replace(run, pose=replace(run.pose, t=first + ends[0] + (since - low) / slope))
