# SPDX-License-Identifier: BSD-3-Clause
"""Effects of the base: converters, motors, wheels, floor, and whatever measures the chair; usual and other form."""

from dataclasses import replace
from typing import Any

import numpy as np
from scipy.signal import lfilter

from kurumaisu.bench.strangers.loch.motion import CATALOGUE, DT, Array, Effect, Hidden, State

Out = dict[str, Any]


def low_pass(a: Array, tau: float, order: int = 1) -> Array:
    """First-order lags in a row, of the same total time."""
    p = float(np.exp(-DT / max(tau / order, 1e-4)))
    for _ in range(order):
        a = np.asarray(lfilter([1 - p], [1, -p], a), dtype=np.float64)
    return a


def _later(s: State, k: float, h: Hidden) -> Out:
    """A pure delay, or a controller that looks at the joystick now and then."""
    if h.form:
        when = np.floor(s.t / max(2 * k, DT)) * max(2 * k, DT)
        return {c: getattr(s, c)[np.clip((when / DT).astype(int), 0, None)] for c in ("cv", "cw")}
    return {c: np.interp(s.t - k, s.t, getattr(s, c), left=0.0) for c in ("cv", "cw")}


def _steering(s: State, k: float, h: Hidden) -> Out:
    """The other intercepts, in other form somewhat smaller; between them the chair does not turn."""
    assert s.law is not None
    b, f = s.law.steering, 1.0 - k * (1.8 if h.form else 2.0)
    b = replace(b, up=(b.up[0], b.up[1] * f), down=(b.down[0], b.down[1] * f))
    side = np.where(s.fs < b.up[1], 1.0, np.where(s.fs > b.down[1], -1.0, 0.0))
    return {"law": s.law._replace(steering=b), "cw": side if b.up[1] < b.down[1] else s.cw}


def _dead(s: State, k: float, h: Hidden, axis: str) -> Out:
    """Dead zone that takes its width off, in volts where there are any; other form: smooth, as grease does it."""
    r = s.v if axis == "v" else s.w
    d = k / (s.law.translation if axis == "v" else s.law.steering).slope(r) if s.law else k + 0 * r
    return {axis: np.sign(r) * (np.sqrt(r**2 + d**2) - d if h.form else np.maximum(np.abs(r) - d, 0))}


def _play(s: State, k: float, h: Hidden) -> Out:
    """Play between joystick and yaw; other form: the flank is taken up softly."""
    out, y, last = np.empty_like(s.w), 0.0, 0.0
    for i, u in enumerate(s.w.tolist()):
        y += (u - last) * 0.5 if h.form and abs(u - y) < k / 2 else 0.0
        y = min(max(y, u - k / 2), u + k / 2)
        last, out[i] = u, y
    return {"w": out * s.moving}


def _ramp(a: Array, limit: float) -> Array:
    """A signal that changes no faster than the limit."""
    out, y, step = np.empty_like(a), 0.0, limit * DT
    for i, u in enumerate(a.tolist()):
        y += min(max(u - y, -step), step)
        out[i] = y
    return out


def _ramps(s: State, k: float, h: Hidden) -> Out:
    """Ramps of the power module; other form: with rounded ends."""
    soft = 0.06 * k if h.form else 0.0
    return {"v": low_pass(_ramp(s.v, 1 / k), soft, 2), "w": low_pass(_ramp(s.w, 2 / k), soft, 2)}


def noise_factor(s: State, h: Hidden) -> Array:
    """By how much the noise is larger, at each step: with the rates, or with their squares as casters shimmy."""
    return np.asarray(1 + h.size * (4 * s.v**2 + 2 * s.w**2 if h.form else np.hypot(s.v / 0.4, s.w / 0.6)))


def _casters(s: State, k: float, h: Hidden) -> Out:
    """Casters swing round over a length of way; other form: as fast as they roll, with a bulge."""
    length, way, last, out = 0.15 + 0.25 * h.u[0], 1e9, 0.0, np.zeros_like(s.v)
    for i, v in enumerate(s.v.tolist()):
        way = 0.0 if v * last < 0 else way + abs(v) * DT
        last = v if abs(v) > 0.01 else last
        out[i] = way / length * np.exp(1 - way / length) * min(abs(v) / 0.3, 1) if h.form else np.exp(-way / length)
    return {"w": s.w + k * out * (np.abs(s.v) > 0.005)}


