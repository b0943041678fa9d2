# SPDX-License-Identifier: BSD-3-Clause
"""What can be wrong with the chair: each cause of the catalogue, in its usual form and in others."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from kurumaisu.bench.strangers.holm.chair import State
from kurumaisu.bench.strangers.holm.core import TRACK, Act, Array, Effect, acts, changes, compose, sets


def _dead(field: str) -> Act:
    def act(s: State, x: float) -> None:
        volts = getattr(s, field)
        setattr(s, field, np.sign(volts) * np.maximum(np.abs(volts) - x, 0))

    return act


def _stiction(field: str) -> Act:
    def act(s: State, x: float) -> None:
        volts = getattr(s, field)
        over = np.abs(volts) - 0.10
        lost = np.sqrt(np.maximum(over**2 - 1.5 * x * np.abs(over), 0))
        setattr(s, field, np.sign(volts) * (0.10 + np.sign(over) * lost))

    return act


def _flip(s: State, _: float) -> None:
    s.decode = s.law.flipped()


def _round(part: Callable[[Array], Array]) -> Act:
    def act(s: State, step: float) -> None:
        s.vf, s.vs = part(s.vf / step) * step, part(s.vs / step) * step

    return act


def _play(s: State, play: float) -> None:
    held, out = 0.0, []
    for u in s.w.tolist():
        held = min(max(held, u - 0.5 * play), u + 0.5 * play)
        out.append(held if abs(u) > 1e-9 else 0.0)
    s.w = np.array(out)


def _rims(s: State, x: float) -> None:
    part = 0.5 * x * TRACK
    left, right = (s.v - 0.5 * TRACK * s.w) * (1 - part), (s.v + 0.5 * TRACK * s.w) * (1 + part)
    s.v, s.w = 0.5 * (left + right), (right - left) / TRACK


def _brake(s: State, x: float) -> None:
    s.w = s.w + x * np.sign(s.v) * np.sqrt(0.4 * np.abs(s.v))


def _since_reversal(s: State) -> Array:
    """Way driven since the sign of the speed last changed; inf before the first change."""
    way, since = np.cumsum(np.abs(s.v)) * s.dt, np.full(s.v.size, np.inf)
    last, begun, turned = 0.0, 0.0, False
    for i, here in enumerate(np.sign(np.where(np.abs(s.v) < 1e-6, 0, s.v)).tolist()):
        if here not in (0, last):
            last, begun, turned = here, float(way[i]), last != 0
        if turned:
            since[i] = way[i] - begun
    return since


def _kick(s: State, x: float) -> None:
    s.w = s.w + x * np.exp(-_since_reversal(s) / 0.25) * (np.abs(s.v) > 1e-6)


def _swing(s: State, x: float) -> None:
    s.w = s.w + 2.5 * x * np.abs(s.v) * np.maximum(1 - _since_reversal(s) / 0.45, 0)


def _slope(s: State, x: float) -> None:
    moving = np.abs(s.v) > 1e-6
    s.v = s.v - moving * x * np.cos(s.th - 0.7)


def _climb(s: State, x: float) -> None:
    s.v = s.v * (1 - 5 * x * np.maximum(np.cos(s.th - 0.7) * np.sign(s.v), 0))


def _smooth_limit(s: State, x: float) -> None:
    for name, most in (("v", 1 / x), ("w", 1.8 / x)):
        rate = getattr(s, name)
        setattr(s, name, rate / (1 + np.abs(rate / most) ** 5) ** 0.2)


def _limit(s: State, x: float) -> None:
    s.v, s.w = np.clip(s.v, -1 / x, 1 / x), np.clip(s.w, -1.8 / x, 1.8 / x)


def _sag(s: State, x: float) -> None:
    factor = 1 - x * s.session
    s.v, s.w = s.v * factor, s.w * factor


def _drain(s: State, x: float) -> None:
    used = s.dt * np.cumsum(0.15 + np.abs(s.v) + 0.3 * np.abs(s.w)) + 0.45 * s.start
    factor = np.exp(-2 * x * used)
    s.v, s.w = s.v * factor, s.w * factor


changes("dac_zero_f", 0.03, "volt vf+", "offset", lambda s, x: x, lambda s, x: x * (0.5 + 1.2 * s.t / s.t[-1]))
changes("dac_zero_s", 0.02, "volt vs+", "offset", lambda s, x: x, lambda s, x: x * (0.5 + 1.2 * s.t / s.t[-1]))
acts("dac_quantisation", 0.08, "volt", _round(np.round), "step", _round(np.trunc), 0.25)
acts("steering_law", 1.0, "volt", _flip, "flip")
acts("dead_zone_v", 0.04, "volt", _dead("vf"), "width", _stiction("vf"), 0.3)
acts("dead_zone_w", 0.03, "volt", _dead("vs"), "width", _stiction("vs"), 0.2)
changes("cross_v_to_w", 0.02, "volt vs+", "share", lambda s, x: x * s.vf, lambda s, x: 1.5 * x * s.vf * np.abs(s.vf))
acts("backlash", 0.08, "want", _play, most=0.3)
changes("gain_v", 0.06, "want v*", "gain", lambda s, x: 1 + x)
changes(
    "reverse_gain",
    0.08,
    "want v*",
    "gain",
    lambda s, x: 1 + x * (s.v < 0),
    lambda s, x: 1 + x * (s.v < 0) * (1 - 0.4 * np.abs(s.v)),
)
changes(
    "left_right_gain",
    0.05,
    "want w*",
    "",
    lambda s, x: 1 + x * np.sign(s.w),
    lambda s, x: 1 + 2 * x * (s.w > 0) / (1 + 0.5 * np.abs(s.w)),
)
changes(
    "curvature_v", 0.12, "want v*", "", lambda s, x: 1 - x * np.abs(s.v), lambda s, x: 1 - x * np.sqrt(np.abs(s.v)), 0.6
)
changes(
    "curvature_w", 0.12, "want w*", "", lambda s, x: 1 - x * np.abs(s.w), lambda s, x: 1 - x * np.sqrt(np.abs(s.w)), 0.5
)
acts("saturation", 1.6, "want", _limit, "", _smooth_limit, 3.0)
acts("battery_sag", 0.0006, "want", _sag, "", _drain, 0.002)
changes("gain_w", 0.06, "tyre w*", "gain", lambda s, x: 1 + x)
acts("veer", 0.03, "tyre", _rims, "curvature", _brake)
changes(
    "understeer", 0.15, "tyre w*", "k", lambda s, x: 1 / (1 + x * s.v**2), lambda s, x: 1 - 0.5 * x * np.abs(s.v), 1.2
)
acts("caster_reversal", 0.1, "tyre", _kick, "", _swing)
changes(
    "lateral_slip", 0.04, "tyre vy+", "c", lambda s, x: -x * s.v * s.w, lambda s, x: -2 * x * s.v * np.abs(s.v) * s.w
)
changes("cross_w_to_v", 0.04, "tyre v+", "", lambda s, x: x * s.w, lambda s, x: 1.5 * x * s.w * np.abs(s.w))
acts("slope", 0.03, "place", _slope, "", _climb)
sets("base.delay", 0.1, "late", lambda x: {"delay": x}, lambda x: {"delay": x}, lambda x: {"period": 2 * x}, 0.6)
sets(
    "base.lag_v", 0.15, "plant", lambda x: {"tau_v": x}, lambda x: {"tau": x}, lambda x: {"tau_v": x, "stages": 3}, 1.0
)
sets(
    "base.lag_w", 0.15, "plant", lambda x: {"tau_w": x}, lambda x: {"tau": x}, lambda x: {"tau_w": x, "stages": 3}, 1.0
)
sets(
    "base.accel_limit",
    1.5,
    "plant",
    lambda x: {"slow_v": x, "slow_w": x / 2},
    lambda x: {"slowness_v": x, "slowness_w": x / 2},
    lambda x: {"stall": 90.0 / x, "free": 2.5},
    5.0,
)
sets(
    "base.payload",
    0.08,
    "plant",
    lambda x: {"loop": x * 1.6, "load": 55 / 1.6},
    other=lambda x: {"loop": x * 1.6, "load": 8.0, "mass": 0.5, "drag": 14.0},
    most=0.4,
)
sets("base.marker_x", 0.04, "pose", lambda x: {"x": x}, lambda x: {"x": x})
sets("base.marker_y", 0.04, "pose", lambda x: {"y": x}, lambda x: {"y": x})
sets("base.marker_yaw", 0.04, "pose", lambda x: {"yaw": x}, lambda x: {"yaw": x})
sets("base.clock_scale", 0.002, "stamp", lambda x: {"scale": x})


def seen(poses: Array, effects: Sequence[Effect]) -> Array:
    """Poses (..., 3) of the chair as the reference has them."""
    p = poses.copy()
    for e in effects:
        if e.hook == "pose":
            p = compose(p, np.array([e.settings.get(k, 0.0) for k in ("x", "y", "yaw")]))
        elif e.hook == "bend":
            e.act(p)
    return p
