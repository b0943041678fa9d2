# SPDX-License-Identifier: BSD-3-Clause
"""Sonars: each answers with the nearest thing in its cone."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kurumaisu.geometry import attached
from kurumaisu.sim.sensors.rays import Rays
from kurumaisu.types import FloatArray, IntArray


@dataclass(frozen=True)
class SonarSettings:
    """A ring of equal sonars. mounts: (n, 4) of x, y, z [m], heading [rad] on the robot; angle of the cone [rad].

    rays: cast through the cone, its borders included: what is thinner than their spacing may be missed;
    ranges [m]; deviation: of a reading [m].
    """

    mounts: FloatArray
    field_of_view: float
    rays: int
    range_min: float
    range_max: float
    deviation: float


class Sonar:
    """Reads the ring on any number of robots."""

    def __init__(self, settings: SonarSettings) -> None:
        """Prepare the cones."""
        self.settings = settings
        half = settings.field_of_view / 2
        spread = settings.field_of_view / (settings.rays - 1) if settings.rays > 1 else 0.0
        self._fan = np.array([-half if settings.rays > 1 else 0.0, spread, settings.rays, settings.range_max])

    def read(self, rays: Rays, poses: FloatArray, trees: IntArray, rng: np.random.Generator) -> FloatArray:
        """Return readings (k, n) [m] of n sonars on robots at poses (k, 4), of trees (k,).

        As in REP 117: +inf: nothing within range_max; -inf: something nearer than range_min.
        """
        s = self.settings
        k, n = len(poses), len(s.mounts)
        origins = attached(poses[:, None, :], s.mounts[None, :, :]).reshape(-1, 4)
        ranges, _ = rays.scan(origins, np.repeat(trees, n), np.tile(self._fan, (k * n, 1)))
        nearest = ranges.reshape(k, n, s.rays).min(axis=-1)
        readings: FloatArray = nearest + s.deviation * rng.standard_normal((k, n))
        readings[nearest < s.range_min] = -np.inf
        readings[readings > s.range_max] = np.inf
        return readings
