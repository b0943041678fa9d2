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
_NEAR = 5.0  # [s] of the first scan: so long before or after it a recording may have begun
_ENDS = np.array([0.0, 1000.0])  # [s] at which clocks are compared
_NONE = 1e-9  # [s] a shift that is none

Look = Callable[[Recording], LaserFinding]


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
    return frozenset(
        each.id for each in effects.LASER if np.abs(_off(each.id, _usual(each.id), model)[0]).max() > _SHIFT
    )


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
    middle = _values(cause)
    by, _ = _off(cause.id, middle, model)
    if np.abs(by).max() < _SHIFT:
        return None  # a clock, or a tilt
    ends = [[{**middle, name: end} for end in (known.lo90, known.hi90)] for name, known in cause.parameters.items()]
    widths = [_off(cause.id, high, model)[0] - _off(cause.id, low, model)[0] for low, high in ends]
    return _Shift(by, np.sqrt(np.sum(np.square(widths), axis=0)) / (2 * NORMAL90))


def _values(cause: Cause, end: str = "estimate") -> dict[str, float]:
    return {name: float(getattr(one, end)) for name, one in cause.parameters.items()}


def _usual(name: str) -> dict[str, float]:
    return {p.name: p.null + p.scale for p in effects.by_id(name).parameters}


def _off(name: str, values: Mapping[str, float], model: Model) -> tuple[FloatArray, FloatArray]:
    """Return how far an effect moves what is in the origin (3,), and puts stamps off at _ENDS (2,) [s]."""
    place, stamps = _applied(name, values, _ENDS, model)
    return place, stamps - _ENDS


def _applied(name: str, values: Mapping[str, float], stamps: FloatArray, model: Model) -> tuple[FloatArray, FloatArray]:
    """Return what an effect makes of the origin (3,) at the first stamp, and of stamps (n,) [s] of a drive since then.

    values: of its parameters; the others are null. What acts on neither the reference nor on beams changes nothing.
    """
    effect, rng = effects.by_id(name), np.random.default_rng(0)
    every = {p.name: p.null for p in effect.parameters} | dict(values)
    if issubclass(effect, ReferenceEffect):
        none = np.zeros((len(stamps), 3))
        measures = effect(every, Context(model.translation, model.steering, rng))
        seen = measures.apply(Reference(stamps, none, none, float(stamps[0])))
        return seen.poses[0], seen.times
    if issubclass(effect, BeamEffect):
        fires = effect(every, rng)
        beams = [fires.apply(Beams.single(stamp)) for stamp in stamps.tolist()]
        return beams[0].mount, np.array([float(beam.times[0]) for beam in beams])
    return np.zeros(3), stamps


def without_double_delay(finding: LaserFinding, stamps: FloatArray, model: Model) -> LaserFinding:
    """Return a finding without a cause of its own for a delay that only says that the clocks agreed at the first scan.

    stamps [s] of the scans, since time 0 of the laser. The model keeps the delay: its clocks agree at time 0.
    """
    first = float(stamps.min())
    off = [(cause, *_off(cause.id, _values(cause), model)[1].tolist()) for cause in finding.causes]
    running = [one for one in off if abs(one[2] - one[1]) > _NONE]
    delays = [one for one in off if abs(one[2] - one[1]) <= _NONE < abs(one[1])]
    if first < _NEAR or len(running) != 1 or len(delays) != 1:
        return finding
    (drift, early, late), (delay, by, _) = running[0], delays[0]
    growth = (late - early) / (_ENDS[1] - _ENDS[0])
    agreed = -(by + early) / growth
    low, high = (float(_off(delay.id, _values(delay, end), model)[1][0]) for end in ("lo90", "hi90"))
    if abs(agreed - first) > _NEAR + _SAME * abs(high - low) / (2 * NORMAL90) / abs(growth):
        return finding
    told = f"{drift.id}: the clocks agreed {agreed:.3g} s after time 0; the model has this as a delay."
    return replace(finding, causes=tuple(c for c in finding.causes if c is not delay), details=(*finding.details, told))


def by_its_clock(
    causes: Sequence[Cause], finding: LaserFinding, recording: Recording, model: Model, look: Look
) -> tuple[LaserFinding, Recording]:
    """Return what the scans say of a recording whose reference is stamped by the commands' clock, and that recording.

    causes: of the drives; finding: of the scans as they are; look: criticises the scans of a recording. If the laser's
    clock still drifts then, it does so by itself, and the finding is what it was.
    """
    told = next((cause for cause in causes if _runs(cause.id, _values(cause), model)), None)
    if told is None or not _drifting(finding, model):
        return finding, recording
    first = min((float(run.pose.t[0]) for run in recording.runs if run.pose is not None), default=0.0)
    stamped = replace(recording, runs=tuple(_restamped(run, told, first, model) for run in recording.runs))
    again = look(stamped)
    if again.refused is not None or again.wrong is not None or _drifting(again, model):
        return finding, recording
    words = f"laser: by the reference its clock seems to drift; the cause is {told.id}, not the laser's clock."
    return replace(again, details=(*again.details, words)), stamped


def _drifting(finding: LaserFinding, model: Model) -> bool:
    """Tell whether an effect by which a scan's time drifts is named, or may act."""
    named = [*(cause.id for cause in finding.causes), *(name for group in finding.confounded for name in group)]
    return any(abs(np.diff(_off(name, _usual(name), model)[1])[0]) > _NONE for name in named)


def by_commands(settings: Settings, model: Model) -> Settings:
    """Return settings for a reference that is stamped by the commands' clock."""
    return tuple(one for one in settings if not _runs(one.id, one.parameters, model))


def _runs(name: str, values: Mapping[str, float], model: Model) -> bool:
    """Tell whether a reference with this effect gives other stamps, in the end."""
    return bool(abs(_off(name, values, model)[1][1]) > _NONE)


def _restamped(run: Run, clock: Cause, first: float, model: Model) -> Run:
    """Return a run whose reference has the stamps of the others' clock; first [s]: of all runs."""
    if run.pose is None:
        return run
    since = run.pose.t - first
    ends = np.array([since[0], since[-1] + 1.0])
    low, high = _applied(clock.id, _values(clock), ends, model)[1]
    slope = (high - low) / (ends[1] - ends[0])
    return replace(run, pose=replace(run.pose, t=first + ends[0] + (since - low) / slope))
