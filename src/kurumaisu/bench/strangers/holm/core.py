# SPDX-License-Identifier: BSD-3-Clause
"""What everything else shares: arrays, the joystick's law, and what an effect is."""
from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]
TRACK = 0.54
RIM_MASS = 55.0
VISCOUS = 30.0

@dataclass(frozen=True)
class Law:
    """Volts of a rate, by its sign: slope and intercept forward and backward."""
    up: tuple[float, float]
    down: tuple[float, float]

    def volts(self, rate: Array) -> Array:
        """What the joystick puts out for a rate."""
        forward, backward = self.up[0] * rate + self.up[1], self.down[0] * rate + self.down[1]
        return np.where(rate > 0, forward, np.where(rate < 0, backward, 0.0))

    def rate(self, volts: Array, hint: Array) -> Array:
        """What the controller makes of volts; where two rates answer, that of the sign of hint."""
        forward, backward = (volts - self.up[1]) / self.up[0], (volts - self.down[1]) / self.down[0]
        is_up, is_down = forward > 0, backward < 0
        both = is_up & is_down
        up = (is_up & ~is_down) | (both & (hint > 0))
        down = (is_down & ~is_up) | (both & (hint < 0))
        return np.where(up, forward, np.where(down, backward, 0.0))

    def flipped(self) -> Law:
        """The law with both intercepts of the other sign."""
        return Law((self.up[0], -self.up[1]), (self.down[0], -self.down[1]))

TRANSLATION = Law((1.32402, 0.127906), (2.07369, -0.108783))
PUBLISHED = Law((-0.499211, 0.104181), (-0.469278, -0.169476))
CORRECTED = PUBLISHED.flipped()

@dataclass(frozen=True)
class Effect:
    """A cause: its hook says where it acts, act is what it does there (settings for the hook plant)."""
    id: str
    hook: str
    act: Callable[[Any], None] = lambda s: None
    settings: dict[str, float] = field(default_factory=dict)
    parameters: dict[str, float] = field(default_factory=dict)
    channel: str = "base"

Maker = Callable[[float, np.random.Generator], Effect]

def log_uniform(rng: np.random.Generator, low: float, high: float) -> float:
    """A number between low and high, even in its logarithm."""
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))

def chosen(rng: np.random.Generator, items: Iterable[Any]) -> Any:
    """One of the items."""
    pool = list(items)
    return pool[int(rng.integers(len(pool)))]

def ornstein(rng: np.random.Generator, n: int, dt: float, sd: float, tau: float, many: int = 1) -> Array:
    """Noise of one colour: many rows of n samples, dt apart."""
    from scipy.signal import lfilter
    keep = float(np.exp(-dt / tau))
    white = rng.standard_normal((many, n)) * sd * np.sqrt(1 - keep * keep)
    white[:, 0] = rng.standard_normal(many) * sd
    return np.asarray(lfilter([1.0], [1.0, -keep], white, axis=1), dtype=float)

def wrap(angle: Array) -> Array:
    """Angles within half a turn of 0."""
    return np.asarray((angle + np.pi) % (2 * np.pi) - np.pi, dtype=float)
