# SPDX-License-Identifier: BSD-3-Clause
"""base_node's odometry again, from what it says it put out: bit for bit, where its clock was the messages' own."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from kurumaisu import _core
from kurumaisu.types import FloatArray

_GAP = 1.5  # of the usual interval: a message is missing


def seconds(nanoseconds: int) -> float:
    """Return a stamp as ROS' own toSec makes it, to the last bit."""
    whole, rest = divmod(nanoseconds, 1_000_000_000)
    return float(whole) + 1e-9 * float(rest)


class Reckoner:
    """Equation (3) over rates that are held from stamp to stamp. A stamp that comes twice holds its last rates."""

    def __init__(self, stamp: int, pose: FloatArray) -> None:
        """Begin at a pose (3,) [m, m, rad] at a stamp [ns]."""
        self._pose = [float(x) for x in pose]
        self._last = stamp
        self._rates = (0.0, 0.0)

    def go(self, stamp: int, v: float, w: float) -> tuple[float, float, float]:
        """Return the pose at a stamp [ns], from which on v [m/s], w [rad/s] hold; an earlier stamp changes nothing."""
        if stamp > self._last:
            dt = seconds(stamp) - seconds(self._last)
            held_v, held_w = (np.array([rate]) for rate in self._rates)
            self._pose = _core.integrate(held_v, held_w, np.array([dt]), self._pose)[-1].tolist()
            self._last = stamp
        if stamp == self._last:
            self._rates = (v, w)
        x, y, theta = self._pose
        return x, y, theta


@dataclass(frozen=True)
class Compared:
    """Odometry again against what was recorded.

    stamps: that both have; equal: of them, to the last bit; worst [m], worst_turn [rad]: the largest differences;
    gaps: intervals in which a message is missing.
    """

    stamps: int
    equal: int
    worst: float
    worst_turn: float
    gaps: int


Odom = tuple[int, float, float, float, float]  # stamp [ns], x, y [m], z and w of the quaternion
Put = tuple[int, float, float]  # stamp [ns], v [m/s], w [rad/s]


def compare(put: list[Put], odom: list[Odom]) -> Compared | None:
    """Return how odometry again, from what was put out, compares with what was recorded; None: no stamp is in both."""
    then = {row[0]: row for row in odom}
    first = next((n for n, row in enumerate(put) if row[0] in then), None)
    if first is None:
        return None
    stamp, x, y, z, w = then[put[first][0]]
    reckoner = Reckoner(stamp, np.array([x, y, heading(z, w)]))
    # the pose at a stamp is the same however often the stamp comes: rates that follow it hold from there
    found = {row[0]: reckoner.go(*row) for row in put[first:]}
    both = [(found[stamp], then[stamp]) for stamp in found if stamp in then]
    ends = np.array([(*pose[:2], math.sin(0.5 * pose[2]), math.cos(0.5 * pose[2])) for pose, _ in both])
    seen = np.array([row[1:] for _, row in both])
    flip = np.where((ends[:, 2:] * seen[:, 2:]).sum(axis=1) < 0, -1.0, 1.0)  # q and -q are one heading
    turn = 2 * np.abs(ends[:, 2:] - flip[:, np.newaxis] * seen[:, 2:]).max(axis=1)
    intervals = np.diff([row[0] for row in put[first:]])
    usual = float(np.median(intervals[intervals > 0])) if (intervals > 0).any() else np.inf
    return Compared(
        len(both),
        int((ends == seen).all(axis=1).sum()),
        float(np.hypot(*(ends - seen)[:, :2].T).max()),
        float(turn.max()),
        int((intervals > _GAP * usual).sum()),
    )


def heading(z: float, w: float) -> float:
    """Return the heading [rad] of a quaternion about z."""
    return 2.0 * math.atan2(z, w)
