# SPDX-License-Identifier: BSD-3-Clause
"""What the base does: from what is asked for, over the converter, motors, tyres and casters, to its way."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

Array = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]
Rng = np.random.Generator
Law = tuple[tuple[float, float], tuple[float, float]]  # slope and intercept forward and backward
Pose = tuple[Array, Array, Array]
DT = 0.02
LAWS: dict[str, Law] = {
    "published": ((-0.499211, 0.104181), (-0.469278, -0.169476)),
    "corrected": ((-0.499211, -0.104181), (-0.469278, 0.169476)),
}
FWD: Law = ((1.32402, 0.127906), (2.07369, -0.108783))


@dataclass
class Cause:
    """Something hidden: id, sizes, and whether its equation is the other one."""

    id: str
    p: dict[str, Any]
    other: bool = False
    told: tuple[str, ...] = ()


Causes = dict[str, Cause]


class Robot(NamedTuple):
    """A base: how it is driven, and how unsteady it is."""

    kind: str
    volts: bool
    vmax: float
    wmax: float
    law: str
    sd_v: float
    sd_w: float
    tau: float
    rate: float
    ramp: float
    style: str
    size: float
    meta: str


@dataclass
class Way:
    """A trajectory on the grid's edges, with the rates and the scale of their noise in its cells."""

    x: Array
    y: Array
    th: Array
    cells: dict[str, Array]

    def at(self, t: Array) -> Pose:
        """Return the pose at times."""
        edges = np.arange(len(self.x)) * DT
        return np.interp(t, edges, self.x), np.interp(t, edges, self.y), np.interp(t, edges, self.th)

    def cell(self, name: str, t: Array) -> Array:
        """Return a quantity of the cells at times."""
        return np.interp(t, (np.arange(len(self.x) - 1) + 0.5) * DT, self.cells[name])


def to_volts(rate: Array, law: Law) -> Array:
    """Return the voltage that a rate is asked for with."""
    (a, b), (c, d) = law
    return np.where(rate > 0, a * rate + b, np.where(rate < 0, c * rate + d, 0.0))


def from_volts(u: Array, law: Law) -> Array:
    """Return the rate that a voltage makes, in a law with a true dead zone."""
    (a, b), (c, d) = law
    s = np.sign(a)
    return np.where(s * u > s * b, (u - b) / a, np.where(s * u < s * d, (u - d) / c, 0.0))


def _cells(t: Array, val: Array, n: int) -> Array:
    """Return means over the cells of what holds from each row to the next."""
    e, tt = np.arange(n + 1) * DT, np.concatenate([[min(0.0, t[0]) - 1e-9], t, [max(t[-1], n * DT) + 1.0]])
    cum = np.concatenate([[0.0, 0.0], np.cumsum(val * np.diff(tt[1:]))])
    return np.asarray(np.diff(np.interp(e, tt, cum)) / DT)


def _play(w: Array, p: float) -> Array:
    out, y = np.empty_like(w), 0.0
    for i, u in enumerate(w.tolist()):
        out[i] = y = min(max(y, u - p), u + p)
    return out


def _ramp(k: Cause, v: Array, slowness: float) -> Array:
    up = 1 / slowness
    down = (1.6 if k.other else 1.0) * up
    out, y, a, b = np.empty_like(v), 0.0, up * DT, down * DT
    for i, u in enumerate(v.tolist()):
        m = a if abs(u) > abs(y) else b
        y += min(max(u - y, -m), m)
        out[i] = y
    return out


def _lag(v: Array, tau: float) -> Array:
    a = np.exp(-DT / max(tau, 1e-3))
    g = tau / DT * (1 - a)  # mean over the cell of an exact first order
    return np.asarray(v * (1 - g) + lfilter([0, 1 - a], [1, -a], v) * g)


def _dead(u: Array, k: Cause | None, zone: tuple[float, float]) -> Array:
    """Return what static friction (other) or a wider dead band of the controller (usual) leaves."""
    if not k:
        return u
    width = k.p["width"]
    if k.other:
        lim = np.where(u > 0, zone[0] + 1.1 * width, zone[1] + 0.9 * width)
        return np.where(np.abs(u) < lim, 0.0, u)
    return np.asarray(np.sign(u) * np.maximum(np.abs(u) - width, 0))


def _off_zero(u: Array, k: Cause | None) -> Array:
    return np.asarray(u + k.p["offset"] * (1 - 0.3 * np.abs(u) * k.other)) if k else u


def _by_volts(robot: Robot, c: Causes, v: Array, w: Array) -> tuple[Array, Array]:
    """Return what the converter and the joystick's input make of the rows."""
    vf, vs = to_volts(v, FWD), to_volts(w, LAWS[robot.law])
    if k := c.get("base.dac_quantisation"):
        cut: Callable[[Array], Array] = np.trunc if k.other else np.round
        vf, vs = cut(vf / k.p["step"]) * k.p["step"], cut(vs / k.p["step"]) * k.p["step"]
    if k := c.get("base.cross_v_to_w"):
        vs = vs + k.p["share"] * (np.sign(vf) * np.abs(vf) ** 1.5 if k.other else vf)
    vf, vs = _off_zero(vf, c.get("base.dac_zero_f")), _off_zero(vs, c.get("base.dac_zero_s"))
    vf = _dead(vf, c.get("base.dead_zone_v"), (0.1279, 0.1088))
    vs = _dead(vs, c.get("base.dead_zone_w"), (0.1695, 0.1042))
    known = "base.steering_law" not in c and robot.law == "published"  # then voltages are what they stand for
    return from_volts(vf, FWD), w if known else from_volts(vs, LAWS["corrected"])


