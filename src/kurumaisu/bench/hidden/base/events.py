# SPDX-License-Identifier: BSD-3-Clause
"""Hidden faults that change what the controller makes of a command: volts, thresholds, gains."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from kurumaisu.bench.hidden.generator import laws
from kurumaisu.bench.hidden.generator.motion import Events, Sizes
from kurumaisu.types import FloatArray

TRACK = 0.54  # [m] between the drive wheels
Made = Events


def dac_zero_f(e: Events, s: Sizes) -> Made:
    """V_f off by `size` [V], read on the branch that was meant."""
    volt = laws.volts(e.v, laws.TRANSLATION) + s["size"]
    return replace(e, v=np.where(e.v == 0, 0.0, laws.rates(volt, np.sign(e.v), laws.TRANSLATION)))


def dac_zero_s(e: Events, s: Sizes) -> Made:
    """V_s off by `size` [V], read on the branch that was meant."""
    volt = laws.volts(e.w, laws.STEERING) + s["size"]
    return replace(e, w=np.where(e.w == 0, 0.0, laws.rates(volt, np.sign(e.w), laws.STEERING)))


def dac_quantisation(e: Events, s: Sizes) -> Made:
    """Both voltages on a grid of `size` [V]."""
    v_f, v_s = (
        np.rint(laws.volts(r, axis) / s["size"]) * s["size"] if s["size"] > 0 else laws.volts(r, axis)
        for r, axis in ((e.v, laws.TRANSLATION), (e.w, laws.STEERING))
    )
    v = np.where(e.v == 0, 0.0, laws.rates(v_f, np.sign(e.v), laws.TRANSLATION))
    w = np.where(e.w == 0, 0.0, laws.rates(v_s, np.sign(e.w), laws.STEERING))
    return replace(e, v=v, w=w)


def dac_truncation(e: Events, s: Sizes) -> Made:
    """Both voltages on a grid of `size` [V]: with `cut` the next level towards 0, else half a step more (mid-rise)."""
    step = max(s["size"], 1e-9)

    def cut(volt: FloatArray) -> FloatArray:
        return np.asarray(np.sign(volt) * (np.floor(np.abs(volt) / step) * step + (1 - s["cut"]) * step / 2))

    v_f, v_s = cut(laws.volts(e.v, laws.TRANSLATION)), cut(laws.volts(e.w, laws.STEERING))
    v = np.where(e.v == 0, 0.0, laws.rates(v_f, np.sign(e.v), laws.TRANSLATION))
    w = np.where(e.w == 0, 0.0, laws.rates(v_s, np.sign(e.w), laws.STEERING))
    return replace(e, v=v, w=w)


def steering_law(e: Events, s: Sizes) -> Made:
    """The chair has equation (2) with both intercepts of the other sign: V_s beyond its dead zone, else nothing."""
    volt = laws.volts(e.w, laws.STEERING)
    (up, at_up), (down, at_down) = laws.STEERING
    left = np.maximum((volt + at_up) / up, 0.0)
    right = np.minimum((volt + at_down) / down, 0.0)
    return replace(e, w=np.where(volt == 0, 0.0, np.where(volt < 0, left, right)))


def sign(e: Events, s: Sizes) -> Made:
    """One of: v reversed (0), w reversed (1), swapped (2), w in degrees taken for radians (3)."""
    kind = int(s["kind"])
    v, w = (e.w, e.v) if kind == 2 else (e.v, e.w)
    return replace(e, v=-v if kind == 0 else v, w=-w if kind == 1 else w * (np.pi / 180 if kind == 3 else 1.0))


def delay(e: Events, s: Sizes) -> Made:
    """All commands `size` [s] later."""
    return replace(e, t=e.t + s["size"])


def _shrunk(rate: FloatArray, width: float, axis: laws.Axis, rounding: float) -> FloatArray:
    """Return rates whose volts beyond the threshold are less by a width; rounding: of the corner, in widths."""
    slope, _ = laws.branch(np.sign(rate), axis)
    over = np.abs(slope * rate)  # [V] beyond the threshold
    if rounding == 0 or width <= 0:
        left = np.maximum(over - width, 0.0)
    else:
        soft = rounding * width
        hyperbola = (over - width + np.hypot(over - width, soft)) / 2
        left = np.maximum(hyperbola - (np.hypot(width, soft) - width) / 2, 0.0)
    return np.asarray(np.sign(rate) * left / np.abs(slope))


def dead_zone_v(e: Events, s: Sizes) -> Made:
    """A threshold of V_f higher by `size` [V]."""
    return replace(e, v=_shrunk(e.v, s["size"], laws.TRANSLATION, 0.0))


def dead_zone_w(e: Events, s: Sizes) -> Made:
    """A threshold of V_s higher by `size` [V]."""
    return replace(e, w=_shrunk(e.w, s["size"], laws.STEERING, 0.0))


def soft_zone_v(e: Events, s: Sizes) -> Made:
    """A threshold of V_f higher by `size` [V], its corner a hyperbola."""
    return replace(e, v=_shrunk(e.v, s["size"], laws.TRANSLATION, 0.5))


def soft_zone_w(e: Events, s: Sizes) -> Made:
    """A threshold of V_s higher by `size` [V], its corner a hyperbola."""
    return replace(e, w=_shrunk(e.w, s["size"], laws.STEERING, 0.5))


def backlash(e: Events, s: Sizes) -> Made:
    """Play of width `size` [rad/s]: w is dragged along by the command."""
    half, at, out = s["size"] / 2, 0.0, np.empty_like(e.w)
    for i, goal in enumerate(e.w):
        at = min(max(at, goal - half), goal + half)
        out[i] = at
    return replace(e, w=np.where((e.v != 0) | (e.w != 0), out, 0.0))


def presliding(e: Events, s: Sizes) -> Made:
    """Play of width about `size` [rad/s] as Dahl's friction: the lag behind the command saturates exponentially."""
    half, before, behind, out = s["size"] / 2, 0.0, 0.0, np.empty_like(e.w)
    for i, goal in enumerate(e.w):
        change = goal - before
        limit = half * np.sign(change)
        if half > 0:
            behind = limit + (behind - limit) * np.exp(-1.5 * abs(change) / half) if change else behind
        out[i], before = goal - behind, goal
    return replace(e, w=np.where((e.v != 0) | (e.w != 0), out, 0.0))


