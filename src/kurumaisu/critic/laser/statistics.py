# SPDX-License-Identifier: BSD-3-Clause
"""How readings scatter, in some forty numbers that know nothing of any effect, alike for measured and simulated."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import maximum_filter1d

from kurumaisu.critic.laser.deviations import ELSEWHERE, near
from kurumaisu.critic.laser.likeness import Kinds
from kurumaisu.critic.laser.noise import ScanNoise
from kurumaisu.critic.laser.normal import Assembly
from kurumaisu.critic.laser.trust import piles
from kurumaisu.types import BoolArray, FloatArray, IntArray

_CLIP = 3.0  # deviations beyond which a reading counts as a tail, not as spread
_FAR = 6.0  # deviations of an outlier
_COMMON = 0.005  # [m] plausible common mode of a scan, when it is read off one scan alone
_CELL = 0.5  # [m] of the map in which errors are averaged
_PILE = 0.05  # [m] of the place of a pile, counted as one: it is known to a step of the readings, which is a fiftieth
_PLACES = 3  # numbers, the last ones, that are such places, or the step of a grid
_GRID = 1e-3  # [m] to which readings are rounded before their values are counted
_AMID = (0.1, 0.9)  # quantiles of readings between which walls are everywhere
_OBLIQUE = np.radians(80.0)  # [rad] beyond which no reading counts
_SQUARE = np.radians(60.0)  # [rad] within which a wall beside a jump hardly moves with an error of the heading
_JUMP = 0.15  # [m] between the two sides of an edge, at least
_FLAT = 0.2  # share of it by which either side may go on
_BESIDE = 3  # beams by which errors of the pose move a narrow face that lies between two sides in truth
_INSIDE = 0.15  # share of it from either side, beyond which a reading lies between them
_LASTS = 0.03  # [m] within which a reading between two sides comes again where a beam meets a third one
_LEVER = 0.5  # [m] from base_link to a laser, at most
_ROUNDS = 3
_SOME = 4  # every so-manieth reading says how wide all are


@dataclass(frozen=True)
class Groups:
    """Masks (k, b) by what is known of a beam beforehand, each a part of the readings that are to be expected."""

    names: tuple[str, ...]
    masks: tuple[BoolArray, ...]


class Statistics:
    """The numbers of one set of shots."""

    def __init__(self, assembly: Assembly, noise: ScanNoise) -> None:
        """Take the geometry; noise: of the reference, which each scan's poses are sought within."""
        seen = assembly.marks.seen
        self._base = assembly.marks.base
        self._sd = assembly.first.sd
        self._trust = assembly.geometry
        self._farthest = assembly.shots.laser.range_max
        self._groups = _groups(self._trust, seen.ranges, seen.incidence, seen.returns)
        self._cells = _cells(assembly)
        self._jumps = _jumps(seen.ranges, seen.incidence)
        self._stand = assembly.layout.stand
        self._basis, self._size = _basis(assembly, noise)
        axes = np.r_[0, 1 + np.arange(self._basis.shape[2] - 1) % 3]
        limit = _steepest(seen.level, seen.incidence)[:, :, axes]
        self._moves = np.clip(self._basis, -limit, limit)
        weighed = np.asarray(self._basis * (self._trust / self._sd)[:, :, np.newaxis])
        inner = np.asarray(weighed.transpose(0, 2, 1) @ weighed, dtype=np.float64)
        inner = inner + np.eye(inner.shape[1]) * (self._size**-2)[:, np.newaxis, :]
        inverse = np.linalg.inv(inner)
        self._solve = (inverse @ weighed.transpose(0, 2, 1)).astype(np.float32)  # half the memory, twice as fast
        self._fitted = (self._basis / self._sd[:, :, np.newaxis]).astype(np.float32)
        self._reach = np.sqrt(np.sum((self._basis * self._size[:, np.newaxis, :]) ** 2, axis=2)) / self._sd
        self._common_sd = _common_sd(inner, inverse, self._size)

    def pose_errors(self, rng: np.random.Generator) -> FloatArray:
        """Return errors of readings (k, b) [m] by errors of the reference, drawn."""
        draws = rng.standard_normal(self._size.shape) * self._size
        draws[:, 0] = 0.0
        for stand in np.unique(self._stand[self._stand >= 0]):  # scans of one pose have its one error
            draws[self._stand == stand] = draws[np.flatnonzero(self._stand == stand)[0]]
        return np.asarray((self._moves @ draws[:, :, np.newaxis])[:, :, 0])

    def of(self, readings: FloatArray, error: FloatArray) -> FloatArray:
        """Return the numbers; readings (k, b) [m] as measured; error (k, b) [m]: off their mean, poses' errors in."""
        left, common = self._leftover(error)
        common = common / self._common_sd
        inside = self._trust & np.isfinite(left)
        z = np.where(inside, np.clip(left, -_CLIP, _CLIP), 0.0)
        out = [_log(float(np.mean(z[group & inside] ** 2))) for group in self._groups.masks if (group & inside).any()]
        power = float(np.mean(z[inside] ** 2))
        for lag in (1, 2, 4):
            both = inside[:, lag:] & inside[:, :-lag]
            out.append(float(np.mean(z[:, lag:][both] * z[:, :-lag][both])) / power)
        size = np.abs(left[inside])
        out += [_share(size > 3), _share(size > 4.5), _share(size > _FAR), _share(size > ELSEWHERE)]
        far = inside & (np.abs(np.nan_to_num(left)) > _FAR)
        out.append(_share((far[:, 1:] & far[:, :-1])[inside[:, 1:]]))
        out += [_log(float(np.mean(common**2))), float(common[1:] @ common[:-1]) / float(common @ common)]
        out += [_between(z, inside, np.broadcast_to(np.arange(z.shape[1]), z.shape)), _between(z, inside, self._cells)]
        out += [_share(np.isnan(readings[group])) for group in self._groups.masks]
        out.append(_share(np.isinf(readings[self._trust])))
        out.append(_share(_mixed(readings) & self._jumps & ~_lasting(readings, self._stand)))
        said = readings[self._trust]
        return np.array([*out, *_values(said), _log(_spacing(said) / _GRID), *self._piles(said)])

    def names(self) -> list[str]:
        """Return what a reader calls the numbers, in their order."""
        return [name for name, *_ in self._told()]

    def kinds(self) -> Kinds:
        """Return which of the numbers are roots of counts, and which are places of piles."""
        counts = np.array([count for _, count, _ in self._told()])
        return Kinds(counts, np.arange(len(counts)) >= len(counts) - _PLACES)

    def of_errors(self) -> BoolArray:
        """Return which of the numbers follow how far readings are off their mean."""
        return np.array([off for *_, off in self._told()])

    def _told(self) -> list[tuple[str, bool, bool]]:
        """Return the numbers' names, whether each is a root of a count, and whether it follows readings' errors."""
        groups = [
            f"reflectance {at}" if kind == "return" else f"{kind} {int(at) + 1} of 4"
            for kind, at in (name.split() for name in self._groups.names)
        ]
        return [
            *((f"spread, {name}", False, True) for name in groups),
            *((f"correlation of beams {lag} apart", False, True) for lag in (1, 2, 4)),
            *((f"readings more than {far:g} sd off", True, True) for far in (3, 4.5, _FAR, ELSEWHERE)),
            (f"neighbours more than {_FAR:g} sd off", True, True),
            ("spread of whole scans", False, True),
            ("correlation of whole scans", False, True),
            ("spread of the beams' means", False, True),
            ("spread of the places' means", False, True),
            *((f"missing readings, {name}", True, False) for name in groups),
            ("readings without return", True, True),
            ("readings inside jumps", True, True),
            ("different values", False, False),
            ("readings of the least value", True, True),
            ("readings of the greatest value", True, True),
            ("step between values", False, False),
            ("least value at which readings pile up", False, False),
            ("greatest value at which readings pile up", False, False),
        ]

    def _piles(self, readings: FloatArray) -> list[float]:
        """Return the ends at which readings are cut off, in units in which a step of them matters to nobody."""
        low, high = piles(readings)
        return [max(low, 0.0) / _PILE, min(high, self._farthest) / _PILE]

    def _leftover(self, error: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return what poses and common mode leave of the errors (k, b), in deviations, and the common modes (k,) [m].

        Missing readings and outliers take the value that the others give them.
        """
        z = error / self._sd
        known = self._trust & np.isfinite(z)
        fitted = np.zeros_like(z)
        inside = near(z, known, self._reach)
        coefficients = np.zeros(self._size.shape)
        for _ in range(_ROUNDS):
            filled = np.where(inside, np.nan_to_num(z), fitted).astype(np.float32)
            coefficients = (self._solve @ filled[:, :, np.newaxis])[:, :, 0]
            fitted = (self._fitted @ coefficients[:, :, np.newaxis])[:, :, 0]
            width = 1.4826 * float(np.median(np.abs((z - fitted)[inside])[::_SOME]))
            inside = known & (np.abs(np.nan_to_num(z - fitted)) < 4.5 * max(width, 0.1))
        return np.where(known, z - fitted, np.nan), coefficients[:, 0]


def _groups(expected: BoolArray, ranges: FloatArray, incidence: FloatArray, returns: FloatArray) -> Groups:
    names, masks = [], []
    for name, values, count in (("range", ranges, 4), ("incidence", incidence, 4)):
        cuts = np.quantile(values[expected], np.linspace(0, 1, count + 1)[1:-1])
        bins = np.digitize(values, cuts)
        for i in range(count):
            names.append(f"{name} {i}")
            masks.append(expected & (bins == i))
    for value in np.unique(returns[expected])[:4]:
        names.append(f"return {value:g}")
        masks.append(expected & (returns == value))
    return Groups(tuple(names), tuple(mask for mask in masks if mask.any()))


def _cells(assembly: Assembly) -> IntArray:
    """Return the cell of the map (k, b) in which each beam ends, numbered."""
    origins, bearings = assembly.origins()
    angle = origins[:, :, 2] + bearings
    ranges = np.nan_to_num(assembly.marks.seen.level, posinf=0.0)
    ends = origins[:, :, :2] + ranges[:, :, np.newaxis] * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    _, index = np.unique(np.floor(ends / _CELL).reshape(-1, 2), axis=0, return_inverse=True)
    return np.asarray(index.reshape(ranges.shape))


def _mixed(readings: FloatArray) -> BoolArray:
    """Return which readings (k, b - 6) lie well between the two sides of a jump, which both go on as they are.

    By the readings alone: where a jump is moves with every error of the pose.
    """
    before, left, here, right, after = (readings[:, i : i - 6 or None] for i in (0, 1, 3, 5, 6))
    with np.errstate(invalid="ignore", divide="ignore"):
        jump = right - left
        share = (here - left) / jump
        flat = np.maximum(np.abs(left - before), np.abs(after - right)) < _FLAT * np.abs(jump)
        return np.asarray((np.abs(jump) > _JUMP) & flat & (share > _INSIDE) & (share < 1 - _INSIDE))


def _lasting(readings: FloatArray, stand: IntArray) -> BoolArray:
    """Return which readings (k, b - 6) come again in the scan before or after from the same place; stand (k,).

    What lies between two sides there is a narrow face that an error of the pose hides from the model: one face, but
    counted in every scan. Mixed readings differ from scan to scan.
    """
    with np.errstate(invalid="ignore"):
        same = np.abs(np.diff(readings[:, 3:-3], axis=0)) < _LASTS
    same &= ((stand[1:] == stand[:-1]) & (stand[1:] >= 0))[:, np.newaxis]
    out = np.zeros(readings[:, 3:-3].shape, dtype=bool)
    out[1:] |= same
    out[:-1] |= same
    return out


def _jumps(ranges: FloatArray, incidence: FloatArray) -> BoolArray:
    """Return where (k, b - 6) a jump from one face to another is to be expected, and no narrow face lies between."""
    narrow = _widened(_mixed(ranges))
    with np.errstate(invalid="ignore"):
        jump = np.abs(np.diff(np.where(incidence < _SQUARE, ranges, np.nan), axis=1)) > _JUMP
    beside = np.zeros(ranges.shape, dtype=bool)
    beside[:, 1:] |= jump
    beside[:, :-1] |= jump
    return np.asarray(_widened(beside)[:, 3:-3] & ~narrow)


def _widened(mask: BoolArray) -> BoolArray:
    """Return a mask (k, b) with some more beams on either side of each."""
    return np.asarray(maximum_filter1d(mask, 2 * _BESIDE + 1, axis=1, mode="constant"))


def _basis(assembly: Assembly, noise: ScanNoise) -> tuple[FloatArray, FloatArray]:
    """Return (k, b, q) what readings do by a common mode and by errors of the poses, and their sds (k, q)."""
    parts = [assembly.random_columns(k) for k in range(len(assembly.residual))]
    widest = max(part.shape[1] for part in parts)
    basis = np.zeros((len(parts), parts[0].shape[0], widest))
    size = np.full((len(parts), widest), 1e-6)
    pose = np.maximum([noise.position_sd, noise.position_sd, noise.heading_sd], 1e-6)
    for k, part in enumerate(parts):
        basis[k, :, : part.shape[1]] = part
        size[k, : part.shape[1]] = np.concatenate([[_COMMON], np.tile(pose, part.shape[1] // 3)])
    return basis, size


def _steepest(ranges: FloatArray, angles: FloatArray) -> FloatArray:
    """Return how much the reading of a beam (k, b, 4) follows common mode, x, y [1] and yaw [m/rad] at most.

    A finite difference over the edge of a wall finds far more, where in truth the beam meets the one wall or the other.
    """
    along = 1 / np.cos(np.minimum(angles, _OBLIQUE))
    reach = np.where(np.isfinite(ranges), ranges, 0.0) + _LEVER
    return np.stack([np.ones_like(along), along, along, reach * along], axis=-1)


def _common_sd(inner: FloatArray, inverse: FloatArray, size: FloatArray) -> FloatArray:
    """Return the sds (k,) [m] of common modes that noise and errors of poses alone give; inner (k, q, q), size (k, q).

    Where walls are all on one side, what looks like a common mode is mostly an error of the pose.
    """
    eye = np.eye(inner.shape[1])
    known = inner - eye * (size**-2)[:, np.newaxis, :]
    drawn = eye * np.where(np.arange(size.shape[1]) > 0, size**2, 0.0)[:, np.newaxis, :]
    covariance = inverse @ (known @ drawn @ known + known) @ inverse
    return np.asarray(np.sqrt(np.maximum(covariance[:, 0, 0], 1e-18)))


def _between(z: FloatArray, inside: BoolArray, group: IntArray) -> float:
    """Return the log of the mean squared group mean, each in deviations of what chance gives it."""
    count = np.bincount(group[inside])
    sums = np.bincount(group[inside], z[inside])
    many = count > 5
    return _log(float(np.mean(sums[many] ** 2 / count[many])))


def _values(readings: FloatArray) -> list[float]:
    """Return how many different values there are, and how many readings have the least and the greatest of them."""
    steps = np.rint(readings[np.isfinite(readings)] / _GRID).astype(np.int64)
    if not len(steps):
        return [0.0, 0.0, 0.0]
    counts = np.bincount(steps - steps.min())
    return [_log(np.count_nonzero(counts)), _root(int(counts[0])), _root(int(counts[-1]))]


def _spacing(readings: FloatArray) -> float:
    """Return the mean step [m] between values amid the readings, where every value of their grid occurs."""
    known = readings[np.isfinite(readings)]
    if not len(known):
        return _GRID
    low, high = np.quantile(known, _AMID)
    steps = np.unique(np.rint(known[(known >= low) & (known <= high)] / _GRID))
    return _GRID * float(np.ptp(steps)) / (len(steps) - 1) if len(steps) > 1 else _GRID


def _share(hits: BoolArray) -> float:
    """Return the square root of a count: its variance does not depend on how many are to be expected."""
    return _root(int(np.count_nonzero(hits)))


def _root(count: int) -> float:
    return 2 * float(np.sqrt(count + 0.375))


def _log(value: float) -> float:
    return float(np.log(max(value, 1e-12)))
