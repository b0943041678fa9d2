# SPDX-License-Identifier: BSD-3-Clause
"""What causes in the base do to its rates, in cells of time."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from scipy.signal import lfilter

from kurumaisu.bench.strangers.marl.causes import Cause, Causes
from kurumaisu.bench.strangers.marl.motions import DT
from kurumaisu.bench.strangers.marl.things import Robot
from kurumaisu.types import BoolArray, FloatArray

Law = tuple[tuple[float, float], tuple[float, float]]  # slope and intercept, of positive and of negative rates
Covariates = dict[str, Callable[[FloatArray], FloatArray]]
Both = tuple[FloatArray, FloatArray]
LAWS: dict[str, Law] = {
    "published": ((-0.499211, 0.104181), (-0.469278, -0.169476)),
    "corrected": ((-0.499211, -0.104181), (-0.469278, 0.169476)),
}
AHEAD: Law = ((1.32402, 0.127906), (2.07369, -0.108783))


class Cells(NamedTuple):
    """Cells of a drive: middles, commanded rates, mean poses; its robot, covariates and number."""

    t: FloatArray
    v: FloatArray
    w: FloatArray
    state: FloatArray
    robot: Robot
    covariates: Covariates
    number: int


class Rates(NamedTuple):
    """Rates before a cause."""

    v: FloatArray
    w: FloatArray
    cells: Cells

    @property
    def vm(self) -> float:
        """Return the largest speed."""
        return self.cells.robot.v

    @property
    def wm(self) -> float:
        """Return the largest yaw rate."""
        return self.cells.robot.w


def to_volts(x: FloatArray, law: Law) -> FloatArray:
    """Return the voltages of rates."""
    (a, b), (c, d) = law
    return np.where(x > 0, a * x + b, np.where(x < 0, c * x + d, 0.0))


def _to_rates(x: FloatArray, law: Law) -> FloatArray:
    """Return the rates of voltages by a law with an ordinary dead zone."""
    (a, b), (c, d) = law
    s = np.sign(a)
    return np.where(s * (x - b) > 0, (x - b) / a, np.where(s * (x - d) < 0, (x - d) / c, 0.0))


def filtered(x: FloatArray, a: float, b: float = 1.0) -> FloatArray:
    """Return x through the filter y = a y + b x."""
    return np.asarray(lfilter([b], [1, -a], x))


def _lag(x: FloatArray, tau: float) -> FloatArray:
    """Return the cells' means of a lagged rate."""
    a = float(np.exp(-DT / tau))
    e = filtered(x, a, 1 - a)
    return np.asarray(x + (np.r_[0.0, e[:-1]] - x) * (1 - a) * tau / DT)


def _lagged(x: FloatArray, c: Cause) -> FloatArray:
    return 0.6 * _lag(x, 0.5 * c.size) + 0.4 * _lag(x, 1.75 * c.size) if c.other else _lag(x, c.size)


def _shift(x: FloatArray, by: float) -> FloatArray:
    way = np.r_[0.0, np.cumsum(x)] * DT
    t = np.arange(len(way)) * DT
    return np.diff(np.interp(t - by, t, way)) / DT


def _delayed(x: FloatArray, c: Cause) -> FloatArray:
    p = c.size
    return (_shift(x, 0.6 * p) + _shift(x, p) + _shift(x, 1.4 * p)) / 3 if c.other else _shift(x, p)


def _since(flag: BoolArray, step: FloatArray) -> FloatArray:
    """Return the sum of step since the last True of flag, or since the start."""
    c = np.cumsum(step)
    return np.asarray(c - np.maximum.accumulate(np.where(flag, c, 0.0)))


def moving(v: FloatArray, w: FloatArray) -> FloatArray:
    """Return 1 where it moves, otherwise 0."""
    return np.asarray(np.abs(v) + np.abs(w) > 1e-3, float)


def _ramp(x: FloatArray, a: float, soft: float) -> FloatArray:
    y, out, q = 0.0, list[float](), a * DT
    for k in x.tolist():
        e = k - y
        if soft and abs(e) < a * soft:
            e = e * min(1.0, DT / soft)
        y += min(q, max(-q, e))
        out.append(y)
    return np.array(out)


def _dead(x: FloatArray, p: float, soft_knee: bool) -> FloatArray:
    knee = p * (1 - np.exp(-np.abs(x) / p)) if soft_knee else p
    return np.asarray(np.sign(x) * np.maximum(np.abs(x) - knee, 0))


def _backlash(r: Rates, c: Cause) -> FloatArray:
    if c.other:
        turned = np.tanh(_lag(np.gradient(r.w, DT), 0.15) / (0.3 * r.wm))
        return np.asarray(r.w - c.size / 2 * turned * moving(r.v, r.w))
    rest = (np.abs(r.cells.v) + np.abs(r.cells.w)) < 1e-9
    y, out, h = 0.0, list[float](), c.size / 2
    for k, s in zip(r.w.tolist(), rest.tolist(), strict=True):
        y = 0.0 if s else max(k - h, min(k + h, y))
        out.append(y)
    return np.array(out)


