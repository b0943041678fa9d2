# SPDX-License-Identifier: BSD-3-Clause
"""What can be hidden in the base: each changes voltages or rates in place; its other form is another equation."""

from __future__ import annotations

import numpy as np
from scipy.signal import lfilter

from kurumaisu.bench.strangers.loess import robots
from kurumaisu.bench.strangers.loess.values import STEP, Array, Effect, Hidden, Rates


def _later(x: Array, t: Array, delay: float) -> Array:
    return np.asarray(np.interp(t - delay, t, x, left=0.0))


def _lagged(x: Array, tau: float) -> Array:
    keep = np.exp(-STEP / max(tau, 1e-3))
    return np.asarray(lfilter([1 - keep], [1, -keep], x))


def _moving(m: Rates) -> Array:
    return np.asarray(np.clip(np.maximum(np.abs(m.v) / 0.03, np.abs(m.w) / 0.05), 0, 1))


def delay(m: Rates, h: Hidden) -> None:
    """Commands take effect later; otherwise the yaw rate waits a little longer than the speed."""
    early, late = (h.size, h.size) if not h.other else (0.8 * h.size, 1.3 * h.size)
    m.cmd_v, m.cmd_w = _later(m.cmd_v, m.t, early), _later(m.cmd_w, m.t, late)


def dac_zero_f(m: Rates, h: Hidden) -> None:
    """An offset of the translation voltage; otherwise it fades as the voltage grows."""
    if m.f is not None:
        m.f = m.f + h.size * (1.25 / (1 + (m.f / 2.0) ** 2) if h.other else 1.0)


def dac_zero_s(m: Rates, h: Hidden) -> None:
    """An offset of the steering voltage; otherwise it fades as the voltage grows."""
    if m.s is not None:
        m.s = m.s + h.size * (1.25 / (1 + (m.s / 0.8) ** 2) if h.other else 1.0)


def dac_quantisation(m: Rates, h: Hidden) -> None:
    """Steps of the converter; otherwise steps that are rounded towards 0 V."""
    for name in ("f", "s"):
        volt = getattr(m, name)
        if volt is not None:
            steps = volt / h.size
            setattr(m, name, h.size * (np.fix(steps) if h.other else np.round(steps)))


def cross_v_to_w(m: Rates, h: Hidden) -> None:
    """The translation voltage leaks into the steering; otherwise as its square root saturates."""
    if m.f is not None and m.s is not None:
        leak = m.f if not h.other else 1.3 * m.f / np.sqrt(1 + (m.f / 1.2) ** 2)
        m.s = m.s + h.size * leak


def steering_law(m: Rates, h: Hidden) -> None:
    """The chair has the other intercepts; otherwise not quite the other ones."""
    if m.s is not None:
        m.law = "corrected"
        m.s = m.s + (0.015 * np.sign(m.s) if h.other else 0.0)


def _shrunk(x: Array, width: float, other: bool) -> Array:
    size = np.abs(x)
    if other:
        return np.asarray(np.sign(x) * (np.sqrt(size**2 + (0.3 * width) ** 2) - 0.3 * width) * (size > width * 0.6))
    return np.asarray(np.sign(x) * np.maximum(size - width, 0))


def _cut(x: Array, width: float, other: bool) -> Array:
    rise = np.clip(np.abs(x) / (0.5 * width) - 1, 0, 1) if other else (np.abs(x) > width).astype(float)
    return np.asarray(x * rise)


def dead_zone_v(m: Rates, h: Hidden) -> None:
    """Small speeds are swallowed and all are less by that; otherwise only the small ones are, and softly."""
    m.v = _cut(m.v, 2.2 * h.size, True) if h.other else _shrunk(m.v, h.size, False)


def dead_zone_w(m: Rates, h: Hidden) -> None:
    """Small yaw rates are swallowed and all are less by that; otherwise with a soft knee."""
    m.w = _shrunk(m.w, h.size, h.other)


def backlash(m: Rates, h: Hidden) -> None:
    """Play of the yaw rate; otherwise it is taken up slowly."""
    out, half = np.zeros(m.w.size), h.size / 2
    creep = 0.02 if h.other else 0.0
    now = 0.0
    for i, asked in enumerate(m.w.tolist()):
        now = min(max(now, asked - half), asked + half)
        now += creep * (asked - now)
        out[i] = now
    m.w = np.where((m.w == 0) & (m.v == 0), 0.0, out)


def gain_v(m: Rates, h: Hidden) -> None:
    """A gain of the speed; otherwise a little less in reverse."""
    m.v = m.v * (1 + h.size * np.where(h.other & (m.v < 0), 0.7, 1.0))


