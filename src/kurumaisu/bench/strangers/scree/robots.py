# SPDX-License-Identifier: BSD-3-Clause
"""The robots: what they are called, how fast they go, how steadily, and the wheelchair's law of voltages."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from kurumaisu.bench.strangers.scree.basics import Array, Rng

SLOPES = ((1.32402, 2.07369), (-0.499211, -0.469278))
CORRECTED = ((0.127906, -0.108783), (-0.104181, 0.169476))
PUBLISHED = ((0.127906, -0.108783), (0.104181, -0.169476))


@dataclass(frozen=True)
class Robot:
    """A robot with two driven wheels."""

    name: str
    kind: str
    v_top: float
    w_top: float
    radius: float
    track: float
    noise_v: float
    noise_w: float
    tau: float
    published: bool = False

    @property
    def volts(self) -> bool:
        """Whether it is driven by voltages."""
        return self.kind == "md100"


ROBOTS = (
    Robot("wheelchair", "md100", 0.7, 0.9, 0.17, 0.54, 0.012, 0.018, 0.25),
    Robot("wheelchair by rates", "velocity", 0.7, 0.9, 0.17, 0.54, 0.012, 0.018, 0.25),
    Robot("small kit of a class room", "diff_drive", 0.22, 1.8, 0.033, 0.160, 0.004, 0.030, 0.15),
    Robot("vacuum cleaner's base", "diff_drive", 0.45, 1.4, 0.035, 0.230, 0.007, 0.022, 0.20),
    Robot("research robot", "diff_drive", 0.65, 1.1, 0.0975, 0.38, 0.009, 0.016, 0.30),
    Robot("shelf carrier", "velocity", 1.1, 0.9, 0.10, 0.46, 0.015, 0.014, 0.40),
    Robot("delivery robot", "velocity", 0.9, 1.0, 0.08, 0.40, 0.012, 0.015, 0.20),
)


def draw_robot(rng: Rng) -> Robot:
    """One of the robots, a little different each time."""
    r = ROBOTS[int(rng.choice(len(ROBOTS), p=[0.22, 0.13, 0.13, 0.13, 0.13, 0.13, 0.13]))]
    f = rng.uniform(0.75, 1.3, 3)
    return replace(r, noise_v=r.noise_v * f[0], noise_w=r.noise_w * f[1], tau=r.tau * f[2])


def to_volts(rate: Array, axis: int, published: bool) -> Array:
    """What the owner's law puts out for a rate."""
    (up, down), (zero_up, zero_down) = SLOPES[axis], (PUBLISHED if published else CORRECTED)[axis]
    return np.where(rate > 0, up * rate + zero_up, np.where(rate < 0, down * rate + zero_down, 0.0))


def from_volts(volts: Array, axis: int, wider: float = 0.0) -> Array:
    """What the chair makes of a voltage: nothing inside of its dead zone."""
    (up, down), (zero_up, zero_down) = SLOPES[axis], CORRECTED[axis]
    way = 1.0 if up > 0 else -1.0
    ahead = np.maximum(way * (volts - zero_up) - wider, 0.0) / abs(up)
    back = np.maximum(-way * (volts - zero_down) - wider, 0.0) / abs(down)
    return np.asarray(ahead - back)
