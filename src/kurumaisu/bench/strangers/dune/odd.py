# SPDX-License-Identifier: BSD-3-Clause
"""Effects of no catalogue: what else happens to wheelchairs and lasers."""

from __future__ import annotations

import numpy as np

from . import plant
from .plant import TWO_PI, Arr, Cause, Signals, reversals, since

TRACK = 0.54


def _cold_motor(s: Signals, c: Cause) -> None:
    s.v = s.v * (1 - c.p["a"] * np.exp(-since(s.moving == 0, s.run.t) / c.p["tau"]))


def _windup(s: Signals, c: Cause) -> None:
    s.v = s.v * (1 - c.p["a"] * np.exp(-since(reversals(s.v), s.run.t) / c.p["tau"]))


def _carpet_nap(s: Signals, c: Cause) -> None:
    s.w = s.w + c.p["a"] * np.sin(2 * s.floor[:, 2] + c.p["phase"]) * s.moving


def _warm_tyre(s: Signals, c: Cause) -> None:
    s.w = s.w + c.p["a"] * s.v * (1 - np.exp(-s.distance / 5) - 0.5)


def _rug(s: Signals, c: Cause) -> None:
    u = s.floor[:, int(c.p["axis"])] - c.p["edge"]
    s.v = s.v * (1 - c.p["a"] * 0.5 * (1 + np.tanh((0.5 - np.abs(u)) / 0.08)))


def _lean(s: Signals, c: Cause) -> None:
    s.w = s.w + c.p["a"] * s.run.columns["lean"] * s.moving


def _pressure(s: Signals, c: Cause) -> None:
    s.v = s.v * (1 + c.p["a"] * (s.run.columns["tyre_pressure"] - 2.4) / 0.15)


def _resonance(s: Signals, c: Cause) -> None:
    s.v = s.v * (1 - c.p["a"] * np.exp(-(((np.abs(s.v) - c.p["at"]) / 0.06) ** 2)))


def _relay(s: Signals, c: Cause) -> None:
    s.v = s.v * (1 - c.p["a"] * events(s.run.t + s.run.start, int(c.p["seed"]), 3.0, 0.5))


def _gust(s: Signals, c: Cause) -> None:
    s.w = s.w + c.p["a"] * s.run.columns["wind"] * s.moving


def _camber(s: Signals, c: Cause) -> None:
    s.side = s.side + c.p["a"] * np.sin(s.floor[:, 2] + c.p["phase"]) * s.moving


def _ruts(s: Signals, c: Cause) -> None:
    s.side = s.side + c.p["a"] * np.sin(TWO_PI * s.floor[:, 0] / 3.0 + c.p["phase"]) * s.moving


def _hum(s: Signals, c: Cause) -> None:
    s.v = s.v * (1 + c.p["a"] * np.sin(TWO_PI * s.run.t / c.p["period"] + c.p["phase"]))


def _flat_spot(s: Signals, c: Cause) -> None:
    s.v = s.v * (1 + c.p["a"] * np.maximum(np.cos(TWO_PI * s.distance / c.p["length"]), 0))


def _left_tyre(s: Signals, c: Cause) -> None:
    left = s.v - 0.5 * TRACK * s.w
    slip = c.p["a"] * np.exp(-(((left - c.p["at"]) / 0.12) ** 2)) * s.moving
    s.w = s.w + slip / TRACK


def _scrub(s: Signals, c: Cause) -> None:
    s.v = s.v - c.p["a"] * np.tanh(s.v * s.w / 0.1)


def _one_sided_brake(s: Signals, c: Cause) -> None:
    s.w = s.w + c.p["a"] * np.exp(-since(s.moving == 0, s.run.t) / c.p["tau"]) * s.moving


plant.ODD.update({
    "odd.cold_motor": _cold_motor, "odd.windup": _windup, "odd.carpet_nap": _carpet_nap, "odd.warm_tyre": _warm_tyre,
    "odd.rug": _rug, "odd.lean": _lean, "odd.pressure": _pressure, "odd.resonance": _resonance, "odd.relay": _relay,
    "odd.gust": _gust, "odd.camber": _camber, "odd.ruts": _ruts, "odd.hum": _hum, "odd.flat_spot": _flat_spot,
    "odd.left_tyre": _left_tyre, "odd.scrub": _scrub, "odd.one_sided_brake": _one_sided_brake,
})  # fmt: skip


