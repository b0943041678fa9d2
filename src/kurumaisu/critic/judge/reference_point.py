# SPDX-License-Identifier: BSD-3-Clause
"""What the scans find because the reference measures another point than base_link.

The drives and the scans are criticised apart, the latter from the reference's poses. Where the reference's point is in
front of base_link, the laser seems to sit as much further back: one fault, named twice, and simulated twice. And beside
so large an effect, a small one of the laser's own goes unseen.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from kurumaisu import effects
from kurumaisu.critic.judge.clock_drift import Look
from kurumaisu.critic.values.laser_finding import LaserFinding
from kurumaisu.critic.values.recording import Recording, Run
from kurumaisu.critic.values.verdict import NORMAL90, Cause
from kurumaisu.effects import BeamEffect, Beams, Context, Reference, ReferenceEffect
from kurumaisu.geometry import compose
from kurumaisu.params import EffectSetting, Model
from kurumaisu.types import FloatArray

_SAME = 3.0  # sds by which two sizes may differ: those of two faults would hardly be opposite so closely
_SHIFT = 1e-6  # [m, rad] below which nothing is elsewhere

_Place = Callable[[Mapping[str, float]], FloatArray]


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
