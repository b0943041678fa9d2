# SPDX-License-Identifier: BSD-3-Clause
"""How readings scatter, in some forty numbers that know nothing of any effect, alike for measured and simulated."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from kurumaisu.critic.ranges.noise.reading_noise import ELSEWHERE
from kurumaisu.critic.ranges.noise.shared_errors import ScanNoise
from kurumaisu.critic.ranges.scans.beams import hits_of
from kurumaisu.critic.ranges.scans.valid_readings import PILED, cut_offs, inside_ends, without_cut_off
from kurumaisu.critic.ranges.search.normal_equations import Assembly
from kurumaisu.critic.scatter.likelihood import MATTERS, StatisticKinds
from kurumaisu.critic.scatter.scan_fit import ScanFit, basis_of, drawn_errors, fluctuating, steepest
from kurumaisu.robust import SIGMA_PER_MAD
from kurumaisu.types import BoolArray, FloatArray, IntArray

# In whose order readings are grouped, from near to far and from straight to oblique, and at which quantiles: what grows
# with the footprint does so in few, the most oblique ones.
_ALONG = {"range": (0.25, 0.5, 0.75), "incidence": (0.5, 0.75, 0.9)}
_SURFACES = 4  # groups by the reflectance, at most
_CLIP = 3.0  # deviations beyond which a reading counts as a tail, not as spread
_FAR = 6.0  # deviations of an outlier
_WITHIN = 3.0  # sds of errors (of poses; of readings, too, at an end that is sought) within which one may be cut off
_KEPT = 4  # fits of all scans, one for each place at which readings are cut off: a few megabytes each
_BURST = 0.15  # [rad] within which outliers that come together are sought
_CELL = 0.5  # [m] of the map in which errors are averaged
_PILE = 0.05  # [m] of the place of a pile, counted as one: it is known to a step of the readings, which is a fiftieth
_PLACES = 3  # numbers, the last ones, that are such places, or the step of a grid
_ALL = 0.95  # of the readings that ought to lie beyond an end and have no return, if they are cut off there
_GRID = 1e-3  # [m] to which readings are rounded before their values are counted
_AMID = (0.1, 0.9)  # quantiles of readings between which walls are everywhere
_JUMP = 0.15  # [m] between the two sides of an edge, at least
_ASIDE = 1.5  # beams to either side within which a beam may meet another surface
_FINELY = 4  # directions per beam in which the surfaces about it are sought
_CLEAR, _FINE = 5.0, 0.005  # sds, and [m], from a surface, beyond which a reading is not of it


@dataclass(frozen=True)
class Groups:
    """Masks (k, b) by what is known of a beam beforehand, each a part of the readings that are to be expected.

    kinds: by what each is, names: what a reader calls it; folds (g,): logs of the middle range of each that is by the
    range, less their mean; 0 of the others.
    """

    kinds: tuple[str, ...]
    names: tuple[str, ...]
    masks: tuple[BoolArray, ...]
    folds: FloatArray


@dataclass(frozen=True)
class Statistic:
    """A number: what a reader calls it, whether it is the root of a count, and whether it follows readings' errors.

    group: of the readings that it is of, None of all. matters: by how much it may differ and matter to nobody.
    """

    name: str
    count: bool
    off: bool
    group: int | None = None
    matters: float = MATTERS


class Statistics:
    """The numbers of one set of shots."""

    def __init__(self, assembly: Assembly, noise: ScanNoise) -> None:
        """Take the geometry; noise: of the reference, which each scan's poses are sought within."""
        seen = assembly.marks.seen
        self._base = assembly.marks.base
        self._sd = assembly.first.sd
        self._trust, self._farthest = assembly.geometry, assembly.shots.laser.range_max
        # What is not read by the model may be anything where readings are cut off: no return, or the last value.
        self._read = assembly.mapped & (self._base > assembly.shots.laser.range_min) & (self._base < self._farthest)
        self._groups = _groups(self._trust, seen.ranges, seen.incidence, seen.returns)
        self._cells = _cells(assembly)
        self._layout, self._tau = assembly.layout, noise.lasting_tau
        self._beside = max(round(_BURST / abs(assembly.shots.laser.angle_increment)), 1)
        self._basis, self._size = basis_of(assembly, noise)
        self._moved = assembly.moved
        axes = np.r_[0, 1 + np.arange(self._basis.shape[2] - 1) % 3]
        limit = steepest(seen.level, seen.incidence)[:, :, axes]
        self._moves = np.clip(self._basis, -limit, limit)
        self._reach = np.sqrt(np.sum((self._moves[:, :, 1:] * self._size[:, np.newaxis, 1:]) ** 2, axis=2))
        self._edges = _Edges(assembly, self._sd, self._reach + _FINE)
        self._fits: dict[tuple[float, float], ScanFit] = {}

    def pose_errors(self, rng: np.random.Generator) -> FloatArray:
        """Return errors of readings (k, b) [m] by errors of the reference, drawn."""
        draws = drawn_errors(self._size, self._layout, self._tau, rng)
        return np.asarray((self._moves @ draws[:, :, np.newaxis])[:, :, 0])

    def of(self, readings: FloatArray, error: FloatArray) -> FloatArray:
        """Return the numbers; readings (k, b) [m] as measured; error (k, b) [m]: off their mean, poses' errors in."""
        ends, (low, high) = self._ends(readings)
        left, common = self._leftover(error, ends)
        inside, z, free, known = self._fluctuating(left)
        out = [_log(_mean(free[group & known] ** 2, 1.0)) for group in self._groups.masks]
        out += _correlations(free, known)
        size = np.abs(left[inside])
        out += [_share(size > 3), _share(size > 4.5), _share(size > _FAR), _share(size > ELSEWHERE)]
        far = inside & (np.abs(np.nan_to_num(left)) > _FAR)
        out.append(_share((far[:, 1:] & far[:, :-1])[inside[:, 1:]]))
        out.append(_crowded(far, inside, self._beside))
        out += [_log(float(np.mean(common**2))), _correlation(common)]
        beams = np.broadcast_to(np.arange(z.shape[1]), z.shape)
        out += [_between(z[known], free[known], group[known]) for group in (beams, self._cells)]
        out += [_share(np.isnan(readings[group])) for group in self._groups.masks]
        out.append(_share(np.isinf(readings[self._trust])))
        out.append(_share(_once(self._edges.mixed(without_cut_off(readings, ends)), self._layout.stand)))
        said = readings[self._trust]
        piled = _counts(readings[self._read])[[0, -1]].tolist()
        values = [_log(np.count_nonzero(_counts(said))), *map(_root, piled)]
        # The places at which readings are cut off, in units in which a step of them matters to nobody.
        least, greatest = max(low, 0.0) / _PILE, min(high, self._farthest) / _PILE
        return np.array([*out, *values, _log(_spacing(said) / _GRID), least, greatest])

    def squares(self, readings: FloatArray, error: FloatArray) -> tuple[FloatArray, BoolArray]:
        """Return the squares (k, b) [1] of what differs from scan to scan, outliers cut, and where it is known (k, b).

        readings, error: as of `of`.
        """
        left, _ = self._leftover(error, self._ends(readings)[0])
        _, _, free, known = self._fluctuating(left)
        return free**2, known

    def _fluctuating(self, left: FloatArray) -> tuple[BoolArray, FloatArray, FloatArray, BoolArray]:
        """Return which readings count, what is left of them, cut, and what of it fluctuates, and where; (k, b) each."""
        inside = self._trust & np.isfinite(left)
        z = np.where(inside, np.clip(left, -_CLIP, _CLIP), 0.0)
        return inside, z, *fluctuating(z, inside, self._layout.stand)

    def names(self) -> list[str]:
        """Return what a reader calls the numbers, in their order."""
        return [one.name for one in self._told()]

    def kinds(self) -> StatisticKinds:
        """Return which of the numbers are roots of counts, which are places of piles, and which follow one another."""
        counts = np.array([one.count for one in self._told()])
        places = np.arange(len(counts)) >= len(counts) - _PLACES
        folds = self._groups.folds
        folds = np.asarray(np.r_[folds, np.zeros(len(counts) - len(folds))])
        matters = np.array([one.matters for one in self._told()])
        return StatisticKinds(counts, places, _trends(self._told(), self._groups.kinds), folds, self._alike(), matters)

    def _alike(self) -> FloatArray:
        """Return correlations of the numbers (m, m): one reading that is missing is so in all groups it belongs to."""
        told = self._told()
        counts = [i for i, one in enumerate(told) if one.count and one.group is not None]
        masks = np.array([mask.ravel() for mask in self._groups.masks], dtype=np.float64)
        masks /= np.linalg.norm(masks, axis=1, keepdims=True)
        out = np.eye(len(told))
        out[np.ix_(counts, counts)] = masks @ masks.T
        return out

    def of_errors(self) -> BoolArray:
        """Return which of the numbers follow how far readings are off their mean."""
        return np.array([one.off for one in self._told()])

    def _told(self) -> list[Statistic]:
        """Return what the numbers are, in their order."""
        groups = list(enumerate(self._groups.names))
        return [
            *(Statistic(f"spread, {name}", count=False, off=True, group=i) for i, name in groups),
            # The square of a sum of many readings is larger by twice what neighbours share of theirs.
            *(
                Statistic(f"correlation of beams {lag} apart", count=False, off=True, matters=MATTERS / 2)
                for lag in (1, 2, 4)
            ),
            *(
                Statistic(f"readings more than {far:g} sd off", count=True, off=True)
                for far in (3, 4.5, _FAR, ELSEWHERE)
            ),
            Statistic(f"neighbours more than {_FAR:g} sd off", count=True, off=True),
            Statistic(f"more than chance of those within {_BURST:g} rad of others", count=True, off=True),
            Statistic("spread of whole scans", count=False, off=True),
            Statistic("correlation of whole scans", count=False, off=True),
            Statistic("spread of the means per beam", count=False, off=True),
            Statistic("spread of the means per place", count=False, off=True),
            *(Statistic(f"missing readings, {name}", count=True, off=False, group=i) for i, name in groups),
            Statistic("readings without return", count=True, off=True),
            Statistic("readings inside range jumps", count=True, off=True),
            Statistic("number of different values", count=False, off=False),
            Statistic("readings of the smallest value", count=True, off=True),
            Statistic("readings of the largest value", count=True, off=True),
            Statistic("step between values", count=False, off=False, matters=1e-3),
            Statistic("lower cut-off of the readings", count=False, off=False),
            Statistic("upper cut-off of the readings", count=False, off=False),
        ]

    def _ends(self, readings: FloatArray) -> tuple[tuple[float, float], tuple[float, float]]:
        """Return the ends of what is read [m], readings (k, b) included that are too far out to be trusted.

        And where they are cut off, which is the middle of a pile.
        """
        (low, high), (least, greatest) = cut_offs(readings[self._read], self._base[self._read])
        said = readings[self._read & np.isfinite(readings)]
        farthest = float(said.max()) if len(said) else np.inf
        beyond = np.isinf(readings[self._read & (self._base > farthest + _WITHIN * (self._sd + self._reach))])
        lost = len(beyond) >= PILED and beyond.mean() > _ALL
        if lost and not np.isfinite(high):
            return (low, farthest), (least, farthest)
        return (low, high), (least, greatest)

    def _leftover(self, error: FloatArray, ends: tuple[float, float]) -> tuple[FloatArray, FloatArray]:
        """Return what poses and common mode leave of the errors (k, b), and the common modes (k,), in deviations.

        ends [m]: where readings are cut off. What lies beyond, or may by an error of the pose, says nothing.
        """
        if ends not in self._fits:
            if len(self._fits) >= _KEPT:
                del self._fits[next(iter(self._fits))]
            trust = self._trust & inside_ends(self._base, ends, _WITHIN * self._reach)
            self._fits[ends] = ScanFit(self._basis, self._size, self._sd, trust, self._layout.stand, self._moved)
        return self._fits[ends].leftover(error)


