# SPDX-License-Identifier: BSD-3-Clause
"""From commands to velocities: drive laws, bounds, and when a command is heard; all robots at once, as in Stage."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from kurumaisu.geometry import PLANAR
from kurumaisu.types import FloatArray, IntArray
from kurumaisu.world.model import Position

Rows = slice | IntArray


class Drive:
    """Holds each robot's velocity until its next update."""

    def __init__(self, robots: Sequence[Position], spans: FloatArray, limit_acceleration: bool) -> None:
        """Start with the velocities of the world file; spans (n,) [s] lie between a robot's updates."""
        n = len(robots)
        self.velocities = _rows([robot.velocity[PLANAR] for robot in robots])
        bounds = [robot.velocity_bounds[PLANAR] for robot in robots]
        self._lowest, self._highest = (_rows([b[:, side] for b in bounds]) for side in (0, 1))
        self._axes = _rows([np.array([1.0, float(robot.drive == "omni"), 1.0]) for robot in robots])
        self._cars = np.array([i for i in range(n) if robots[i].drive == "car"], dtype=np.int64)
        self._wheelbase = np.array([robots[i].wheelbase for i in self._cars])
        self._gain = _gains(robots, spans) if limit_acceleration else None
        self._wanted = np.zeros((n, 3))

    def update(self, commands: FloatArray, due: Rows) -> None:
        """Hear commands (n, 3): forward, leftward [m/s], turn [rad/s] or, for a car, steering angle [rad]; finite."""
        wanted = self._wanted
        np.multiply(commands, self._axes, out=wanted)
        if len(self._cars):
            speed, angle = commands[self._cars, 0], commands[self._cars, 2]
            wanted[self._cars, 0] = speed * np.cos(angle)
            wanted[self._cars, 2] = speed * np.sin(angle) / self._wheelbase
        np.maximum(wanted, self._lowest, out=wanted)
        np.minimum(wanted, self._highest, out=wanted)
        if self._gain is not None:
            np.maximum(wanted, self.velocities + self._gain[0], out=wanted)
            np.minimum(wanted, self.velocities + self._gain[1], out=wanted)
        self.velocities[due] = wanted[due]


def without_nonsense(commands: FloatArray) -> tuple[FloatArray, int]:
    """Return commands (n, 3), zero where one of a robot's numbers is not finite, and how many robots that were."""
    every = commands.ravel()
    if math.isfinite(every.dot(every)):  # faster than to ask each; of large numbers it may overflow
        return commands, 0
    good = np.isfinite(commands)
    if good.all():
        return commands, 0
    bad = ~good.all(axis=1)
    return np.where(bad[:, np.newaxis], 0.0, commands), int(bad.sum())


def _gains(robots: Sequence[Position], spans: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the largest loss and gain of velocity (n, 3) from one update to the next."""
    free = np.array([[-np.inf, np.inf]] * 4)
    given = [free if robot.acceleration_bounds is None else robot.acceleration_bounds for robot in robots]
    low, high = (_rows([b[PLANAR, side] for b in given]) * spans[:, np.newaxis] for side in (0, 1))
    return low, high


def _rows(rows: Sequence[FloatArray]) -> FloatArray:
    return np.array(rows, dtype=np.float64).reshape(-1, 3)