def gain_w(m: Rates, h: Hidden) -> None:
    """A gain of the yaw rate; otherwise a little less to the left."""
    m.w = m.w * (1 + h.size * np.where(h.other & (m.w > 0), 0.8, 1.0))


def left_right_gain(m: Rates, h: Hidden) -> None:
    """Left turns more, right turns less; otherwise with a smooth change between the sides."""
    side = np.tanh(m.w / 0.12) if h.other else np.sign(m.w)
    m.w = m.w * (1 + h.size * side)


def veer(m: Rates, h: Hidden) -> None:
    """Each metre bends the path; otherwise reverse bends it less."""
    m.w = m.w + h.size * m.v * np.where(h.other & (m.v < 0), 0.6, 1.0)


def reverse_gain(m: Rates, h: Hidden) -> None:
    """A gain in reverse; otherwise one that grows from standstill."""
    onset = 1.15 * (1 - np.exp(-np.abs(m.v) / 0.08)) if h.other else 1.0
    m.v = np.where(m.v < 0, m.v * (1 + h.size * onset), m.v)


def curvature_v(m: Rates, h: Hidden) -> None:
    """The gain falls with the speed; otherwise by another power."""
    m.v = m.v * (1 - h.size * np.abs(m.v) ** (1.7 if h.other else 1.0))


def curvature_w(m: Rates, h: Hidden) -> None:
    """The gain falls with the yaw rate; otherwise by another power."""
    m.w = m.w * (1 - h.size * np.abs(m.w) ** (1.7 if h.other else 1.0))


def _limited(x: Array, most: float, soft: bool) -> Array:
    if soft:
        return np.asarray(x / (1 + (np.abs(x) / most) ** 7) ** (1 / 7))
    return np.clip(x, -most, most)


def saturation(m: Rates, h: Hidden) -> None:
    """Rates have a ceiling; otherwise one that is rounded. The size is what is cut of the greatest rates."""
    m.v = _limited(m.v, (1 - h.size) * 0.75, h.other)
    m.w = _limited(m.w, (1 - h.size) * 0.85, h.other)


def battery_sag(m: Rates, h: Hidden) -> None:
    """All slows down during a drive; otherwise quickly first and then less."""
    gone = m.t if not h.other else 70 * (1 - np.exp(-m.t / 60))
    m.v, m.w = m.v * (1 - h.size * gone), m.w * (1 - h.size * gone)


def _slow(x: Array, tau: float, other: bool) -> Array:
    return 0.65 * _lagged(x, 0.6 * tau) + 0.35 * _lagged(x, 2 * tau) if other else _lagged(x, tau)


def lag_v(m: Rates, h: Hidden) -> None:
    """A first-order lag; otherwise two time constants."""
    m.v = _slow(m.v, h.size, h.other)


def lag_w(m: Rates, h: Hidden) -> None:
    """A first-order lag; otherwise two time constants."""
    m.w = _slow(m.w, h.size, h.other)


def _ramped(x: Array, up: float, down: float) -> Array:
    out, now = np.zeros(x.size), 0.0
    for i, goal in enumerate(x.tolist()):
        most = (up if abs(goal) > abs(now) else down) * STEP
        now += min(max(goal - now, -most), most)
        out[i] = now
    return out


def accel_limit(m: Rates, h: Hidden) -> None:
    """Ramps; otherwise it brakes better than it accelerates."""
    brake = 1.8 if h.other else 1.0
    m.v = _ramped(m.v, 1 / h.size, brake / h.size)
    m.w = _ramped(m.w, 2 / h.size, 2 * brake / h.size)


def payload(m: Rates, h: Hidden) -> None:
    """Slower and later; otherwise the heavier the faster it is asked to go."""
    tau = 0.1 + 2 * h.size
    drop = h.size * (1.4 * np.abs(m.v) ** 0.3 if h.other else 1.0)
    m.v, m.w = _lagged(m.v * (1 - drop), tau), _lagged(m.w * (1 - drop), tau)


def understeer(m: Rates, h: Hidden) -> None:
    """Turns less when fast; otherwise by another power of the speed."""
    m.w = m.w * (1 - 0.8 * h.size * np.abs(m.v) ** 1.3) if h.other else m.w / (1 + h.size * m.v**2)


