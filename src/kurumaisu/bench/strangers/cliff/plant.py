# SPDX-License-Identifier: BSD-3-Clause
"""The chair: effects on its rates, two wheels, and their integration by RK4."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.signal import cont2discrete, lfilter

from .drives import Run
from .values import STEP, TRACK, Array, Cause


@dataclass
class State:
    """What the effects work on: mean rates over each step."""

    run: Run
    v: Array
    w: Array
    side: Array  # lateral speed
    mark: Array  # where the reference's marker is

    @property
    def heading(self) -> Array:
        """Heading at the start of each step."""
        return self.run.pose0[2] + STEP * (np.cumsum(self.w) - self.w)

    @property
    def moving(self) -> Array:
        """1 where the chair drives or turns."""
        return ((np.abs(self.v) > 1e-3) | (np.abs(self.w) > 1e-3)).astype(float)

    @property
    def place(self) -> Array:
        """Place at the start of each step, as rates are now."""
        return integrate(self.run, self.v, self.w, self.side)[:-1, :2]


def law_f(v: Array) -> Array:
    """Equation (1)."""
    return np.where(v > 0, 1.32402 * v + 0.127906, np.where(v < 0, 2.07369 * v - 0.108783, 0.0))


def law_s(w: Array) -> Array:
    """Equation (2), as published."""
    return np.where(w > 0, -0.499211 * w + 0.104181, np.where(w < 0, -0.469278 * w - 0.169476, 0.0))


def _volts_v(s: State, more: Array) -> None:
    """Add a voltage to V_f; the chair stays in its branch, or stands in the dead zone."""
    new = s.v + more / np.where(s.v >= 0, 1.32402, 2.07369)
    s.v = np.where(new * s.v > 0, new, 0.0)


def _volts_w(s: State, more: Array, always: bool = False) -> None:
    """Add a voltage to V_s; at rest (0 V) nothing follows, unless always."""
    new = s.w + more / np.where(s.w >= 0, -0.499211, -0.469278)
    s.w = np.where((new * s.w > 0) | ((s.w == 0) & always), new, 0.0)


def _hold(x: Array, tau: float) -> Array:
    """First-order lag of a stepwise signal: its mean over each step, exact."""
    a = float(np.exp(-STEP / tau))
    y, _ = lfilter([0.0, 1.0 - a], [1.0, -a], x, zi=[x[0]])
    return np.asarray(x + (y - x) * (1.0 - a) * tau / STEP)


def _second(x: Array, tau: float) -> Array:
    """Second-order lag of the same delay, damping 0.5."""
    f = 1.0 / tau  # 2 zeta / f = tau
    b, a, _ = cont2discrete(([f * f], [1.0, f, f * f]), STEP)
    y = np.asarray(lfilter(b[0], a, x))
    return np.asarray(0.5 * (y + np.append(y[1:], y[-1])))


def _lag(x: Array, tau: float, other: bool) -> Array:
    return _second(x, tau) if other else _hold(x, tau)


def _ramp(x: Array, slow: float, other: bool) -> Array:
    """Change limited to 1/slow; other: braking is not limited."""
    out, y, most = np.empty_like(x), 0.0, STEP / slow
    for k, aim in enumerate(x.tolist()):
        step = aim - y
        if not (other and aim * y >= 0 and abs(aim) < abs(y)):
            step = min(max(step, -most), most)
        out[k] = y + 0.5 * step
        y += step
    return out


def _play(x: Array, play: float) -> Array:
    """Play of that full width."""
    out, y, half = np.empty_like(x), 0.0, 0.5 * play
    for k, aim in enumerate(x.tolist()):
        y = 0.0 if aim == 0.0 else min(max(y, aim - half), aim + half)
        out[k] = y
    return out


def _shift(x: Array, delay: Array | float) -> Array:
    """The signal of `delay` before."""
    total = np.concatenate([[0.0], np.cumsum(x)])
    edge = np.arange(len(x) + 1) - np.asarray(delay) / STEP
    return np.asarray(np.diff(np.interp(edge, np.arange(len(total)), total)))


def since(flag: Array, measure: Array) -> Array:
    """What `measure` has grown by since the flag was last raised (infinite before)."""
    last = np.maximum.accumulate(np.where(flag, np.arange(len(flag)), -1))
    return np.where(last >= 0, measure - measure[np.maximum(last, 0)], np.inf)


def reversals(v: Array) -> Array:
    """True at the first step after a change of the sense of travel."""
    out = np.zeros(len(v), bool)
    go = np.flatnonzero(np.abs(v) > 1e-3)
    out[go[1:][np.sign(v[go[1:]]) != np.sign(v[go[:-1]])]] = True
    return out


def _delay(s: State, a: float, c: Cause) -> None:
    # other: a controller that falls behind: the delay grows through the drive, up to twice its mean
    d: Array | float = a * np.append(s.run.t, s.run.t[-1]) * 2.0 / s.run.t[-1] if c.other else a
    s.v, s.w = _shift(s.v, d), _shift(s.w, d)


def _clock(s: State, a: float, c: Cause) -> None:
    t = STEP * np.arange(len(s.v) + 1)
    d = a * (t if not c.other else 15.0 * (1.0 - np.cos(t / 8.0)))  # other: the clock is steered to and fro
    s.v, s.w = _shift(s.v, d), _shift(s.w, d)


def _steps(s: State, a: float, c: Cause) -> None:
    volts = law_f(s.v), law_s(s.w)
    step = [a * (1.0 + np.abs(u)) if c.other else a for u in volts]  # other: steps that grow with the voltage
    f, g = (q * np.rint(u / q) - u for u, q in zip(volts, step, strict=True))
    _volts_v(s, f)
    _volts_w(s, g)


def _dead_v(s: State, a: float, c: Cause) -> None:
    # other: soft corner: the loss fades as the chair gets faster
    _volts_v(s, -np.sign(s.v) * a * (np.exp(-np.abs(s.v) / 0.25) * 2.0 if c.other else 1.0))


def _dead_w(s: State, a: float, c: Cause) -> None:
    _volts_w(s, np.sign(s.w) * a * (np.exp(-np.abs(s.w) / 0.3) * 2.0 if c.other else 1.0))


def _leak(s: State, a: float, c: Cause) -> None:
    f = law_f(s.v)
    _volts_w(s, a * (f * np.abs(f) if c.other else f), always=True)


def _veer(s: State, a: float, c: Cause) -> None:
    """Unequal wheels; other: the tyre grows with speed."""
    share = a * TRACK / 2.0 * (np.abs(s.v) / 0.4 if c.other else 1.0)
    left, right = s.v - s.w * TRACK / 2, s.v + s.w * TRACK / 2
    left, right = left * (1.0 - share), right * (1.0 + share)
    s.v, s.w = (left + right) / 2, (right - left) / TRACK


def _gain_v(s: State, a: float, c: Cause) -> None:
    s.v = s.v * (1.0 + a * (np.exp(-((s.v / 0.45) ** 4)) if c.other else 1.0))  # other: fades at speed


def _gain_w(s: State, a: float, c: Cause) -> None:
    s.w = s.w * (1.0 + a * (np.exp(-((s.w / 0.5) ** 4)) if c.other else 1.0))


def _sides(s: State, a: float, c: Cause) -> None:
    s.w = s.w * (1.0 + 0.5 * a * np.sign(s.w) * (4.0 * np.abs(s.w) * (np.abs(s.w) > 0.4) if c.other else 1.0))


def _reverse(s: State, a: float, c: Cause) -> None:
    s.v = np.where(s.v < 0, s.v * (1.0 + a * (4.0 * np.abs(s.v) if c.other else 1.0)), s.v)


def _bend_v(s: State, a: float, c: Cause) -> None:
    s.v = s.v * (1.0 - a * (3.0 * np.abs(s.v) ** 3 if c.other else np.abs(s.v)))


def _bend_w(s: State, a: float, c: Cause) -> None:
    s.w = s.w * (1.0 - a * (3.0 * np.abs(s.w) ** 3 if c.other else np.abs(s.w)))


def _saturate(s: State, a: float, c: Cause) -> None:
    name = "w" if c.more.get("turn") else "v"
    x, top = getattr(s, name), c.more.get("top", 0.8)
    # plain: a clip at 1 - a of the largest rate of these drives; other: tanh
    setattr(
        s,
        name,
        np.tanh(2.0 * a * x / top) * top / (2.0 * a) if c.other else np.clip(x, (a - 1.0) * top, (1.0 - a) * top),
    )


def _sag(s: State, a: float, c: Cause) -> None:
    t, end = s.run.t, s.run.t[-1]
    fade = 60.0 * a / (1.0 + np.exp(-(t - 0.75 * end) / 2.0)) if c.other else a * t  # other: it collapses late
    s.v, s.w = s.v * (1.0 - fade), s.w * (1.0 - fade)


def _lever(s: State, a: float, c: Cause) -> None:
    s.v = s.v + a * (np.abs(s.w) * np.sign(s.v) if c.other else s.w)  # other: only while it drives, either way


def _load(s: State, a: float, c: Cause) -> None:
    tau = a * c.more.get("tau_per", 2.0)
    s.v, s.w = (_lag(x * (1.0 - a), tau, c.other) for x in (s.v, s.w))


def _under(s: State, a: float, c: Cause) -> None:
    s.w = s.w * (1.0 - 0.1 * a * np.tanh((s.v / 0.3) ** 2)) if c.other else s.w / (1.0 + a * s.v**2)


def _caster(s: State, a: float, c: Cause) -> None:
    gone = since(reversals(s.v), STEP * np.cumsum(np.abs(s.v)))
    length = c.more.get("length", 0.25)
    # other: the casters stay across for a while, then flip
    shape = (
        (gone < 1.5 * length) * np.sin(np.pi * np.minimum(gone / (1.5 * length), 1.0))
        if c.other
        else np.exp(-gone / length)
    )
    s.w = s.w + a * shape * (np.abs(s.v) > 1e-3)


def _slip(s: State, a: float, c: Cause) -> None:
    force = s.v * s.w
    s.side = s.side - a * (0.1 * np.tanh(force / 0.06) if c.other else force)


def _slope(s: State, a: float, c: Cause) -> None:
    on = s.place[:, 0] > 0 if c.other else 1.0  # other: a ramp in half of the room
    th = s.heading - c.more.get("uphill", 0.0)
    s.v = s.v - a * np.cos(th) * (np.abs(s.v) > 1e-3) * on


def _both_lag(s: State, a: float, c: Cause) -> None:
    if c.id.endswith("v"):
        s.v = _lag(s.v, a, c.other)
    else:
        s.w = _lag(s.w, a, c.other)


def _accel(s: State, a: float, c: Cause) -> None:
    if "w" not in c.more:
        s.v = _ramp(s.v, a, c.other)
    if "v" not in c.more:
        s.w = _ramp(s.w, 0.5 * a, c.other)


def _backlash(s: State, a: float, c: Cause) -> None:
    s.w = _play(s.w, a)


def _mark_x(s: State, a: float, c: Cause) -> None:
    s.mark = s.mark + np.array([a, 0.0])


def _mark_y(s: State, a: float, c: Cause) -> None:
    s.mark = s.mark + np.array([0.0, a])


def _zero_f(s: State, a: float, c: Cause) -> None:
    _volts_v(s, a * np.ones_like(s.v) * (s.run.t / s.run.t[-1] * 2.0 if c.other else 1.0))  # other: drifts


def _zero_s(s: State, a: float, c: Cause) -> None:
    _volts_w(s, a * np.ones_like(s.v) * (s.run.t / s.run.t[-1] * 2.0 if c.other else 1.0))


Effect = Callable[[State, float, Cause], None]
# in the order in which they act, with a typical size
EFFECTS: dict[str, tuple[Effect, float]] = {
    "base.clock_scale": (_clock, 0.002),
    "base.delay": (_delay, 0.04),
    "base.dac_zero_f": (_zero_f, 0.01),
    "base.dac_zero_s": (_zero_s, 0.01),
    "base.dac_quantisation": (_steps, 0.03),
    "base.cross_v_to_w": (_leak, 0.01),
    "base.dead_zone_v": (_dead_v, 0.02),
    "base.dead_zone_w": (_dead_w, 0.02),
    "base.backlash": (_backlash, 0.03),
    "base.saturation": (_saturate, 0.15),
    "base.gain_v": (_gain_v, 0.03),
    "base.gain_w": (_gain_w, 0.03),
    "base.left_right_gain": (_sides, 0.03),
    "base.reverse_gain": (_reverse, 0.05),
    "base.curvature_v": (_bend_v, 0.05),
    "base.curvature_w": (_bend_w, 0.05),
    "base.battery_sag": (_sag, 0.001),
    "base.payload": (_load, 0.03),
    "base.understeer": (_under, 0.1),
    "base.accel_limit": (_accel, 0.5),
    "base.lag_v": (_both_lag, 0.06),
    "base.lag_w": (_both_lag, 0.06),
    "base.veer": (_veer, 0.01),
    "base.cross_w_to_v": (_lever, 0.01),
    "base.caster_reversal": (_caster, 0.05),
    "base.lateral_slip": (_slip, 0.02),
    "base.slope": (_slope, 0.01),
    "base.marker_x": (_mark_x, 0.02),
    "base.marker_y": (_mark_y, 0.02),
}
# effects that a machine has with one sign only
ONE_SIDED = "delay dac_quantisation dead_zone_v dead_zone_w backlash saturation payload accel_limit lag_v lag_w"
ONE_SIDED += " battery_sag curvature_v curvature_w understeer lateral_slip range_noise incidence_noise tilt"
SIGNED = set((ONE_SIDED + " beam_correlation").split())


def rates(run: Run, causes: Sequence[Cause], extra: dict[str, Effect] | None = None) -> State:
    """Commands turned into rates by the model's law and by what is hidden."""
    s = State(run, run.v.copy(), run.w.copy(), np.zeros_like(run.v), np.zeros(2))
    for name, (effect, _) in EFFECTS.items():
        for c in causes:
            if c.id == name:
                effect(s, c.size, c)
    for c in causes:
        if extra and c.id in extra:
            extra[c.id](s, c.size, c)
    if len(run.stuck):
        s.v, s.w, s.side = (np.where(run.stuck, 0.0, x) for x in (s.v, s.w, s.side))
    return s


