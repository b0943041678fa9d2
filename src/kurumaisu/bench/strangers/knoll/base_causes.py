# SPDX-License-Identifier: BSD-3-Clause
"""Causes in a robot's drives and wheels and in its reference."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from kurumaisu.bench.strangers.knoll.signals import lag, play, ramp, shift, since_reversal
from kurumaisu.bench.strangers.knoll.things import Cause, Draw, Drive, Maker, Pose, Rates
from kurumaisu.types import FloatArray


def _on_axis(c: Cause, change: Callable[[FloatArray], FloatArray]) -> None:
    """Change the rate that the cause's name ends with."""
    if c.id.endswith("v"):
        c.rate = lambda x, v, w, u: (change(v), w, u)
    else:
        c.rate = lambda x, v, w, u: (v, change(w), u)


def _top(c: Cause, d: Draw) -> float:
    return d.scene.vmax if c.id.endswith("v") else d.scene.wmax


def _dac_zero_f(c: Cause, d: Draw) -> None:
    o = c.tell("offset", 0.012 * d.signed)
    c.volt = lambda x, f, s: (f + o * (np.tanh(np.abs(x.vc) / 0.2) if d.other else 1), s)


def _dac_zero_s(c: Cause, d: Draw) -> None:
    o = c.tell("offset", 0.012 * d.signed)
    c.volt = lambda x, f, s: (f, s + o * (1 + 0.3 * np.sign(x.wc) if d.other else 1))


def _dac_quantisation(c: Cause, d: Draw) -> None:
    o = c.tell("step", min(0.06 * d.size, 0.4))
    cut = np.trunc if d.other else np.round
    c.volt, c.order = lambda x, f, s: (cut(f / o) * o, cut(s / o) * o), 1


def _steering_law(c: Cause, d: Draw) -> None:
    c.tell("flip", 1)
    c.law = "corrected"
    if d.other:
        c.volt = lambda x, f, s: (f, 0.97 * s)


def _cross_v_to_w(c: Cause, d: Draw) -> None:
    o = c.tell("share", 0.02 * d.signed)
    c.volt = lambda x, f, s: (f, s + (o * f * np.abs(f) / 0.6 if d.other else o * f))


def _delay(c: Cause, d: Draw) -> None:
    o = c.tell("delay", 0.06 * d.size)
    c.rate, c.order = lambda x, v, w, u: (shift(v, o), shift(w, o * (1.25 if d.other else 1)), u), 2


def _dead_zone(c: Cause, d: Draw) -> None:
    z = min(0.03 * d.size * (0.7 if c.id.endswith("v") else 1.0), 0.35 * _top(c, d))
    if not d.scene.voltage:
        c.tell("width", z)

    def dead(x: FloatArray) -> FloatArray:
        return np.asarray(x - z * np.tanh(x / (0.7 * z)) if d.other else np.sign(x) * np.maximum(np.abs(x) - z, 0))

    _on_axis(c, dead)
    c.order = 3


def _backlash(c: Cause, d: Draw) -> None:
    o = c.tell("play", 0.04 * d.size)
    c.order = 3
    c.rate = lambda x, v, w, u: (v, 0.6 * play(w, o) + 0.4 * play(w, 1.8 * o) if d.other else play(w, o), u)


def _gain_v(c: Cause, d: Draw) -> None:
    o = c.tell("gain", 0.05 * d.signed)
    c.rate = lambda x, v, w, u: (v * (1 + o * (1.2 - 0.4 * (x.day + x.t) / 600 if d.other else 1)), w, u)


def _gain_w(c: Cause, d: Draw) -> None:
    o = c.tell("gain", 0.05 * d.signed)
    c.rate = lambda x, v, w, u: (v, w * (1 + o * (1 + 0.15 * np.sign(w) if d.other else 1)), u)


def _left_right_gain(c: Cause, d: Draw) -> None:
    o, wm = c.tell("asymmetry", 0.05 * d.signed), d.scene.wmax
    c.rate = lambda x, v, w, u: (v, w * (1 + o * (np.tanh(w / (0.2 * wm)) if d.other else np.sign(w))), u)


