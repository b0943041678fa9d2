# SPDX-License-Identifier: BSD-3-Clause
"""Is there room? The box of an experiment against the walls of a world."""

from __future__ import annotations

import numpy as np

from kurumaisu import geometry
from kurumaisu.experiments.script import Box
from kurumaisu.params import Chassis
from kurumaisu.types import FloatArray


def reach(chassis: Chassis) -> float:
    """Return the distance of the chair's farthest corner from base_link [m]."""
    rear = chassis.length - chassis.axle_to_front
    return float(np.hypot(max(chassis.axle_to_front, rear), chassis.width / 2))


def obstructed(box: Box, start: FloatArray, margin: float, walls: FloatArray) -> FloatArray:
    """Return the walls (k, 4) out of (m, 4) that reach into the box grown by a margin [m].

    walls: x and y of both ends [m]; start (3,): where the experiment begins, in the frame of the walls.
    """
    ends = walls.reshape(-1, 2)
    seen = geometry.between(start, np.column_stack([ends, np.zeros(len(ends))]))[:, :2].reshape(-1, 2, 2)
    low = np.array([-box.behind - margin, -box.right - margin])
    high = np.array([box.ahead + margin, box.left + margin])
    origin, way = seen[:, 0], seen[:, 1] - seen[:, 0]
    # Liang-Barsky: the part of each wall, from 0 to 1 along it, that lies between both pairs of sides.
    with np.errstate(divide="ignore", invalid="ignore"):
        sides = np.stack([(low - origin) / way, (high - origin) / way])
    inside = (origin >= low) & (origin <= high)
    enter = np.where(way == 0, np.where(inside, -np.inf, np.inf), sides.min(axis=0)).max(axis=1)
    leave = np.where(way == 0, np.where(inside, np.inf, -np.inf), sides.max(axis=0)).min(axis=1)
    return np.asarray(walls[np.maximum(enter, 0) <= np.minimum(leave, 1)])
