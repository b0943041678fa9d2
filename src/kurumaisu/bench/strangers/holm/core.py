# SPDX-License-Identifier: BSD-3-Clause
"""What everything else shares: arrays, the joystick's law, and what an effect is and how it is entered."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

Array = NDArray[Any]
TRACK = 0.54
RIM_MASS = 55.0
VISCOUS = 30.0
LASER_HOOKS = {"mount", "stamps", "sweep", "tilt", "room", "mean", "spread", "error", "reading", "last"}


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
    """A cause: its hook says where it acts, act is what it does there (some hooks take settings instead)."""

    id: str
    hook: str
    act: Callable[[Any], None] = lambda s: None
    settings: dict[str, float] = field(default_factory=dict)
    parameters: dict[str, float] = field(default_factory=dict)


Act = Callable[[Any, float], None]
Change = Callable[[Any, float], Any]
Values = Callable[[float], dict[str, float]]
Maker = Callable[[float, np.random.Generator], Effect]
USUAL: dict[str, tuple[float, Maker]] = {}
OTHER: dict[str, tuple[float, Maker]] = {}
MOST: dict[str, float] = {}


def effect(name: str, hook: str, act: Act, x: float, key: str = "") -> Effect:
    """An effect of size x, which is its parameter if there is a key."""
    return Effect(name, hook, lambda s: act(s, x), {"size": x}, {key: x} if key else {})


def by(what: str, change: Change) -> Act:
    """Add a change to the field that is named before a +, or multiply the one before a *."""
    name = what[:-1]

    def act(s: Any, x: float) -> None:
        old, new = getattr(s, name), change(s, x)
        setattr(s, name, old * new if what.endswith("*") else old + new)

    return act


def acts(
    name: str, size: float, hook: str, usual: Act, key: str = "", other: Act | None = None, most: float = np.inf
) -> None:
    """Enter a cause by what it does, usually and in another form, with its typical and its largest size."""
    full = ("laser." if hook in LASER_HOOKS else "base.") + name
    USUAL[full], MOST[full] = (size, lambda x, _: effect(full, hook, usual, x, key)), most
    if other is not None:
        OTHER[full] = (size, lambda x, _: effect(full, hook, other, x))


def changes(
    name: str, size: float, what: str, key: str, usual: Change, other: Change | None = None, most: float = np.inf
) -> None:
    """Enter a cause that adds to a field or multiplies it; what: its hook and field, as `tyre w*`."""
    hook, target = what.split()
    acts(name, size, hook, by(target, usual), key, by(target, other) if other else None, most)


def sets(
    full: str,
    size: float,
    hook: str,
    usual: Values,
    parameters: Values = lambda x: {},
    other: Values | None = None,
    most: float = np.inf,
) -> None:
    """Enter a cause that is made by settings."""
    USUAL[full], MOST[full] = (size, lambda x, _: Effect(full, hook, settings=usual(x), parameters=parameters(x))), most
    if other is not None:
        OTHER[full] = (size, lambda x, _: Effect(full, hook, settings=other(x)))


def log_uniform(rng: np.random.Generator, low: float, high: float) -> float:
    """A number between low and high, even in its logarithm."""
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def chosen(rng: np.random.Generator, items: Sequence[Any]) -> Any:
    """One of the items."""
    return items[int(rng.integers(len(items)))]


def ornstein(rng: np.random.Generator, n: int, dt: float, sd: float, tau: float, many: int = 1) -> Array:
    """Noise of one colour: many rows of n samples, dt apart."""
    keep = float(np.exp(-dt / tau))
    white = rng.standard_normal((many, n)) * sd * np.sqrt(1 - keep * keep)
    white[:, 0] = rng.standard_normal(many) * sd
    return np.asarray(lfilter([1.0], [1.0, -keep], white, axis=1), dtype=float)


def wrap(angle: Array) -> Array:
    """Angles within half a turn of 0."""
    return np.asarray((angle + np.pi) % (2 * np.pi) - np.pi, dtype=float)


def compose(a: Array, b: Array) -> Array:
    """Pose a, then motion b in its frame."""
    c, s = np.cos(a[..., 2]), np.sin(a[..., 2])
    x, y = a[..., 0] + c * b[..., 0] - s * b[..., 1], a[..., 1] + s * b[..., 0] + c * b[..., 1]
    return np.stack([x, y, a[..., 2] + b[..., 2]], axis=-1)


def relative(a: Array, b: Array) -> Array:
    """Motion from poses a to poses b, in the frame of a."""
    d = b - a
    c, s = np.cos(a[..., 2]), np.sin(a[..., 2])
    return np.stack([c * d[..., 0] + s * d[..., 1], -s * d[..., 0] + c * d[..., 1], d[..., 2]], axis=-1)
