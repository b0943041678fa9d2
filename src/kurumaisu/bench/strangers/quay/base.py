# SPDX-License-Identifier: BSD-3-Clause
"""How commands become motion, with each of the base's causes, and what the reference measures of it."""
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy.signal import lfilter

from kurumaisu.bench.strangers.quay.things import Array, Reference, Robot

DT = 0.01
Effects = dict[str, dict[str, Any]]
LAWS = {"corrected": (-0.104181, 0.169476), "published": (0.104181, -0.169476)}


@dataclass
class Drive:
    """One drive on a grid of 10 ms; all times are from its start."""

    name: str
    start: float
    n: int
    since: float = 0.0
    vc: Array = field(default_factory=lambda: np.zeros(0))
    wc: Array = field(default_factory=lambda: np.zeros(0))
    nv: Array = field(default_factory=lambda: np.zeros(0))
    nw: Array = field(default_factory=lambda: np.zeros(0))
    pose0: tuple[float, float, float] = (0, 0, 0)
    rows: list[int] = field(default_factory=list)
    path: Array = field(default_factory=lambda: np.zeros((0, 3)))
    pose_t: Array = field(default_factory=lambda: np.zeros(0))
    pose: Array = field(default_factory=lambda: np.zeros((0, 3)))
    off: Array = field(default_factory=lambda: np.zeros(0, bool))
    scan_t: Array = field(default_factory=lambda: np.zeros(0))
    scan: Array = field(default_factory=lambda: np.zeros((0, 0)))
    cov_t: Array = field(default_factory=lambda: np.zeros(0))
    cov: dict[str, Array] = field(default_factory=dict)

    def at(self, t: Array, path: Array | None = None) -> Array:
        """Pose at times t from the start, along the last axis."""
        p = self.path if path is None else path
        g = np.arange(len(p)) * DT
        return np.stack([np.interp(t, g, p[:, i]) for i in range(3)], -1)


def to_volts(robot: Robot, v: Array, w: Array, law: str | None = None) -> tuple[Array, Array]:
    """Equations (1) and (2)."""
    pos, neg = LAWS[law or robot.law]
    vf = np.where(v > 0, 1.32402 * v + 0.127906, np.where(v < 0, 2.07369 * v - 0.108783, 0.0))
    vs = np.where(w > 0, -0.499211 * w + pos, np.where(w < 0, -0.469278 * w + neg, 0.0))
    return vf, vs


def to_rates(vf: Array, vs: Array) -> tuple[Array, Array]:
    """The rates of voltages by the corrected law: an ordinary dead zone."""
    v = np.where(vf > 0.127906, (vf - 0.127906) / 1.32402, np.where(vf < -0.108783, (vf + 0.108783) / 2.07369, 0.0))
    w = np.where(vs < -0.104181, (vs + 0.104181) / -0.499211, np.where(vs > 0.169476, (vs - 0.169476) / -0.469278, 0.0))
    return v, w


def _lag(u: Array, tau: float) -> Array:
    if tau <= 1e-6:
        return u
    a = float(np.exp(-DT / tau))
    return lfilter([1 - a], [1, -a], u)


def _delay(u: Array, d: float) -> Array:
    k = np.arange(u.size) - d / DT
    return np.interp(k, np.arange(u.size), u, left=0.0)


def _ramp(u: Array, slow: float) -> Array:
    if slow <= 0:
        return u
    step, y, out = DT / slow, 0.0, []
    for x in u.tolist():
        y += min(max(x - y, -step), step)
        out.append(y)
    return np.array(out)


def _play(u: Array, half: float) -> Array:
    y, out = 0.0, []
    for x in u.tolist():
        y = min(max(y, x - half), x + half)
        out.append(y)
    return np.array(out)


def _dead(u: Array, width: float, other: bool) -> Array:
    a = abs(u)
    if other:
        return u / (1 + np.exp(-np.clip((a - width) / (0.08 * abs(width) + 1e-9), -50, 50)))
    return np.sign(u) * np.maximum(a - width, 0)


