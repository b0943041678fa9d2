# SPDX-License-Identifier: BSD-3-Clause
"""How commands become motion, with each of the base's causes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy.signal import lfilter

from kurumaisu.bench.strangers.quay.things import Array, Bools, Robot

DT = 0.01
Cause = dict[str, Any]
Effects = dict[str, Cause]
Step = Callable[[Cause, Array, Robot], Array]
LAWS = {"corrected": (-0.104181, 0.169476), "published": (0.104181, -0.169476)}


@dataclass
class Drive:
    """One drive on a grid of 10 ms; all times are from its start."""

    name: str
    start: float
    n: int
    since: float
    nv: Array
    nw: Array
    cov_t: Array
    cov: dict[str, Array]
    pose0: tuple[float, float, float]
    vc: Array
    wc: Array
    rows: list[int] = field(default_factory=list)
    path: Array = field(default_factory=lambda: np.zeros((0, 3)))
    pose_t: Array = field(default_factory=lambda: np.zeros(0))
    pose: Array = field(default_factory=lambda: np.zeros((0, 3)))
    off: Bools = field(default_factory=lambda: np.zeros(0, bool))
    scan_t: Array = field(default_factory=lambda: np.zeros(0))
    scan: Array = field(default_factory=lambda: np.zeros((0, 0)))

    def at(self, t: Array, path: Array | None = None) -> Array:
        """Return the pose at times t from the start, along the last axis."""
        p = self.path if path is None else path
        g = np.arange(len(p)) * DT
        return np.stack([np.interp(t, g, p[:, i]) for i in range(3)], -1)


def to_volts(v: Array, w: Array, law: str) -> tuple[Array, Array]:
    """Return the voltages of rates."""
    pos, neg = LAWS[law]
    vf = np.where(v > 0, 1.32402 * v + 0.127906, np.where(v < 0, 2.07369 * v - 0.108783, 0.0))
    vs = np.where(w > 0, -0.499211 * w + pos, np.where(w < 0, -0.469278 * w + neg, 0.0))
    return vf, vs


def to_rates(vf: Array, vs: Array) -> tuple[Array, Array]:
    """Return the rates of voltages by the corrected law: an ordinary dead zone."""
    v = np.where(vf > 0.127906, (vf - 0.127906) / 1.32402, np.where(vf < -0.108783, (vf + 0.108783) / 2.07369, 0.0))
    w = np.where(vs < -0.104181, (vs + 0.104181) / -0.499211, np.where(vs > 0.169476, (vs - 0.169476) / -0.469278, 0.0))
    return v, w


def _lag(u: Array, tau: float) -> Array:
    if tau <= 1e-6:
        return u
    a = float(np.exp(-DT / tau))
    return np.asarray(lfilter([1 - a], [1, -a], u))


def _delay(u: Array, d: float) -> Array:
    k = np.arange(u.size) - d / DT
    return np.interp(k, np.arange(u.size), u, left=0.0)


def _ramp(u: Array, slow: float, form: bool) -> Array:
    step, y, out = DT / slow, 0.0, []
    for x in u.tolist():
        y += min(max(x - y, -step), step)
        out.append(y)
    return _lag(np.array(out), 0.06) if form else np.array(out)


def _backlash(p: Cause, u: Array, robot: Robot) -> Array:
    half, y, out = p["play"] / 2, 0.0, []
    for x in u.tolist():
        y = min(max(y, x - half), x + half)
        out.append(y)
    return _lag(np.array(out), 0.1) if p["form"] else np.array(out)


def _dead(p: Cause, u: Array, robot: Robot) -> Array:
    a, width = abs(u), p["width"]
    if p["form"]:
        return np.asarray(u / (1 + np.exp(-np.clip((a - width) / (0.08 * abs(width) + 1e-9), -50, 50))))
    return u if robot.volts else _narrowed(u, width)  # voltages were narrowed before


def _narrowed(u: Array, width: float) -> Array:
    return np.asarray(np.sign(u) * np.maximum(abs(u) - width, 0))


def _gain(ahead: float, back: float) -> Step:
    return lambda p, x, robot: x * (1 + p["gain"] * (np.where(x > 0, ahead, back) if p["form"] else 1))


def _left_right(p: Cause, w: Array, robot: Robot) -> Array:
    return np.asarray(w * (1 + p["asymmetry"] * (np.where(w > 0, 1.6, 0.0) if p["form"] else np.sign(w))))


def _reverse(p: Cause, v: Array, robot: Robot) -> Array:
    back = 1 / (1 + np.exp(np.clip(v / (0.05 * robot.vmax), -50, 50))) if p["form"] else v < 0
    return np.asarray(v * (1 + p["gain"] * back))


def _bent(p: Cause, x: Array, top: float) -> Array:
    return np.asarray(x * (1 - p["curvature"] * (top * (abs(x) / top) ** 1.7 if p["form"] else abs(x))))


def _saturated(p: Cause, x: Array, k: float) -> Array:
    return np.asarray(x / (1 + (k * abs(x)) ** 8) ** 0.125 if p["form"] else np.clip(x, -1 / k, 1 / k))


def _slow(p: Cause, x: Array, robot: Robot) -> Array:
    return _lag(_lag(x, 0.7 * p["tau"]), 0.3 * p["tau"]) if p["form"] else _lag(x, p["tau"])


def _sag(p: Cause, x: Array, robot: Robot) -> Array:
    t = np.arange(x.size) * DT
    f = 1 - (p["sag"] * 100 * (t / 100) ** 1.5 if p["form"] else p["sag"] * t)
    return np.asarray(x * np.maximum(f, 0.1))


# What each cause does to one of the rates, in the order in which they act.
V_STEPS: dict[str, Step] = {
    "base.dead_zone_v": _dead,
    "base.sign": lambda p, v, robot: v * p["factor_v"],
    "base.gain_v": _gain(1.12, 0.85),
    "base.reverse_gain": _reverse,
    "base.curvature_v": lambda p, v, robot: _bent(p, v, robot.vmax),
    "base.saturation": lambda p, v, robot: _saturated(p, v, p["inverse_v"]),
    "base.payload": lambda p, v, robot: (1 - p["droop"]) * _lag(v, p["tau"]),
    "base.lag_v": _slow,
    "base.accel_limit": lambda p, v, robot: _ramp(v, p["slowness_v"], p["form"]),
    "base.battery_sag": _sag,
}
W_STEPS: dict[str, Step] = {
    "base.dead_zone_w": _dead,
    "base.sign": lambda p, w, robot: w * p.get("factor_w", 1),
    "base.gain_w": _gain(1.1, 0.88),
    "base.left_right_gain": _left_right,
    "base.curvature_w": lambda p, w, robot: _bent(p, w, robot.wmax),
    "base.saturation": lambda p, w, robot: _saturated(p, w, p["inverse_w"]),
    "base.payload": lambda p, w, robot: (1 - p["droop"] * (0.85 if p["form"] else 1)) * _lag(w, p["tau"]),
    "base.lag_w": _slow,
    "base.accel_limit": lambda p, w, robot: _ramp(w, p["slowness_w"], p["form"]),
    "base.backlash": _backlash,
    "base.battery_sag": _sag,
}
ON_VOLTS = {
    *("base.dac_zero_f", "base.dac_zero_s", "base.dac_quantisation", "base.steering_law", "base.cross_v_to_w"),
    *("base.dead_zone_v", "base.dead_zone_w"),
}


def _by_volts(robot: Robot, eff: Effects, v: Array, w: Array) -> tuple[Array, Array]:
    """Return rates that went through voltages, with what acts on these."""
    vf, vs = to_volts(v, w, robot.law if "base.steering_law" in eff else "corrected")
    moving = (abs(v) > 0) | (abs(w) > 0)
    if p := eff.get("base.dac_zero_f"):
        vf = vf + p["offset"] * (moving if p["form"] else 1)
    if p := eff.get("base.dac_zero_s"):
        vs = vs + p["offset"] * (moving if p["form"] else 1)
    if p := eff.get("base.cross_v_to_w"):
        vs = vs + p["share"] * (vf * np.sqrt(abs(vf) / 0.8) if p["form"] else vf)
    if p := eff.get("base.dac_quantisation"):
        cut = np.trunc if p["form"] else np.round
        vf, vs = cut(vf / p["step"]) * p["step"], cut(vs / p["step"]) * p["step"]
    if (p := eff.get("base.dead_zone_v")) and not p["form"]:
        vf = _narrowed(vf, p["width"])
    if (p := eff.get("base.dead_zone_w")) and not p["form"]:
        vs = _narrowed(vs, p["width"])
    return to_rates(vf, vs)


def _casters(p: Cause, v: Array, w: Array, vmax: float) -> Array:
    """Return the turning with what casters add that turn round after a change of direction."""
    n = v.size
    s = np.sign(np.where(abs(v) > 0.02 * vmax, v, 0))
    at = np.maximum.accumulate(np.where(s != 0, np.arange(n), -1))
    last = np.where(at >= 0, s[at], 0)
    turn = np.flatnonzero(np.diff(last) * (last[:-1] != 0)) + 1
    way = np.cumsum(abs(v)) * DT
    k = np.searchsorted(turn, np.arange(n), side="right") - 1
    if not turn.size:
        return w
    gone = np.where(k >= 0, way - way[turn[np.maximum(k, 0)]], np.inf) / p["length"]
    shape = np.maximum(1 - gone / 2, 0) if p["form"] else np.exp(-gone)
    return np.asarray(w + p["kick"] * shape * (abs(v) > 0.02 * vmax))


def rates(dr: Drive, robot: Robot, eff: Effects, n: int) -> tuple[Array, Array, Array]:
    """Return mean v, sideways speed and w on the grid but for what depends on the pose."""
    v, w, u = dr.vc[:n].copy(), dr.wc[:n].copy(), np.zeros(n)
    vm, wm = robot.vmax, robot.wmax
    if p := eff.get("base.delay"):
        v, w = _delay(v, p["delay"]), _delay(w, p["delay"] * (1.25 if p["form"] else 1))
    if robot.volts and ON_VOLTS & set(eff):
        v, w = _by_volts(robot, eff, v, w)
    for name in (name for name in V_STEPS if name in eff):
        v = V_STEPS[name](eff[name], v, robot)
    for name in (name for name in W_STEPS if name in eff):
        w = W_STEPS[name](eff[name], w, robot)
    if p := eff.get("base.understeer"):
        w = w / (1 + p["k"] * (vm**2 * (abs(v) / vm) ** 1.5 if p["form"] else v * v))
    ahead = v
    if p := eff.get("base.cross_w_to_v"):
        v = v + p["lever"] * (w * np.sqrt(abs(w) / wm) if p["form"] else w)
    if p := eff.get("base.veer"):
        w = w + p["curvature"] * (ahead * (abs(ahead) / vm) ** 0.3 if p["form"] else ahead)
    if p := eff.get("base.caster_reversal"):
        w = _casters(p, ahead, w, vm)
    if p := eff.get("base.lateral_slip"):
        u = -p["c"] * ahead * (w * np.sqrt(abs(w) / wm) if p["form"] else w)
    return v, u, w


def pose_terms(dr: Drive, robot: Robot, eff: Effects, path: Array, v: Array, w: Array) -> tuple[Array, Array]:
    """Return what place, heading and a column add to v and w."""
    dv, dw = np.zeros(v.size), np.zeros(v.size)
    if p := eff.get("base.slope"):
        on = abs(v) / robot.vmax if p["form"] else (abs(v) > 0.01 * robot.vmax)
        dv = dv - (p["climb_x"] * np.cos(path[:, 2]) + p["climb_y"] * np.sin(path[:, 2])) * on * (2 if p["form"] else 1)
    for key, x, top in (("unknown.v", dv, robot.vmax), ("unknown.w", dw, robot.wmax)):
        if p := eff.get(key):
            drives = np.hypot(v / robot.vmax, w / robot.wmax) > 0.03
            x += p["size"] * top * p["shape"](quantity(dr, robot, p["of"], path, v, w)) * drives
    return dv, dw


def quantity(dr: Drive, robot: Robot, name: str, path: Array, v: Array, w: Array) -> Array:
    """Return a covariate on the grid, scaled to about 0..1 or -1..1."""
    t = np.arange(v.size) * DT
    if name == "time_since_rest":
        rest = np.hypot(dr.vc[: v.size], dr.wc[: v.size]) < 1e-9
        return np.asarray((t - np.maximum.accumulate(np.where(rest, t, 0))) / 8)
    if name == "humidity":
        return np.asarray((np.interp(t, dr.cov_t, dr.cov[name]) - 50) / 15)
    plain = {"time": (t, 100), "x": (path[:, 0], 3), "y": (path[:, 1], 3), "heading": (path[:, 2], np.pi)}
    plain |= {"abs_v": (abs(v), robot.vmax), "abs_w": (abs(w), robot.wmax)}
    value, scale = plain[name]
    return np.asarray(value / scale)


def integrate(dr: Drive, v: Array, u: Array, w: Array) -> Array:
    """Return the path of the rates from the drive's first pose, n + 1 rows."""
    x0, y0, th0 = dr.pose0
    th = th0 + np.concatenate([[0], np.cumsum(w) * DT])
    m = th[:-1] + w * DT / 2
    x = x0 + np.concatenate([[0], np.cumsum(v * np.cos(m) - u * np.sin(m)) * DT])
    y = y0 + np.concatenate([[0], np.cumsum(v * np.sin(m) + u * np.cos(m)) * DT])
    return np.stack([x, y, th], -1)


