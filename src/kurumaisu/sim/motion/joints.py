# SPDX-License-Identifier: BSD-3-Clause
"""Hinges: a point stays where it is, and the heading within limits."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import pymunk

from kurumaisu.sim.motion.rigid import Pivot
from kurumaisu.types import FloatArray

_BEYOND = 1.0e-4  # [rad] a limit holds from where it is passed on


def constraints(floor: pymunk.Body, body: pymunk.Body, pivot: Pivot) -> list[pymunk.Constraint]:
    """Return what holds a body on its pivot."""
    pin = pymunk.PivotJoint(floor, body, tuple(pivot.place.tolist()), tuple(pivot.anchor.tolist()))
    pin.max_bias = 0.0  # project puts it back
    return [pin, pymunk.RotaryLimitJoint(floor, body, pivot.lowest, pivot.highest)]


class Hinges:
    """The pivots among some bodies."""

    def __init__(self, pivots: Sequence[Pivot | None]) -> None:
        """Take what each body hangs on."""
        self._pivots = [(row, pivot) for row, pivot in enumerate(pivots) if pivot is not None]

    def time(self, poses: FloatArray, velocities: FloatArray, limit: float) -> float:
        """Return the time [s] until the first of them passes a limit, at velocities (k, 3); or limit."""
        for row, pivot in self._pivots:
            turn, heading = float(velocities[row, 2]), float(poses[row, 3])
            left = pivot.highest - heading if turn > 0 else heading - pivot.lowest
            if left >= 0 and abs(turn) * limit > left + _BEYOND:
                limit = (left + _BEYOND) / abs(turn)
        return limit

    def project(self, poses: FloatArray, velocities: FloatArray) -> None:
        """Put bodies (poses (k, 4), velocities (k, 3) in the map) back on their pivots, in place."""
        for row, pivot in self._pivots:
            c, s = math.cos(poses[row, 3]), math.sin(poses[row, 3])
            arm = np.array([[c, -s], [s, c]]) @ pivot.anchor
            poses[row, :2] = pivot.place - arm
            turn = velocities[row, 2]
            velocities[row, :2] = turn * arm[1], -turn * arm[0]


def settled(poses: FloatArray, pivots: Sequence[Pivot | None]) -> FloatArray:
    """Return poses (k, 4) whose hinged bodies are on their pivots, their headings near the limits' mean and within."""
    result = poses.copy()
    for row, pivot in enumerate(pivots):
        if pivot is not None:
            mean = (pivot.lowest + pivot.highest) / 2
            heading = mean + math.remainder(poses[row, 3] - mean, 2 * math.pi)
            result[row, 3] = min(max(heading, pivot.lowest), pivot.highest)
    Hinges(pivots).project(result, np.zeros((len(result), 3)))
    return result