def _veer(c: Cause, d: Draw) -> None:
    o, wm = c.tell("curvature", 0.04 * d.signed), d.scene.wmax
    c.rate = lambda x, v, w, u: (v, w + o * v * (np.exp(-np.abs(w) / wm) * 1.3 if d.other else 1), u)


def _reverse_gain(c: Cause, d: Draw) -> None:
    o, vm = c.tell("gain", 0.1 * d.signed), d.scene.vmax

    def back(x: Drive, v: FloatArray, w: FloatArray, u: FloatArray) -> Rates:
        factor = 1 + o * (np.abs(v) / (0.15 * vm + np.abs(v)) if d.other else 1)
        return np.where(v < 0, v * factor, v), w, u

    c.rate = back


def _curvature(c: Cause, d: Draw) -> None:
    top = _top(c, d)
    o = c.tell("curvature", 0.09 * d.size / top)

    def bend(x: FloatArray) -> FloatArray:
        y = np.abs(x)
        return x * (1 - o * top * (y / top) ** 1.7) if d.other else x * (1 - o * y)

    _on_axis(c, bend)


def _saturation(c: Cause, d: Draw) -> None:
    kv, kw = (min(0.9, 0.8 / d.size**0.5) * top for top in (d.scene.vmax, d.scene.wmax))
    c.tell("inverse_v", 1 / kv)
    c.tell("inverse_w", 1 / kw)

    def cut(x: FloatArray, k: float) -> FloatArray:
        return np.asarray(x / (1 + (np.abs(x) / k) ** 6) ** (1 / 6) if d.other else np.clip(x, -k, k))

    c.rate, c.order = lambda x, v, w, u: (cut(v, kv), cut(w, kw), u), 6


def _battery_sag(c: Cause, d: Draw) -> None:
    o = c.tell("sag", 0.0009 * d.size)

    def left(t: FloatArray) -> FloatArray:
        return np.asarray(1 - 90 * o * (1 - np.exp(-t / 90)) if d.other else 1 - o * t)

    c.rate = lambda x, v, w, u: (v * left(x.t), w * left(x.t), u)


def _lag(c: Cause, d: Draw) -> None:
    o = c.tell("tau", 0.1 * d.size)
    _on_axis(c, lambda x: lag(x, o, d.other))
    c.order = 8


def _accel_limit(c: Cause, d: Draw) -> None:
    sv = c.tell("slowness_v", 0.9 * d.size / max(d.scene.vmax, 0.3))
    sw = c.tell("slowness_w", 0.6 * d.size / max(d.scene.wmax, 0.3))
    c.rate, c.order = lambda x, v, w, u: (ramp(v, sv, d.other), ramp(w, sw, d.other), u), 8


def _payload(c: Cause, d: Draw) -> None:
    k, tau = c.tell("droop", 0.05 * d.size), c.tell("tau", 0.09 * d.size)
    tau_w = tau * (1.3 if d.other else 1)
    c.rate, c.order = lambda x, v, w, u: (lag(v * (1 - k), tau, d.other), lag(w * (1 - k), tau_w, d.other), u), 8


def _process_noise(c: Cause, d: Draw) -> None:
    a, vm, wm = 2.5 * d.size, d.scene.vmax, d.scene.wmax
    if d.other:
        c.growth = lambda v, w: (1 + a * (v / vm) ** 2, 1 + a * (np.abs(w) / wm + np.abs(v) / vm) / 2)
    else:
        c.growth = lambda v, w: (1 + a * np.abs(v) / vm, 1 + a * np.abs(w) / wm)


def _understeer(c: Cause, d: Draw) -> None:
    low = min(d.scene.vmax, 1)
    o = c.tell("k", 0.1 * d.size / low**2)

    def under(x: Drive, v: FloatArray, w: FloatArray, u: FloatArray) -> Rates:
        if d.other:
            return v, w * (1 - 0.8 * o * low**0.5 * np.abs(v) ** 1.5 / (1 + o * v**2)), u
        return v, w / (1 + o * v**2), u

    c.rate, c.order = under, 9


