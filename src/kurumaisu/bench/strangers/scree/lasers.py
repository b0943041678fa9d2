# SPDX-License-Identifier: BSD-3-Clause
"""The lasers: fan, gate, noise, time of a turn, and where they sit."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from kurumaisu.bench.strangers.scree.basics import Array, Rng

HEIGHT = 0.35


@dataclass(frozen=True)
class Laser:
    """A laser as its owner believes it to be."""

    name: str
    first: float
    step: float
    beams: int
    turn: float
    sigma: tuple[float, float, float]
    resolution: float
    near: float
    far: float
    scale: float = 1.0
    datum: float = 0.0
    mount: tuple[float, float, float] = (0.0, 0.0, 0.0)

    @property
    def bearing(self) -> Array:
        """Bearings of the beams."""
        return np.asarray(self.first + self.step * np.arange(self.beams))

    @property
    def between(self) -> float:
        """Time from beam to beam."""
        return self.turn * self.step / (2 * np.pi)

    def sd(self, r: Array) -> Array:
        """The noise of a reading."""
        a, b, c = self.sigma
        return np.asarray(np.maximum(a + b * r + c * r * r, 1e-4))


def _fan(degrees: float, step: float) -> tuple[float, float, int]:
    n = round(degrees / step) + 1
    return -np.deg2rad(step) * (n - 1) / 2, np.deg2rad(step), n


_URG = (0.002334, -0.000488, 0.000199)
LASERS = (
    Laser("URG-04LX", -2.086214, 0.006135923, 682, 0.1, _URG, 0.001, 0.06, 4.0, 1.004587, 0.058826),
    Laser("UST-10LX", *_fan(270, 0.5), 0.025, (0.006, 0.0, 0.0), 0.001, 0.06, 10.0),
    Laser("LMS100", *_fan(270, 0.5), 0.02, (0.009, 0.0004, 0.0), 0.001, 0.5, 20.0),
    Laser("LMS200", *_fan(180, 1.0), 0.01333, (0.005, 0.0, 0.0001), 0.001, 0.1, 8.1),
    Laser("RPLIDAR A1", *_fan(359, 1.0), 0.15, (0.003, 0.003, 0.0003), 0.001, 0.15, 12.0),
    Laser("TiM561", *_fan(270, 1.0), 0.0667, (0.012, 0.0005, 0.0), 0.001, 0.05, 10.0),
    Laser("LDS-01", *_fan(359, 1.0), 0.2, (0.006, 0.002, 0.0), 0.001, 0.12, 3.5),
    Laser("UTM-30LX", *_fan(270, 0.75), 0.025, (0.008, 0.0, 0.0002), 0.001, 0.1, 30.0),
)


def draw_laser(rng: Rng) -> Laser:
    """One of the lasers on its mount."""
    laser = LASERS[int(rng.integers(len(LASERS)))]
    mount = np.round([rng.uniform(0.0, 0.3), rng.normal(0, 0.03), rng.choice([0.0, rng.normal(0, 0.05)])], 3)
    return replace(
        laser,
        first=round(laser.first, 8),
        step=round(laser.step, 10),
        mount=(float(mount[0]), float(mount[1]), float(mount[2])),
    )
