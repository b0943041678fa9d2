# SPDX-License-Identifier: BSD-3-Clause
"""What all parts share: types, the step of the plant, a cause, and the noise."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[Any]
Rng = np.random.Generator
STEP = 0.002  # [s] of the plant
TRACK = 0.54  # [m] between the drive wheels


@dataclass
class Cause:
    """Something hidden: which, in which form, how large, and what else its equation needs."""

    id: str
    size: float
    other: bool = False
    more: dict[str, float] = field(default_factory=dict)
    z: float = 0.0
    beside: float = 0.0


@dataclass(frozen=True)
class Noise:
    """Noise of the wheels (each by itself, coloured) and of the reference (white, and slowly drifting)."""

    wheel: float  # [m/s]
    tau: float  # [s]
    gated: bool  # only while the chair moves
    white: Array  # sd of x, y, theta
    drift: Array
    drift_tau: float  # [s]

    @property
    def rates(self) -> Array:
        """Sd of v and w: independent of each other, since both wheels are equally rough."""
        return np.array([self.wheel / np.sqrt(2.0), self.wheel * np.sqrt(2.0) / TRACK])


def draw_noise(rng: Rng) -> Noise:
    """A robot's and a reference's noise."""
    p, h = float(rng.uniform(0.001, 0.004)), float(rng.uniform(0.0015, 0.005))
    dp, dh = float(rng.uniform(0.0005, 0.003)), float(rng.uniform(0.0005, 0.0025))
    return Noise(
        float(rng.uniform(0.003, 0.012)),
        float(rng.uniform(0.15, 0.6)),
        bool(rng.random() < 1 / 3),
        np.array([p, p, h]),
        np.array([dp, dp, dh]),
        float(rng.uniform(10.0, 40.0)),
    )


def coloured(n: int, dt: Array | float, tau: float, rng: Rng) -> Array:
    """Ornstein-Uhlenbeck of sd 1 at n times, dt apart."""
    from scipy.signal import lfilter

    e = rng.standard_normal(n)
    if isinstance(dt, float):
        a = float(np.exp(-dt / tau))
        e[1:] *= np.sqrt(1.0 - a * a)
        return np.asarray(lfilter([1.0], [1.0, -a], e))
    out = e.copy()
    fade = np.exp(-dt / tau)
    for k in range(1, n):
        out[k] = fade[k - 1] * out[k - 1] + np.sqrt(1.0 - fade[k - 1] ** 2) * e[k]
    return out


def wrap(a: Array) -> Array:
    """Into (-pi, pi]."""
    return np.asarray((a + np.pi) % (2 * np.pi) - np.pi)
