# SPDX-License-Identifier: BSD-3-Clause
"""Errors that are in no catalogue, and data that are wrong as a whole."""
from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from .chair import State
from .core import Array, Effect
from .laser import Look

Curve = Callable[[Any, float], Array]

def since(moving: Array, dt: float) -> Array:
    """Time since the last standing cell."""
    index = np.arange(moving.size)
    last = np.maximum.accumulate(np.where(moving, -1, index))
    return np.asarray((index - last) * dt)

def _bump(x: Array, centre: float, width: float) -> Array:
    return np.asarray(np.exp(-0.5 * ((x - centre) / width) ** 2))

def _go(s: State) -> Array:
    return np.asarray(np.sign(np.where(np.abs(s.v) > 1e-6, s.v, 0)))

BASE: list[tuple[str, list[str], str, float, Curve, str]] = [
    ("base.v", ["x"], "place", 0.08, lambda s, a: a * s.v * np.tanh((s.x - 0.3) / 0.4),
     "a carpet on one side of the room"),
    ("base.v", ["y"], "place", 0.08, lambda s, a: a * s.v * _bump(s.y, 0.2, 0.5), "a strip of carpet"),
    ("base.v", ["heading"], "place", 0.03, lambda s, a: a * _go(s) * np.cos(2 * s.th + 0.6),
     "the pile of a carpet, both ways"),
    ("base.v", ["distance"], "tyre", 0.08,
     lambda s, a: a * s.v * np.sin(2 * np.pi * np.cumsum(np.abs(s.v)) * s.dt / 2.4),
     "a tyre out of round"),
    ("base.v", ["time_since_rest", "time_since_change"], "tyre", 0.15,
     lambda s, a: -abs(a) * s.v * np.exp(-since(np.abs(s.v) + np.abs(s.w) > 1e-6, s.dt) / 1.5),
     "bearings that stick after a stand"),
    ("base.v", ["time"], "tyre", 0.08, lambda s, a: a * s.v * np.sin(2 * np.pi * s.t / 37), "a motor that hunts"),
    ("base.v", ["motor_temperature"], "tyre", 0.1,
     lambda s, a: -abs(a) * s.v * np.tanh((s.extra["motor_temperature"] - 40) / 4),
     "grease that stiffens"),
    ("base.w", ["x"], "place", 0.03, lambda s, a: a * _go(s) * np.tanh(s.x / 0.5), "a floor that leans"),
    ("base.w", ["time"], "tyre", 0.02, lambda s, a: a * _go(s) * np.sin(2 * np.pi * s.t / 41), "a load that sways"),
    ("base.w", ["tyre_pressure"], "tyre", 0.04, lambda s, a: a * s.v * (s.extra["tyre_pressure"] - 2.5) / 0.2,
     "a tyre that is pumped and leaks"),
    ("base.w", ["heading"], "place", 0.03, lambda s, a: a * _go(s) * np.sin(2 * s.th), "a floor with a grain"),
]
LASER: list[tuple[str, list[str], float, Curve, str]] = [
    ("laser.range", ["bearing", "beam"], 0.015, lambda s, a: a * _bump(s.bearing, 0.25, 0.22),
     "a smudge on the window"),
    ("laser.range", ["direction"], 0.01, lambda s, a: a * np.maximum(np.cos(s.direction - 0.9), 0) ** 2,
     "sun from a window"),
    ("laser.range", ["scan_parity"], 0.004, lambda s, a: a * (2 * s.parity - 1), "two mirrors, every other scan"),
    ("laser.range", ["range"], 0.012, lambda s, a: a * _bump(s.r, 1.9, 0.2), "an echo inside the housing"),
    ("laser.range", ["time"], 0.006, lambda s, a: a * (s.stamp % 17 < 2.5), "a supply that drops out"),
    ("laser.range", ["humidity"], 0.006, lambda s, a: a * np.tanh((s.extra["humidity"] - 50) / 4),
     "damp on the window"),
    ("laser.range", ["hit_x"], 0.012, lambda s, a: a * np.tanh((s.hit_x - 0.4) / 0.3), "steam in one half of the room"),
    ("laser.spread", ["bearing", "beam"], 1.0, lambda s, a: abs(a) * _bump(s.bearing, -0.5, 0.3),
     "a scratch on the window"),
    ("laser.spread", ["direction"], 0.8, lambda s, a: abs(a) * np.maximum(np.cos(s.direction + 0.4), 0),
     "light from one side"),
    ("laser.spread", ["time"], 0.8, lambda s, a: abs(a) * (np.sin(2 * np.pi * s.stamp / 29) > 0), "a lamp that blinks"),
    ("laser.spread", ["humidity"], 0.7, lambda s, a: abs(a) * (1 + np.tanh((s.extra["humidity"] - 50) / 3)), "fog"),
]
EXTRA = {"motor_temperature": (40.0, 6.0), "tyre_pressure": (2.5, 0.25), "humidity": (50.0, 6.0),
         "temperature": (20.0, 5.0)}
WRONG = ["positions in mm", "headings in degrees", "y of the wrong sign", "x and y swapped", "heading clockwise",
         "heading of a compass", "clock of the reference is shifted", "times of the reference in ms",
         "commands in km/h",
         "speed of the wrong sign", "yaw rate of the wrong sign", "voltages in mV", "poses of another drive"]
WRONG_SCANS = ["another map", "mirrored fan", "ranges in mm"]
Pick = tuple[str, list[str], str, Callable[[float], Effect], float, str]

def _bent(channel: str, axis: int, wave: Callable[[Array], Array]) -> Callable[[float], Effect]:
    def make(a: float) -> Effect:
        def act(p: Array) -> None:
            p[..., axis] += a * wave(p.copy())
        return Effect("unknown", "bend", act)
    return make

def picks() -> list[Pick]:
    """All unknowns: channel, what it follows, whether base or laser, maker, size, sentence."""
    out: list[Pick] = []
    for channel, names, hook, size, curve, says in BASE:
        def base(a: float, hook: str = hook, channel: str = channel, curve: Curve = curve) -> Effect:
            def act(s: State) -> None:
                change = curve(s, a)
                if channel == "base.v":
                    s.v = s.v + change
                else:
                    s.w = s.w + change
            return Effect("unknown", hook, act)
        out.append((channel, names, "base", base, size, says))
    waves: list[tuple[list[str], int, Callable[[Array], Array], str]] = [
        (["x"], 0, lambda p: np.sin(2 * np.pi * p[..., 0] / 2.5), "a camera's lens"),
        (["x"], 1, lambda p: np.sin(2 * np.pi * p[..., 0] / 2.2), "a seam between two cameras"),
        (["heading"], 0, lambda p: np.cos(3 * p[..., 2]), "markers that hide each other")]
    for names, axis, wave, says in waves:
        out.append(("base.pose", names, "base", _bent("base.pose", axis, wave), 0.02, says))
    for channel, names, size, curve, says in LASER:
        def laser(a: float, channel: str = channel, curve: Curve = curve) -> Effect:
            def act(s: Look) -> None:
                if channel == "laser.range":
                    s.mu = s.mu + curve(s, a)
                else:
                    s.sd = s.sd * (1 + curve(s, a))
            return Effect("unknown", "mean" if channel == "laser.range" else "spread", act, channel="laser")
        out.append((channel, names, "laser", laser, size, says))
    return out
