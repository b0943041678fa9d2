# SPDX-License-Identifier: BSD-3-Clause
"""What can be wrong with the chair: each cause of the catalogue, in its usual form and in others."""
from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from .chair import State
from .core import TRACK, Array, Effect, Maker

USUAL: dict[str, tuple[float, Maker]] = {}
OTHER: dict[str, tuple[float, Maker]] = {}
Act = Callable[[State, float], None]
Values = Callable[[float], dict[str, float]]

def _put(name: str, size: float, hook: str, act: Act, parameter: str = "", other: Act | None = None,
         more: str = "") -> None:
    def usual(x: float, _: Any) -> Effect:
        return Effect("base." + name, hook, lambda s: act(s, x), {}, {parameter: x} if parameter else {})
    USUAL["base." + name] = (size, usual)
    if other is not None:
        changed = other

        def make(x: float, _: Any) -> Effect:
            return Effect("base." + name, more or hook, lambda s: changed(s, x))
        OTHER["base." + name] = (size, make)

def _set(name: str, size: float, settings: Values, parameters: Values, other: Values | None,
         hook: str = "plant") -> None:
    full = "base." + name
    USUAL[full] = (size, lambda x, _: Effect(full, hook, settings=settings(x), parameters=parameters(x)))
    if other is not None:
        changed = other
        OTHER["base." + name] = (size, lambda x, _: Effect("base." + name, hook, settings=changed(x)))

def _add(field: str, change: Callable[[State, float], Array]) -> Act:
    def act(s: State, x: float) -> None:
        setattr(s, field, getattr(s, field) + change(s, x))
    return act

def _times(field: str, factor: Callable[[State, float], Array]) -> Act:
    def act(s: State, x: float) -> None:
        setattr(s, field, getattr(s, field) * factor(s, x))
    return act

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

def _round(s: State, step: float, cut: bool = False) -> None:
    for name in ("vf", "vs"):
        volts = getattr(s, name)
        setattr(s, name, (np.trunc if cut else np.round)(volts / step) * step)

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

def since_reversal(s: State) -> tuple[Array, Array]:
    """Way driven since the sign of the speed last changed, and that sign (0 before the first change)."""
    sign = np.sign(np.where(np.abs(s.v) < 1e-6, 0, s.v))
    way = np.cumsum(np.abs(s.v)) * s.dt
    last, begun, turned = 0.0, 0.0, 0.0
    since, side = np.full(s.v.size, np.inf), np.zeros(s.v.size)
    for i, here in enumerate(sign.tolist()):
        if here != 0 and here != last:
            turned = here if last != 0 else 0.0
            last, begun = here, float(way[i])
        since[i], side[i] = way[i] - begun, turned
    return np.where(side == 0, np.inf, since), side

def _kick(s: State, x: float, length: float = 0.25) -> None:
    since, side = since_reversal(s)
    s.w = s.w + x * np.exp(-since / length) * (np.abs(side) > 0) * (np.abs(s.v) > 1e-6)

def _swing(s: State, x: float) -> None:
    since, _ = since_reversal(s)
    s.w = s.w + 2.5 * x * np.abs(s.v) * np.maximum(1 - since / 0.45, 0)

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

def _left(s: State, x: float) -> Array:
    return 1 + x * np.sign(s.w)

_put("dac_zero_f", 0.03, "volt", _add("vf", lambda s, x: np.full(s.t.size, x)), "offset",
     _add("vf", lambda s, x: x * (0.5 + 1.2 * s.t / s.t[-1])))
_put("dac_zero_s", 0.02, "volt", _add("vs", lambda s, x: np.full(s.t.size, x)), "offset",
     _add("vs", lambda s, x: x * (0.5 + 1.2 * s.t / s.t[-1])))
_put("dac_quantisation", 0.08, "volt", _round, "step", lambda s, x: _round(s, x, True))
_put("steering_law", 1.0, "volt", _flip, "flip")
_put("dead_zone_v", 0.04, "volt", _dead("vf"), "width", _stiction("vf"))
_put("dead_zone_w", 0.03, "volt", _dead("vs"), "width", _stiction("vs"))
_put("cross_v_to_w", 0.02, "volt", _add("vs", lambda s, x: x * s.vf), "share",
     _add("vs", lambda s, x: 1.5 * x * s.vf * np.abs(s.vf)))
