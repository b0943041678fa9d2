# SPDX-License-Identifier: BSD-3-Clause
"""Lasers as they are bought: fan, noise, gate, and how often a recording has a scan of them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kurumaisu.bench.strangers.loess.values import Array


@dataclass(frozen=True)
class Laser:
    """A laser on a robot: mounting, fan, times, and its errors as the model states them."""

    name: str
    x: float
    y: float
    yaw: float
    start: float
    increment: float
    beams: int
    scan_time: float
    beam_time: float
    scale: float
    offset: float
    sigma: tuple[float, float, float]
    resolution: float
    near: float
    far: float
    period: float

    def bearings(self) -> Array:
        """The direction of each beam from the laser's axis."""
        return self.start + self.increment * np.arange(self.beams, dtype=float)

    def noise(self, r: Array) -> Array:
        """The sd of a reading of a range, as the model states it."""
        s0, s1, s2 = self.sigma
        sd: Array = np.maximum(s0 + s1 * r + s2 * r**2, 5e-4)
        return sd


def draw_laser(rng: np.random.Generator) -> Laser:
    """A laser: cheap or good, mounted somewhere in front."""
    name, fan, beams, scan_time, scale, offset, sigma, resolution, near, far = (
        ("URG-04LX", 240.0, 228, 0.1, 1.004587, 0.058826, (0.002334, -0.000488, 0.000199), 0.001, 0.06, 4.0),
        ("UTM-30LX", 270.0, 361, 0.025, 1.0, 0.0, (0.006, 0.0, 0.00008), 0.001, 0.1, 30.0),
        ("LMS111", 270.0, 271, 0.02, 1.0, 0.0, (0.009, 0.0003, 0.0), 0.001, 0.5, 20.0),
        ("LMS200", 180.0, 181, 0.0267, 1.0, 0.0, (0.005, 0.0, 0.0), 0.001, 0.05, 8.0),
        ("RPLIDAR A1", 359.0, 240, 0.13, 1.0, 0.0, (0.004, 0.002, 0.0012), 0.001, 0.15, 12.0),
        ("LDS-01", 359.0, 180, 0.2, 1.0, 0.0, (0.006, 0.0, 0.0025), 0.001, 0.12, 3.5),
        ("TiM561", 270.0, 271, 0.067, 1.0, 0.0, (0.01, 0.0005, 0.0), 0.001, 0.05, 10.0),
    )[int(rng.integers(7))]
    width = np.radians(fan)
    beam_time = scan_time * fan / 360.0 / beams
    place = np.round(rng.uniform([0.1, -0.06, -0.04], [0.4, 0.06, 0.04]), 3)
    aside, turned = rng.random() < 0.4, rng.random() < 0.3
    x, y, yaw = float(place[0]), float(place[1] * aside), float(place[2] * turned)
    period = float(rng.choice([0.4, 0.6, 1.0]))
    start, increment = -width / 2, width / (beams - 1)
    errors = (scale, offset, sigma, resolution, near, far)
    return Laser(name, x, y, yaw, start, increment, beams, scan_time, beam_time, *errors, period)
