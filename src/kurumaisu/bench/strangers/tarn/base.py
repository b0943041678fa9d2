# SPDX-License-Identifier: BSD-3-Clause
"""A robot, what is hidden in it, how it moves as it is asked to, and how the reference sees it."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.signal import lfilter

Array = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]
Pose = tuple[Array, Array, Array]
Rng = np.random.Generator
DT = 0.01


class Effect(NamedTuple):
    """Something hidden: an id of the catalogue with numbers, `alt` if the equation is an unusual one."""

    id: str
    p: dict[str, float]
    alt: bool = False
    channel: str = ""
    covariate: str = ""
    told: tuple[str, ...] = ()


class Effects:
    """Some effects that act together, found by id."""

    def __init__(self, effects: list[Effect]) -> None:
        self.all, self.by_id = list(effects), {e.id: e for e in effects}

    def get(self, id_: str) -> Effect | None:
        """The effect of this id, if it acts."""
        return self.by_id.get(id_)

    def odd(self, channel: str) -> Effect | None:
        """What acts on this channel and is in no catalogue."""
        e = self.by_id.get("unknown")
        return e if e and e.channel == channel else None

    def p(self, id_: str, name: str, otherwise: float = 0.0) -> float:
        """A number of an effect, or what holds without it."""
        return self.by_id[id_].p.get(name, otherwise) if id_ in self.by_id else otherwise

    def alt(self, id_: str) -> bool:
        """Whether the effect acts by its unusual equation."""
        return id_ in self.by_id and self.by_id[id_].alt

    def without(self, id_: str) -> Effects:
        """All the others."""
        return Effects([e for e in self.all if e.id != id_])

    def plus(self, e: Effect) -> Effects:
        """These and one more, which replaces one of its id."""
        return Effects([*self.without(e.id).all, e])


class Laser(NamedTuple):
    """A laser: where it is, its fan, its error, its gate, and how many scans are kept per second."""

    x: float
    y: float
    z: float
    yaw: float
    amin: float
    ainc: float
    beams: int
    tinc: float
    scan_time: float
    scale: float
    offset: float
    sigma: tuple[float, float, float]
    res: float
    rmin: float
    rmax: float
    rate: float


class Reference(NamedTuple):
    """A source of poses: rows per second, errors of a row, and a drift that forgets within tau."""

    kind: str
    rate: float
    sd_p: float
    sd_h: float
    drift_p: float
    drift_h: float
    tau: float
    jitter: float


class Noise(NamedTuple):
    """How the rates fluctuate: sd at rest and per rate, and for how long."""

    av: float
    bv: float
    aw: float
    bw: float
    tau_v: float
    tau_w: float


class Lab(NamedTuple):
    """A robot with its instruments, where it drives, and how it is driven and recorded."""

    kind: str
    law: str
    vmax: float
    wmax: float
    cmd_dt: float
    radius: float
    track: float
    laser: Laser | None
    ref: Reference
    noise: Noise
    half: tuple[float, float]
    margin: float
    room: str
    pixel: float
    epoch: float
    uneven: float
    columns: bool
    manner: str


class Drive:
    """One drive: what was asked for, what happened, what was measured."""

    def __init__(self, name: str, t: Array, ov: Array, ow: Array, pose0: tuple[float, float, float]) -> None:
        self.name, self.t, self.ov, self.ow, self.pose0 = name, t, ov, ow, pose0
        self.edges, self.cov = np.append(t, t[-1] + DT), dict[str, Array]()
        self.tc, self.vc, self.wc = t[:1], np.zeros(1), np.zeros(1)
        self.x = self.y = self.th = self.stamp = self.px = self.py = self.pth = np.zeros(0)
        self.bad, self.ts, self.scans = np.zeros(0, bool), np.zeros(0), np.zeros((0, 0))


def coloured(rng: Rng, n: int, tau: float) -> Array:
    """A process of unit sd that forgets within tau."""
    a = float(np.exp(-DT / tau))
    e = rng.normal(size=n) * np.where(np.arange(n) > 0, np.sqrt(1 - a * a), 1.0)
    return np.asarray(lfilter([1.0], [1.0, -a], e))


def write_csv(path: Path, names: list[str], columns: list[Array], form: str = "%.6f") -> None:
    """A table with a header."""
    np.savetxt(path, np.column_stack(columns), form, ",", header=",".join(names), comments="")


F_POS, F_NEG = (1.32402, 0.127906), (2.07369, -0.108783)
S_POS, S_NEG = (-0.499211, 0.104181), (-0.469278, -0.169476)


def volts(v: Array, w: Array, law: str) -> tuple[Array, Array]:
    """Equations (1) and (2), the latter with turned intercepts if the law is `corrected`."""
    k = -1.0 if law == "corrected" else 1.0
    vf = np.where(v > 0, F_POS[0] * v + F_POS[1], np.where(v < 0, F_NEG[0] * v + F_NEG[1], 0.0))
    return vf, np.where(w > 0, S_POS[0] * w + k * S_POS[1], np.where(w < 0, S_NEG[0] * w + k * S_NEG[1], 0.0))


def _rates(vf: Array, vs: Array, w: Array, law: str) -> tuple[Array, Array]:
    v = np.maximum((vf - F_POS[1]) / F_POS[0], 0) + np.minimum((vf - F_NEG[1]) / F_NEG[0], 0)
    k = -1.0 if law == "corrected" else 1.0
    left, right = np.maximum((vs - k * S_POS[1]) / S_POS[0], 0), np.minimum((vs - k * S_NEG[1]) / S_NEG[0], 0)
    return v, left + right if law == "corrected" else np.where(w > 0, left, np.where(w < 0, right, 0.0))


def held(d: Drive, delay: float) -> tuple[Array, Array]:
    """The mean command over each step."""
    t = np.append(d.tc, max(d.edges[-1], d.tc[-1]) + 10)
    sums = [np.concatenate([[0.0], np.cumsum(c * np.diff(t))]) for c in (d.vc, d.wc)]
    v, w = (np.diff(np.interp(d.edges - delay, t, s)) / DT for s in sums)
    return v, w


def _lag(u: Array, tau: float) -> Array:
    a = float(np.exp(-DT / tau)) if tau > 0 else 0.0
    return np.asarray(lfilter([1 - a], [1.0, -a], u))


def _follow(u: Array, near: float, most: float) -> Array:
    out, y = [], 0.0
    for c in u.tolist():
        y += min(max(min(max(y, c - near), c + near) - y, -most), most)
        out.append(y)
    return np.asarray(out)


def series(d: Drive, name: str, heading: Array | None = None) -> Array:
    """A covariate along the drive, by the commands."""
    v, w = held(d, 0.0)
    if name == "heading":
        return d.th[:-1] if heading is None else heading
    if name == "time_since_rest":
        i = np.arange(len(v))
        return np.asarray((i - np.maximum.accumulate(np.where(np.abs(v) + np.abs(w) < 1e-6, i, 0))) * DT)
    return np.asarray(np.abs(v) if name == "abs_v" else d.t - d.t[0] if name == "time" else d.cov[name])


def curve(u: Array, p: dict[str, float]) -> Array:
    """The shape of what is in no catalogue: a wave or a bump over a covariate."""
    z = (u - p["mid"]) / p["wide"]
    return np.asarray(p["size"] * (np.sin(2 * np.pi * z) if p["wave"] > 0 else np.exp(-0.5 * (3 * z) ** 2)))


def _dead(v: Array, width: float, soft: bool) -> Array:
    if soft:
        return np.asarray(v * (1 - np.exp(-((v / max(width, 1e-6)) ** 2))))
    return np.asarray(np.sign(v) * np.maximum(np.abs(v) - width, 0.0))


def _by_voltage(lab: Lab, fx: Effects, v: Array, w: Array) -> tuple[Array, Array]:
    vf, vs = volts(v, w, lab.law)
    vs = vs + fx.p("base.cross_v_to_w", "share") * vf + fx.p("base.dac_zero_s", "offset")
    vf = vf + fx.p("base.dac_zero_f", "offset")
    step = fx.p("base.dac_quantisation", "step")
    if step > 0:
        part = np.trunc if fx.alt("base.dac_quantisation") else np.round
        vf, vs = step * part(vf / step), step * part(vs / step)
    corrected = (lab.law == "corrected") != bool(fx.get("base.steering_law"))
    return _rates(vf, vs, w, "corrected" if corrected else "published")


def _limits(fx: Effects, u: Array, axis: str) -> Array:
    """What may keep either rate from its command: curvature, saturation, lags, ramps."""
    bend, c = "base.curvature_" + axis, fx.p("base.curvature_" + axis, "curvature")
    u = u / (1 + np.maximum(c * np.abs(u), -0.9)) if fx.alt(bend) else u * (1 - c * np.abs(u))
    k = fx.p("base.saturation", "inverse_" + axis)
    if k > 0:
        u = u / (1 + (u * k) ** 6) ** (1 / 6) if fx.alt("base.saturation") else np.clip(u, -1 / k, 1 / k)
    if axis == "w" and fx.get("base.backlash"):
        play = fx.p("base.backlash", "play")
        if fx.alt("base.backlash"):
            up = np.append(0.0, np.diff(u))
            last = np.maximum.accumulate(np.where(np.abs(up) > 1e-9, np.arange(len(u)), 0))
            u = u - 0.5 * play * np.sign(up[last]) * (np.abs(u) > 1e-6)
        else:
            u = _follow(u, 0.5 * play, 99.0)
    lag = "base.lag_" + axis
    u = _lag(_lag(u, fx.p(lag, "tau") + fx.p("base.payload", "tau")), fx.p(lag, "tau") if fx.alt(lag) else 0.0)
    slow = fx.p("base.accel_limit", "slowness_" + axis)
    return _follow(u, 0.0, DT / slow) if slow > 0 else u


def _swing(v: Array, length: float, straight: bool) -> Array:
    """How far the casters have not yet turned since the last reversal, 1 to 0."""
    i, sign = np.arange(len(v)), np.sign(np.where(np.abs(v) > 1e-3, v, 0.0))
    held_sign = sign[np.maximum.accumulate(np.where(sign != 0, i, 0))]
    turned = np.append(False, (np.diff(held_sign) != 0) & (held_sign[:-1] != 0))
    j, s = np.maximum.accumulate(np.where(turned, i, -1)), np.cumsum(np.abs(v)) * DT
    gone = (s - s[np.maximum(j, 0)]) / length
    return np.where((j >= 0) & (sign != 0), np.maximum(1 - 0.5 * gone, 0) if straight else np.exp(-gone), 0.0)


def rates(lab: Lab, d: Drive, fx: Effects, heading: Array | None = None) -> tuple[Array, Array, Array]:
    """Forward speed, yaw rate and sideways speed without noise; heading None: that of the drive's own noise."""
    v, w = held(d, fx.p("base.delay", "delay"))
    v, w = _by_voltage(lab, fx, v, w) if lab.kind == "md100" else (v, w)
    slope = (F_POS[0], -S_POS[0]) if lab.kind == "md100" else (1.0, 1.0)
    v = _dead(v, fx.p("base.dead_zone_v", "width") / slope[0], fx.alt("base.dead_zone_v"))
    w = _dead(w, fx.p("base.dead_zone_w", "width") / slope[1], fx.alt("base.dead_zone_w"))
    since, sag = d.t - d.t[0], fx.p("base.battery_sag", "sag")
    tired = np.exp(-sag * since * since / 100) if fx.alt("base.battery_sag") else 1 - sag * since
    tired, back = tired * (1 - fx.p("base.payload", "droop")), fx.p("base.reverse_gain", "gain") * (v < 0)
    v = v * tired * (1 + fx.p("base.gain_v", "gain"))
    v = _limits(fx, v - 0.3 * lab.vmax * back if fx.alt("base.reverse_gain") else v * (1 + back), "v")
    a, k = fx.p("base.left_right_gain", "asymmetry"), fx.p("base.understeer", "k")
    side = np.where(w > 0, a, 0.0 if fx.alt("base.left_right_gain") else -a)
    w = w * tired * (1 + fx.p("base.gain_w", "gain")) * (1 + side)
    w = w * np.exp(-1.5 * k * np.abs(v) ** 1.5) if fx.alt("base.understeer") else w / (1 + k * v * v)
    w = _limits(fx, w, "w")
    w = w + fx.p("base.veer", "curvature") * v * (np.abs(v) / lab.vmax * 1.5 if fx.alt("base.veer") else 1.0)
    kick, odd = fx.get("base.caster_reversal"), fx.odd("base.w")
    if kick:
        w = w + kick.p["kick"] * _swing(v, kick.p["length"], kick.alt)
    if odd:
        w = w + curve(series(d, odd.covariate), odd.p) * (np.abs(v) + 0.3 * np.abs(w))
    if heading is None:
        heading = d.pose0[2] + np.cumsum(w + spread(lab.noise, v, w)[1] * d.ow) * DT
    u = -fx.p("base.lateral_slip", "c") * v * w * (np.abs(v) / lab.vmax * 2 if fx.alt("base.lateral_slip") else 1.0)
    on, odd = np.minimum(np.abs(v) / 0.05, 1), fx.odd("base.v")
    if odd:
        v = v + curve(series(d, odd.covariate, heading), odd.p) * np.abs(v)
    climb = fx.p("base.slope", "climb_x") * np.cos(heading) + fx.p("base.slope", "climb_y") * np.sin(heading)
    v = v + fx.p("base.cross_w_to_v", "lever") * (np.abs(w) if fx.alt("base.cross_w_to_v") else w)
    v = v - (np.maximum(climb, 0) * 1.5 if fx.alt("base.slope") else climb) * on
    return np.asarray(v), w, np.asarray(u)


