# SPDX-License-Identifier: BSD-3-Clause
"""A recorded drive on its time line: what was there at any moment. Times in seconds, all else SI and radians."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np

from kurumaisu.types import FloatArray, IntArray
from kurumaisu.viewer.play_clock import ROUNDED
from kurumaisu.viewer.protocol import Fan, Note, Pose

_GAP = 1.0  # [s] between samples that nobody may fill in, unless the samples are always that far apart
_USUAL = 3.0  # usual distances of samples that are a gap


class Track:
    """Poses (n, 3) at times (n,) that do not fall; where a time is there twice, one piece ends and another begins."""

    def __init__(self, times: FloatArray, poses: FloatArray) -> None:
        self.times, self.poses = times, poses
        steps = np.diff(times)
        self._gap = max(_GAP, _USUAL * float(np.median(steps)) if len(steps) else 0.0)

    def at(self, t: float) -> Pose | None:
        """Return the pose at t, linear between samples; None in a gap, and as far from the first and the last."""
        if not len(self.times):
            return None
        after = int(np.searchsorted(self.times, t, side="right"))
        before = max(after - 1, 0)
        after = min(after, len(self.times) - 1)
        t0, t1 = self.times[before], self.times[after]
        if t == t0:
            return _pose(self.poses[before])
        if before == after:
            return _pose(self.poses[before]) if abs(t - t0) <= self._gap else None
        if t1 - t0 > self._gap:
            return None
        share = (t - t0) / (t1 - t0)
        return _pose(self.poses[before] + share * (self.poses[after] - self.poses[before]))

    def line(self, most: int) -> list[tuple[float, float] | None]:
        """Return at most so many points of the path from above, None where it is torn."""
        last = max(len(self.times) - 1, 0)
        rows = np.unique(np.append(np.arange(0, len(self.times), max(1, -(-len(self.times) // most))), last))
        rows = rows[: len(self.times)]
        torn = np.zeros(len(self.times), dtype=bool)
        steps = np.diff(self.times)
        torn[1:] = (steps == 0) | (steps > self._gap)
        return list(_points(self.poses[rows, :2], np.add.accumulate(torn)[rows]))


def _points(places: FloatArray, pieces: IntArray) -> list[tuple[float, float] | None]:
    points: list[tuple[float, float] | None] = []
    for i, (x, y) in enumerate(places.tolist()):
        if i and pieces[i] != pieces[i - 1]:
            points.append(None)
        points.append((round(x, 4), round(y, 4)))
    return points


def _pose(row: FloatArray) -> Pose:
    x, y, theta = row.tolist()
    return x, y, theta


class Held:
    """Values (n, m) that hold from their times (n,) until the next."""

    def __init__(self, times: FloatArray, values: FloatArray) -> None:
        self._times, self._values = times, values

    def at(self, t: float) -> tuple[float, ...] | None:
        """Return what holds at t, None before the first."""
        row = int(np.searchsorted(self._times, t, side="right")) - 1
        return tuple(self._values[row].tolist()) if row >= 0 else None


@dataclass(frozen=True)
class Tape:
    """One run from begin to end [s].

    truth, odom: where the chair was and where it thought it was, in the map; tracks: of other bodies, by id; rates: v
    and w as odometry has them; asked: as commanded; volts: forward, steering; fan: returns one of the scans that begin
    at scan_times (k,); notes: what a person should know.
    """

    name: str
    begin: float
    end: float
    truth: Track | None = None
    odom: Track | None = None
    tracks: Mapping[str, Track] = field(default_factory=dict)
    rates: Held | None = None
    asked: Held | None = None
    volts: Held | None = None
    scan_times: FloatArray = field(default_factory=lambda: np.empty(0))
    fan: Callable[[int], Fan] | None = None
    notes: tuple[Note, ...] = ()

    def scan_at(self, t: float) -> int:
        """Return the number of the newest scan at t, -1 where there is none or it is long past."""
        row = int(np.searchsorted(self.scan_times, t + ROUNDED, side="right")) - 1
        return row if row >= 0 and t - self.scan_times[row] <= _GAP else -1
