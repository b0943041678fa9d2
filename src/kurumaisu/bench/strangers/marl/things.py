# SPDX-License-Identifier: BSD-3-Clause
"""Robots, lasers and references."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

Rng = np.random.Generator
RESOLUTION = 0.001


class Robot(NamedTuple):
    """A base: its largest rates, its radius, and how often it drives backward."""

    name: str
    v: float
    w: float
    radius: float
    back: float
    chair: bool = False


class Noise(NamedTuple):
    """Noise of the rates: sds, and its time constant."""

    v: float
    w: float
    tau: float


class Reference(NamedTuple):
    """What measures poses: its rate, and its errors in m and rad, white and wandering."""

    name: str
    hz: float
    white: tuple[float, float]
    wander: tuple[float, float]
    tau: float


class LaserKind(NamedTuple):
    """What a data sheet says; fan in degrees, sigma over the range's powers."""

    name: str
    fan: tuple[float, float]
    beams: int
    scan_time: float
    scale: float
    datum: float
    sigma: tuple[float, float, float]
    near: float
    far: float


LASERS = (
    LaserKind("URG-04LX", (-119.53, 119.53), 341, 0.1, 1.004587, 0.058826, (0.002334, -0.000488, 0.000199), 0.06, 4.0),
    LaserKind("UTM-30LX", (-135, 135), 361, 0.025, 1.0, 0.0, (0.006, 0.0004, 0.0), 0.1, 30.0),
    LaserKind("UST-10LX", (-135, 135), 271, 0.025, 1.0, 0.0, (0.005, 0.0005, 0.0), 0.06, 10.0),
    LaserKind("LMS-200", (-90, 90), 181, 0.0133, 1.0, 0.0, (0.005, 0.0, 0.0), 0.1, 8.19),
    LaserKind("TiM561", (-135, 135), 271, 0.0667, 1.001, 0.004, (0.008, 0.0006, 0.0), 0.05, 10.0),
    LaserKind("LDS-01", (0, 359), 360, 0.2, 1.0, 0.0, (0.004, 0.003, 0.0008), 0.12, 3.5),
    LaserKind("RPLIDAR-A1", (-180, 179), 360, 0.13, 1.0, 0.0, (0.003, 0.002, 0.0005), 0.15, 12.0),
    LaserKind("S300", (-135, 135), 181, 0.04, 1.002, -0.003, (0.007, 0.0003, 0.0), 0.1, 25.0),
    LaserKind("slice", (-29, 29), 117, 0.0333, 1.0, 0.0, (0.002, 0.0, 0.0015), 0.45, 6.0),
    LaserKind("LMS-111", (-135, 135), 271, 0.02, 1.0, 0.0, (0.006, 0.0003, 0.0), 0.3, 18.0),
)
ROBOTS = (
    Robot("burger", 0.22, 1.3, 0.12, 0.8),
    Robot("kobuki", 0.5, 1.5, 0.2, 0.6),
    Robot("pioneer", 0.7, 1.2, 0.28, 0.6),
    Robot("husky", 0.9, 1.0, 0.45, 0.6),
    Robot("cart", 0.8, 0.7, 0.38, 0.4),
    Robot("rover", 0.4, 1.0, 0.25, 0.7),
    Robot("vacuum", 0.3, 1.6, 0.18, 0.5),
)
REFERENCES = (
    Reference("motion capture", 100, (0.0008, 0.0015), (0.0008, 0.0008), 40.0),
    Reference("scan matching", 5, (0.006, 0.004), (0.008, 0.003), 25.0),
    Reference("total station", 8, (0.002, 0.005), (0.002, 0.002), 60.0),
)


class Laser:
    """A laser on its robot."""

    def __init__(self, rng: Rng, kind: LaserKind, radius: float) -> None:
        self.kind, self.beams, self.near, self.far = kind, kind.beams, kind.near, kind.far
        self.start = round(np.radians(kind.fan[0]), 6)
        self.step = round(np.radians(kind.fan[1] - kind.fan[0]) / (kind.beams - 1), 9)
        self.beam_time = round(kind.scan_time * kind.beams * self.step / (2 * np.pi) / kind.beams, 9)
        self.x, self.y = round(radius * rng.uniform(0, 0.8), 3), round(rng.uniform(-0.05, 0.05), 3)
        self.yaw = round(float(rng.choice([0, 0, rng.uniform(-0.2, 0.2)])), 4)
        self.height = round(rng.uniform(0.15, 0.5), 3)
        self.bearing = self.start + self.step * np.arange(self.beams)