def spread(n: Noise, v: Array, w: Array) -> tuple[Array, Array]:
    """The sd of the fluctuation of either rate."""
    on = np.minimum(np.abs(v) / 0.03 + np.abs(w) / 0.05, 1.0)
    sw = n.aw + n.bw * np.abs(w) + 0.5 * n.bw * np.abs(v)
    return np.asarray(on * (n.av + n.bv * np.abs(v))), np.asarray(on * sw)


def integrate(pose0: tuple[float, float, float], v: Array, w: Array, u: Array) -> Pose:
    """The path at the edges of the steps."""
    th = pose0[2] + np.concatenate([[0.0], np.cumsum(w) * DT])
    c, s = np.cos(0.5 * (th[1:] + th[:-1])), np.sin(0.5 * (th[1:] + th[:-1]))
    x, y = (np.concatenate([[0.0], np.cumsum(a) * DT]) for a in (v * c - u * s, v * s + u * c))
    return pose0[0] + x, pose0[1] + y, th


def simulate(lab: Lab, d: Drive, fx: Effects) -> None:
    """Fill in what happened, with the drive's own noise."""
    v, w, u = rates(lab, d, fx)
    sv, sw = spread(lab.noise, v, w)
    d.x, d.y, d.th = integrate(d.pose0, v + sv * d.ov, w + sw * d.ow, u)


