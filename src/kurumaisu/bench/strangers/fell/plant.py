# SPDX-License-Identifier: BSD-3-Clause
"""What the base does: from what is asked for, over the converter, motors, tyres and casters, to its way."""

from collections import namedtuple
from dataclasses import dataclass
from typing import Any
import numpy as np
from scipy.signal import lfilter

DT = 0.02
LAWS = {
    "published": ((-0.499211, 0.104181), (-0.469278, -0.169476)),
    "corrected": ((-0.499211, -0.104181), (-0.469278, 0.169476)),
}
FWD = ((1.32402, 0.127906), (2.07369, -0.108783))


@dataclass
class Cause:
    """Something hidden: id, sizes, and whether its equation is the other one."""

    id: str
    p: dict[str, Any]
    other: bool = False
    told: tuple[str, ...] = ()


# a base: how it is driven, and how unsteady it is
Robot = namedtuple("Robot", "kind volts vmax wmax law sd_v sd_w tau rate ramp style size meta")


@dataclass
class Way:
    """A trajectory on the grid's edges, with the rates and the scale of their noise in its cells."""

    x: np.ndarray
    y: np.ndarray
    th: np.ndarray
    cells: dict[str, np.ndarray]

    def at(self, t: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The pose at times."""
        return tuple(np.interp(t, np.arange(len(self.x)) * DT, a) for a in (self.x, self.y, self.th))

    def cell(self, name: str, t: np.ndarray) -> np.ndarray:
        """A quantity of the cells at times."""
        return np.interp(t, (np.arange(len(self.x) - 1) + 0.5) * DT, self.cells[name])


def to_volts(rate: np.ndarray, law: tuple) -> np.ndarray:
    """Voltage that a rate is asked for with."""
    (a, b), (c, d) = law
    return np.where(rate > 0, a * rate + b, np.where(rate < 0, c * rate + d, 0.0))


def from_volts(u: np.ndarray, law: tuple) -> np.ndarray:
    """Rate that a voltage makes, in a law with a true dead zone."""
    (a, b), (c, d) = law
    s = np.sign(a)
    return np.where(s * u > s * b, (u - b) / a, np.where(s * u < s * d, (u - d) / c, 0.0))


def _cells(t: np.ndarray, val: np.ndarray, n: int) -> np.ndarray:
    """Means over the cells of what holds from each row to the next."""
    e, tt = np.arange(n + 1) * DT, np.concatenate([[min(0.0, t[0]) - 1e-9], t, [max(t[-1], n * DT) + 1.0]])
    cum = np.concatenate([[0.0, 0.0], np.cumsum(val * np.diff(tt[1:]))])
    return np.diff(np.interp(e, tt, cum)) / DT


def _play(w: np.ndarray, p: float) -> np.ndarray:
    out, y = np.empty_like(w), 0.0
    for i, u in enumerate(w.tolist()):
        out[i] = y = min(max(y, u - p), u + p)
    return out


def _ramp(v: np.ndarray, up: float, down: float) -> np.ndarray:
    out, y, a, b = np.empty_like(v), 0.0, up * DT, down * DT
    for i, u in enumerate(v.tolist()):
        m = a if abs(u) > abs(y) else b
        y += min(max(u - y, -m), m)
        out[i] = y
    return out


def _lag(v: np.ndarray, tau: float) -> np.ndarray:
    a = np.exp(-DT / max(tau, 1e-3))
    g = tau / DT * (1 - a)  # mean over the cell of an exact first order
    return v * (1 - g) + lfilter([0, 1 - a], [1, -a], v) * g


def _dead(u: np.ndarray, k: Cause | None, zone: tuple[float, float]) -> np.ndarray:
    """Static friction (other) or a wider dead band of the controller (usual)."""
    if not k:
        return u
    width = k.p["width"]
    lim = np.where(u > 0, zone[0] + 1.1 * width, zone[1] + 0.9 * width)
    return np.where(np.abs(u) < lim, 0.0, u) if k.other else np.sign(u) * np.maximum(np.abs(u) - width, 0)


def _law(robot: Robot, c: dict[str, Cause], v: np.ndarray, w: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """What the converter and the joystick's input make of the rows."""
    vf, vs = to_volts(v, FWD), to_volts(w, LAWS[robot.law])
    if k := c.get("base.dac_quantisation"):
        cut = np.trunc if k.other else np.round
        vf, vs = cut(vf / k.p["step"]) * k.p["step"], cut(vs / k.p["step"]) * k.p["step"]
    if k := c.get("base.cross_v_to_w"):
        vs = vs + k.p["share"] * (np.sign(vf) * np.abs(vf) ** 1.5 if k.other else vf)
    vf, vs = (
        u + c[i].p["offset"] * (1 - 0.3 * np.abs(u) * c[i].other) if i in c else u
        for u, i in ((vf, "base.dac_zero_f"), (vs, "base.dac_zero_s"))
    )
    vf = _dead(vf, c.get("base.dead_zone_v"), (0.1279, 0.1088))
    vs = _dead(vs, c.get("base.dead_zone_w"), (0.1695, 0.1042))
    known = "base.steering_law" not in c and robot.law == "published"  # then voltages are what they stand for
    return from_volts(vf, FWD), w if known else from_volts(vs, LAWS["corrected"])


def rates(robot: Robot, causes: list[Cause], rows: np.ndarray, n: int, ctx: dict[str, np.ndarray]) -> dict:
    """Mean rates v, w, vy in the cells, and the scale of their noise. ctx: th, x, y, humidity in the cells."""
    c = {k.id: k for k in causes}
    t, v, w = rows.T
    asked = np.abs(v) + np.abs(w)
    if robot.volts:
        v, w = _law(robot, c, v, w)
    else:
        v, w = _dead(v, c.get("base.dead_zone_v"), (0, 0)), _dead(w, c.get("base.dead_zone_w"), (0, 0))
    if k := c.get("base.sign"):
        v, w = v * k.p["factor_v"], w * k.p["factor_w"]
    if k := c.get("base.backlash"):
        w = np.mean([_play(w, f * k.p["play"]) for f in ((0.6, 1.4) if k.other else (1.0,))], 0)
    d = c["base.delay"].p["delay"] if "base.delay" in c else 0.0
    on, v = _cells(t, asked, n) > 1e-4, _cells(t + d, v, n)
    w = _cells(t + d * (1.5 if d and c["base.delay"].other else 1.0), w, n)
    time = (np.arange(n) + 0.5) * DT
    if k := c.get("base.gain_v"):
        v = v * (1 + k.p["gain"] * (1.2 - 1.2 * np.exp(-np.abs(v) / (0.15 * robot.vmax)) if k.other else 1))
    if k := c.get("base.gain_w"):
        w = w * (1 + k.p["gain"] * (np.where(w > 0, 1.12, 0.88) if k.other else 1))
    if k := c.get("base.left_right_gain"):
        w = w * (1 + k.p["asymmetry"] / 2 * (np.tanh(w / (0.15 * robot.wmax)) if k.other else np.sign(w)))
    if k := c.get("base.reverse_gain"):
        v = np.where(v < 0, v * (1 + k.p["gain"] * (np.tanh(np.abs(v) / 0.08) if k.other else 1)), v)
    v, w = (
        u * np.maximum(1 - c[i].p["curvature"] * (np.abs(u) ** 1.7 * top**-0.7 if c[i].other else np.abs(u)), 0.1)
        if i in c
        else u
        for u, i, top in ((v, "base.curvature_v", robot.vmax), (w, "base.curvature_w", robot.wmax))
    )
    if k := c.get("base.saturation"):
        soft = (lambda u, m: u / (1 + np.abs(u / m) ** 8) ** 0.125) if k.other else (lambda u, m: np.clip(u, -m, m))
        v, w = soft(v, 1 / k.p["inverse_v"]), soft(w, 1 / k.p["inverse_w"])
    if k := c.get("base.battery_sag"):
        sag = 0.6 * time + 14 * (1 - np.exp(-time / 30)) if k.other else time
        v, w = v * (1 - np.minimum(k.p["sag"] * sag, 0.8)), w * (1 - np.minimum(k.p["sag"] * sag, 0.8))
    if k := c.get("base.payload"):
        v, w = (_lag(u * (1 - k.p["droop"]), k.p["tau"] * f) for u, f in ((v, 1.0), (w, 0.7 if k.other else 1.0)))
    if k := c.get("base.accel_limit"):
        a, b, f = 1 / k.p["slowness_v"], 1 / k.p["slowness_w"], 1.6 if k.other else 1.0
        v, w = _ramp(v, a, f * a), _ramp(w, b, f * b)
    v, w = (
        u
        if not (k := c.get(i))
        else 0.65 * _lag(u, 0.6 * k.p["tau"]) + 0.35 * _lag(u, 1.74 * k.p["tau"])
        if k.other
        else _lag(u, k.p["tau"])
        for u, i in ((v, "base.lag_v"), (w, "base.lag_w"))
    )
    moving = np.abs(v) > 0.004
    th, x, y, hum = (ctx[k][:n] for k in ("th", "x", "y", "humidity"))
    for k in causes:
        if k.id in ("unknown.base.v", "unknown.base.w"):
            a, of, kk, f = k.p["a"], k.p["of"], k.p["k"], k.p["f"]
            rest = time - np.maximum.accumulate(np.where(on, 0, time))
            a = (
                a
                * {
                    "humidity": (hum - 45) / 8,
                    "x": np.sin(kk * x + f),
                    "y": np.sin(kk * y + f),
                    "time_since_rest": np.exp(-rest / 2.5),
                    "heading": np.cos(2 * th + f),
                    "time": (time / k.p["period"] + f) % 1 < 0.3,
                }[of]
            )
            v, w = (v * (1 + a), w) if k.id == "unknown.base.v" else (v, w + a * moving)
    if k := c.get("base.understeer"):
        w = w * (np.exp(-k.p["k"] * np.abs(v) ** 1.5 * robot.vmax**0.5) if k.other else 1 / (1 + k.p["k"] * v * v))
    if k := c.get("base.veer"):
        w = w + k.p["curvature"] * v * (np.where(v > 0, 1.1, 0.8) if k.other else 1)
    if k := c.get("base.cross_w_to_v"):
        v = v + k.p["lever"] * (np.abs(w) if k.other else w)
    if k := c.get("base.caster_reversal"):
        s = np.where(moving, np.sign(v), 0)
        s = s[np.maximum.accumulate(np.where(s != 0, np.arange(n), 0))]
        dist = np.cumsum(np.abs(v)) * DT
        since = dist - np.maximum.accumulate(np.where(np.concatenate([[False], s[1:] * s[:-1] < 0]), dist, -1e3))
        fade = np.maximum(1 - since / (2 * k.p["length"]), 0) if k.other else np.exp(-since / k.p["length"])
        w = w + k.p["kick"] * fade * moving
    if k := c.get("base.slope"):
        pull = k.p["climb_x"] * np.cos(th) + k.p["climb_y"] * np.sin(th)
        v = v - pull * moving * (np.where(v * pull > 0, 1.2, 0.8) if k.other else 1)
    vy, sv, sw = np.zeros(n), robot.sd_v * on, robot.sd_w * on
    if k := c.get("base.lateral_slip"):
        vy = -k.p["c"] * v * (np.sign(w) * np.abs(w) ** 1.5 if k.other else w)
    if k := c.get("base.process_noise"):
        f = 1 + k.p["a"] * (np.abs(v) / robot.vmax) ** (1.7 if k.other else 1.0)
        sv, sw = sv * f, sw * f
    return {"v": v, "w": w, "vy": vy, "sv": sv, "sw": sw}


def travel(
    robot: Robot,
    causes: list[Cause],
    rows: np.ndarray,
    n: int,
    start: tuple,
    ctx: dict,
    noise: np.ndarray | None = None,
    passes: int = 1,
) -> Way:
    """The way that the base takes; with noise its poses are written into ctx as those that effects follow."""
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