def rates(dr: Drive, robot: Robot, eff: Effects, n: int) -> tuple[Array, Array, Array]:
    """Mean v, sideways speed and w on the grid but for what depends on the pose."""
    v, w = dr.vc[:n].copy(), dr.wc[:n].copy()
    vm, wm = robot.vmax, robot.wmax
    t = np.arange(n) * DT
    u = np.zeros(n)

    def of(name: str) -> dict[str, Any] | None:
        return eff.get("base." + name)

    if p := of("delay"):
        v, w = _delay(v, p["delay"]), _delay(w, p["delay"] * (1.25 if p["form"] else 1))
    if robot.volts:
        names = ("dac_zero_f", "dac_zero_s", "dac_quantisation", "steering_law", "cross_v_to_w", "dead_zone_v",
                 "dead_zone_w")
        if any(of(k) for k in names):
            vf, vs = to_volts(robot, v, w)
            if not of("steering_law") and robot.law != "corrected":
                vf, vs = to_volts(robot, v, w, "corrected")
            moving = (abs(v) > 0) | (abs(w) > 0)
            if p := of("dac_zero_f"):
                vf = vf + p["offset"] * (moving if p["form"] else 1)
            if p := of("dac_zero_s"):
                vs = vs + p["offset"] * (moving if p["form"] else 1)
            if p := of("cross_v_to_w"):
                vs = vs + p["share"] * (vf * np.sqrt(abs(vf) / 0.8) if p["form"] else vf)
            if p := of("dac_quantisation"):
                f = np.trunc if p["form"] else np.round
                vf, vs = f(vf / p["step"]) * p["step"], f(vs / p["step"]) * p["step"]
            if p := of("dead_zone_v"):
                vf = np.sign(vf) * np.maximum(abs(vf) - p["width"], 0) if not p["form"] else vf
            if p := of("dead_zone_w"):
                vs = np.sign(vs) * np.maximum(abs(vs) - p["width"], 0) if not p["form"] else vs
            v, w = to_rates(vf, vs)
    for axis in "vw":
        if (p := of("dead_zone_" + axis)) and (p["form"] or not robot.volts):
            x = _dead(v if axis == "v" else w, p["width"], p["form"])
            v, w = (x, w) if axis == "v" else (v, x)
    if p := of("sign"):
        if p.get("swap"):
            v, w = w, v
        v, w = v * p.get("factor_v", 1), w * p.get("factor_w", 1)
    if p := of("gain_v"):
        v = v * (1 + p["gain"] * (np.where(v > 0, 1.12, 0.85) if p["form"] else 1))
    if p := of("gain_w"):
        w = w * (1 + p["gain"] * (np.where(w > 0, 1.1, 0.88) if p["form"] else 1))
    if p := of("left_right_gain"):
        w = w * (1 + p["asymmetry"] * (np.where(w > 0, 1.6, 0.0) if p["form"] else np.sign(w)))
    if p := of("reverse_gain"):
        w0 = 1 / (1 + np.exp(np.clip(v / (0.05 * vm), -50, 50))) if p["form"] else v < 0
        v = v * (1 + p["gain"] * w0)
    if p := of("curvature_v"):
        v = v * (1 - p["curvature"] * (vm * (abs(v) / vm) ** 1.7 if p["form"] else abs(v)))
    if p := of("curvature_w"):
        w = w * (1 - p["curvature"] * (wm * (abs(w) / wm) ** 1.7 if p["form"] else abs(w)))
    if p := of("saturation"):
        for axis in "vw":
            k = p.get("inverse_" + axis, 0.0)
            x = v if axis == "v" else w
            if k:
                x = x / (1 + (k * abs(x)) ** 8) ** 0.125 if p["form"] else np.clip(x, -1 / k, 1 / k)
            v, w = (x, w) if axis == "v" else (v, x)
    if p := of("payload"):
        tau = p["tau"]
        v, w = (1 - p["droop"]) * _lag(v, tau), (1 - p["droop"] * (0.85 if p["form"] else 1)) * _lag(w, tau)
    if p := of("lag_v"):
        v = _lag(_lag(v, 0.7 * p["tau"]), 0.3 * p["tau"]) if p["form"] else _lag(v, p["tau"])
    if p := of("lag_w"):
        w = _lag(_lag(w, 0.7 * p["tau"]), 0.3 * p["tau"]) if p["form"] else _lag(w, p["tau"])
    if p := of("accel_limit"):
        v, w = _ramp(v, p["slowness_v"]), _ramp(w, p["slowness_w"])
        if p["form"]:
            v, w = _lag(v, 0.06), _lag(w, 0.06)
    if p := of("backlash"):
        w = _lag(_play(w, p["play"] / 2), 0.1) if p["form"] else _play(w, p["play"] / 2)
    if p := of("battery_sag"):
        f = 1 - (p["sag"] * 100 * (t / 100) ** 1.5 if p["form"] else p["sag"] * t)
        v, w = v * np.maximum(f, 0.1), w * np.maximum(f, 0.1)
    if p := of("understeer"):
        w = w / (1 + p["k"] * (vm**2 * (abs(v) / vm) ** 1.5 if p["form"] else v * v))
    vv = v
    if p := of("cross_w_to_v"):
        v = v + p["lever"] * (w * np.sqrt(abs(w) / wm) if p["form"] else w)
    if p := of("veer"):
        w = w + p["curvature"] * (vv * (abs(vv) / vm) ** 0.3 if p["form"] else vv)
    if p := of("caster_reversal"):
        s = np.sign(np.where(abs(vv) > 0.02 * vm, vv, 0))
        at = np.maximum.accumulate(np.where(s != 0, np.arange(n), -1))
        last = np.where(at >= 0, s[at], 0)
        turn = np.flatnonzero(np.diff(last) * (last[:-1] != 0)) + 1
        way = np.cumsum(abs(vv)) * DT
        k = np.searchsorted(turn, np.arange(n), side="right") - 1
        if turn.size:
            gone = np.where(k >= 0, way - way[turn[np.maximum(k, 0)]], np.inf) / p["length"]
            shape = np.maximum(1 - gone / 2, 0) if p["form"] else np.exp(-gone)
            w = w + p["kick"] * shape * (abs(vv) > 0.02 * vm)
    if p := of("lateral_slip"):
        u = -p["c"] * vv * (w * np.sqrt(abs(w) / wm) if p["form"] else w)
    return v, u, w