def _caster(r: Rates, c: Cause) -> FloatArray:
    """Return the turn that casters give after a reversal."""
    s = np.sign(np.where(np.abs(r.v) > 1e-3, r.v, 0))
    f = s[np.maximum.accumulate(np.where(s != 0, np.arange(len(s)), 0))]
    reversed_ = np.r_[False, (f[1:] != f[:-1]) & (f[:-1] != 0)]
    far = np.where(np.cumsum(reversed_) > 0, _since(reversed_, np.abs(r.v) * DT), 99.0)
    k = np.exp(-((far / c.own["length"]) ** 2)) if c.other else np.exp(-far / c.own["length"])
    return np.asarray(r.w + c.size * k * np.minimum(1, np.abs(r.v) / (0.15 * r.vm)))


def _quantised(x: FloatArray, c: Cause, law: Law) -> FloatArray:
    volts = to_volts(x, law)
    steps = np.trunc(volts / c.size) if c.other else np.round(volts / c.size)
    return _to_rates(np.where(volts == 0, 0, steps * c.size), law)


def _volts_moved(x: FloatArray, law: Law, by: FloatArray | float) -> FloatArray:
    return _to_rates(to_volts(x, law) + by, law)


def _zero(x: FloatArray, c: Cause, law: Law) -> FloatArray:
    """Return rates whose zero of voltage is off, in the other form less in one direction."""
    return _volts_moved(x, law, c.size * np.where(x < 0, 0.75, 1.0) if c.other else c.size)


def _crossed(r: Rates, c: Cause) -> FloatArray:
    f = to_volts(r.v, AHEAD)
    return _volts_moved(r.w, LAWS["corrected"], c.size * (f * np.abs(f) if c.other else f))


def _saturated(r: Rates, c: Cause) -> Both:
    v, w = r.vm / (1 + c.size), r.wm / (1 + c.size)
    if c.other:
        return v * np.tanh(r.v / v), w * np.tanh(r.w / w)
    return np.clip(r.v, -v, v), np.clip(r.w, -w, w)


def _sagged(r: Rates, c: Cause) -> Both:
    t, p = r.cells.t, c.size
    g = 1 - p * 100 * (1 - np.exp(-t / 80)) if c.other else 1 / (1 + p * t)
    return r.v * g, r.w * g


def _loaded(r: Rates, c: Cause) -> Both:
    tau = c.own["tau"]
    return _lag(r.v * (1 - c.size), tau), _lag(r.w * (1 - c.size * (0.85 if c.other else 1)), tau)


def _limited(r: Rates, c: Cause) -> Both:
    soft = 0.15 * c.other
    return _ramp(r.v, 1 / c.size, soft), _ramp(r.w, 1 / (c.size * c.own["ratio"]), soft)


def _reversed_gain(r: Rates, c: Cause) -> FloatArray:
    return np.where(r.v < 0, r.v * (1 + c.size * (1 - np.exp(r.v / (0.05 * r.vm)) if c.other else 1)), r.v)


def _curved(x: FloatArray, top: float, c: Cause) -> FloatArray:
    return x * (1 - c.size * (np.abs(x) ** 1.6 * top**-0.6 if c.other else np.abs(x)))


def _sloped(r: Rates, c: Cause) -> FloatArray:
    b = np.cos(r.cells.state[2] - c.own["way"])
    return np.asarray(r.v - c.size * (np.tanh(2 * b) if c.other else b) * moving(r.v, np.zeros(1)))


def _knee(r: Rates, c: Cause, per_volt: float) -> float:
    return c.size / per_volt if r.cells.robot.chair else c.size


def _unknown(r: Rates, c: Cause) -> Both:
    f = OVER[c.of](r) * c.size if c.channel in ("base.v", "base.w") else np.zeros(1)
    v, w = r.v, r.w
    if c.channel == "base.v":
        v = v * (1 + f) if c.share else v + f * r.vm * moving(v, w)
    elif c.channel == "base.w":
        w = w * (1 + f) if c.share else w + f * r.wm * moving(v, w)
    return v, w


def _bursts(t: FloatArray) -> FloatArray:
    return np.asarray(np.sin(t / 7.3) + np.sin(t / 4.1 + 1) > 1.15, float)