def _arrived(robot: Robot, c: Causes, rows: Array, n: int) -> tuple[Array, Array]:
    """Return the rates that arrive at the motors in the cells."""
    t, v, w = rows.T
    if robot.volts:
        v, w = _by_volts(robot, c, v, w)
    else:
        v, w = _dead(v, c.get("base.dead_zone_v"), (0, 0)), _dead(w, c.get("base.dead_zone_w"), (0, 0))
    if k := c.get("base.sign"):
        v, w = v * k.p["factor_v"], w * k.p["factor_w"]
    if k := c.get("base.backlash"):
        w = np.mean([_play(w, f * k.p["play"]) for f in ((0.6, 1.4) if k.other else (1.0,))], 0)
    if k := c.get("base.delay"):
        return _cells(t + k.p["delay"], v, n), _cells(t + k.p["delay"] * (1.5 if k.other else 1.0), w, n)
    return _cells(t, v, n), _cells(t, w, n)


def _gain_v(k: Cause, v: Array, top: float) -> Array:
    f = 1.2 - 1.2 * np.exp(-np.abs(v) / (0.15 * top)) if k.other else 1
    return np.asarray(v * (1 + k.p["gain"] * f))


def _gain_w(k: Cause, w: Array, top: float) -> Array:
    return np.asarray(w * (1 + k.p["gain"] * (np.where(w > 0, 1.12, 0.88) if k.other else 1)))


def _left_right(k: Cause, w: Array, top: float) -> Array:
    return np.asarray(w * (1 + k.p["asymmetry"] / 2 * (np.tanh(w / (0.15 * top)) if k.other else np.sign(w))))


def _reverse(k: Cause, v: Array, top: float) -> Array:
    return np.where(v < 0, v * (1 + k.p["gain"] * (np.tanh(np.abs(v) / 0.08) if k.other else 1)), v)


def _bent(k: Cause, u: Array, top: float) -> Array:
    f = np.abs(u) ** 1.7 * top**-0.7 if k.other else np.abs(u)
    return np.asarray(u * np.maximum(1 - k.p["curvature"] * f, 0.1))


def _saturated(k: Cause, u: Array, m: float) -> Array:
    return np.asarray(u / (1 + np.abs(u / m) ** 8) ** 0.125 if k.other else np.clip(u, -m, m))


def _sag(k: Cause, u: Array, top: float) -> Array:
    time = (np.arange(len(u)) + 0.5) * DT
    sag = 0.6 * time + 14 * (1 - np.exp(-time / 30)) if k.other else time
    return np.asarray(u * (1 - np.minimum(k.p["sag"] * sag, 0.8)))


def _slow(k: Cause, u: Array, top: float) -> Array:
    tau = k.p["tau"]
    return 0.65 * _lag(u, 0.6 * tau) + 0.35 * _lag(u, 1.74 * tau) if k.other else _lag(u, tau)


# What motors do to either rate, in the order in which it acts; the last argument is the robot's largest rate.
Step = Callable[[Cause, Array, float], Array]
V_STEPS: dict[str, Step] = {
    "base.gain_v": _gain_v,
    "base.reverse_gain": _reverse,
    "base.curvature_v": _bent,
    "base.saturation": lambda k, v, top: _saturated(k, v, 1 / k.p["inverse_v"]),
    "base.battery_sag": _sag,
    "base.payload": lambda k, v, top: _lag(v * (1 - k.p["droop"]), k.p["tau"]),
    "base.accel_limit": lambda k, v, top: _ramp(k, v, k.p["slowness_v"]),
    "base.lag_v": _slow,
}
W_STEPS: dict[str, Step] = {
    "base.gain_w": _gain_w,
    "base.left_right_gain": _left_right,
    "base.curvature_w": _bent,
    "base.saturation": lambda k, w, top: _saturated(k, w, 1 / k.p["inverse_w"]),
    "base.battery_sag": _sag,
    "base.payload": lambda k, w, top: _lag(w * (1 - k.p["droop"]), k.p["tau"] * (0.7 if k.other else 1.0)),
    "base.accel_limit": lambda k, w, top: _ramp(k, w, k.p["slowness_w"]),
    "base.lag_w": _slow,
}