def events(t: Arr, seed: int, every: float, lasting: float) -> Arr:
    """Pulses that come and go, the same for the same seed: 0 or 1."""
    rng = np.random.default_rng(seed)
    begin = np.cumsum(rng.exponential(every, 400))
    last = begin + rng.uniform(0.5, 1.5, 400) * lasting
    i = np.searchsorted(begin, t) - 1
    return np.asarray((i >= 0) & (t < last[np.maximum(i, 0)]), dtype=np.float64)


# id: size, other parameters (low, high), channel, what it follows, what it is
UNKNOWN: list[tuple[str, float, dict[str, tuple[float, float]], str, list[str], str]] = [
    ("odd.cold_motor", 0.3, {"tau": (0.8, 2.0)}, "v", ["since_rest"], "cold motors start weakly after each rest"),
    ("odd.carpet_nap", 0.05, {"phase": (0, 6.28), "place": (1, 1)}, "w", ["heading"],
     "the nap of a carpet turns the chair"),
    ("odd.lean", 0.05, {}, "w", ["lean"], "the occupant leans to one side"),
    ("odd.ref_heading", 0.05, {"phase": (0, 6.28)}, "reference", ["heading"],
     "a compass with deviation gives the heading"),
    ("odd.rug", 0.15, {"axis": (0, 1.99), "edge": (0, 0), "place": (1, 1)}, "v", ["x", "y"], "a thick rug brakes"),
    ("laser.odd_gain_switch", 0.001, {"at": (1.2, 2.2)}, "range", ["range"],
     "the laser's amplifier switches at some range"),
    ("odd.resonance", 0.15, {"at": (0.3, 0.45)}, "v", ["abs_v", "v", "v_f", "wheel_left", "wheel_right"],
     "wheels shimmy at one speed"),
    ("laser.odd_dirt", 0.5, {"at": (-1.2, 1.2)}, "scatter", ["bearing", "beam"],
     "a part of the laser's window is dirty"),
    ("odd.windup", 0.3, {"tau": (1.0, 2.5)}, "v", ["since_reversal"], "the gears wind up after each reversal"),
    ("odd.camber", 0.02, {"phase": (0, 6.28), "place": (1, 1)}, "lateral", ["heading"],
     "the floor falls off to one side"),
    ("odd.relay", 0.6, {"seed": (1, 1e6)}, "v", ["time"], "a relay drops out now and then"),
    ("laser.odd_lamp", 0.001, {}, "range", ["lamp"], "a lamp that goes on and off shifts the ranges"),
    ("odd.gust", 0.08, {"seed": (1, 1e6)}, "w", ["wind", "time"], "gusts from the door push the chair round"),
    ("odd.ref_lens", 0.05, {"phase": (0, 6.28), "length": (2.0, 4.0)}, "reference", ["x"],
     "the cameras' lens was not calibrated"),
    ("odd.hum", 0.12, {"phase": (0, 6.28), "period": (9, 22)}, "v", ["time"], "the supply swings slowly"),
    ("laser.odd_shake", 1.0, {}, "scatter", ["w"], "the laser's mast shakes in turns"),
    ("odd.pressure", 0.04, {}, "v", ["tyre_pressure"], "the tyres' size follows their pressure"),
    ("odd.left_tyre", 0.05, {"at": (0.15, 0.45)}, "w", ["wheel_left"], "the left tyre creeps at one speed"),
    ("laser.odd_swing", 0.001, {"phase": (0, 6.28), "period": (12, 30)}, "range", ["time", "scan"],
     "the laser's oscillator swings"),
    ("odd.flat_spot", 0.15, {"length": (0.9, 1.3)}, "v", ["distance"], "a tyre has a flat spot"),
    ("odd.scrub", 0.02, {}, "v", ["v_times_w"], "tyres scrub in right turns and pull in left ones"),
    ("odd.ruts", 0.03, {"phase": (0, 6.28), "place": (1, 1)}, "lateral", ["x"], "ruts in the floor push sideways"),
    ("laser.odd_sun", 1.0, {"at": (-3, 3)}, "scatter", ["direction"], "the sun shines in from one side"),
    ("odd.warm_tyre", 0.08, {}, "w", ["distance", "time"], "one tyre warms up and grows"),
    ("laser.odd_flex", 0.002, {}, "range", ["w"], "the mirror's bearing gives way in turns"),
    ("odd.one_sided_brake", 0.15, {"tau": (0.8, 2.0)}, "w", ["since_rest"], "the left brake comes off late"),
]  # fmt: skip
