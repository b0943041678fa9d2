# SPDX-License-Identifier: BSD-3-Clause
"""Which readings may speak about the mean: those that meet a wall well inside, within the gate, and are no outliers."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import maximum_filter1d

from kurumaisu import effects, geometry
from kurumaisu.critic.ranges.scans.beams import BeamHits, Shots, stated_beams
from kurumaisu.critic.ranges.scans.walls import Rays
from kurumaisu.types import BoolArray, FloatArray

_KINK = 1e-4  # departure from a straight wall, where 1/r(i+1) + 1/r(i-1) = 2 cos(increment) / r(i), relative to 1/r
_BESIDE = 0.025  # [rad] on each side of a corner or jump, a beam at least: errors of pose or mounting move it so far
_BEFORE = 0.1  # [m] by which a wall's end stands before what a beam meets that passes it
# [rad] oblique beyond this, a beam slides along the wall with every error of the pose, which then acts by its square,
# too; and what becomes of a footprint four times as long as wide is another equation for everybody.
_STEEPEST = np.radians(75.0)
GATE = 0.1  # [m] from the ends of the gate: nearer ones are cut off one-sidedly
PILED = 20  # readings of one value, the least or the greatest, that are a pile if they are
_HIGHER = 3  # times as many as any value has that lies within the gate beside them
_MICRON = 6  # decimals of a metre: readings a grid apart are not within it, however they were rounded
_GRIDS = (1e-3, 4e-3)  # [m] within which values are one; a cut-off need not be sharp
_WIDEST = 32e-3  # [m] likewise, as readings scatter, at a far end where the map has most walls beyond
_BEYOND = 0.5  # share of a pile that most are
_MILLIMETRE = 1e-3  # [m] to which a message rounds
_COARSE = 2.5  # millimetres from which a grid is not that of the message
_ADJACENT = 1.5  # usual steps up to which two values are neighbours
_ROUNDED = 0.65  # millimetres that values may be off a regular grid: half of one by rounding, and what is fitted
_FEWEST = 20  # values that tell a grid


def edges(seen: BeamHits, increment: float, reach: float = 0.0) -> BoolArray:
    """Return (k, b) which beams have a corner or a jump of the range beside them; increment [rad] between beams.

    reach [m]: by how far corners may be elsewhere than on the map.
    """
    with np.errstate(divide="ignore"):
        near = 1 / seen.level
    middle = near[:, 1:-1]
    jump = ~(near > 0)
    jump[:, [0, -1]] = True  # nobody sees what lies beyond
    jump[:, 1:-1] |= np.abs(near[:, 2:] + near[:, :-2] - 2 * np.cos(increment) * middle) > _KINK * middle
    beside = np.maximum(_BESIDE / increment, 1.0) + reach * maximum_filter1d(np.nan_to_num(near), 3, axis=1) / increment
    wide = jump.copy()
    for shift in range(1, int(min(beside[jump].max(), jump.shape[1] - 1)) + 1):
        far = jump & (beside >= shift)
        wide[:, shift:] |= far[:, :-shift]
        wide[:, :-shift] |= far[:, shift:]
    return wide


def usable_beams(shots: Shots, seen: BeamHits, base: FloatArray, reach: float = 0.0) -> BoolArray:
    """Return (k, b) which beams meet a wall where a reading may speak about the mean, whatever they read.

    reach [m]: as of edges.
    """
    inside = (base > shots.laser.range_min + GATE) & (base < shots.laser.range_max - GATE)
    increment = shots.laser.angle_increment
    beside = edges(seen, increment, reach) if increment <= _BESIDE else _edges_between(shots, seen, reach)
    return np.asarray(inside & ~beside & (seen.incidence < _STEEPEST))


def _edges_between(shots: Shots, seen: BeamHits, reach: float) -> BoolArray:
    """Return the same as edges of a fan whose beams are too far apart to tell what is beside each of them."""
    rays, origins = Rays(shots.walls), seen.origins.reshape(-1, 3)
    bearings = seen.bearings.ravel()
    with np.errstate(divide="ignore", invalid="ignore"):
        aside = _BESIDE + reach / np.nan_to_num(seen.level.ravel(), posinf=np.inf)
        right, near, left = (1 / rays.cast(origins, bearings + side * aside)[0] for side in (-1.0, 0.0, 1.0))
        bent = ~(near > 0) | ~(np.abs(left + right - 2 * np.cos(aside) * near) <= _KINK * near)
    return np.asarray(bent.reshape(seen.level.shape) | _passes_ends(shots, seen, reach))


def _passes_ends(shots: Shots, seen: BeamHits, reach: float) -> BoolArray:
    """Return (k, b) which beams pass the end of a wall that stands before the one they meet, however thin it is."""
    out, laser = np.zeros(seen.level.shape, dtype=np.bool_), shots.laser
    ends = np.unique(shots.walls.segments.reshape(-1, 2), axis=0)
    for row, origins, level in zip(out, seen.origins, seen.level, strict=True):
        middle = origins[len(origins) // 2]
        bearings = geometry.wrap(np.arctan2(*(ends - middle[:2]).T[::-1]) - middle[2])
        nearest = np.rint((bearings - laser.bearings[0]) / laser.angle_increment).astype(int)
        for beam in (nearest - 1, nearest, nearest + 1):
            known = (beam >= 0) & (beam < len(origins))
            which, end = beam[known], ends[known]
            aim = origins[which] + laser.bearings[which, np.newaxis] * np.array([0.0, 0.0, 1.0])
            ahead = geometry.between(aim, np.column_stack([end, np.zeros(len(end))]))
            along, across = ahead[:, 0], np.abs(ahead[:, 1])
            row[which[(along > 0) & (along < level[which] - _BEFORE) & (across < _BESIDE * along + reach)]] = True
    return out


def usable_readings(shots: Shots, seen: BeamHits, base: FloatArray) -> BoolArray:
    """Return (k, b) which readings may speak about the mean, outliers aside."""
    inside = inside_ends(base, cut_off_ends(shots.measured, base))
    return np.asarray(usable_beams(shots, seen, base) & inside & np.isfinite(shots.measured))


def inside_ends(base: FloatArray, ends: tuple[float, float], doubt: FloatArray | float = 0.0) -> BoolArray:
    """Return (k, b) which beams are to be read well inside the ends [m] at which readings are cut off.

    doubt [m]: by how much they may be read elsewhere, where that is more than a gate.
    """
    low, high = ends
    gate = np.maximum(GATE, doubt)
    return np.asarray((base > low + gate) & (base < high - gate))


def cut_off_ends(readings: FloatArray, expected: FloatArray | None = None) -> tuple[float, float]:
    """Return the least and the greatest reading [m] where readings pile up there, as if cut off; else infinite ones.

    expected [m]: readings as the map has them, which tell a far end that is not sharp. Of that, what lies inside.
    """
    return cut_offs(readings, expected)[0]


def cut_offs(readings: FloatArray, expected: FloatArray | None) -> tuple[tuple[float, float], tuple[float, float]]:
    """Return these ends [m], and the middles of the piles there; infinite where there is none."""
    near, far = _piles(readings, expected)
    ends = -near.min(initial=np.inf), far.min(initial=np.inf)
    return ends, (-_middle(near), _middle(far))


def _middle(pile: FloatArray) -> float:
    return float(np.median(pile)) if len(pile) else np.inf


def _piles(readings: FloatArray, expected: FloatArray | None) -> Iterator[FloatArray]:
    """Yield the readings (n,) [m] that pile up as the least, their sign changed, and as the greatest; none: (0,)."""
    known = np.isfinite(readings)
    for sign in (-1.0, 1.0):
        values = sign * readings[known]
        off = np.round(np.max(values) - values if len(values) else values, _MICRON)
        grid = next((grid for grid in _GRIDS if _piled(off[off < GATE], grid)), 0.0)
        if not grid and sign > 0 and expected is not None and _piled(off[off < GATE], _WIDEST):
            beyond = expected[known][off < _WIDEST] > values.max(initial=-np.inf)
            grid = _WIDEST if beyond.mean() > _BEYOND else 0.0
        yield values[off < grid]


def _piled(off: FloatArray, grid: float) -> bool:
    """Return whether readings pile up at an end; off (n,) [m]: how far each lies inside of it."""
    counts = np.bincount((off / grid).astype(np.int64), minlength=2)
    return bool(counts[0] > max(PILED, _HIGHER * counts[1:].max()))


def without_cut_off(readings: FloatArray, ends: tuple[float, float] | None = None) -> FloatArray:
    """Return readings [m] without those cut off, of which nobody knows where they are: NaN in their place.

    ends [m]: where they are cut off, None: as they pile up.
    """
    low, high = ends or cut_off_ends(readings)
    with np.errstate(invalid="ignore"):
        return np.where((readings > low) & (readings < high), readings, np.nan)


@dataclass(frozen=True)
class PoseWeights:
    """The q reference poses around a scan: rows of its track, and (b, q) the weight of each in each beam's pose."""

    rows: slice
    weights: FloatArray


