# SPDX-License-Identifier: BSD-3-Clause
"""The chair as a chain of blocks on a 2 ms grid: transport, converter, nonlinearity, dynamics, floor, reference."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

Arr = NDArray[np.float64]
DT = 0.002
TWO_PI = 2.0 * np.pi
A_F, B_F = (1.32402, 2.07369), (0.127906, -0.108783)  # slope and intercept for v > 0 and v < 0
A_S, B_S = (-0.499211, -0.469278), (0.104181, -0.169476)


@dataclass(frozen=True, eq=False)
class Cause:
    """One hidden cause: its parameters, and those of them (keys) that grow with its size."""

    id: str
    p: dict[str, float]
    keys: tuple[str, ...]
    form: str = "plain"

    def scaled(self, factor: float) -> Cause:
        """The same cause, stronger by a factor."""
        return replace(self, p={k: x * factor if k in self.keys else x for k, x in self.p.items()})


@dataclass
class Run:
    """What was asked for on the grid, from where, and when the chair was stuck."""

    v: Arr
    w: Arr
    pose0: Arr
    start: float  # seconds since the recording began
    free: Arr  # 0 while the chair stands against a wall
    columns: dict[str, Arr] = field(default_factory=dict)

    @property
    def t(self) -> Arr:
        """Time since the start of this run."""
        return np.arange(len(self.v)) * DT


@dataclass
class Path:
    """Rates and poses on the grid; pose[k] holds at t[k]."""

    v: Arr
    w: Arr
    pose: Arr  # n x 3


@dataclass
class Signals:
    """What runs through the blocks."""

    run: Run
    vc: Arr
    wc: Arr
    floor: Arr  # poses at which the floor is read
    vf: Arr = field(default_factory=lambda: np.zeros(0))
    vs: Arr = field(default_factory=lambda: np.zeros(0))
    v: Arr = field(default_factory=lambda: np.zeros(0))
    w: Arr = field(default_factory=lambda: np.zeros(0))
    side: Arr = field(default_factory=lambda: np.zeros(0))

    @property
    def moving(self) -> Arr:
        """One while something is commanded."""
        return np.asarray((self.vc != 0) | (self.wc != 0), dtype=np.float64)

    @property
    def distance(self) -> Arr:
        """Distance driven since the start of the run."""
        return np.asarray(np.cumsum(np.abs(self.v)) * DT)


Effect = Callable[[Signals, Cause], None]


def since(mark: NDArray[np.bool_], clock: Arr) -> Arr:
    """How far the clock went since the mark was last set (a large number before)."""
    return np.asarray(clock - np.maximum.accumulate(np.where(mark, clock, -1e3)))


def reversals(v: Arr) -> NDArray[np.bool_]:
    """Where the direction of travel is another than the last one that was not zero."""
    sign = np.sign(v)
    last = np.maximum.accumulate(np.where(sign != 0, np.arange(len(v)), 0))
    held = sign[last]
    before = np.concatenate([[0.0], held[:-1]])
    return np.asarray((held * before) < 0)


def lag(u: Arr, tau: float, second: bool = False) -> Arr:
    """First-order lag, or a second-order one that overshoots with about the same delay."""
    if not second:
        a = float(np.exp(-DT / max(tau, 1e-4)))
        return np.asarray(lfilter([1 - a], [1.0, -a], u))
    k, zeta = DT * 0.9 / max(tau, 1e-3), 0.45
    den = [1.0, -2.0 + 2 * zeta * k, 1.0 - 2 * zeta * k + k * k]
    return np.asarray(lfilter([0.0, 0.0, k * k], den, u))


def ramp(u: Arr, up: float, down: float) -> Arr:
    """Follow u with limited slopes: `up` away from zero, `down` towards it."""
    y, out = 0.0, []
    for target in u.tolist():
        step = (up if target * y >= 0 and abs(target) > abs(y) else down) * DT
        y += min(max(target - y, -step), step)
        out.append(y)
    return np.array(out)


def play(u: Arr, width: float, soft: bool) -> Arr:
    """The play operator; soft: its edge is a spring."""
    y, out, half = 0.0, [], 0.5 * width
    for x in u.tolist():
        gap = x - y
        if abs(gap) > half:
            y += gap - np.sign(gap) * half
        elif soft:
            y += gap * DT / 0.8
        out.append(y)
    return np.array(out)


def _delay(s: Signals, c: Cause) -> None:
    late = np.full(len(s.vc), c.p["delay"])
    if c.form == "other":  # the buffer fills and empties
        late *= 1.0 + np.sin(TWO_PI * s.run.t / 11.0)
    index = np.clip(((s.run.t - late) / DT + 0.5).astype(int), 0, None)
    s.vc, s.wc = s.vc[index], s.wc[index]


def _dac_step(s: Signals, c: Cause) -> None:
    cut = np.trunc if c.form == "other" else np.round
    s.vf, s.vs = cut(s.vf / c.p["step"]) * c.p["step"], cut(s.vs / c.p["step"]) * c.p["step"]


def _cross_vw(s: Signals, c: Cause) -> None:
    s.vs = s.vs + c.p["share"] * (s.vf if c.form == "plain" else np.maximum(np.abs(s.vf) - 0.5, 0) * np.sign(s.vf) * 3)


def _zero_s(s: Signals, c: Cause) -> None:
    s.vs = s.vs + c.p["offset"] * (s.wc != 0)


def _zero_f(s: Signals, c: Cause) -> None:
    s.vf = s.vf + c.p["offset"]


def convert(s: Signals) -> None:
    """Rates to volts by the published law."""
    v, w = s.vc, s.wc
    s.vf = np.where(v > 0, A_F[0] * v + B_F[0], np.where(v < 0, A_F[1] * v + B_F[1], 0.0))
    s.vs = np.where(w > 0, A_S[0] * w + B_S[0], np.where(w < 0, A_S[1] * w + B_S[1], 0.0))


def invert(s: Signals) -> None:
    """Volts to rates by the same law; the commanded sign says which branch of the steering law holds."""
    s.v = np.maximum((s.vf - B_F[0]) / A_F[0], 0.0) + np.minimum((s.vf - B_F[1]) / A_F[1], 0.0)
    b = np.where(s.wc > 0, B_S[0], np.where(s.wc < 0, B_S[1], 0.0))
    s.w = (s.vs - b) / np.where(s.wc < 0, A_S[1], A_S[0])
    s.side = np.zeros(len(s.v))


def _steering_law(s: Signals, c: Cause) -> None:
    s.w = np.maximum((s.vs + B_S[0]) / A_S[0], 0.0) + np.minimum((s.vs + B_S[1]) / A_S[1], 0.0)


def dead(u: Arr, width: float, soft: bool) -> Arr:
    """Take the width off a signal's size; soft: with a round corner."""
    size = np.abs(u)
    left = size - width * (1 - np.exp(-size / width)) if soft else np.maximum(size - width, 0.0)
    return np.asarray(np.sign(u) * left)


