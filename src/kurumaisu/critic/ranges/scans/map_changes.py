# SPDX-License-Identifier: BSD-3-Clause
"""Places of the map where nearly all readings are of something else: glass, a wall that was moved, furniture."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import binary_dilation
from scipy.spatial import cKDTree

from kurumaisu.critic.ranges.scans.valid_readings import without_cut_off
from kurumaisu.critic.values.criticism import UNKNOWN_CHANNEL
from kurumaisu.critic.values.verdict import Unknown
from kurumaisu.geometry import wrap
from kurumaisu.robust import SIGMA_PER_MAD
from kurumaisu.types import BoolArray, FloatArray, IntArray

_CELL = 0.5  # [m] of the map
_FAR = 0.25  # [m] off: no wall of the catalogue is moved so far, and an error of the mounting moves all walls
_MANY = 20  # readings of a cell, at least
_SCANS = 4  # of which they are, at least
_NEARLY_ALL = 0.8  # share of a cell's readings that are far off, to one side
FEW = 0.25  # share of all readings that such cells may have: of more, it is the map or the reference that is wrong
_WELL = 0.05  # [m] that the median reading elsewhere may be off
_LEAST = 0.002  # share of all readings below which they tell nothing
_COVARIATES = ("hit x", "hit y")
_NEARER = 0.25  # [m] than the map, and from all that it has nearby: an error of a pose or a stamp moves walls less
_FEWEST = 4  # neighbouring beams: light of others and tails of the noise do not agree on where something is
_SMOOTH = 0.1  # [m] between neighbours on one thing
_WIDEST = 1.2  # [m] of a thing: what is wider, such as the floor before a tilted laser, is none
_CLOSE = 0.05  # [m] before a wall, where poses are known by the scans: more than what bends readings does
_BEYOND_NOISE = 5.0  # sds by which readings are off the map, likewise
_ON = 0.67  # share of the other readings of a place, and of a beam, that are nearer the map than that
_OTHERS = 4  # times as many of them as are off in the scan, at least
_MARGIN = 3  # beams on each side that may meet the thing in part
_TOLD = 5  # in which things stand, before they are told
_RARER = 3.0  # times as many as end beyond all walls: an error of the heading makes both alike
_SPOT = 0.15  # [m] of the floor
_BESIDE = 0.225  # [m] of a place where something stands, within which what ends is of it
_STAYS = 4  # scans in which a beam towards a cell ends there, at least,
_ENDS = 0.5  # and their share of those that do or go on: else it is a place where light of others was taken for one
_PASSING = ("time", "hit x", "hit y")
_KNOWN = 10  # readings of a beam, at least
_MOST = (0.1, 0.9)  # quantiles between which most readings lie
_STILL = 0.05  # [m] within which most readings of what moves with the chair stay
_MOVES = 0.3  # [m] by which walls must come and go meanwhile
_ELSEWHERE = 0.1  # [m] from the walls
_GROUPS = 3  # groups of neighbours in a sentence


@dataclass(frozen=True)
class MapChange:
    """readings (k, b): of where nearly all are of something else; low, high (2,) [m]: its ends; off [m]: the median."""

    readings: BoolArray
    low: FloatArray
    high: FloatArray
    off: float

    def unknowns(self) -> Iterator[Unknown]:
        """Yield what is outside the catalogue, over x and y of the map."""
        if not self.readings.any():
            return
        ends = [f"{low:.3g} to {high:.3g} m" for low, high in zip(self.low, self.high, strict=True)]
        longer = "too long" if self.off > 0 else "too short"
        shape = f"where the map has x {ends[0]}, y {ends[1]}, readings are {abs(self.off):.3g} m {longer} (median)"
        # The narrower the better it says where.
        for axis in np.argsort(self.high - self.low).tolist():
            yield Unknown(UNKNOWN_CHANNEL, _COVARIATES[axis], shape, 1.0)


def map_change(measured: FloatArray, expected: FloatArray, hits: FloatArray, incidence: FloatArray) -> MapChange:
    """Return where a part of the map is not what stands there.

    measured, expected (k, b) [m], NaN where there is none; hits (k, b, 2) [m]: what beams meet by the map, incidence
    (k, b) [rad]: and how obliquely.
    """
    off = measured - expected
    readings, bad = changed_places(measured, expected, hits, incidence=incidence)
    none = MapChange(np.zeros_like(readings), np.zeros(2), np.zeros(2), 0.0)
    seen = np.isfinite(off)
    share = float(readings.sum() / max(seen.sum(), 1))
    if not _LEAST <= share <= FEW or abs(float(np.median(off[seen & ~readings]))) > _WELL:
        return none
    inside = hits[readings]
    ends = np.maximum(bad.min(axis=0) * _CELL, inside.min(axis=0)), inside.max(axis=0)
    # What is expected there is of something else, whether or not it is read, and nobody knows how far it goes on.
    whole = np.isfinite(expected)
    near = {(x + i, y + j) for x, y in bad.tolist() for i in (-1, 0, 1) for j in (-1, 0, 1)}
    whole[whole] = [tuple(cell) in near for cell in np.floor(hits[whole] / _CELL).astype(np.int64).tolist()]
    return MapChange(whole, *ends, float(np.median(off[readings])))


def changed_places(
    measured: FloatArray,
    expected: FloatArray,
    hits: FloatArray,
    *,
    incidence: FloatArray | float = 0.0,
    many: int = _MANY,
    either: bool = False,
) -> tuple[BoolArray, IntArray]:
    """Return which readings (k, b) are expected in cells where nearly all are of something else, and the cells (n, 2).

    many: readings of such a cell, at least; either: a wall that was moved is farther from one side, nearer from the
    other; other arguments as of displaced: how obliquely need not be known.
    """
    off = measured - expected
    seen = np.isfinite(off)
    moved = np.nan_to_num(off * np.cos(incidence))  # along a wall, one a little nearer is met much earlier
    side = np.where(np.abs(moved) > _FAR, np.sign(moved), 0.0)
    cells, index = np.unique(np.floor(hits[seen] / _CELL).astype(np.int64), axis=0, return_inverse=True)
    index = index.ravel()
    counts = np.bincount(index, minlength=len(cells))
    pairs = np.unique(np.column_stack([index, np.nonzero(seen)[0]]), axis=0)
    scans = np.bincount(pairs[:, 0], minlength=len(cells))
    sides = np.abs(np.bincount(index, np.abs(side[seen]) if either else side[seen], minlength=len(cells)))
    bad = (counts >= many) & (scans >= _SCANS) & (sides >= _NEARLY_ALL * counts)
    readings = seen.copy()
    readings[seen] = bad[index]
    return readings, cells[bad]


@dataclass(frozen=True)
class PassingObjects:
    """readings (k, b): of things that the map does not have; scans (n,): with any.

    nearer [m]: than the map, the median; place (2,) [m]: where one is in the first of the scans.
    """

    readings: BoolArray
    scans: IntArray
    nearer: float
    place: FloatArray

    @property
    def many(self) -> bool:
        """Whether there are enough of them to be told."""
        return len(self.scans) >= _TOLD

    @property
    def words(self) -> str:
        """What is there, and where."""
        x, y = self.place
        return (
            f"in {len(self.scans)} of {len(self.readings)} scans an object that is not in the map stands before its "
            f"walls, {self.nearer:.2g} m nearer (median), first at x {x:.2f}, y {y:.2f} m"
        )

    def with_close(self, sights: Sights) -> PassingObjects:
        """Return the same with things close before walls, as seen from where the scans were taken by themselves."""
        core = _close(sights)
        if not core.any():
            return self
        close = _objects(sights, core)
        if not len(self.scans):
            return close
        place = close.place if close.scans[0] < self.scans[0] else self.place
        scans = np.union1d(self.scans, close.scans)
        return replace(self, readings=self.readings | close.readings, scans=scans, place=place)

    def unknowns(self) -> Iterator[Unknown]:
        """Yield what is outside the catalogue where so much is not in the map that the map is what is wrong."""
        if self.many and self.readings.mean() > FEW:
            yield from (Unknown(UNKNOWN_CHANNEL, covariate, self.words, 1.0) for covariate in _PASSING)


@dataclass(frozen=True)
class Sights:
    """measured, expected (k, b) [m], NaN where there is none; bearings (b,) [rad] of the beams, evenly apart.

    poses (k, 3): of the laser in the map.
    """

    measured: FloatArray
    expected: FloatArray
    bearings: FloatArray
    poses: FloatArray

    def ends(self, ranges: FloatArray) -> FloatArray:
        """Return where (k, b, 2) [m] beams of some ranges (k, b) end in the map."""
        angles = self.poses[:, 2:] + self.bearings
        way = ranges[..., np.newaxis] * np.stack([np.cos(angles), np.sin(angles)], axis=-1)
        return np.asarray(self.poses[:, np.newaxis, :2] + way)


def passing_objects(sights: Sights) -> PassingObjects:
    """Return the readings of things that are not on the map; all others may be of it."""
    nearer = np.nan_to_num(sights.expected - sights.measured)
    ends = sights.ends(sights.measured)
    off = _off_walls(sights, ends, nearer)
    seen, wide = np.zeros((2, *nearer.shape), dtype=bool)
    step = abs(float(sights.bearings[1] - sights.bearings[0]))
    for k, first, stop in _runs(sights.measured, nearer > _NEARER):
        width = (stop - first) * step * float(np.median(sights.measured[k, first:stop]))
        (wide if width > _WIDEST else seen)[k, first:stop] = True
    core = _standing(sights, ends, nearer, off & (nearer > 0) & ~wide) | (seen & off)
    if core.sum() < _RARER * np.count_nonzero(off & (nearer < 0)) or not core.any():
        return PassingObjects(np.zeros_like(core), np.empty(0, dtype=np.int64), 0.0, np.zeros(2))
    return _objects(sights, core)


def _objects(sights: Sights, core: BoolArray) -> PassingObjects:
    """Return what some readings (k, b), of things for sure, are of, with those beside them."""
    scans = np.flatnonzero(core.any(axis=1))
    place = np.median(sights.ends(sights.measured)[scans[0]][core[scans[0]]], axis=0)
    nearer = float(np.median((sights.expected - sights.measured)[core]))
    return PassingObjects(np.asarray(binary_dilation(core, np.ones((1, 2 * _MARGIN + 1)))), scans, nearer, place)


def _close(sights: Sights) -> BoolArray:
    """Return which readings (k, b) meet a thing before a wall that is elsewhere seen where the map has it.

    By other beams, and by the same ones before other walls: then neither the map nor the laser is off.
    """
    nearer = sights.expected - sights.measured
    out, known = np.zeros(nearer.shape, dtype=bool), np.isfinite(nearer)
    if not known.any():
        return out
    least = max(_CLOSE, _BEYOND_NOISE * SIGMA_PER_MAD * float(np.median(np.abs(nearer[known]))))
    with np.errstate(invalid="ignore"):
        off = nearer > least
        too_far = list(_runs(sights.measured, -nearer > least))
    _, cell = np.unique(np.floor(sights.ends(sights.expected)[known] / _SPOT), axis=0, return_inverse=True)
    place = np.full(nearer.shape, -1)
    place[known] = cell.ravel()
    met, missed = np.bincount(place[known]), np.bincount(place[known], np.abs(nearer[known]) > least)
    beams, astray = known.sum(axis=0), (known & (np.abs(nearer) > least)).sum(axis=0)

    def mostly_on(seen: IntArray, wrong: FloatArray, own: int) -> bool:
        others = int(seen.sum()) - own
        return others >= _OTHERS * own and others - (float(wrong.sum()) - own) >= _ON * others

    runs, step = list(_runs(sights.measured, off)), abs(float(sights.bearings[1] - sights.bearings[0]))
    for k, first, stop in runs if len(runs) > _RARER * len(too_far) else ():
        own, count = slice(first, stop), stop - first
        if count * step * float(np.median(sights.measured[k, own])) <= _WIDEST:
            cells = np.unique(place[k, own])
            out[k, own] = mostly_on(met[cells], missed[cells], count) and mostly_on(beams[own], astray[own], count)
    return out


def _off_walls(sights: Sights, ends: FloatArray, nearer: FloatArray) -> BoolArray:
    """Return which readings (k, b) are far off and end (k, b, 2) [m] where the map has no wall."""
    far = np.abs(nearer) > _NEARER
    hits = sights.ends(sights.expected)
    walls = np.unique(np.floor(hits[np.isfinite(hits).all(axis=2)] / _SPOT), axis=0)
    if far.any():
        far[far] = cKDTree(walls).query(np.floor(ends[far] / _SPOT))[0] > 1.0
    return far


def _standing(sights: Sights, ends: FloatArray, nearer: FloatArray, off: BoolArray) -> BoolArray:
    """Return which readings (k, b) end where something stands, however few beams of a scan meet it.

    off (k, b): which are too short, and end where the map has nothing.
    """
    out = np.zeros(nearer.shape, dtype=bool)
    cells, of, counts = np.unique(np.floor(ends[off] / _SPOT), axis=0, return_inverse=True, return_counts=True)
    places = np.column_stack([np.bincount(of.ravel(), ends[off][:, i], len(cells)) for i in (0, 1)]) / counts[:, None]
    places = places[[_ended(sights, place) for place in places]]
    if len(places):
        out[nearer > _SMOOTH] = cKDTree(places).query(ends[nearer > _SMOOTH])[0] < _BESIDE
    return out


def _ended(sights: Sights, place: FloatArray) -> bool:
    """Tell whether beams towards a place (2,) [m] end there."""
    towards = place - sights.poses[:, :2]
    bearing = wrap(np.arctan2(towards[:, 1], towards[:, 0]) - sights.poses[:, 2])
    step = float(sights.bearings[1] - sights.bearings[0])
    beam = np.rint((bearing - sights.bearings[0]) / step).astype(np.int64)
    inside = (beam >= 0) & (beam < len(sights.bearings))
    off = sights.measured[inside, beam[inside]] - np.hypot(*towards[inside].T)
    there, beyond = np.count_nonzero(np.abs(off) < _SPOT), np.count_nonzero(off >= _SPOT)
    return there >= _STAYS and there >= _ENDS * (there + beyond)


def _runs(measured: FloatArray, off: BoolArray) -> Iterator[tuple[int, int, int]]:
    """Yield scan, first beam and the one after the last of neighbours that are off and meet one thing."""
    with np.errstate(invalid="ignore"):
        linked = off[:, 1:] & off[:, :-1] & (np.abs(np.diff(measured, axis=1)) < _SMOOTH)
    ends = np.diff(np.pad(linked, ((0, 0), (1, 1))).astype(np.int8), axis=1)
    starts, stops = np.argwhere(ends == 1), np.argwhere(ends == -1)
    for (k, first), (_, last) in zip(starts.tolist(), stops.tolist(), strict=True):
        if last - first + 1 >= _FEWEST:
            yield k, first, last + 1


def blocked_beams(measured: FloatArray, expected: FloatArray) -> BoolArray:
    """Return which beams (b,) read the same wherever the chair stands; measured, expected (k, b) [m].

    What is the same to the last digit is no distance: readings have been cut off there.
    """
    seen = np.isfinite(expected) & np.isfinite(without_cut_off(measured))
    out = np.zeros(measured.shape[1], dtype=bool)
    for beam in np.flatnonzero(seen.sum(axis=0) >= _KNOWN):
        here, walls = measured[seen[:, beam], beam], expected[seen[:, beam], beam]
        stays, moves = (float(np.ptp(np.quantile(values, _MOST))) for values in (here, walls))
        elsewhere = float(np.median(np.abs(here - walls))) > _ELSEWHERE
        out[beam] = 0 < stays < _STILL and moves > _MOVES and elsewhere
    return out


def described(beams: BoolArray, measured: FloatArray, bearings: FloatArray) -> Iterator[Unknown]:
    """Yield what is outside the catalogue where beams (b,) are blocked; bearings (b,) [rad]."""
    edges = np.flatnonzero(np.diff(np.r_[False, beams, False]))
    groups = sorted(zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True), key=lambda ends: ends[0] - ends[1])
    words = [
        f"beams from {bearings[first]:.3g} to {bearings[stop - 1]:.3g} rad read "
        f"{np.nanmedian(measured[:, first:stop]):.3g} m"
        for first, stop in groups[:_GROUPS]
    ]
    if words:
        shape = f"{'; '.join(words)}, wherever the chair stands: something on the chair blocks them"
        yield Unknown(UNKNOWN_CHANNEL, "bearing", shape, 1.0)
