# SPDX-License-Identifier: BSD-3-Clause
"""What no sentence of the catalogue describes: odd things of the rates and of the reference."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from kurumaisu.bench.strangers.scree.basics import STEP, Array, Cause, Rates
from kurumaisu.bench.strangers.scree.rates import Equation, State, since

Offset = Callable[[Cause, State, Array], Array]


@dataclass(frozen=True)
class Nature:
    """Where an unknown shows and what it follows."""

    channel: str
    covariates: tuple[str, ...]
    typical: float


def episodes(t: Array, c: Cause) -> Array:
    """1 in some stretches of time, 0 elsewhere, never twice at the same distance."""
    period = c.draw(0, 14.0, 24.0)
    phase = t / period + c.draws[1] + 0.35 * np.sin(t / (2.3 * period) + 6 * c.draws[2])
    return np.asarray(1 / (1 + np.exp(-((np.cos(2 * np.pi * phase) - 0.75) / 0.04))))


def _column(c: Cause, s: State) -> Array:
    column = s.columns[int(c.draws[0] * len(s.columns)) % len(s.columns)]
    return column.shape(s.t + s.start)


def _damp(c: Cause, s: State) -> Rates:
    """Belts slip as a column grows."""
    return s.rates.but(v=s.rates.v * (1 + c.size * np.tanh(1.2 * _column(c, s))))


def _pull(c: Cause, s: State) -> Rates:
    """A column pulls the robot to one side."""
    return s.rates.but(w=s.rates.w + c.size * s.robot.w_top * _column(c, s) * s.moving)


def _carpet(c: Cause, s: State) -> Rates:
    """A soft floor in one part of the room costs speed."""
    on = 1 / (1 + np.exp(-np.clip((s.path.x - c.draw(0, 2.6, 4.0)) / 0.12, -30, 30)))
    return s.rates.but(v=s.rates.v * (1 - abs(c.size) * on))


def _ruts(c: Cause, s: State) -> Rates:
    """Ruts of the floor push the wheels to and fro across the room."""
    return s.rates.but(
        w=s.rates.w + c.size * s.robot.w_top * np.sin(s.path.y * c.draw(0, 1.4, 2.4) + 6 * c.draws[1]) * s.moving
    )


def _cold_grease(c: Cause, s: State) -> Rates:
    """After each stop the gears are stiff for some seconds."""
    rest = (np.abs(s.asked.v) + np.abs(s.asked.w) < 1e-3).astype(float)
    far = since(rest, np.full_like(s.t, STEP))
    return s.rates.but(v=s.rates.v * (1 - abs(c.size) * np.exp(-np.maximum(far, 0.0) / c.draw(0, 3.0, 6.0))))


def _resonance(c: Cause, s: State) -> Rates:
    """At one speed the frame shakes, and the robot turns."""
    x = (np.abs(s.rates.v) / s.robot.v_top - c.draw(0, 0.4, 0.6)) / 0.13
    return s.rates.but(w=s.rates.w + c.size * s.robot.w_top * np.exp(-x * x / 2))


def _tether(c: Cause, s: State) -> Rates:
    """A cable tugs, twice for each turn of the robot."""
    return s.rates.but(w=s.rates.w + c.size * s.robot.w_top * np.sin(2 * s.path.th + 6 * c.draws[0]) * s.moving)


def _gusts(c: Cause, s: State) -> Rates:
    """A wheel drags now and then."""
    return s.rates.but(w=s.rates.w + 2 * c.size * s.robot.w_top * episodes(s.t + 0.37 * s.start, c) * s.moving)


def _hill_of_gain(c: Cause, s: State) -> Rates:
    """The speed controller's gain has a dip at a middle yaw rate."""
    x = (np.abs(s.rates.w) / s.robot.w_top - c.draw(0, 0.35, 0.6)) / 0.12
    return s.rates.but(v=s.rates.v * (1 - abs(c.size) * 2 * np.exp(-x * x / 2)))


RATES: dict[str, Equation] = {
    "unknown.damp": _damp,
    "unknown.pull": _pull,
    "unknown.carpet": _carpet,
    "unknown.ruts": _ruts,
    "unknown.cold_grease": _cold_grease,
    "unknown.resonance": _resonance,
    "unknown.tether": _tether,
    "unknown.gusts": _gusts,
    "unknown.hill_of_gain": _hill_of_gain,
}


def _lens(c: Cause, s: State, pose: Array) -> Array:
    """The cameras' picture is bent: x is off in waves along y."""
    out = np.zeros_like(pose)
    out[:, 0] = c.size * np.sin(pose[:, 1] * c.draw(0, 1.6, 2.6) + 6 * c.draws[1])
    return out


def _ring(c: Cause, s: State, pose: Array) -> Array:
    """The heading's ring is out of centre."""
    out = np.zeros_like(pose)
    out[:, 2] = c.size * np.sin(pose[:, 2] + 6 * c.draws[0])
    return out


def _mast(c: Cause, s: State, pose: Array) -> Array:
    """The mast of the reference bends with a column."""
    out = np.zeros_like(pose)
    out[:, 1] = 4 * c.size * np.tanh(2.5 * _column(c, s))
    return out


OFFSETS: dict[str, Offset] = {"unknown.lens": _lens, "unknown.ring": _ring, "unknown.mast": _mast}

NATURES: dict[str, Nature] = {
    "unknown.damp": Nature("base.v", ("column",), 0.04),
    "unknown.pull": Nature("base.w", ("column",), 0.02),
    "unknown.carpet": Nature("base.v", ("x",), 0.07),
    "unknown.ruts": Nature("base.w", ("y",), 0.025),
    "unknown.cold_grease": Nature("base.v", ("time_since_rest",), 0.12),
    "unknown.resonance": Nature("base.w", ("abs_v", "v"), 0.05),
    "unknown.tether": Nature("base.w", ("heading",), 0.025),
    "unknown.gusts": Nature("base.w", ("time",), 0.05),
    "unknown.hill_of_gain": Nature("base.v", ("abs_w",), 0.05),
    "unknown.lens": Nature("base.pose", ("y",), 0.015),
    "unknown.ring": Nature("base.pose", ("heading",), 0.02),
    "unknown.mast": Nature("base.pose", ("column",), 0.015),
    "unknown.haze": Nature("laser.range", ("column",), 0.006),
    "unknown.sunlight": Nature("laser.range", ("direction",), 0.01),
    "unknown.curtain": Nature("laser.range", ("hit_x",), 0.01),
    "unknown.flicker": Nature("laser.range", ("time",), 0.008),
    "unknown.shaking": Nature("laser.range", ("abs_v", "v"), 0.008),
    "unknown.dust": Nature("laser.spread", ("bearing", "beam"), 0.5),
    "unknown.damp_air": Nature("laser.spread", ("column",), 0.3),
    "unknown.rattle": Nature("laser.spread", ("abs_w",), 0.5),
    "unknown.lamp": Nature("laser.spread", ("hit_y",), 0.5),
}