def _slope(s: State, k: float, h: Hidden) -> Out:
    """A floor that falls to one side; other form: what the motors lose up they do not gain down."""
    assert s.guide is not None
    up = np.cos(s.guide.th - 2 * np.pi * h.u[0]) * np.sign(s.v)
    return {"v": s.v - k * np.where((up < 0) & (h.form > 0), 0.6 * up, up) * np.sign(s.v) * (np.abs(s.v) > 0.01)}


def _sag(s: State, k: float, h: Hidden) -> Out:
    """Voltage falls by the time, or in other form by the way that was driven."""
    share = 1 - k * (np.cumsum(np.abs(s.v) + 0.3 * np.abs(s.w)) * DT / 0.3 if h.form else s.t)
    return {"v": s.v * share, "w": s.w * share}


def _clock(p: Any, k: float, h: Hidden) -> Out:
    """A quartz that is off; other form: one that gets worse as it warms."""
    when = p.t + k * (p.t + h.form * p.t**2 / 80)
    return {c: np.interp(when, p.t, getattr(p, c)) for c in ("x", "y", "th")}


def _marker(p: Any, x: Array | float, y: Array | float) -> Out:
    """A marker elsewhere on the chair."""
    c, s = np.cos(p.th), np.sin(p.th)
    return {"x": p.x + x * c - y * s, "y": p.y + x * s + y * c}


def enter(into: dict[str, Effect], prefix: str, heads: str, words: str, law: Any) -> None:
    """Enters an effect: stage, name, parameter, sizes, flags, largest size, each - if there is none."""
    stage, name, key, sizes, flags, largest = heads.split()
    into[prefix + name] = Effect(
        stage,
        law,
        tuple(float(a) for a in sizes.split(",")),
        key.strip("-"),
        words,
        flags.strip("-"),
        float(largest.replace("-", "inf")),
    )