def pose_terms(dr: Drive, robot: Robot, eff: Effects, path: Array, v: Array, w: Array) -> tuple[Array, Array]:
    """What place, heading and a column add to v and w."""
    dv, dw = np.zeros(v.size), np.zeros(v.size)
    if p := eff.get("base.slope"):
        on = abs(v) / robot.vmax if p["form"] else (abs(v) > 0.01 * robot.vmax)
        dv = dv - (p["climb_x"] * np.cos(path[:, 2]) + p["climb_y"] * np.sin(path[:, 2])) * on * (2 if p["form"] else 1)
    for key, x in (("unknown.v", dv), ("unknown.w", dw)):
        if p := eff.get(key):
            m = robot.vmax if key[-1] == "v" else robot.wmax
            drives = np.hypot(v / robot.vmax, w / robot.wmax) > 0.03
            x += p["size"] * m * p["shape"](quantity(dr, robot, p["of"], path, v, w)) * drives
    return dv, dw


def quantity(dr: Drive, robot: Robot, name: str, path: Array, v: Array, w: Array) -> Array:
    """A covariate on the grid, scaled to about 0..1 or -1..1."""
    n = v.size
    t = np.arange(n) * DT
    if name == "time":
        return t / 100
    if name == "time_since_rest":
        rest = np.hypot(dr.vc[:n], dr.wc[:n]) < 1e-9
        return (t - np.maximum.accumulate(np.where(rest, t, 0))) / 8
    if name in ("x", "y"):
        return path[:, "xy".index(name)] / 3
    if name == "heading":
        return path[:, 2] / np.pi
    if name in ("abs_v", "v"):
        return (abs(v) if name == "abs_v" else v) / robot.vmax
    if name in ("abs_w", "w"):
        return (abs(w) if name == "abs_w" else w) / robot.wmax
    return (np.interp(t, dr.cov_t, dr.cov[name]) - 50) / 15


def integrate(dr: Drive, v: Array, u: Array, w: Array) -> Array:
    """Path of the rates from the drive's first pose, n + 1 rows."""
    x0, y0, th0 = dr.pose0
    th = th0 + np.concatenate([[0], np.cumsum(w) * DT])
    m = th[:-1] + w * DT / 2
    x = x0 + np.concatenate([[0], np.cumsum(v * np.cos(m) - u * np.sin(m)) * DT])
    y = y0 + np.concatenate([[0], np.cumsum(v * np.sin(m) + u * np.cos(m)) * DT])
    return np.stack([x, y, th], -1)


def drive_on(dr: Drive, robot: Robot, eff: Effects, n: int) -> Array:
    """The path that is driven, with noise."""
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
    """How much larger the noise of the rates is than in rest; 1 without the cause."""
    p = eff.get("base.process_noise")
    a = np.hypot(v / robot.vmax, w / robot.wmax)
    return 1 + (0 * a if p is None else p["growth"] * (a * a if p["form"] else a))