class _Edges:
    """Where beams pass the edge of a surface, and which readings there are of no surface at all."""

    def __init__(self, assembly: Assembly, sd: FloatArray, reach: FloatArray) -> None:
        """Take the geometry; sd (k, b) [m] of readings; reach (k, b) [m]: of errors of the poses."""
        shots, seen = assembly.shots, assembly.marks.seen
        count = round(_ASIDE * _FINELY)
        turns = abs(shots.laser.angle_increment) / _FINELY * np.arange(-count, count + 1)
        ways = np.array([hits_of(shots, (), 0, shift=np.array([0.0, 0.0, a]), like=seen).ranges for a in turns])
        with np.errstate(invalid="ignore"):
            jumps = np.abs(np.diff(ways, axis=0)) > _JUMP
        self._at = np.nonzero(jumps.any(axis=0) & np.isfinite(ways).all(axis=0))
        self._sd, self._reach = sd[self._at], reach[self._at]
        self._trust, self._base = assembly.geometry, assembly.marks.base
        rows, beams = self._at
        # of the ranges met, the readings, which are nearly the same
        ways = ways[:, rows, beams] + (self._base - seen.ranges)[self._at]
        one, other = ways[1:], np.where(jumps[:, rows, beams], ways[1:], ways[:-1])
        self._low, self._high = np.minimum(one, other), np.maximum(one, other)
        self._ends = ways.min(axis=0), ways.max(axis=0)

    def mixed(self, readings: FloatArray) -> BoolArray:
        """Return which readings (k, b) [m] lie between the surfaces about their beam, clear of each.

        What errors on the mean move all readings by counts as their scatter: at an edge nobody can tell them.
        """
        said, off = readings[self._at], np.abs(readings - self._base)[self._trust]
        usual = SIGMA_PER_MAD * float(np.median(off[np.isfinite(off)])) if np.isfinite(off).any() else 0.0
        near, far = self._ends
        clear = self._reach + _CLEAR * np.maximum(self._sd, usual)
        with np.errstate(invalid="ignore"):
            met = ((said > self._low - clear) & (said < self._high + clear)).any(axis=0)
            between = (said > near + clear) & (said < far - clear) & ~met
        out = np.zeros(readings.shape, dtype=bool)
        out[self._at] = between
        return out