def _unknown(k: Cause, ctx: dict[str, Array], on: Bools) -> Array:
    """Return what something outside of the catalogue does in the cells."""
    n, p = len(on), k.p
    th, x, y, hum = (ctx[name][:n] for name in ("th", "x", "y", "humidity"))
    time = (np.arange(n) + 0.5) * DT
    rest = time - np.maximum.accumulate(np.where(on, 0, time))
    shape = {
        "humidity": (hum - 45) / 8,
        "x": np.sin(p["k"] * x + p["f"]),
        "y": np.sin(p["k"] * y + p["f"]),
        "time_since_rest": np.exp(-rest / 2.5),
        "heading": np.cos(2 * th + p["f"]),
        "time": (time / p["period"] + p["f"]) % 1 < 0.3,
    }
    return np.asarray(p["a"] * shape[p["of"]])


def _casters(k: Cause, v: Array, moving: Bools) -> Array:
    """Return the turning that casters add which turn round after a change of direction."""
    s = np.where(moving, np.sign(v), 0)
    s = s[np.maximum.accumulate(np.where(s != 0, np.arange(len(v)), 0))]
    dist = np.cumsum(np.abs(v)) * DT
    since = dist - np.maximum.accumulate(np.where(np.concatenate([[False], s[1:] * s[:-1] < 0]), dist, -1e3))
    fade = np.maximum(1 - since / (2 * k.p["length"]), 0) if k.other else np.exp(-since / k.p["length"])
    return np.asarray(k.p["kick"] * fade * moving)


def _rolled(robot: Robot, c: Causes, v: Array, w: Array, moving: Bools, th: Array) -> tuple[Array, Array, Array]:
    """Return v, w and the sideways speed that tyres, casters and the floor make of the wheels' rates."""
    if k := c.get("base.understeer"):
        bent = np.exp(-k.p["k"] * np.abs(v) ** 1.5 * robot.vmax**0.5) if k.other else 1 / (1 + k.p["k"] * v * v)
        w = w * bent
    if k := c.get("base.veer"):
        w = w + k.p["curvature"] * v * (np.where(v > 0, 1.1, 0.8) if k.other else 1)
    if k := c.get("base.cross_w_to_v"):
        v = v + k.p["lever"] * (np.abs(w) if k.other else w)
    if k := c.get("base.caster_reversal"):
        w = w + _casters(k, v, moving)
    if k := c.get("base.slope"):
        pull = k.p["climb_x"] * np.cos(th) + k.p["climb_y"] * np.sin(th)
        v = v - pull * moving * (np.where(v * pull > 0, 1.2, 0.8) if k.other else 1)
    if k := c.get("base.lateral_slip"):
        return v, w, -k.p["c"] * v * (np.sign(w) * np.abs(w) ** 1.5 if k.other else w)
    return v, w, np.zeros_like(v)


def rates(robot: Robot, causes: list[Cause], rows: Array, n: int, ctx: dict[str, Array]) -> dict[str, Array]:
    """Return mean rates v, w, vy in the cells, and the scale of their noise; ctx: th, x, y, humidity in the cells."""
    c = {k.id: k for k in causes}
    on = _cells(rows[:, 0], np.abs(rows[:, 1]) + np.abs(rows[:, 2]), n) > 1e-4
    v, w = _arrived(robot, c, rows, n)
    for name in (name for name in V_STEPS if name in c):
        v = V_STEPS[name](c[name], v, robot.vmax)
    for name in (name for name in W_STEPS if name in c):
        w = W_STEPS[name](c[name], w, robot.wmax)
    moving = np.abs(v) > 0.004
    if k := c.get("unknown.base.v"):
        v = v * (1 + _unknown(k, ctx, on))
    if k := c.get("unknown.base.w"):
        w = w + _unknown(k, ctx, on) * moving
    v, w, vy = _rolled(robot, c, v, w, moving, ctx["th"][:n])
    sv, sw = robot.sd_v * on, robot.sd_w * on
    if k := c.get("base.process_noise"):
        f = 1 + k.p["a"] * (np.abs(v) / robot.vmax) ** (1.7 if k.other else 1.0)
        sv, sw = sv * f, sw * f
    return {"v": v, "w": w, "vy": vy, "sv": sv, "sw": sw}


def travel(
    robot: Robot,
    causes: list[Cause],
    rows: Array,
    n: int,
    start: tuple[float, float, float],
    ctx: dict[str, Array],
    noise: Array | None = None,
    passes: int = 1,
) -> Way:
    """Return the way that the base takes; with noise its poses are written into ctx as those that effects follow."""
    for _ in range(passes):
        r = rates(robot, causes, rows, n, ctx)
        if noise is not None:
            r["v"], r["w"] = r["v"] + r["sv"] * noise[0, :n], r["w"] + r["sw"] * noise[1, :n]
        th = start[2] + np.concatenate([[0.0], np.cumsum(r["w"]) * DT])
        m = (th[1:] + th[:-1]) / 2
        x = start[0] + np.concatenate([[0.0], np.cumsum(r["v"] * np.cos(m) - r["vy"] * np.sin(m)) * DT])
        y = start[1] + np.concatenate([[0.0], np.cumsum(r["v"] * np.sin(m) + r["vy"] * np.cos(m)) * DT])
        if noise is not None:
            ctx["th"][:n], ctx["x"][:n], ctx["y"][:n] = m, (x[1:] + x[:-1]) / 2, (y[1:] + y[:-1]) / 2
    return Way(x, y, th, r)
