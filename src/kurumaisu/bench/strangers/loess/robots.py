# SPDX-License-Identifier: BSD-3-Clause
"""The robots: wheelchairs driven by voltages, and others driven by rates; their noise and what measures them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kurumaisu.bench.strangers.loess.values import Array

FORWARD, BACK = (1.32402, 0.127906), (2.07369, -0.108783)
STEERING = {
    "published": ((-0.499211, 0.104181), (-0.469278, -0.169476)),
    "corrected": ((-0.499211, -0.104181), (-0.469278, 0.169476)),
}


@dataclass(frozen=True)
class Reference:
    """What measures the poses: white noise, slow wander, rate of rows."""

    name: str
    position: float
    heading: float
    wander: float
    wander_heading: float
    wander_tau: float
    period: float

    def totals(self) -> tuple[float, float]:
        """The sds of position and heading with all that is in them."""
        return float(np.hypot(self.position, self.wander)), float(np.hypot(self.heading, self.wander_heading))


@dataclass(frozen=True)
class Robot:
    """A robot: its law (empty: no voltages), speeds, sizes, noise of its rates, its reference and its driver."""

    name: str
    law: str
    fast: float
    turn: float
    radius: float
    sd_v: float
    sd_w: float
    tau: float
    still: float
    reference: Reference
    person: bool
    hold: float

    def amplitude(self, v: Array, w: Array) -> Array:
        """The share of the noise of rates that there is at these rates."""
        busy = np.abs(v) / (0.15 * self.fast) + np.abs(w) / (0.2 * self.turn)
        share: Array = self.still + (1 - self.still) * np.minimum(busy, 1.0)
        return share


def volts(law: str, v: Array, w: Array) -> tuple[Array, Array]:
    """The voltages that ask for rates."""
    left, right = STEERING[law]
    f = np.where(v > 0, FORWARD[0] * v + FORWARD[1], np.where(v < 0, BACK[0] * v + BACK[1], 0.0))
    s = np.where(w > 0, left[0] * w + left[1], np.where(w < 0, right[0] * w + right[1], 0.0))
    return f, s


def rates(law: str, f: Array, s: Array, asked: Array) -> tuple[Array, Array]:
    """The rates that voltages stand for; where two answer, that of the side that was asked for."""
    v = np.maximum(f - FORWARD[1], 0) / FORWARD[0] + np.minimum(f - BACK[1], 0) / BACK[0]
    left, right = STEERING[law]
    to_left, to_right = (s - left[1]) / left[0], (s - right[1]) / right[0]
    if law == "published":
        return v, np.where(asked > 0, to_left, np.where(asked < 0, to_right, 0.0))
    return v, np.maximum(to_left, 0) + np.minimum(to_right, 0)


def _reference(rng: np.random.Generator) -> Reference:
    kind = int(rng.integers(3))
    name, position, heading, period = (
        ("motion capture", rng.uniform(0.001, 0.003), rng.uniform(0.002, 0.004), 0.04),
        ("scan matching", rng.uniform(0.006, 0.012), rng.uniform(0.004, 0.008), 0.1),
        ("total station", rng.uniform(0.002, 0.005), rng.uniform(0.003, 0.006), 0.08),
    )[kind]
    share = rng.uniform(0.3, 0.9)
    return Reference(
        name,
        position,
        heading,
        share * position,
        share * heading / 2,
        rng.uniform(30, 90),
        period * rng.uniform(0.9, 1.3),
    )


def draw_robot(rng: np.random.Generator) -> Robot:
    """A wheelchair of the paper in half the cases, else another robot on two wheels."""
    reference = _reference(rng)
    noise = (
        rng.uniform(0.006, 0.016),
        rng.uniform(0.01, 0.03),
        rng.uniform(0.1, 0.7),
        float(rng.choice([1.0, 0.5, 0.15])),
    )
    hold = float(rng.choice([0.04, 0.06, 0.1]))
    if rng.random() < 0.5:
        law = "published" if rng.random() < 0.2 else "corrected"
        return Robot("MD-100", law, rng.uniform(0.6, 1.1), rng.uniform(0.7, 1.2), 0.42, *noise, reference, True, hold)
    name, fast, turn, radius, person = (
        ("power wheelchair", rng.uniform(0.7, 1.2), rng.uniform(0.7, 1.3), 0.42, True),
        ("hospital tug", rng.uniform(0.5, 0.9), rng.uniform(0.5, 0.9), 0.4, False),
        ("drug trolley", rng.uniform(0.4, 0.8), rng.uniform(0.6, 1.2), 0.32, False),
        ("telepresence robot", rng.uniform(0.4, 0.8), rng.uniform(0.8, 1.6), 0.3, True),
    )[int(rng.integers(4))]
    return Robot(name, "", fast, turn, radius, *noise, reference, person, hold)