def caster_reversal(m: Rates, h: Hidden) -> None:
    """A swing after each reversal that dies out with the way; otherwise it ends after a certain way."""
    sign = np.sign(np.where(np.abs(m.v) > 0.02, m.v, 0.0))
    moving = np.flatnonzero(sign)
    since = np.full(m.v.size, 50.0)
    if moving.size:
        turned = moving[1:][np.diff(sign[moving]) != 0]
        way = np.cumsum(np.abs(m.v)) * STEP
        last = np.searchsorted(turned, np.arange(m.v.size), side="right") - 1
        if turned.size:
            since = np.where(last >= 0, way - way[turned[np.maximum(last, 0)]], 50.0)
    length = 0.15 + 0.2 * h.extra
    shape = np.clip(1.2 - since / (1.8 * length), 0, 1) if h.other else np.exp(-since / length)
    m.w = m.w + h.size * shape * (sign != 0)


def lateral_slip(m: Rates, h: Hidden) -> None:
    """It drifts outwards in curves; otherwise more than in proportion to the speed."""
    m.side = m.side - h.size * m.w * m.v * (np.sqrt(np.abs(m.v) / 0.4) if h.other else 1.0)


def slope(m: Rates, h: Hidden) -> None:
    """Slower uphill, faster downhill; otherwise the hill takes a share of the speed."""
    a = m.pose[:, 2] - 2 * np.pi * h.extra
    m.v = m.v - h.size * np.cos(a) * (np.abs(m.v) / 0.45 if h.other else _moving(m) * (np.abs(m.v) > 0))


def cross_w_to_v(m: Rates, h: Hidden) -> None:
    """Turning moves the chair by a lever; otherwise the same way for both sides."""
    m.v = m.v + h.size * (np.abs(m.w) if h.other else m.w)


def law_of(m: Rates) -> None:
    """Turn voltages back into rates."""
    if m.f is not None and m.s is not None:
        m.v, m.w = robots.rates(m.law, m.f, m.s, m.cmd_w)


BASE: dict[str, Effect] = {
    "base.delay": Effect(delay, "command", 0.06, 0.25, False, "delay"),
    "base.dac_zero_f": Effect(dac_zero_f, "volt", 0.012, 0.05, True, "offset", True),
    "base.dac_zero_s": Effect(dac_zero_s, "volt", 0.01, 0.035, True, "offset", True),
    "base.dac_quantisation": Effect(dac_quantisation, "volt", 0.03, 0.08, False, "step", True),
    "base.cross_v_to_w": Effect(cross_v_to_w, "volt", 0.015, 0.05, True, "share", True),
    "base.steering_law": Effect(steering_law, "volt", 1.0, 1.0, False, "", True),
    "base.dead_zone_v": Effect(dead_zone_v, "rate", 0.02, 0.06, False),
    "base.dead_zone_w": Effect(dead_zone_w, "rate", 0.03, 0.08, False),
    "base.gain_v": Effect(gain_v, "rate", 0.03, 0.12, True, "gain"),
    "base.gain_w": Effect(gain_w, "rate", 0.03, 0.12, True, "gain"),
    "base.left_right_gain": Effect(left_right_gain, "rate", 0.03, 0.1, True, "asymmetry"),
    "base.veer": Effect(veer, "rate", 0.02, 0.08, True, "curvature"),
    "base.reverse_gain": Effect(reverse_gain, "rate", 0.1, 0.3, True, "gain"),
    "base.curvature_v": Effect(curvature_v, "rate", 0.08, 0.25, False, "curvature"),
    "base.curvature_w": Effect(curvature_w, "rate", 0.06, 0.2, False, "curvature"),
    "base.saturation": Effect(saturation, "rate", 0.12, 0.35, False),
    "base.battery_sag": Effect(battery_sag, "rate", 0.0007, 0.002, False, "sag"),
    "base.payload": Effect(payload, "rate", 0.04, 0.12, False),
    "base.understeer": Effect(understeer, "rate", 0.15, 0.5, False, "k"),
    "base.backlash": Effect(backlash, "slow", 0.04, 0.12, False, "play"),
    "base.lag_v": Effect(lag_v, "slow", 0.12, 0.4, False, "tau"),
    "base.lag_w": Effect(lag_w, "slow", 0.1, 0.35, False, "tau"),
    "base.accel_limit": Effect(accel_limit, "slow", 1.2, 3.0, False),
    "base.cross_w_to_v": Effect(cross_w_to_v, "path", 0.02, 0.08, True, "lever"),
    "base.lateral_slip": Effect(lateral_slip, "path", 0.04, 0.15, False, "c"),
    "base.slope": Effect(slope, "path", 0.015, 0.05, False),
    "base.caster_reversal": Effect(caster_reversal, "path", 0.1, 0.35, True, "kick"),
}