def seen(d: Drive, fx: Effects, path: Pose, t: Array) -> Pose:
    """What a faultless reference says at times t of the path, with the hidden effects on it."""
    x, y, th = (np.interp(t, d.edges, c) for c in path)
    mx, my, odd = fx.p("base.marker_x", "x"), fx.p("base.marker_y", "y"), fx.odd("base.pose")
    x, y = x + mx * np.cos(th) - my * np.sin(th), y + mx * np.sin(th) + my * np.cos(th)
    if odd:
        off = curve(np.interp(t, d.edges, d.x if odd.covariate == "x" else d.y), odd.p)
        a = th - np.interp(t, d.edges, d.th) + (0.0 if odd.covariate == "x" else np.pi / 2)
        x, y = x + off * np.cos(a), y + off * np.sin(a)
    return x, y, th + fx.p("base.marker_yaw", "yaw")


def refer(rng: Rng, lab: Lab, d: Drive, fx: Effects) -> None:
    """Measure the poses: rows with jitter, gaps, a slow drift, and a few that are off."""
    r = lab.ref
    t = d.t[0] + 0.02 + np.cumsum(np.clip(rng.normal(1, 0.06, int((d.t[-1] - d.t[0]) * r.rate)), 0.5, 2)) / r.rate
    t = t[t < d.t[-1] - 0.05]
    keep = rng.random(len(t)) > rng.choice([0.0, 0.004, 0.02])
    for _ in range(rng.integers(0, 4)):
        a = rng.uniform(t[0] + 5, t[-1] - 5)
        keep &= ~((t > a) & (t < a + rng.uniform(0.2, 0.9)))
    t = t[keep]
    true, n = seen(d, fx, (d.x, d.y, d.th), t), len(t)
    slow = [np.interp(t, d.t, coloured(rng, len(d.t), r.tau)) for _ in range(3)]
    px, py = (true[k] + rng.normal(size=n) * r.sd_p + r.drift_p * slow[k] for k in (0, 1))
    pth, bad = true[2] + rng.normal(size=n) * r.sd_h + r.drift_h * slow[2], np.zeros(n, bool)
    off = rng.choice(n, int(rng.choice([0, 0, 1, 3])), replace=False)
    bad[off] = True
    px[off] += rng.choice([-1, 1], len(off)) * rng.uniform(0.05, 0.3, len(off))
    stamp = t + fx.p("base.clock_scale", "scale") * (t - d.t[0]) + rng.normal(size=n) * r.jitter
    o = np.argsort(stamp)
    d.stamp, d.px, d.py, d.pth, d.bad = stamp[o], px[o], py[o], pth[o], bad[o]