def _groups(expected: BoolArray, ranges: FloatArray, incidence: FloatArray, returns: FloatArray) -> Groups:
    found: list[tuple[str, str, BoolArray]] = []
    for (kind, shares), values in zip(_ALONG.items(), (ranges, incidence), strict=True):
        bins = np.digitize(values, np.quantile(values[expected], shares))
        parts = len(shares) + 1
        found += [(kind, f"{kind} {i + 1} of {parts}", expected & (bins == i)) for i in range(parts)]
    for value in np.unique(returns[expected])[:_SURFACES]:
        found.append(("reflectance", f"reflectance {value:g}", expected & (returns == value)))
    kinds, names, masks = zip(*(each for each in found if each[2].any()), strict=True)
    logs = [np.log(np.median(ranges[m])) if kind == "range" else np.nan for kind, m in zip(kinds, masks, strict=True)]
    return Groups(kinds, names, masks, np.nan_to_num(np.array(logs) - np.nanmean(logs)))


def _trends(told: Sequence[Statistic], kinds: Sequence[str]) -> FloatArray:
    """Return weights (g, m) from -1 to 1 over each numbers' groups of ranges, and of incidences; kinds: of groups."""
    out = []
    for off, kind in product((True, False), _ALONG):
        own = [i for i, one in enumerate(told) if one.group is not None and (one.off, kinds[one.group]) == (off, kind)]
        out.append(np.zeros(len(told)))
        out[-1][own] = np.linspace(-1.0, 1.0, len(own))
    return np.array(out)


