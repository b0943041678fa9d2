# SPDX-License-Identifier: BSD-3-Clause
"""The equations of the causes of the base on the grid, each the usual one and another."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.signal import lfilter

from kurumaisu.bench.strangers.scree.asking import Asked
from kurumaisu.bench.strangers.scree.basics import STEP, Array, Cause, Column, Path, Rates
from kurumaisu.bench.strangers.scree.robots import Robot


@dataclass(frozen=True)
class State:
    """What an equation may use: what was asked, what was made of it so far, where the robot is."""

    asked: Asked
    rates: Rates
    path: Path
    t: Array
    start: float
    robot: Robot
    columns: tuple[Column, ...]

    @property
    def moving(self) -> Array:
        """1 where something drives, 0 at rest."""
        r = self.robot
        return np.asarray(np.tanh(np.abs(self.rates.v) / (0.04 * r.v_top) + np.abs(self.rates.w) / (0.04 * r.w_top)))


Equation = Callable[[Cause, State], Rates]


def follow(u: Array, tau: float) -> Array:
    """A first-order lag, as means over cells."""
    a = float(np.exp(-STEP / max(tau, 1e-4)))
    return np.asarray(lfilter([1 - a], [1, -a], u))


def pi_loop(u: Array, tau: float, damping: float) -> Array:
    """A motor under a PI loop: second order, about as late as a lag of tau."""
    pole = 2 * damping / tau
    a = np.array([1.0, 2 * damping * pole, pole * pole])
    top = 2 + a[1] * STEP
    return np.asarray(
        lfilter([2 * a[2] * STEP**2 / top], [1, (2 * a[2] * STEP**2 - 4) / top, (2 - a[1] * STEP) / top], u)
    )


def since(event: Array, grow: Array) -> Array:
    """What grew since the last event; large before the first."""
    total = np.cumsum(grow)
    mark = np.maximum.accumulate(np.where(event > 0, total, -1e6))
    return np.asarray(total - mark)


def ramps(u: Array, most: float) -> Array:
    """The same with limited acceleration."""
    out = np.empty_like(u)
    at, step = 0.0, most * STEP
    for k, x in enumerate(u.tolist()):
        at += min(max(x - at, -step), step)
        out[k] = at
    return out


def _gain_v(c: Cause, s: State) -> Rates:
    v = s.rates.v
    return s.rates.but(v=v * (1 + c.size * (1 + 0.2 * np.tanh(v / 0.1) if c.other else 1.0)))


def _gain_w(c: Cause, s: State) -> Rates:
    w = s.rates.w
    scrub = 0.8 + 0.4 * np.abs(w) / (np.abs(w) + 0.3 * s.robot.w_top) if c.other else 1.0
    return s.rates.but(w=w * (1 + c.size * scrub))


def _left_right(c: Cause, s: State) -> Rates:
    w = s.rates.w
    side = np.tanh(w / (0.15 * s.robot.w_top)) if c.other else np.sign(w)
    return s.rates.but(w=w * (1 + 0.5 * c.size * side))


def _veer(c: Cause, s: State) -> Rates:
    v = s.rates.v
    back = np.where(v < 0, 0.7, 1.0) if c.other else 1.0
    return s.rates.but(w=s.rates.w + c.size * v * back)


def _reverse(c: Cause, s: State) -> Rates:
    v = s.rates.v
    part = np.clip(np.abs(v) / (0.12 * s.robot.v_top), 0, 1) if c.other else 1.0
    return s.rates.but(v=np.where(v < 0, v * (1 + c.size * part), v))


def _bend(u: Array, c: Cause, top: float) -> Array:
    x = np.abs(u)
    return np.asarray(u * (np.exp(-c.size * x * (x / (0.6 * top)) ** 0.6) if c.other else 1 - c.size * x))


def _curvature_v(c: Cause, s: State) -> Rates:
    return s.rates.but(v=_bend(s.rates.v, c, s.robot.v_top))


def _curvature_w(c: Cause, s: State) -> Rates:
    return s.rates.but(w=_bend(s.rates.w, c, s.robot.w_top))


def _saturation(c: Cause, s: State) -> Rates:
    p = 5.0 if c.other else 16.0
    rv = (1 + c.size) / s.robot.v_top
    rw = (1 + c.draw(0, 0.5, 1.0) * c.size) / s.robot.w_top
    v, w = s.rates.v, s.rates.w
    return s.rates.but(v=v / (1 + np.abs(v * rv) ** p) ** (1 / p), w=w / (1 + np.abs(w * rw) ** p) ** (1 / p))


def _sag(c: Cause, s: State) -> Rates:
    used = np.cumsum(np.abs(s.rates.v) / s.robot.v_top + 0.3) * STEP * 1.2 if c.other else s.t
    left = 1 - c.size * used
    return s.rates.but(v=s.rates.v * left, w=s.rates.w * left)


def _slow(u: Array, c: Cause) -> Array:
    if not c.other:
        return follow(u, c.size)
    if c.draws[0] < 0.5:
        return pi_loop(u, c.size, c.draw(1, 0.65, 1.0))
    return 0.6 * follow(u, 0.5 * c.size) + 0.4 * follow(u, 1.75 * c.size)


def _lag_v(c: Cause, s: State) -> Rates:
    return s.rates.but(v=_slow(s.rates.v, c))


def _lag_w(c: Cause, s: State) -> Rates:
    return s.rates.but(w=_slow(s.rates.w, c))


def _accel(c: Cause, s: State) -> Rates:
    turning = c.draw(0, 0.35, 0.7) * c.size * s.robot.v_top / s.robot.w_top
    v, w = ramps(s.rates.v, 1 / c.size), ramps(s.rates.w, 1 / turning)
    if c.other:
        v, w = follow(v, 0.12), follow(w, 0.12)
    return s.rates.but(v=v, w=w)


def _payload(c: Cause, s: State) -> Rates:
    tau = c.draw(0, 1.2, 2.5) * c.size
    less = 1 - c.size * (0.8 + 0.4 * np.abs(s.rates.v) / s.robot.v_top if c.other else 1.0)
    late = pi_loop if c.other else None
    v, w = s.rates.v * less, s.rates.w * less
    if late is None:
        return s.rates.but(v=follow(v, tau), w=follow(w, tau))
    return s.rates.but(v=late(v, tau, 0.9), w=late(w, 1.15 * tau, 0.9))


def _understeer(c: Cause, s: State) -> Rates:
    v = np.abs(s.rates.v)
    slip = c.size * (v**3 / (0.6 * s.robot.v_top) if c.other else v**2)
    return s.rates.but(w=s.rates.w / (1 + slip))


def _caster(c: Cause, s: State) -> Rates:
    way = np.sign(np.where(np.abs(s.asked.v) > 0.01, s.asked.v, 0.0))
    k = np.maximum.accumulate(np.where(way != 0, np.arange(len(way)), 0))
    turned = np.concatenate([[0.0], np.diff(way[k]) != 0]).astype(float)
    turned[: int(np.argmax(way != 0)) + 1] = 0.0
    far = since(turned, np.abs(s.rates.v) * STEP)
    length = c.draw(0, 0.15, 0.4)
    bump = np.exp(-far / length)
    if c.other:
        bump = 0.5 * (1 + np.cos(np.pi * np.clip(far / (2.2 * length), 0, 1)))
    return s.rates.but(w=s.rates.w + c.size * bump * (np.abs(s.rates.v) > 0.005))


def _lateral(c: Cause, s: State) -> Rates:
    pull = s.rates.v * s.rates.w
    most = 0.5 * s.robot.v_top * s.robot.w_top
    return s.rates.but(side=s.rates.side - c.size * (most * np.tanh(pull / most) if c.other else pull))


def _slope(c: Cause, s: State) -> Rates:
    way = c.draw(0, -np.pi, np.pi)
    up = np.cos(s.path.th - way)
    pull = c.size * (up + 0.25 * up * np.abs(up) if c.other else up)
    drives = np.tanh(np.abs(s.rates.v) / (0.05 * s.robot.v_top))
    return s.rates.but(v=s.rates.v - pull * drives)


def _cross_w_to_v(c: Cause, s: State) -> Rates:
    w = s.rates.w
    return s.rates.but(v=s.rates.v + c.size * (w * np.abs(w / s.robot.w_top + 0.05) ** 0.3 if c.other else w))


EQUATIONS: dict[str, Equation] = {
    "base.gain_v": _gain_v,
    "base.gain_w": _gain_w,
    "base.left_right_gain": _left_right,
    "base.veer": _veer,
    "base.reverse_gain": _reverse,
    "base.curvature_v": _curvature_v,
    "base.curvature_w": _curvature_w,
    "base.saturation": _saturation,
    "base.battery_sag": _sag,
    "base.lag_v": _lag_v,
    "base.lag_w": _lag_w,
    "base.accel_limit": _accel,
    "base.payload": _payload,
    "base.understeer": _understeer,
    "base.caster_reversal": _caster,
    "base.lateral_slip": _lateral,
    "base.slope": _slope,
    "base.cross_w_to_v": _cross_w_to_v,
}