def pose_weights(shots: Shots, scan: int) -> PoseWeights:
    """Return on which reference poses a scan rests: those around the times at which its beams leave by the model."""
    track = shots.tracks[shots.run[scan]]
    times = effects.build_laser(shots.own, np.random.default_rng(0)).aim(stated_beams(shots, scan)).times
    last = len(track.times) - 1
    first = min(max(int(np.searchsorted(track.times, times.min(), side="right")) - 1, 0), last)
    rows = slice(first, min(max(int(np.searchsorted(track.times, times.max())), first), last) + 1)
    knots = track.times[rows]
    return PoseWeights(rows, np.stack([np.interp(times, knots, unit) for unit in np.eye(len(knots))], axis=-1))


def grid_step(measured: FloatArray) -> float:
    """Return the usual step [m] between the values that readings have, to a millimetre."""
    values = np.unique(np.rint(measured[np.isfinite(measured)] / _MILLIMETRE))
    return _MILLIMETRE * float(np.median(np.diff(values))) if len(values) > 1 else _MILLIMETRE


def unrounded(measured: FloatArray) -> FloatArray:
    """Return readings [m] as a coarse grid has them, where there is one, before a message rounded its values.

    A grid of 9.97 mm beats with one of 1 mm: over 0.4 m of the range the message is off by half a millimetre either
    way, which is no wave of the laser's.
    """
    if grid_step(measured) < _COARSE * _MILLIMETRE:
        return measured
    known = np.isfinite(measured)
    values, index = np.unique(np.rint(measured[known] / _MILLIMETRE), return_inverse=True)
    if len(values) < _FEWEST:
        return measured
    steps = np.diff(values)
    near = steps[steps < _ADJACENT * np.median(steps)]
    places = np.concatenate([[0.0], np.cumsum(np.rint(steps / near.mean()))])
    even = np.polyval(np.polyfit(places, values, 1), places)
    if np.abs(even - values).max() > _ROUNDED:
        return measured
    out = measured.copy()
    out[known] = _MILLIMETRE * even[index]
    return out