OVER: dict[str, Callable[[Rates], FloatArray]] = {  # what something unknown follows, shaped to about -1..1
    "humidity": lambda r: np.tanh(1.5 * (r.cells.covariates["humidity"](r.cells.t) - 50) / 10),
    "tyre": lambda r: (r.cells.covariates["tyre"](r.cells.t) - 2.0) / 0.3,
    "time": lambda r: _bursts(r.cells.t + 11 * r.cells.number),
    "time_since_rest": lambda r: np.exp(-_since(moving(r.cells.v, r.cells.w) == 0, np.full(len(r.cells.t), DT)) / 2.5),
    "x": lambda r: np.sin(2 * np.pi * r.cells.state[0] / 4.0),
    "y": lambda r: np.sin(2 * np.pi * r.cells.state[1] / 3.0),
    "heading": lambda r: np.sin(3 * r.cells.state[2]),
    "abs_v": lambda r: np.exp(-(((np.abs(r.v) / r.vm - 0.5) / 0.12) ** 2)),
    "w": lambda r: np.exp(-(((r.w / r.wm - 0.4) / 0.15) ** 2)),
}
SPEED: dict[str, Callable[[Rates, Cause], FloatArray]] = {
    "dac_zero_f": lambda r, c: _zero(r.v, c, AHEAD),
    "dead_zone_v": lambda r, c: _dead(r.v, _knee(r, c, 1.5), c.other),
    "gain_v": lambda r, c: r.v * (1 + c.size * ((np.abs(r.v) / r.vm + 0.01) ** 0.25 if c.other else 1)),
    "reverse_gain": _reversed_gain,
    "curvature_v": lambda r, c: _curved(r.v, r.vm, c),
    "lag_v": lambda r, c: _lagged(r.v, c),
    "slope": _sloped,
    "cross_w_to_v": lambda r, c: r.v + c.size * (r.w * r.w / r.wm if c.other else np.abs(r.w)),
}
TURN: dict[str, Callable[[Rates, Cause], FloatArray]] = {
    "dac_zero_s": lambda r, c: _zero(r.w, c, LAWS["corrected"]),
    "cross_v_to_w": _crossed,
    "steering_law": lambda r, c: _to_rates(to_volts(r.w, LAWS["published"]), LAWS["corrected"]),
    "dead_zone_w": lambda r, c: _dead(r.w, _knee(r, c, 0.485), c.other),
    "gain_w": lambda r, c: r.w * (1 + c.size * (np.where(r.w > 0, 1.1, 0.9) if c.other else 1)),
    "left_right_gain": lambda r, c: (
        r.w * (1 + c.size / 2 * (np.tanh(r.w / (0.15 * r.wm)) if c.other else np.sign(r.w)))
    ),
    "curvature_w": lambda r, c: _curved(r.w, r.wm, c),
    "backlash": _backlash,
    "lag_w": lambda r, c: _lagged(r.w, c),
    "veer": lambda r, c: r.w + c.size * (np.where(r.v > 0, r.v, 0.75 * r.v) if c.other else r.v),
    "understeer": lambda r, c: r.w / (1 + c.size * (np.abs(r.v) ** 1.5 * r.vm**0.5 if c.other else r.v * r.v)),
    "caster_reversal": _caster,
}
BOTH: dict[str, Callable[[Rates, Cause], Both]] = {
    "dac_quantisation": lambda r, c: (_quantised(r.v, c, AHEAD), _quantised(r.w, c, LAWS["corrected"])),
    "saturation": _saturated,
    "battery_sag": _sagged,
    "payload": _loaded,
    "accel_limit": _limited,
    "delay": lambda r, c: (_delayed(r.v, c), _delayed(r.w, c)),
    "unknown": _unknown,
}
ORDER = (
    *("dac_zero_f", "dac_zero_s", "dac_quantisation", "cross_v_to_w", "steering_law", "dead_zone_v", "dead_zone_w"),
    *("gain_v", "gain_w", "left_right_gain", "reverse_gain", "curvature_v", "curvature_w", "saturation"),
    *("battery_sag", "backlash", "payload", "accel_limit", "lag_v", "lag_w", "delay", "veer", "understeer"),
    *("caster_reversal", "lateral_slip", "slope", "cross_w_to_v", "unknown"),
)


def rates(cells: Cells, causes: Causes) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return mean v, w and sideways speed in each cell, as commanded and with causes."""
    r, u = Rates(cells.v.copy(), cells.w.copy(), cells), np.zeros(len(cells.v))
    named = {c.id.removeprefix("base."): c for c in causes}
    for name in ORDER:
        if name not in named:
            continue
        c = named[name]
        if name in SPEED:
            r = r._replace(v=SPEED[name](r, c))
        elif name in TURN:
            r = r._replace(w=TURN[name](r, c))
        elif name in BOTH:
            v, w = BOTH[name](r, c)
            r = r._replace(v=v, w=w)
        else:
            u = u - c.size * r.v * r.w * (np.sqrt(np.abs(r.w) / r.wm) if c.other else 1)
    return r.v, r.w, u