def _dead_v(s: Signals, c: Cause) -> None:
    a = np.where(s.v > 0, A_F[0], A_F[1])
    s.v = dead(s.v * a, c.p["width"], c.form == "other") / a


def _dead_w(s: Signals, c: Cause) -> None:
    a = np.abs(np.where(s.w > 0, A_S[0], A_S[1]))
    s.w = dead(s.w * a, c.p["width"], c.form == "other") / a


def _backlash(s: Signals, c: Cause) -> None:
    s.w = play(s.w, c.p["play"], c.form == "other")


def _gain_v(s: Signals, c: Cause) -> None:
    s.v = s.v * (1 + c.p["gain"])


def _gain_w(s: Signals, c: Cause) -> None:
    s.w = s.w * (1 + c.p["gain"])


def _left_right(s: Signals, c: Cause) -> None:
    high = np.clip((np.abs(s.w) - 0.2) / 0.2, 0, 1) if c.form == "other" else 1.0
    s.w = s.w * (1 + c.p["asymmetry"] * np.sign(s.w) * high)


def _reverse(s: Signals, c: Cause) -> None:
    more = np.minimum(s.v, 0.0) if c.form == "plain" else np.where(s.v < 0, -0.2 * np.tanh(-s.v / 0.1), 0.0)
    s.v = s.v + c.p["gain"] * more


def _curve_v(s: Signals, c: Cause) -> None:
    s.v = s.v * (1 - c.p["curvature"] * (np.abs(s.v) if c.form == "plain" else 4 * np.abs(s.v) ** 4))


def _curve_w(s: Signals, c: Cause) -> None:
    s.w = s.w * (1 - c.p["curvature"] * (np.abs(s.w) if c.form == "plain" else 2 * np.abs(s.w) ** 4))