_put("backlash", 0.08, "want", _play)
_put("gain_v", 0.06, "want", _times("v", lambda s, x: np.full(s.t.size, 1 + x)), "gain")
_put("reverse_gain", 0.08, "want", _times("v", lambda s, x: 1 + x * (s.v < 0)), "gain",
     _times("v", lambda s, x: 1 + x * (s.v < 0) * (1 - 0.4 * np.abs(s.v))))
_put("left_right_gain", 0.05, "want", _times("w", _left), "",
     _times("w", lambda s, x: 1 + 2 * x * (s.w > 0) / (1 + 0.5 * np.abs(s.w))))
_put("curvature_v", 0.12, "want", _times("v", lambda s, x: 1 - x * np.abs(s.v)), "",
     _times("v", lambda s, x: 1 - x * np.sqrt(np.abs(s.v))))
_put("curvature_w", 0.12, "want", _times("w", lambda s, x: 1 - x * np.abs(s.w)), "",
     _times("w", lambda s, x: 1 - x * np.sqrt(np.abs(s.w))))
_put("saturation", 1.6, "want", _limit, "", _smooth_limit)
_put("battery_sag", 0.0006, "want", _sag, "", _drain)
_put("gain_w", 0.06, "tyre", _times("w", lambda s, x: np.full(s.t.size, 1 + x)), "gain")
_put("veer", 0.03, "tyre", _rims, "curvature", _brake)
_put("understeer", 0.15, "tyre", _times("w", lambda s, x: 1 / (1 + x * s.v**2)), "k",
     _times("w", lambda s, x: 1 - 0.5 * x * np.abs(s.v)))
_put("caster_reversal", 0.1, "tyre", _kick, "", _swing)
_put("lateral_slip", 0.04, "tyre", _add("vy", lambda s, x: -x * s.v * s.w), "c",
     _add("vy", lambda s, x: -2 * x * s.v * np.abs(s.v) * s.w))
_put("cross_w_to_v", 0.04, "tyre", _add("v", lambda s, x: x * s.w), "", _add("v", lambda s,
                                                                             x: 1.5 * x * s.w * np.abs(s.w)))
_put("slope", 0.03, "place", _slope, "", _climb)
_set("delay", 0.1, lambda x: {"delay": x}, lambda x: {"delay": x}, lambda x: {"period": 2 * x}, "late")
_set("lag_v", 0.15, lambda x: {"tau_v": x}, lambda x: {"tau": x}, lambda x: {"tau_v": x, "stages": 3})
_set("lag_w", 0.15, lambda x: {"tau_w": x}, lambda x: {"tau": x}, lambda x: {"tau_w": x, "stages": 3})
_set("accel_limit", 1.5, lambda x: {"slow_v": x, "slow_w": x / 2}, lambda x: {"slowness_v": x, "slowness_w": x / 2},
     lambda x: {"stall": 90.0 / x, "free": 2.5})
_set("payload", 0.08, lambda x: {"loop": x * 1.6, "load": 55 / 1.6}, lambda x: {},
     lambda x: {"loop": x * 1.6, "load": 8.0, "mass": 0.5, "drag": 14.0})

def _marker(name: str, size: float) -> None:
    full = "base." + name
    USUAL[full] = (size, lambda x, _: Effect(full, "pose", settings={name: x}, parameters={name[7:]: x}))

for _name, _size in (("marker_x", 0.04), ("marker_y", 0.04), ("marker_yaw", 0.04)):
    _marker(_name, _size)
USUAL["base.clock_scale"] = (0.002, lambda x, _: Effect("base.clock_scale", "stamp", settings={"scale": x}))
SIGNED = {"dac_zero_f", "dac_zero_s", "cross_v_to_w", "gain_v", "gain_w", "left_right_gain", "veer", "reverse_gain",
          "caster_reversal", "cross_w_to_v", "slope", "marker_x", "marker_y", "marker_yaw", "clock_scale"}

def seen(poses: Array, effects: list[Effect]) -> Array:
    """Poses (..., 3) of the chair as the reference has them."""
    p = poses.copy()
    for e in effects:
        if e.hook == "pose":
            x, y, yaw = (e.settings.get(k, 0.0) for k in ("marker_x", "marker_y", "marker_yaw"))
            c, s = np.cos(p[..., 2]), np.sin(p[..., 2])
            p = np.stack([p[..., 0] + c * x - s * y, p[..., 1] + s * x + c * y, p[..., 2] + yaw], axis=-1)
        elif e.hook == "bend":
            e.act(p)
    return p