def mean_path(dr: Drive, robot: Robot, eff: Effects) -> Array:
    """The path without noise of the rates; what depends on the pose goes by the true one."""
    v, u, w = rates(dr, robot, eff, dr.n)
    dv, dw = pose_terms(dr, robot, eff, dr.path[:-1], v, w)
    return integrate(dr, v + dv, u, w + dw)


def refer(dr: Drive, robot: Robot, eff: Effects, path: Array, t: Array) -> Array:
    """What the reference measures of a path at its stamps t, without its errors."""
    if p := eff.get("base.clock_scale"):
        t = t * (1 - p["scale"])
    q = dr.at(t, path)
    x, y = (eff.get(k, {}).get(k[-1], 0.0) for k in ("base.marker_x", "base.marker_y"))
    c, s = np.cos(q[:, 2]), np.sin(q[:, 2])
    q = q + np.stack([c * x - s * y, s * x + c * y, 0 * c + eff.get("base.marker_yaw", {}).get("yaw", 0.0)], -1)
    if p := eff.get("unknown.pose"):
        z = np.interp(t, np.arange(dr.n) * DT,
                      p["shape"](quantity(dr, robot, p["of"], dr.path[:-1], dr.vc, dr.wc)))
        q[:, p["part"]] += p["size"] * z
    return q


def relative(q: Array, i: Array, j: Array) -> Array:
    """Motion from rows i to rows j in the frame of the first."""
    d = q[j] - q[i]
    c, s = np.cos(q[i, 2]), np.sin(q[i, 2])
    return np.stack([c * d[:, 0] + s * d[:, 1], -s * d[:, 0] + c * d[:, 1], d[:, 2]], -1)


def motion_cov(dr: Drive, robot: Robot, ref: Reference, t: Array, grow: Array, chain: bool = True) -> Array:
    """Covariance of the motions between times t (a chain, or pairs), from process noise and reference."""
    i = np.arange(len(t) - 1) if chain else np.arange(0, len(t), 2)
    n, m = i.size, 10
    a, b = t[i], t[i + 1]
    h = (b - a) / m
    tk = a[:, None] + (np.arange(m) + 0.5) * h[:, None]
    qa, qb, qk = dr.at(a), dr.at(b), dr.at(tk)
    rel = qk[..., 2] - qa[:, None, 2]
    e = qb[:, None, :2] - qk[..., :2]
    c, s = np.cos(qa[:, 2])[:, None], np.sin(qa[:, 2])[:, None]
    ex, ey = c * e[..., 0] + s * e[..., 1], -s * e[..., 0] + c * e[..., 1]
    jv, jw = np.zeros((3, n, n, m)), np.zeros((3, n, n, m))
    d, hh = np.arange(n), h[:, None]
    jv[0, d, d], jv[1, d, d] = np.cos(rel) * hh, np.sin(rel) * hh
    jw[0, d, d], jw[1, d, d], jw[2, d, d] = -ey * hh, ex * hh, hh
    g = np.interp(tk.ravel(), np.arange(grow.size) * DT, grow)
    k = np.exp(-abs(tk.ravel()[:, None] - tk.ravel()) / robot.tau) * g[:, None] * g
    x = h.mean() / robot.tau
    k *= 1 + (2 * (x - 1 + np.exp(-x)) / x**2 - 1) * np.eye(len(k))
    jv, jw = jv.reshape(3 * n, -1), jw.reshape(3 * n, -1)
    cov = robot.sd_v**2 * jv @ k @ jv.T + robot.sd_w**2 * jw @ k @ jw.T
    near = abs(t[:, None] - t)
    old = np.exp(-near / ref.wtau)
    same = near < 1e-9
    mo = relative(dr.at(t), i, i + 1)
    co, si = np.cos(qa[:, 2]), np.sin(qa[:, 2])
    j = np.zeros((3, n, 3, len(t)))
    for row, (p, q) in enumerate(((co, si), (-si, co))):
        j[row, d, 0, i + 1], j[row, d, 0, i], j[row, d, 1, i + 1], j[row, d, 1, i] = p, -p, q, -q
    j[0, d, 2, i], j[1, d, 2, i] = mo[:, 1], -mo[:, 0]
    j[2, d, 2, i + 1], j[2, d, 2, i] = 1, -1
    for part, (sd, wd) in enumerate(((ref.sp, ref.wp), (ref.sp, ref.wp), (ref.sh, ref.wh))):
        jj = j[:, :, part].reshape(3 * n, -1)
        cov += jj @ (sd**2 * same + wd**2 * old) @ jj.T
    return cov