def drive_on(dr: Drive, robot: Robot, eff: Effects, n: int) -> Array:
    """Return the path that is driven, with noise."""
    v, u, w = rates(dr, robot, eff, n)
    f = growth(robot, eff, v, w)
    nv, nw = dr.nv[:n] * f, dr.nw[:n] * f
    path = integrate(dr, v + nv, u, w + nw)
    if any(k in eff for k in ("base.slope", "unknown.v", "unknown.w")):
        for _ in range(3):
            dv, dw = pose_terms(dr, robot, eff, path[:-1], v, w)
            path = integrate(dr, v + dv + nv, u, w + dw + nw)
    return path


def growth(robot: Robot, eff: Effects, v: Array, w: Array) -> Array:
    """Return how much larger the noise of the rates is than in rest; 1 without the cause."""
    p = eff.get("base.process_noise")
    a = np.hypot(v / robot.vmax, w / robot.wmax)
    return np.asarray(1 + (0 * a if p is None else p["growth"] * (a * a if p["form"] else a)))


def mean_path(dr: Drive, robot: Robot, eff: Effects) -> Array:
    """Return the path without noise of the rates; what depends on the pose goes by the true one."""
    v, u, w = rates(dr, robot, eff, dr.n)
    dv, dw = pose_terms(dr, robot, eff, dr.path[:-1], v, w)
    return integrate(dr, v + dv, u, w + dw)