def _cells(assembly: Assembly) -> IntArray:
    """Return the cell of the map (k, b) in which each beam ends, numbered."""
    seen = assembly.marks.seen
    ends = seen.ends(np.nan_to_num(seen.level, posinf=0.0))
    _, index = np.unique(np.floor(ends / _CELL).reshape(-1, 2), axis=0, return_inverse=True)
    return np.asarray(index.reshape(seen.level.shape))


def _once(mask: BoolArray, stand: IntArray) -> BoolArray:
    """Return a mask (k, n) in which each column counts once in the scans from the same place; stand (k,).

    From one place, a beam as wide as it is meets the same two surfaces in every scan; so does a narrow face that an
    error of the pose hides from the model.
    """
    out = mask.copy()
    for place in np.unique(stand[stand >= 0]):
        rows = np.flatnonzero(stand == place)
        out[rows[1:]] &= ~np.logical_or.accumulate(mask[rows[:-1]], axis=0)
    return out


def _crowded(far: BoolArray, inside: BoolArray, beside: int) -> float:
    """Return how many outliers (k, b) have others so many beams beside them, less how many would by chance, in sds.

    inside (k, b): which readings there are.
    """
    ends = np.clip(np.arange(far.shape[1])[:, np.newaxis] + np.array([-beside, beside + 1]), 0, far.shape[1])
    about, there = (np.diff(_sums(mask)[:, ends], axis=2)[:, :, 0][far] for mask in (far, inside))
    rate = np.count_nonzero(far) / max(np.count_nonzero(inside), 1)
    return _root(np.count_nonzero(about > 1)) - _root(float(np.sum(1 - (1 - rate) ** (there - 1))))


