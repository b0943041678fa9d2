# SPDX-License-Identifier: BSD-3-Clause
"""What the scans find because the reference measures another point than base_link, or by a clock of its own.

The drives and the scans are criticised apart, the latter from the reference's poses. Where the reference's point is in
front of base_link, the laser seems to sit as much further back: one fault, named twice, and simulated twice. And beside
so large an effect, a small one of the laser's own goes unseen.

A clock that runs fast or slow is one fault, too: neither a delay besides, nor the laser's if it is the reference's.
Nobody knows from when on it does: if clocks agreed later than at 0, a delay is a part of it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from kurumaisu import effects
from kurumaisu.critic.values.criticism import LaserFinding, Settings
from kurumaisu.critic.values.recording import Recording, Run
from kurumaisu.critic.values.verdict import NORMAL90, Cause
from kurumaisu.effects import BeamEffect, Beams, Context, Reference, ReferenceEffect
from kurumaisu.geometry import compose
from kurumaisu.params import EffectSetting, Model
from kurumaisu.types import FloatArray

_SAME = 3.0  # sds by which two sizes may differ: those of two faults would hardly be opposite so closely
_SHIFT = 1e-6  # [m, rad] below which nothing is elsewhere

_Place = Callable[[Mapping[str, float]], FloatArray]
_NEAR = 5.0  # [s] of the first scan: so long before or after it a recording may have begun
_SURE = 1.8  # times half of a 90 % interval: three standard deviations
_LATER = 1000.0  # [s] at which a clock's drift is looked at
_NONE = 1e-9  # [s] a shift that is none

Look = Callable[[Recording], LaserFinding]
_Times = Callable[[FloatArray, float], FloatArray]


def from_base_link(
    causes: Sequence[Cause], finding: LaserFinding, recording: Recording, model: Model, look: Look
) -> tuple[LaserFinding, tuple[EffectSetting, ...]]:
    """Return what the scans say from base_link, and settings with which they are expected from the reference.

    causes: of the drives; finding: from the reference; look: criticises the scans of a recording. What shifts the laser
    by as much as a cause shifts the reference, the other way, is no cause of its own: the scans are looked at again.
    """
    points = [(cause.id, point) for cause in causes if (point := _shift(cause, model)) is not None]
    seen = [(cause.id, shift) for cause in finding.causes if (shift := _shift(cause, model)) is not None]
    told = {name: other for name, shift in seen for other, point in points if shift.undoes(point)}
    if not told:
        return finding, finding.settings
    by = np.sum([shift.by for name, shift in seen if name in told], axis=0)
    again = look(replace(recording, runs=tuple(_moved(run, by) for run in recording.runs)))
    words = [
        f"laser: seen from the reference it seems displaced ({name}); the cause is {other}, not the mounting."
        for name, other in told.items()
    ]
    there = tuple(setting for setting in finding.settings if setting.id in told)
    return replace(again, details=(*again.details, *words)), (*again.settings, *there)


def is_point(name: str) -> bool:
    """Tell whether an effect is one on what the reference measures: it may put that elsewhere than base_link."""
    return issubclass(effects.by_id(name), ReferenceEffect)


def mountings(model: Model) -> frozenset[str]:
    """Return the effects that put the laser elsewhere."""
    out = set()
    for effect in effects.LASER:
        place = _placed_by(effect.id, model)
        null, usual = ({p.name: p.null + far * p.scale for p in effect.parameters} for far in (0.0, 1.0))
        if place is not None and np.abs(place(usual) - place(null)).max() > _SHIFT:
            out.add(effect.id)
    return frozenset(out)


def ruled_out(
    points: Sequence[Cause],
    sets: Sequence[Sequence[str]],
    finding: LaserFinding,
    recording: Recording,
    model: Model,
    look: Look,
) -> dict[str, str]:
    """Return which effects of some sets the scans tell not to act, and why.

    points: those of the sets that put the reference elsewhere, as they would be; look: asks scans for the laser's place
    alone. A reference that is elsewhere shows in the scans as a laser that is as far off the other way. Where it does,
    nothing else of its set is needed; where it does not, and scans taken from where the chair would be do show a laser
    that is off, it is not.
    """
    out: dict[str, str] = {}
    for cause in points if finding.refused is None and finding.wrong is None else ():
        shift = _shift(cause, model)
        if shift is None:
            continue
        if _undone(shift, finding, model):
            others = {name for group in sets if cause.id in group for name in group if name != cause.id}
            out |= dict.fromkeys(others, f"the scans see the laser where {cause.id} would have it")
            continue
        there = replace(recording, runs=tuple(_moved(run, -shift.by) for run in recording.runs))
        if _undone(replace(shift, by=-shift.by), look(there), model):
            out[cause.id] = "with it the scans would see the laser elsewhere than it is"
    return out


def _undone(point: _Shift, finding: LaserFinding, model: Model) -> bool:
    """Tell whether scans see a laser that is off as it is by a shift of the reference."""
    return any(shift.undoes(point) for cause in finding.causes if (shift := _shift(cause, model)) is not None)


def _moved(run: Run, by: FloatArray) -> Run:
    """Return a run whose reference poses are those of another point."""
    return run if run.pose is None else replace(run, pose=replace(run.pose, values=compose(run.pose.values, by)))


@dataclass(frozen=True)
class _Shift:
    """By how much something sits elsewhere (3,) [m, m, rad], with sds."""

    by: FloatArray
    sd: FloatArray

    def undoes(self, other: _Shift) -> bool:
        """Return whether both together are none, within their doubt."""
        axes = (np.abs(self.by) > _SHIFT) | (np.abs(other.by) > _SHIFT)
        return bool(np.all(np.abs(self.by + other.by)[axes] < _SAME * np.hypot(self.sd, other.sd)[axes]))


def _shift(cause: Cause, model: Model) -> _Shift | None:
    """Return by how much a cause shifts the reference's point or the laser; None where it shifts neither."""
    effect, place = effects.by_id(cause.id), _placed_by(cause.id, model)
    if place is None:
        return None
    nulls = {p.name: p.null for p in effect.parameters}
    middle = nulls | {name: known.estimate for name, known in cause.parameters.items()}
    by = place(middle) - place(nulls)
    if np.abs(by).max() < _SHIFT:
        return None  # a clock, or a tilt
    widths = [
        place({**middle, name: known.hi90}) - place({**middle, name: known.lo90})
        for name, known in cause.parameters.items()
    ]
    return _Shift(by, np.sqrt(np.sum(np.square(widths), axis=0)) / (2 * NORMAL90))


def _placed_by(name: str, model: Model) -> _Place | None:
    """Return where an effect of some values puts what was in the origin (3,); None if it is of no such kind."""
    effect, rng = effects.by_id(name), np.random.default_rng(0)
    if issubclass(effect, ReferenceEffect):
        context = Context(model.translation, model.steering, rng)
        origin = Reference(np.zeros(()), np.zeros(3), np.zeros(3))
        return lambda values: effect(values, context).apply(origin).poses
    if issubclass(effect, BeamEffect):
        return lambda values: effect(values, rng).apply(Beams.single()).mount
    return None


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
