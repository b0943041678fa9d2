# SPDX-License-Identifier: BSD-3-Clause
"""What changes the mean readings by many coefficients at once: walls that are off at random, and unknown curves.

The coefficients are normal before the data. Which effect of the catalogue draws such numbers is found by giving it a
generator that draws 0 but once. No effect is named.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kurumaisu import effects
from kurumaisu.critic.ranges.scans.beams import RATES, BeamHits, Shots
from kurumaisu.critic.ranges.scans.walls import Rays
from kurumaisu.critic.ranges.signals.effect_columns import STEP, EffectColumns
from kurumaisu.critic.unknown.bases import Basis, knots_of, priors_of
from kurumaisu.effects import Echoes, Parameter
from kurumaisu.geometry import wrap
from kurumaisu.types import BoolArray, FloatArray

_HATS, _POSE_HATS = 14, 8  # of curves of the readings, and of the laser's pose
_STOPS = 20  # stops of which each may have a knot of its own
_DRAWS = 150  # coefficients of an effect that are still told one by one; of more, so many draws stand for all
_ROUNDING = 1e-6
_LEAST = 0.3  # [m, rad, s] spread of a covariate that a curve may follow
_SAMPLES = 20000  # readings that say how often a covariate has which value


@dataclass(frozen=True)
class Block:
    """A block of columns whose coefficients are normal before the data, with covariances `priors`, to a factor.

    id: of the effect; parameter: the sd of the coefficients, in units of its scale, None of a curve; basis: of the
    curve, None of an effect of the catalogue; whole: it changes all readings of a scan alike; pose: which of x, y and
    heading of the laser a curve is an error of, against the reference, None of one of the readings.
    """

    id: str
    parameter: Parameter | None
    basis: Basis | None
    priors: tuple[FloatArray, ...]
    span: slice
    whole: bool = False
    pose: int | None = None


class _Spike(np.random.Generator):
    """Draws 0 from the normal distribution, but `size` in one place; counts what it is asked for."""

    def __init__(self, at: int, size: float) -> None:
        super().__init__(np.random.PCG64(0))
        self._at, self._size, self.asked = at, size, 0

    def standard_normal(self, size: Any = None, *_: Any, **__: Any) -> Any:
        """Return zeros, and the spike where it belongs."""
        out = np.zeros(size if size is not None else ())
        if self.asked <= self._at < self.asked + out.size:
            out.flat[self._at - self.asked] = self._size
        self.asked += out.size
        return out


def blocks(
    shots: Shots, marks: EffectColumns, poses: FloatArray, start: int, ids: frozenset[str] | None
) -> tuple[list[Block], FloatArray]:
    """Return all blocks, those first that change whole scans, and their columns (k, b, m).

    poses (k, b, 3): change of the readings per metre and radian of a pose; start: index of the first one in the whole
    matrix.
    """
    found: list[Block] = []
    columns: list[NDArray[np.float32]] = []
    parts = list(_drawn(shots, marks, ids))
    if ids is None or effects.SMOOTH in ids:
        parts += [*_curves(shots, marks), *pose_curves(shots, marks, poses)]
    for free, part in sorted(parts, key=lambda each: not each[0].whole):
        found.append(replace(free, span=slice(start, start + part.shape[2])))
        columns.append(part.astype(np.float32))
        start += part.shape[2]
    return found, np.concatenate([np.empty((*marks.base.shape, 0), dtype=np.float32), *columns], axis=2)


def _drawn(shots: Shots, marks: EffectColumns, ids: frozenset[str] | None) -> Iterator[tuple[Block, FloatArray]]:
    """Yield effects of the world whose walls are moved by normal numbers that are drawn once."""
    slope = _slope(shots, marks.seen.ranges)
    for effect in effects.WORLD:
        null = marks.null(effect)
        for p in effect.parameters:
            if not effect.random or (ids is not None and effect.id not in ids):
                continue
            values = {**null, p.name: p.null + STEP * p.scale}
            counter = _Spike(-1, 0.0)
            drawn = effect(values, np.random.default_rng(0)).apply(shots.walls.segments)
            still = effect(values, counter).apply(shots.walls.segments)
            if not counter.asked or not np.array_equal(still, shots.walls.segments) or np.array_equal(still, drawn):
                continue
            many = counter.asked > _DRAWS
            made = []
            for i in range(_DRAWS if many else counter.asked):
                rng = np.random.default_rng(i) if many else _Spike(i, 1.0)
                change = _moved(shots, effect(values, rng).apply(shots.walls.segments), marks)
                made.append((change * slope / STEP / (np.sqrt(_DRAWS) if many else 1.0)).astype(np.float32))
            columns: Any = np.stack([one for one in made if np.abs(one).max() > 0], axis=-1)
            yield Block(effect.id, p, None, (np.eye(columns.shape[2]),), slice(0)), columns


def _moved(shots: Shots, segments: FloatArray, marks: EffectColumns) -> FloatArray:
    """Return how much farther level beams (k, b) go [m] before other walls; 0 where they meet another one."""
    seen = marks.seen
    rays = Rays(replace(shots.walls, segments=segments))
    ranges = rays.ranges(seen.origins.reshape(-1, 3), seen.bearings.ravel()).reshape(seen.level.shape)
    with np.errstate(invalid="ignore"):
        change = ranges - seen.level
    return np.where(np.isfinite(change) & (np.abs(change) < 0.1), change, 0.0)


def _slope(shots: Shots, ranges: FloatArray) -> FloatArray:
    """Return how the mean reading grows with the range."""
    error, step = shots.laser.error, 1e-3
    safe = np.where(np.isfinite(ranges), ranges, 1.0)
    return np.asarray((error.mean(safe + step) - error.mean(safe - step)) / (2 * step))


def _curves(shots: Shots, marks: EffectColumns) -> Iterator[tuple[Block, FloatArray]]:
    known = np.isfinite(marks.base)
    for name, at in covariates(shots, marks.seen).items():
        whole = bool((np.ptp(at, axis=1) <= _ROUNDING).mean() > 0.5) or name == "heading"
        basis = _basis(name, at, known, shots, whole=whole)
        if basis is not None:
            columns = basis.matrix(at.ravel()).reshape(*at.shape, len(basis.knots))
            yield Block(effects.smooth_range_id(name), None, basis, basis.priors, slice(0), whole), columns


def pose_curves(shots: Shots, marks: EffectColumns, poses: FloatArray) -> Iterator[tuple[Block, FloatArray]]:
    """Yield what a laser that is not where the reference says may follow: its heading, or its place in the map.

    The reference may err, or the laser may move on the robot: the scans alone do not tell.
    """
    known, origins = np.isfinite(marks.base), marks.seen.origins
    follow = {"heading": wrap(origins[..., 2]), "x": origins[..., 0], "y": origins[..., 1]}
    rates = {name: np.repeat(shots.known[name][:, np.newaxis], shots.laser.beams, axis=1) for name in RATES}
    for axis, which in enumerate((("x", "y"), ("x", "y"), (*RATES, "heading", "x", "y"))):
        for name in which:
            at = {**follow, **rates}[name]
            basis = _basis(name, at, known, shots, _POSE_HATS)
            if basis is not None:
                columns = basis.matrix(at.ravel()).reshape(*at.shape, len(basis.knots)) * poses[:, :, axis, np.newaxis]
                # A reference that wanders is an error of its own: only what is faster than that is none of its noise.
                made = Block(f"pose.{axis}.{name}", None, basis, basis.priors, slice(0), name in RATES, axis)
                yield made, columns


def _basis(
    name: str, at: FloatArray, known: BoolArray, shots: Shots, hats: int = _HATS, *, whole: bool = False
) -> Basis | None:
    """Return the curves over a quantity at (k, b) of the beams, None where it hardly varies.

    whole: the quantity is one for a whole scan.
    """
    values = at[known]
    if not np.isfinite(values).all() or np.ptp(values) <= (0.0 if name in shots.known else _LEAST):
        return None
    few = values[:: max(len(values) // _SAMPLES, 1)]
    knots = _knots(at[:, 0] if whole else few, hats)
    if len(knots) < 3:
        return None
    matrix = np.column_stack([np.interp(few, knots, row) for row in np.eye(len(knots))])
    low, high = np.quantile(few, [0.025, 0.975])
    return Basis(name, knots, {}, tuple(priors_of(knots, matrix)), float(low), float(high))


def covariates(shots: Shots, seen: BeamHits) -> dict[str, FloatArray]:
    """Return what curves may follow, by name, at each beam (k, b)."""
    echoes = echoes_of(shots, seen)
    beside = {name: np.repeat(at[:, np.newaxis], shots.laser.beams, axis=1) for name, at in shots.known.items()}
    return {**{name: of(echoes) for name, of in effects.RANGE_COVARIATES.items()}, **beside}


def echoes_of(shots: Shots, seen: BeamHits) -> Echoes:
    """Return what the beams (k, b) of all scans meet, for curves over it; of nothing, at a range of 0."""
    still = np.where(np.isfinite(seen.ranges), seen.ranges, 0.0)
    bearings = np.broadcast_to(shots.laser.bearings, still.shape)
    parts = (still, seen.incidence, seen.returns, still, still, still, still, seen.origins)
    return Echoes(shots.stamps[:, np.newaxis], bearings, *parts)


def _knots(values: FloatArray, hats: int) -> FloatArray:
    """Return knots of a curve: one for each value where there are few, as of stops."""
    ordered = np.sort(values)
    gaps = np.flatnonzero(np.diff(ordered) > 0.02 * max(float(np.ptp(ordered)), 1e-9))
    groups = np.split(ordered, gaps + 1)
    if 3 <= len(groups) <= _STOPS and sum(float(np.ptp(group)) for group in groups) < 0.1 * float(np.ptp(ordered)):
        return np.array([group.mean() for group in groups])
    return knots_of(values, hats)