def integrate(run: Run, v: Array, w: Array, side: Array) -> Array:
    """Pose at the edges of the steps: RK4 with each wheel's speed held over a step."""
    left, right = v - w * TRACK / 2, v + w * TRACK / 2
    v, w = (left + right) / 2, (right - left) / TRACK
    th = run.pose0[2] + STEP * np.concatenate([[0.0], np.cumsum(w)])
    x, y = 0.0, 0.0
    for weight, part in ((1, 0.0), (4, 0.5), (1, 1.0)):  # the two middle stages are equal here
        a = th[:-1] + part * STEP * w
        x = x + weight / 6 * (v * np.cos(a) - side * np.sin(a))
        y = y + weight / 6 * (v * np.sin(a) + side * np.cos(a))
    px, py = (p + STEP * np.concatenate([[0.0], np.cumsum(d)]) for p, d in zip(run.pose0[:2], (x, y), strict=True))
    return np.column_stack([px, py, th])


def at(path: Array, t: Array, mark: Array | None = None) -> Array:
    """Poses at times, of the marker if one is given."""
    grid = STEP * np.arange(len(path))
    out = np.column_stack([np.interp(t, grid, path[:, k]) for k in range(3)])
    if mark is not None:
        c, s = np.cos(out[:, 2]), np.sin(out[:, 2])
        out[:, 0] += c * mark[0] - s * mark[1]
        out[:, 1] += s * mark[0] + c * mark[1]
    return out
