# SPDX-License-Identifier: BSD-3-Clause
"""Errors that are in no catalogue, and data that are wrong as a whole."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from kurumaisu.bench.strangers.holm.chair import State
from kurumaisu.bench.strangers.holm.core import Act, Array, Change, Effect, by, effect
from kurumaisu.bench.strangers.holm.laser import Look

EXTRA = {
    "motor_temperature": (40.0, 6.0),
    "tyre_pressure": (2.5, 0.25),
    "humidity": (50.0, 6.0),
    "temperature": (20.0, 5.0),
}
_WRONG = """positions in mm|headings in degrees|y of the wrong sign|x and y swapped|heading clockwise
heading of a compass|clock of the reference is shifted|times of the reference in ms|commands in km/h
speed of the wrong sign|yaw rate of the wrong sign|voltages in mV|poses of another drive"""
WRONG = _WRONG.replace("\n", "|").split("|")
WRONG_SCANS = ["another map", "mirrored fan", "ranges in mm"]
FIELDS = {"base.v": "v+", "base.w": "w+", "laser.range": "mu+", "laser.spread": "sd*"}
HOOKS = {"base.pose": "bend", "laser.range": "mean", "laser.spread": "spread"}


class Pick(NamedTuple):
    """An unknown error: what it changes, what it follows, its typical size, its curve, and a cause in words."""

    channel: str
    follows: str
    size: float
    curve: Change
    says: str

    def effect(self, x: float) -> Effect:
        """The error at size x."""
        hook = HOOKS.get(self.channel) or ("place" if self.follows in ("x", "y", "heading") else "tyre")
        act = by(FIELDS[self.channel], self.curve) if self.channel in FIELDS else self.curve
        return effect("unknown", hook, act, x)


def _rested(s: State) -> Array:
    """Time since the last standing cell."""
    index = np.arange(s.v.size)
    moving = np.abs(s.v) + np.abs(s.w) > 1e-6
    return np.asarray((index - np.maximum.accumulate(np.where(moving, -1, index))) * s.dt)


def _bump(x: Array, centre: float, width: float) -> Array:
    return np.asarray(np.exp(-0.5 * ((x - centre) / width) ** 2))


def _go(s: State) -> Array:
    return np.asarray(np.sign(np.where(np.abs(s.v) > 1e-6, s.v, 0)))


def _round(s: State) -> Array:
    return np.asarray(np.sin(2 * np.pi * np.cumsum(np.abs(s.v)) * s.dt / 2.4))


def _stiff(s: State) -> Array:
    return np.asarray(np.tanh((s.extra["motor_temperature"] - 40) / 4))


def _damp(s: Look, width: float) -> Array:
    return np.asarray(np.tanh((s.extra["humidity"] - 50) / width))


def _lit(s: Look, turn: float) -> Array:
    return np.asarray(np.maximum(np.cos(s.direction + turn), 0))


def _bend(axis: int, wave: Change) -> Act:
    def act(p: Array, a: float) -> None:
        p[..., axis] += wave(p, a)

    return act


_ROWS: list[tuple[str, str, float, Change, str]] = [
    ("base.v", "x", 0.08, lambda s, a: a * s.v * np.tanh((s.x - 0.3) / 0.4), "a carpet on one side of the room"),
    ("base.v", "y", 0.08, lambda s, a: a * s.v * _bump(s.y, 0.2, 0.5), "a strip of carpet"),
    ("base.v", "heading", 0.03, lambda s, a: a * _go(s) * np.cos(2 * s.th + 0.6), "the pile of a carpet, both ways"),
    ("base.v", "distance", 0.08, lambda s, a: a * s.v * _round(s), "a tyre out of round"),
    (
        "base.v",
        "time_since_rest time_since_change",
        0.15,
        lambda s, a: -abs(a) * s.v * np.exp(-_rested(s) / 1.5),
        "bearings that stick after a stand",
    ),
    ("base.v", "time", 0.08, lambda s, a: a * s.v * np.sin(2 * np.pi * s.t / 37), "a motor that hunts"),
    ("base.v", "motor_temperature", 0.1, lambda s, a: -abs(a) * s.v * _stiff(s), "grease that stiffens"),
    ("base.w", "x", 0.03, lambda s, a: a * _go(s) * np.tanh(s.x / 0.5), "a floor that leans"),
    ("base.w", "time", 0.02, lambda s, a: a * _go(s) * np.sin(2 * np.pi * s.t / 41), "a load that sways"),
    (
        "base.w",
        "tyre_pressure",
        0.04,
        lambda s, a: a * s.v * (s.extra["tyre_pressure"] - 2.5) / 0.2,
        "a tyre that is pumped and leaks",
    ),
    ("base.w", "heading", 0.03, lambda s, a: a * _go(s) * np.sin(2 * s.th), "a floor with a grain"),
    ("base.pose", "x", 0.02, _bend(0, lambda p, a: a * np.sin(2 * np.pi * p[..., 0] / 2.5)), "a camera's lens"),
    (
        "base.pose",
        "x",
        0.02,
        _bend(1, lambda p, a: a * np.sin(2 * np.pi * p[..., 0] / 2.2)),
        "a seam between two cameras",
    ),
    ("base.pose", "heading", 0.02, _bend(0, lambda p, a: a * np.cos(3 * p[..., 2])), "markers that hide each other"),
    ("laser.range", "bearing beam", 0.015, lambda s, a: a * _bump(s.bearing, 0.25, 0.22), "a smudge on the window"),
    ("laser.range", "direction", 0.01, lambda s, a: a * _lit(s, -0.9) ** 2, "sun from a window"),
    ("laser.range", "scan_parity", 0.004, lambda s, a: a * (2 * s.parity - 1), "two mirrors, every other scan"),
    ("laser.range", "range", 0.012, lambda s, a: a * _bump(s.r, 1.9, 0.2), "an echo inside the housing"),
    ("laser.range", "time", 0.006, lambda s, a: a * (s.stamp % 17 < 2.5), "a supply that drops out"),
    ("laser.range", "humidity", 0.006, lambda s, a: a * _damp(s, 4), "damp on the window"),
    ("laser.range", "hit_x", 0.012, lambda s, a: a * np.tanh((s.hit_x - 0.4) / 0.3), "steam in one half of the room"),
    (
        "laser.spread",
        "bearing beam",
        1.0,
        lambda s, a: 1 + abs(a) * _bump(s.bearing, -0.5, 0.3),
        "a scratch on the window",
    ),
    ("laser.spread", "direction", 0.8, lambda s, a: 1 + abs(a) * _lit(s, 0.4), "light from one side"),
    (
        "laser.spread",
        "time",
        0.8,
        lambda s, a: 1 + abs(a) * (np.sin(2 * np.pi * s.stamp / 29) > 0),
        "a lamp that blinks",
    ),
    ("laser.spread", "humidity", 0.7, lambda s, a: 1 + abs(a) * (1 + _damp(s, 3)), "fog"),
]
PICKS = [Pick(*row) for row in _ROWS]