def _saturation(s: Signals, c: Cause) -> None:
    for name in ("v", "w"):
        inverse = c.p.get("inverse_" + name, 0.0)
        u = getattr(s, name)
        if inverse > 0:
            soft = u / (1 + np.abs(u * inverse) ** 4) ** 0.25
            setattr(s, name, np.clip(u, -1 / inverse, 1 / inverse) if c.form == "plain" else soft)


def _sag(s: Signals, c: Cause) -> None:
    t = s.run.t
    end = t[-1]
    fall = (
        c.p["sag"] * t
        if c.form == "plain"
        else c.p["sag"] * end * 3 * np.clip((t - 0.7 * end) / (0.3 * end), 0, 1) ** 2
    )
    s.v, s.w = s.v * (1 - fall), s.w * (1 - fall)


def _understeer(s: Signals, c: Cause) -> None:
    k = c.p["k"] * s.v**2
    s.w = s.w / (1 + k) if c.form == "plain" else s.w * (1 - 0.35 * c.p["k"] * np.clip((np.abs(s.v) - 0.3) / 0.1, 0, 1))


def _lag_v(s: Signals, c: Cause) -> None:
    s.v = lag(s.v, c.p["tau"], c.form == "other")


def _lag_w(s: Signals, c: Cause) -> None:
    s.w = lag(s.w, c.p["tau"], c.form == "other")


def _accel(s: Signals, c: Cause) -> None:
    for name in ("v", "w"):
        slow = c.p.get("slowness_" + name, 0.0)
        if slow > 0:  # other: brakes bite at once
            setattr(s, name, ramp(getattr(s, name), 1 / slow, 1 / slow if c.form == "plain" else 1e3))


def _payload(s: Signals, c: Cause) -> None:
    if c.form == "plain":
        s.v, s.w = s.v * (1 - c.p["droop"]), s.w * (1 - c.p["droop"])
        s.v, s.w = lag(s.v, c.p["tau"]), lag(s.w, c.p["tau"])
    else:  # the load swings
        s.v, s.w = (
            lag(s.v * (1 - c.p["droop"]), c.p["tau"], True),
            lag(s.w * (1 - c.p["droop"]), 1.6 * c.p["tau"], True),
        )


def _veer(s: Signals, c: Cause) -> None:
    s.w = s.w + c.p["curvature"] * (s.v if c.form == "plain" else 2.5 * np.maximum(s.v, 0) ** 2)


def _cross_wv(s: Signals, c: Cause) -> None:
    s.v = s.v + c.p["lever"] * (s.w if c.form == "plain" else np.abs(s.w) * s.w * 1.5)


def _caster(s: Signals, c: Cause) -> None:
    d = since(reversals(s.v), s.distance)
    x = d / c.p["length"]
    swing = np.exp(-x) if c.form == "plain" else np.where(x < 3, np.sin(np.pi * np.clip(x / 3, 0, 1)), 0.0)
    s.w = s.w + c.p["kick"] * swing * (s.v != 0) * (d < 100)


def _slip(s: Signals, c: Cause) -> None:
    s.side = s.side - c.p["c"] * (s.v * s.w if c.form == "plain" else 6 * np.abs(s.w) * s.w * s.v**2)


def _slope(s: Signals, c: Cause) -> None:
    climb = c.p["climb_x"] * np.cos(s.floor[:, 2]) + c.p["climb_y"] * np.sin(s.floor[:, 2])
    s.v = s.v - (climb if c.form == "plain" else 1.6 * np.maximum(climb, 0)) * (np.abs(s.v) > 0.01)


CONVERTER: dict[str, Effect] = {
    "base.cross_v_to_w": _cross_vw, "base.dac_zero_f": _zero_f, "base.dac_zero_s": _zero_s,
    "base.dac_quantisation": _dac_step,
}  # fmt: skip
RATES: dict[str, Effect] = {
    "base.steering_law": _steering_law, "base.dead_zone_v": _dead_v, "base.dead_zone_w": _dead_w,
    "base.backlash": _backlash, "base.gain_v": _gain_v, "base.gain_w": _gain_w, "base.left_right_gain": _left_right,
    "base.reverse_gain": _reverse, "base.curvature_v": _curve_v, "base.curvature_w": _curve_w,
    "base.understeer": _understeer, "base.saturation": _saturation, "base.battery_sag": _sag, "base.payload": _payload,
    "base.lag_v": _lag_v, "base.lag_w": _lag_w, "base.accel_limit": _accel, "base.veer": _veer,
    "base.cross_w_to_v": _cross_wv, "base.caster_reversal": _caster, "base.lateral_slip": _slip, "base.slope": _slope,
}  # fmt: skip
ODD: dict[str, Effect] = {}  # effects of no catalogue: odd.py


