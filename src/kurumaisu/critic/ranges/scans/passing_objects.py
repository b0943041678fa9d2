# SPDX-License-Identifier: BSD-3-Clause
"""What stands or walks before the walls in some scans, and is not on the map: people, doors, furniture."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from kurumaisu.critic.values.laser_finding import UNKNOWN_CHANNEL
from kurumaisu.critic.values.verdict import Unknown
from kurumaisu.types import BoolArray, FloatArray

_NEARER = 0.25  # [m] than the map, and from all that it has nearby: an error of a pose or a stamp moves walls less
_FEWEST = 4  # neighbouring beams: light of others and tails of the noise do not agree on where something is
_SMOOTH = 0.1  # [m] between neighbours on one thing
_WIDEST = 1.2  # [m] of a thing: what is wider, such as the floor before a tilted laser, is none
_ABOUT = 0.25  # [rad] of bearing, in which the map is looked at
_MARGIN = 3  # beams on each side that may meet the thing in part
_SCANS = 5  # in which things stand, before they are told
_RARER = 3.0  # times as many beams as are longer than the map by as much: an error of the heading makes both alike
_COVARIATES = ("time", "hit x", "hit y")


@dataclass(frozen=True)
class PassingObjects:
    """readings (k, b): of things that the map does not have; scans: with any; nearer [m]: than the map, the median."""

    readings: BoolArray
    scans: int
    nearer: float

    @property
    def many(self) -> bool:
        """Whether there are enough of them to be told."""
        return self.scans >= _SCANS

    def unknowns(self) -> Iterator[Unknown]:
        """Yield what is outside the catalogue: when it is there, and where."""
        if self.many:
            shape = (
                f"in {self.scans} of {len(self.readings)} scans an object that is not in the map stands before its "
                f"walls, {self.nearer:.2g} m nearer (median)"
            )
            yield from (Unknown(UNKNOWN_CHANNEL, covariate, shape, 1.0) for covariate in _COVARIATES)


def passing_objects(measured: FloatArray, expected: FloatArray, bearings: FloatArray) -> PassingObjects:
    """Return the readings of things that are not on the map; all others may be of it.

    measured, expected (k, b) [m], NaN where there is none; bearings (b,) [rad] of the beams, evenly apart.
    """
    nearer = np.nan_to_num(expected - measured)
    shorter, longer = _runs(measured, nearer > _NEARER), _runs(measured, nearer < -_NEARER)
    step = abs(float(bearings[1] - bearings[0]))
    points, walls = (_points(ranges, bearings) for ranges in (measured, expected))
    out, depths, scans, found = np.zeros(measured.shape, dtype=bool), list[float](), set[int](), 0
    reach = round(_ABOUT / step)
    for k, first, stop in shorter:
        about = walls[k, max(first - reach, 0) : stop + reach]
        middle = points[k, (first + stop) // 2]
        wide = (stop - first) * step * float(np.median(measured[k, first:stop])) > _WIDEST
        if not wide and np.nanmin(np.abs(about - middle)) > _NEARER:
            out[k, max(first - _MARGIN, 0) : stop + _MARGIN] = True
            depths.append(float(np.median(nearer[k, first:stop])))
            scans.add(k)
            found += stop - first
    if found < _RARER * sum(stop - first for _, first, stop in longer):
        return PassingObjects(np.zeros_like(out), 0, 0.0)
    return PassingObjects(out, len(scans), float(np.median(depths)) if depths else 0.0)


def _points(ranges: FloatArray, bearings: FloatArray) -> np.ndarray[tuple[int, ...], np.dtype[np.complex128]]:
    """Return where readings (k, b) [m] are in the laser's frame, as complex numbers."""
    return np.asarray(ranges * np.exp(1j * bearings))


def _runs(measured: FloatArray, off: BoolArray) -> Iterator[tuple[int, int, int]]:
    """Yield scan, first beam and the one after the last of neighbours that are off and meet one thing."""
    with np.errstate(invalid="ignore"):
        linked = off[:, 1:] & off[:, :-1] & (np.abs(np.diff(measured, axis=1)) < _SMOOTH)
    ends = np.diff(np.pad(linked, ((0, 0), (1, 1))).astype(np.int8), axis=1)
    starts, stops = np.argwhere(ends == 1), np.argwhere(ends == -1)
    for (k, first), (_, last) in zip(starts.tolist(), stops.tolist(), strict=True):
        if last - first + 1 >= _FEWEST:
            yield k, first, last + 1
