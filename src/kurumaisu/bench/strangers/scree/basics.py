# SPDX-License-Identifier: BSD-3-Clause
"""What all modules share: a cause, a column of covariates, rates and paths on a grid."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Rng = np.random.Generator
STEP = 0.02


@dataclass(frozen=True)
class Cause:
    """One thing that is hidden: its id, its size, whether its equation is the other one, further draws in 0..1."""

    id: str
    size: float
    other: bool = False
    draws: tuple[float, ...] = (0.5, 0.5, 0.5)

    def draw(self, number: int, low: float, high: float) -> float:
        """A further constant of the equation."""
        return low + (high - low) * self.draws[number]


@dataclass(frozen=True)
class Column:
    """A slowly changing quantity that the owner wrote down."""

    name: str
    middle: float
    swing: float
    period: float
    phase: float
    slope: float

    def at(self, t: Array) -> Array:
        """Its values at times of the whole recording."""
        turn = 2 * np.pi * t / self.period + self.phase
        wave = 0.75 * np.sin(turn) + 0.25 * np.sin(2.7 * turn + 1.0)
        return np.asarray(self.middle + self.swing * wave + self.slope * t)

    def shape(self, t: Array) -> Array:
        """Its values without middle and unit, some -1 to 1."""
        return np.asarray((self.at(t) - self.middle - self.slope * t) / self.swing)


@dataclass(frozen=True)
class Rates:
    """Rates of the body in each cell of the grid: forward, yaw, sideways."""

    v: Array
    w: Array
    side: Array

    def but(self, v: Array | None = None, w: Array | None = None, side: Array | None = None) -> Rates:
        """The same with other rates."""
        return replace(
            self, v=self.v if v is None else v, w=self.w if w is None else w, side=self.side if side is None else side
        )


@dataclass(frozen=True)
class Path:
    """A pose at each edge of the grid."""

    x: Array
    y: Array
    th: Array

    def at(self, t: Array) -> Array:
        """Poses at any times, a row each."""
        edges = STEP * np.arange(len(self.x))
        return np.stack([np.interp(t, edges, u) for u in (self.x, self.y, self.th)], axis=-1)

    def cut(self, n: int) -> Path:
        """The first n cells' poses at their starts."""
        return Path(self.x[:n], self.y[:n], self.th[:n])


@dataclass(frozen=True)
class Rows:
    """The commands as recorded: asked rates from t on, voltages if there are any."""

    t: Array
    v: Array
    w: Array


def integrate(rates: Rates, start: Array) -> Path:
    """Drive from a start with given rates."""
    th = start[2] + STEP * np.concatenate([[0.0], np.cumsum(rates.w)])
    mid = th[:-1] + 0.5 * STEP * rates.w
    c, s = np.cos(mid), np.sin(mid)
    x = start[0] + STEP * np.concatenate([[0.0], np.cumsum(rates.v * c - rates.side * s)])
    y = start[1] + STEP * np.concatenate([[0.0], np.cumsum(rates.v * s + rates.side * c)])
    return Path(x, y, th)


def compose(a: Array, b: Array) -> Array:
    """Poses b, given in the frames of poses a, in the outer frame."""
    c, s = np.cos(a[..., 2]), np.sin(a[..., 2])
    return np.stack(
        [
            a[..., 0] + c * b[..., 0] - s * b[..., 1],
            a[..., 1] + s * b[..., 0] + c * b[..., 1],
            a[..., 2] + b[..., 2],
        ],
        axis=-1,
    )


def between(a: Array, b: Array) -> Array:
    """Poses b in the frames of poses a."""
    c, s = np.cos(a[..., 2]), np.sin(a[..., 2])
    dx, dy = b[..., 0] - a[..., 0], b[..., 1] - a[..., 1]
    return np.stack([c * dx + s * dy, -s * dx + c * dy, b[..., 2] - a[..., 2]], axis=-1)


def wandering(rng: Rng, times: Array, sd: float, tau: float) -> Array:
    """Noise whose correlation falls off with time, at given times."""
    from_step = np.exp(-np.maximum(np.diff(times), 0.0) / tau)
    kicks = rng.standard_normal(len(times)) * sd
    out = np.empty(len(times))
    out[0] = kicks[0]
    for k in range(1, len(times)):
        a = from_step[k - 1]
        out[k] = a * out[k - 1] + np.sqrt(1 - a * a) * kicks[k]
    return out