def _caster_reversal(c: Cause, d: Draw) -> None:
    k, length = c.tell("kick", 0.12 * d.signed), c.tell("length", float(d.rng.uniform(0.15, 0.4)))

    def kick(x: Drive, v: FloatArray, w: FloatArray, u: FloatArray) -> Rates:
        far = since_reversal(v)
        if d.other:
            shape = np.where(far < length * 2, np.cos(np.minimum(far / (2 * length), 1) * np.pi / 2), 0)
            return v, w + k * shape * (np.abs(v) / (np.abs(v) + 0.02)), u
        return v, w + k * np.exp(-far / length) * (v != 0), u

    c.rate, c.order = kick, 9


def _lateral_slip(c: Cause, d: Draw) -> None:
    o = c.tell("c", 0.025 * d.size * (1 if d.scene.vmax > 0.4 else 3))
    c.rate = lambda x, v, w, u: (v, w, u - o * v * w * (np.minimum(1, (v * w / 0.1) ** 2) if d.other else 1))
    c.order = 9


def _slope(c: Cause, d: Draw) -> None:
    a, m, vm = d.rng.uniform(0, 2 * np.pi), 0.025 * d.size, d.scene.vmax

    def pull(_x: Any, _y: Any, th: Any, v: Any, w: Any) -> tuple[Any, Any]:
        down = m * np.cos(th - a)
        return v + np.where(np.abs(v) > 0.01, down * (np.sqrt(np.abs(v) / vm) if d.other else 1.0), 0.0), w

    c.place = pull


def _cross_w_to_v(c: Cause, d: Draw) -> None:
    o = c.tell("lever", 0.035 * d.signed)
    c.rate = lambda x, v, w, u: (v + o * (np.abs(w) ** 1.5 * np.sign(w) if d.other else w), w, u)
    c.order = 9


def _marker(c: Cause, d: Draw) -> None:
    name = c.id.removeprefix("base.marker_")
    k = ("x", "y", "yaw").index(name)
    c.marker = np.zeros(3)
    c.marker[k] = m = c.tell(name, (0.035, 0.035, 0.025)[k] * d.signed)

    def swing(t: FloatArray, _x: FloatArray, _y: FloatArray, th: FloatArray) -> Pose:
        a = 0.35 * m * np.sin(t / 17.0)
        if k == 2:
            return 0 * a, 0 * a, a
        along = a * (k == 0), a * (k == 1)
        cos, sin = np.cos(th), np.sin(th)
        return along[0] * cos - along[1] * sin, along[0] * sin + along[1] * cos, 0 * a

    c.warp = swing if d.other else None


def _clock_scale(c: Cause, d: Draw) -> None:
    c.clock = 0.004 * d.signed


_DRIVES = (
    *(_dac_zero_f, _dac_zero_s, _dac_quantisation, _steering_law, _delay, _dead_zone, _dead_zone, _backlash),
    *(_cross_v_to_w, _gain_v, _gain_w, _left_right_gain, _veer, _reverse_gain, _curvature, _curvature, _saturation),
    *(_battery_sag, _lag, _lag, _accel_limit, _payload, _process_noise, _understeer, _caster_reversal, _lateral_slip),
    *(_slope, _cross_w_to_v, _marker, _marker, _marker, _clock_scale),
)
_NAMES = (
    "dac_zero_f dac_zero_s dac_quantisation steering_law delay dead_zone_v dead_zone_w backlash cross_v_to_w gain_v "
    "gain_w left_right_gain veer reverse_gain curvature_v curvature_w saturation battery_sag lag_v lag_w accel_limit "
    "payload process_noise understeer caster_reversal lateral_slip slope cross_w_to_v marker_x marker_y marker_yaw "
    "clock_scale"
)
MAKERS: dict[str, Maker] = dict(zip(_NAMES.split(), _DRIVES, strict=True))