def rates(run: Run, causes: list[Cause], floor: Arr) -> Signals:
    """Run the commands through the blocks; no noise."""
    s = Signals(run, run.v, run.w, floor)
    by_id = {c.id: c for c in causes}
    if "base.delay" in by_id:
        _delay(s, by_id["base.delay"])
    convert(s)
    for block in (CONVERTER, RATES, ODD):
        for name in block:
            if name in by_id:
                block[name](s, by_id[name])
        if block is CONVERTER:
            invert(s)
    return s


def integrate(run: Run, s: Signals, noise: Arr | None) -> Path:
    """Midpoint rule at the fixed step; noise is n x 3 (forward, yaw, sideways)."""
    n = np.zeros((len(s.v), 3)) if noise is None else noise[: len(s.v)]
    v, w, side = (s.v + n[:, 0]) * run.free, (s.w + n[:, 1]) * run.free, (s.side + n[:, 2]) * run.free
    turned = np.concatenate([[0.0], np.cumsum(w)]) * DT
    th = run.pose0[2] + turned
    mid = th[:-1] + 0.5 * DT * w
    x = run.pose0[0] + np.concatenate([[0.0], np.cumsum(v * np.cos(mid) - side * np.sin(mid))]) * DT
    y = run.pose0[1] + np.concatenate([[0.0], np.cumsum(v * np.sin(mid) + side * np.cos(mid))]) * DT
    return Path(v, w, np.stack([x, y, th], axis=1)[:-1])


def simulate(run: Run, causes: list[Cause], noise: Arr | None, floor: Arr | None = None, passes: int = 4) -> Path:
    """The path; where the floor matters and its pose is not given, it is found by repetition."""
    if floor is not None:
        return integrate(run, rates(run, causes, floor), noise)
    path = integrate(run, rates(run, [], np.tile(run.pose0, (len(run.v), 1))), noise)
    again = any(c.id == "base.slope" or "place" in c.p for c in causes)
    for _ in range(passes if again else 1):
        path = integrate(run, rates(run, causes, path.pose), noise)
    return path


def measure(path: Path, t: Arr, causes: list[Cause]) -> Arr:
    """What a perfect reference would write at the stamps t (since the start of the run): m x 3."""
    marker = [0.0, 0.0]
    odd: list[Cause] = []
    for c in causes:
        if c.id == "base.clock_scale":  # other: the clock is set right in steps
            t = t / (1 + c.p["scale"]) if c.form == "plain" else t - c.p["scale"] * 8 * np.floor(t / 8.0)
        marker[0] += c.p["x"] if c.id == "base.marker_x" else 0.0
        marker[1] += c.p["y"] if c.id == "base.marker_y" else 0.0
        odd += [c] if c.id.startswith("odd.ref") else []
    grid = np.arange(len(path.v)) * DT
    x, y, th = (np.interp(t, grid, path.pose[:, i]) for i in range(3))
    x, y = x + marker[0] * np.cos(th) - marker[1] * np.sin(th), y + marker[0] * np.sin(th) + marker[1] * np.cos(th)
    for c in odd:
        if c.id == "odd.ref_heading":  # a compass with deviation
            th = th + c.p["a"] * np.sin(th + c.p["phase"])
        else:  # a lens that was not calibrated
            x = x + c.p["a"] * np.sin(TWO_PI * x / c.p["length"] + c.p["phase"])
    return np.stack([x, y, th], axis=1)


def increments(rows: Arr) -> Arr:
    """From row to row, in the body frame of the earlier one: (m - 1) x 3."""
    d = np.diff(rows, axis=0)
    c, s = np.cos(rows[:-1, 2]), np.sin(rows[:-1, 2])
    return np.stack([c * d[:, 0] + s * d[:, 1], c * d[:, 1] - s * d[:, 0], d[:, 2]], axis=1)
