# SPDX-License-Identifier: BSD-3-Clause
"""Places of the map where nearly all readings are of something else: glass, a wall that was moved, furniture."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from kurumaisu.critic.values.criticism import UNKNOWN_CHANNEL
from kurumaisu.critic.values.verdict import Unknown
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