for _heads, _words, _f in (
    ("command delay delay .05,.15 + -", "a buffer, or slow polling of the joystick", _later),
    (
        "volt dac_zero_f offset .03 v -",
        "translation's zero is off, or breathes",
        lambda s, k, h: {"fv": s.fv + k * (1 + h.form * 0.3 * np.sin(s.t * (0.15 + 0.1 * h.u[0]))) * (s.cv != 0)},
    ),
    (
        "volt dac_zero_s offset .03 v -",
        "steering's zero is off, or breathes",
        lambda s, k, h: {"fs": s.fs + k * (1 + h.form * 0.3 * np.sin(s.t * (0.15 + 0.1 * h.u[0]))) * (s.cw != 0)},
    ),
    (
        "volt dac_quantisation step .05,.1,.15 v+ -",
        "coarse codes, rounded or cut",
        lambda s, k, h: {c: (np.floor if h.form else np.round)(getattr(s, c) / k) * k for c in ("fv", "fs")},
    ),
    ("volt steering_law flip 1,.05 v+ -", "the intercepts have the other sign", _steering),
    (
        "volt cross_v_to_w share .03 v -",
        "translation leaks into steering, or up to a limit",
        lambda s, k, h: {"fs": s.fs + k * (0.5 * np.tanh(s.fv / 0.5) if h.form else s.fv)},
    ),
    ("rate dead_zone_v width .03,.1 + -", "wider dead zone, or smooth", lambda s, k, h: _dead(s, k, h, "v")),
    ("rate dead_zone_w width .02,.06 + -", "wider dead zone, or smooth", lambda s, k, h: _dead(s, k, h, "w")),
    ("rate backlash - .05,.2 + -", "play, or with soft flanks", _play),
    (
        "rate gain_v gain .05 - -",
        "wrong radius, or growing slowly",
        lambda s, k, h: {"v": s.v * (1 + k * (np.abs(s.v) / 0.4) ** (0.3 * h.form))},
    ),
    (
        "rate gain_w gain .05 - -",
        "wrong track, or growing slowly",
        lambda s, k, h: {"w": s.w * (1 + k * (np.abs(s.w) / 0.5) ** (0.3 * h.form))},
    ),
    (
        "rate left_right_gain - .05 - -",
        "left by 1+k, right by 1-k, or one side, by and by",
        lambda s, k, h: {"w": s.w * (1 + k * (1 / (1 + np.exp(-s.w / 0.15)) if h.form else np.sign(s.w)))},
    ),
    (
        "rate veer curvature .05 - -",
        "a smaller wheel, or a soft tyre that gives way more at speed",
        lambda s, k, h: {"w": s.w + k * s.v * (np.abs(s.v) / 0.4) ** (0.5 * h.form)},
    ),
    (
        "rate reverse_gain gain .1 - -",
        "another gain in reverse, or coming with the speed",
        lambda s, k, h: {"v": s.v * (1 + k * (s.v < 0) * (np.tanh(np.abs(s.v) / 0.15) if h.form else 1))},
    ),
    (
        "rate curvature_v curvature .1 + -",
        "gain falls, or as friction shares it",
        lambda s, k, h: {"v": s.v / (1 + k * np.abs(s.v) ** 1.3) if h.form else s.v * (1 - k * np.abs(s.v))},
    ),
    (
        "rate curvature_w curvature .1 + -",
        "gain falls, or as tyres scrub",
        lambda s, k, h: {"w": s.w / (1 + k * np.abs(s.w) ** 1.3) if h.form else s.w * (1 - k * np.abs(s.w))},
    ),
    (
        "rate saturation - 2,3 + -",
        "a current limit, or with a round knee",
        lambda s, k, h: {
            c: a / (1 + np.abs(a / m) ** 6) ** (1 / 6) if h.form else np.clip(a, -m, m)
            for c, a, m in (("v", s.v, 1 / k), ("w", s.w, 1.3 / k))
        },
    ),
    ("rate battery_sag sag .001 + -", "weaker by the time, or by the way", _sag),
    (
        "rate understeer k .2 + -",
        "casters push outwards with v^2, or v^1.5",
        lambda s, k, h: {"w": s.w / (1 + k * (0.6 * np.abs(s.v) ** 1.5 if h.form else s.v**2))},
    ),
    (
        "rate cross_w_to_v - .03 - -",
        "either turn makes it creep, or the more so the faster it is",
        lambda s, k, h: {"v": s.v + k * (s.w**2 / 0.5 if h.form else np.abs(s.w))},
    ),
    ("lag lag_v tau .1,.3 + -", "mass, or of 2nd order", lambda s, k, h: {"v": low_pass(s.v, k, 1 + h.form)}),
    ("lag lag_w tau .1,.3 + -", "inertia, or of 2nd order", lambda s, k, h: {"w": low_pass(s.w, k, 1 + h.form)}),
    ("lag accel_limit slowness_v .7,1.5 + -", "ramps, or with rounded ends", _ramps),
    (
        "lag payload droop .05 + -",
        "a heavy person: droop and lag, or of 2nd order",
        lambda s, k, h: {c: low_pass(getattr(s, c) * (1 - k), (2 + h.form / 2) * k, 1 + h.form) for c in ("v", "w")},
    ),
    ("lag caster_reversal - .2 - -", "casters swing round, or with a bulge", _casters),
    (
        "plane process_noise - .5 + -",
        "noise grows with the rates, or their squares",
        lambda s, k, h: {c: getattr(s, c) * noise_factor(s, h) for c in ("nv", "nw")},
    ),
    (
        "plane lateral_slip c .05 - -",
        "outwards, or once the tyres creep",
        lambda s, k, h: {
            "vy": -k * (np.sign(s.w * s.v) * np.maximum(np.abs(s.v * s.w) - 0.05, 0) * 1.6 if h.form else s.v * s.w)
        },
    ),
    ("plane slope - .02 +p -", "the floor falls to one side, or more is lost than gained", _slope),
    (
        "reference marker_x x .05 - -",
        "marker before the axle, or on a pole that leans",
        lambda p, k, h: _marker(p, k * (1 - h.form * 0.25 * np.gradient(low_pass(p.v, 0.2), DT)), 0.0),
    ),
    (
        "reference marker_y y .05 - -",
        "marker on an armrest, or one that gives way in curves",
        lambda p, k, h: _marker(p, 0.0, k * (1 + h.form * 0.6 * low_pass(p.v * p.w, 0.2))),
    ),
    (
        "reference marker_yaw yaw .05 - -",
        "marker turned, or its tape creeps",
        lambda p, k, h: {"th": p.th + k * (1 + h.form * 0.3 * np.sin(p.t / 25 + 6 * h.u[0]))},
    ),
    ("reference clock_scale - .003 - -", "a quartz is off, or ever more", _clock),
):
    enter(CATALOGUE, "base.", _heads, _words, _f)