def _sums(mask: BoolArray) -> IntArray:
    """Return how many of each row (k, b) are set before each column, and in all, (k, b + 1)."""
    return np.pad(np.cumsum(mask, axis=1), ((0, 0), (1, 0)))


def _between(z: FloatArray, free: FloatArray, group: IntArray) -> float:
    """Return the log of the mean squared group mean, each in deviations of what readings that scatter so give it.

    free: what of them scatters. Else any noise would spread means, too, and hide that beams keep something.
    """
    count = np.bincount(group)
    sums, chance = np.bincount(group, z), np.bincount(group, free**2)
    many = (count > 5) & (chance > 0)
    return _log(_mean(sums[many] ** 2 / chance[many], 1.0))


def _counts(readings: FloatArray) -> IntArray:
    """Return how many readings have each value, from the least to the greatest."""
    steps = np.rint(readings[np.isfinite(readings)] / _GRID).astype(np.int64)
    return np.bincount(steps - steps.min()) if len(steps) else np.zeros(1, dtype=np.int64)


def _spacing(readings: FloatArray) -> float:
    """Return the mean step [m] between values amid the readings, where nearly every value of their grid occurs."""
    known = readings[np.isfinite(readings)]
    if not len(known):
        return _GRID
    low, high = np.quantile(known, _AMID)
    steps = np.diff(np.unique(np.rint(known[(known >= low) & (known <= high)] / _GRID)))
    # Where readings are few some values are missing.
    return _GRID * float(np.mean(steps[steps < 1.5 * np.median(steps)])) if len(steps) else _GRID


def _share(hits: BoolArray) -> float:
    """Return the square root of a count: its variance does not depend on how many are to be expected."""
    return _root(int(np.count_nonzero(hits)))


def _root(count: float) -> float:
    return 2 * float(np.sqrt(count + 0.375))


def _correlations(z: FloatArray, inside: BoolArray) -> list[float]:
    """Return how readings (k, b) of a scan correlate with those some beams on."""
    power = _mean(z[inside] ** 2, 1.0)
    both = ((lag, inside[:, lag:] & inside[:, :-lag]) for lag in (1, 2, 4))
    return [_mean(z[:, lag:][of] * z[:, :-lag][of], 0.0) / max(power, 1e-12) for lag, of in both]


def _correlation(common: FloatArray) -> float:
    """Return how common modes (k,) follow those of the scans before."""
    power = float(common @ common)
    return float(common[1:] @ common[:-1]) / power if power else 0.0


def _mean(values: FloatArray, none: float) -> float:
    """Return the mean; none: what it is of no values, as chance would give it."""
    return float(np.mean(values)) if values.size else none


def _log(value: float) -> float:
    return float(np.log(max(value, 1e-12)))