def gain_v(e: Events, s: Sizes) -> Made:
    """Wheels larger by a share `size`, as far as driving goes."""
    return replace(e, v=e.v + s["size"] * e.v)


def gain_w(e: Events, s: Sizes) -> Made:
    """A track shorter by what makes turns faster by a share `size`."""
    return replace(e, w=(e.w * TRACK) / (TRACK / (1 + s["size"])))


def left_right_gain(e: Events, s: Sizes) -> Made:
    """Left turns faster and right turns slower by a share `size`."""
    return replace(e, w=e.w + s["size"] * np.abs(e.w))


def veer(e: Events, s: Sizes) -> Made:
    """`size` [rad] more of a turn per metre driven."""
    return replace(e, w=e.w + s["size"] * e.v)


def unequal_wheels(e: Events, s: Sizes) -> Made:
    """The right wheel larger and the left one smaller by the share that makes `size` [rad/m] of veer."""
    share = s["size"] * TRACK / 2
    right, left = (e.v + e.w * TRACK / 2) * (1 + share), (e.v - e.w * TRACK / 2) * (1 - share)
    return replace(e, v=(right + left) / 2, w=(right - left) / TRACK)


def reverse_gain(e: Events, s: Sizes) -> Made:
    """Backwards faster by a share `size`."""
    return replace(e, v=e.v + s["size"] * np.minimum(e.v, 0.0))


def curvature_v(e: Events, s: Sizes) -> Made:
    """V less by `size` [s/m] of its square."""
    return replace(e, v=e.v - s["size"] * e.v * np.abs(e.v))


def curvature_w(e: Events, s: Sizes) -> Made:
    """W less by `size` [s/rad] of its square."""
    return replace(e, w=e.w - s["size"] * e.w * np.abs(e.w))


def expo_v(e: Events, s: Sizes) -> Made:
    """V bent as 1 / (1 + c |v|)."""
    return replace(e, v=e.v / (1 + s["size"] * np.abs(e.v)))


def expo_w(e: Events, s: Sizes) -> Made:
    """W bent as 1 / (1 + c |w|)."""
    return replace(e, w=e.w / (1 + s["size"] * np.abs(e.w)))


def saturation(e: Events, s: Sizes) -> Made:
    """Rates clipped at a share 1 - `size` of the fastest that anyone asks for; axis 0: v, 1: w, 2: both."""
    return _limited(e, s, lambda rate, top: np.clip(rate, -top, top))


def soft_saturation(e: Events, s: Sizes) -> Made:
    """The same with a corner that is a parabola, from a fifth below the limit to a fifth above."""
    return _limited(e, s, _rounded)


def _limited(e: Events, s: Sizes, limit: Callable[[FloatArray, float], FloatArray]) -> Made:
    top = 1 - s["size"]
    v = e.v if s["axis"] == 1 else limit(e.v, s["top_v"] * top)
    w = e.w if s["axis"] == 0 else limit(e.w, s["top_w"] * top)
    return replace(e, v=v, w=w)


def _rounded(rate: FloatArray, top: float) -> FloatArray:
    width, size = 0.2 * top, np.abs(rate)
    beyond = np.clip(size - (top - width), 0.0, 2 * width)
    return np.asarray(np.sign(rate) * np.minimum(size - beyond**2 / (4 * width), top))


def cross_w_to_v(e: Events, s: Sizes) -> Made:
    """The chair turns about a point beside base_link, by `size` [m]."""
    return replace(e, v=e.v + s["size"] * e.w)


def cross_v_to_w(e: Events, s: Sizes) -> Made:
    """A share `size` of V_f on the steering line."""
    slope, _ = laws.branch(np.sign(e.w), laws.STEERING)
    return replace(e, w=e.w + s["size"] * laws.volts(e.v, laws.TRANSLATION) / slope)
