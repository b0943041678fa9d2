# SPDX-License-Identifier: BSD-3-Clause
"""What can be wrong with the base: a law for each effect and, for most, another plausible one."""

from __future__ import annotations

import numpy as np
from scipy.signal import lfilter

from kurumaisu.bench.strangers.reed.core import DT, STEERING, TRANSLATION, Array, Effect, Motion, Use


def _late(signal: Array, m: Motion, ago: Array | float) -> Array:
    """A held signal some time ago, averaged over each cell."""
    edges = np.append(m.t, m.t[-1] + DT)
    total = np.concatenate([[0.0], np.cumsum(signal) * DT])
    back = np.append(m.t - ago, m.t[-1] + DT - np.max(ago))
    return np.diff(np.interp(back, edges, total)) / DT


def _lag(signal: Array, tau: float, order: int = 1) -> Array:
    """First-order lags in a row, tau altogether."""
    keep = float(np.exp(-DT * order / max(tau, 1e-6)))
    for _ in range(order):
        signal = np.asarray(lfilter([1.0 - keep], [1.0, -keep], signal))
    return signal


def _ramp(signal: Array, slowness: float, brake: bool) -> Array:
    """Ramps; brake: only when it speeds up, for brakes bite at once."""
    out, now, limit = np.empty_like(signal), 0.0, DT / max(slowness, 1e-3)
    for i, want in enumerate(signal.tolist()):
        step = 9.0 if brake and (abs(want) < abs(now) or want * now < 0) else limit
        now += min(max(want - now, -step), step)
        out[i] = now
    return out


def _play(m: Motion, size: float) -> Array:
    """Play between what is asked of the steering and what it does; a rest stays one."""
    out, now, half = np.empty_like(m.w), 0.0, 0.5 * size
    for i, want in enumerate(m.w.tolist()):
        now = min(max(now, want - half), want + half)
        out[i] = now
    return np.where((np.abs(m.cw) < 1e-9) & (np.abs(m.cv) < 1e-9), m.w, out)


def _width(r: Array, m: Motion, volt: float, axis: str) -> Array:
    """A width in volts as one of rates, by the slopes of (1) and (2)."""
    law = TRANSLATION if axis == "v" else STEERING["corrected"]
    slope = np.abs(np.where(r > 0, law[0][0], law[1][0])) if m.drive.robot == "md100" else np.ones_like(r)
    return np.asarray(volt / slope)


def _dead(r: Array, m: Motion, u: Use, axis: str) -> Array:
    """A dead zone with corners."""
    return np.asarray(np.sign(r) * np.maximum(np.abs(r) - _width(r, m, u.size, axis), 0.0))


def _greasy(r: Array, m: Motion, u: Use, axis: str) -> Array:
    """A dead zone without corners, as of thick grease."""
    width = _width(r, m, u.size, axis)
    return np.asarray(np.sign(r) * (np.abs(r) - width * np.tanh(np.abs(r) / width / 1.3)))


def since_reversal(m: Motion) -> Array:
    """Distance driven since the speed asked for last changed its sign; far, if it never did."""
    sense, way = np.sign(m.cv), np.cumsum(np.abs(m.v)) * DT
    idx = np.flatnonzero(sense)
    flips = idx[1:][sense[idx[1:]] != sense[idx[:-1]]]
    last = np.searchsorted(flips, np.arange(len(way)), side="right") - 1
    return np.where(last >= 0, way - way[flips[np.maximum(last, 0)]], 99.0) if len(flips) else np.full(len(way), 99.0)


def _root(r: Array, top: float) -> Array:
    """A share that grows with the root of the rate."""
    return np.asarray(np.sqrt(np.abs(r) / top))


def _rise(m: Motion, u: Use) -> Array:
    """How steeply the floor rises ahead."""
    return np.asarray(np.cos(m.path.th[:-1] - u.aux["phase"]) * (np.abs(m.cv) > 1e-6))


def _mark(k: int) -> Effect:
    """What the reference tracks sits elsewhere."""
    name = ("x", "y", "yaw")[k]
    return Effect(f"base.marker_{name}", 5, 0.03, 1.0, name, "marker", lambda r, m, u, _: r + u.size * np.eye(3)[k])


_ALL = [
    Effect("base.dac_zero_f", 1, 0.01, 0.09, "offset", "vf", lambda r, m, u, _: r + u.size),
    Effect("base.dac_zero_s", 1, 0.01, 0.09, "offset", "vs", lambda r, m, u, _: r + u.size),
    Effect(
        "base.dac_quantisation",
        1,
        0.03,
        0.6,
        "step",
        "vf vs",
        lambda r, m, u, _: np.round(r / u.size) * u.size,
        lambda r, m, u, _: np.trunc(r / u.size) * u.size,
    ),
    Effect("base.steering_law", 1, 1.0, 1.0, "flip", "plant", lambda r, m, u, _: "corrected"),
    Effect(
        "base.delay",
        0,
        0.05,
        1.0,
        "delay",
        "cv cw",
        lambda r, m, u, _: _late(r, m, u.size),
        lambda r, m, u, _: _late(r, m, u.size * (1 + 0.5 * np.sin(6.28 * m.t / u.aux["period"] + u.aux["phase"]))),
    ),
    Effect("base.dead_zone_v", 2, 0.03, 0.5, "width", "v", _dead, _greasy),
    Effect("base.dead_zone_w", 2, 0.03, 0.5, "width", "w", _dead, _greasy),
    Effect(
        "base.backlash",
        2,
        0.05,
        0.6,
        "play",
        "w",
        lambda r, m, u, _: _play(m, u.size),
        lambda r, m, u, _: r + _lag(_play(m, u.size) - r, 0.25),
    ),
    Effect(
        "base.cross_v_to_w",
        1,
        0.01,
        0.5,
        "share",
        "vs",
        lambda r, m, u, _: r + u.size * m.vf,
        lambda r, m, u, _: r + u.size * m.vf * np.abs(m.vf),
    ),
    Effect(
        "base.gain_v",
        2,
        0.05,
        0.9,
        "gain",
        "v",
        lambda r, m, u, _: r * (1 + u.size),
        lambda r, m, u, _: r * (1 + u.size * _root(r, 0.4)),
    ),
    Effect(
        "base.gain_w",
        2,
        0.05,
        0.9,
        "gain",
        "w",
        lambda r, m, u, _: r * (1 + u.size),
        lambda r, m, u, _: r * (1 + u.size * _root(r, 0.5)),
    ),
    Effect(
        "base.left_right_gain",
        2,
        0.05,
        0.9,
        "",
        "w",
        lambda r, m, u, _: r * (1 + u.size * np.sign(r)),
        lambda r, m, u, _: r * (1 + u.size * (r > 0)),
    ),
    Effect(
        "base.veer",
        2,
        0.03,
        1.0,
        "curvature",
        "w",
        lambda r, m, u, _: r + u.size * m.v,
        lambda r, m, u, _: r + u.size * m.v * _root(m.v, 0.4),
    ),
    Effect(
        "base.reverse_gain",
        2,
        0.05,
        0.9,
        "gain",
        "v",
        lambda r, m, u, _: r * (1 + u.size * (r < 0)),
        lambda r, m, u, _: r * (1 + u.size * (r < 0) * _root(r, 0.3)),
    ),
    Effect(
        "base.curvature_v",
        2,
        0.05,
        0.9,
        "curvature",
        "v",
        lambda r, m, u, _: r * (1 - u.size * np.abs(r)),
        lambda r, m, u, _: r * (1 - u.size * 1.6 * r**2),
    ),
    Effect(
        "base.curvature_w",
        2,
        0.05,
        0.8,
        "curvature",
        "w",
        lambda r, m, u, _: r * (1 - u.size * np.abs(r)),
        lambda r, m, u, _: r * (1 - u.size * 1.2 * r**2),
    ),
    Effect(
        "base.saturation",
        2,
        0.3,
        0.9,
        "",
        "v w",
        lambda r, m, u, axis: np.clip(r, -cap(u, axis), cap(u, axis)),
        lambda r, m, u, axis: r / (1 + np.abs(r / cap(u, axis)) ** 8) ** 0.125,
    ),
    Effect(
        "base.battery_sag",
        2,
        0.001,
        0.006,
        "sag",
        "v w",
        lambda r, m, u, _: r * (1 - u.size * m.t),
        lambda r, m, u, _: r * (1 - u.size / 0.3 * np.cumsum(np.abs(m.cv) + 0.3 * np.abs(m.cw)) * DT),
    ),
    Effect(
        "base.lag_v", 3, 0.1, 3.0, "tau", "v", lambda r, m, u, _: _lag(r, u.size), lambda r, m, u, _: _lag(r, u.size, 2)
    ),
    Effect(
        "base.lag_w", 3, 0.1, 3.0, "tau", "w", lambda r, m, u, _: _lag(r, u.size), lambda r, m, u, _: _lag(r, u.size, 2)
    ),
    Effect(
        "base.accel_limit",
        3,
        1.0,
        15.0,
        "slowness_v",
        "v w",
        lambda r, m, u, axis: _ramp(r, u.size / (1 + (axis == "w")), False),
        lambda r, m, u, axis: _ramp(r, u.size / (1 + (axis == "w")), True),
    ),
    Effect(
        "base.payload",
        3,
        0.05,
        0.45,
        "droop",
        "v w",
        lambda r, m, u, _: _lag(r * (1 - u.size), 2 * u.size),
        lambda r, m, u, _: _lag(r * (1 - u.size * _root(r, 0.45)), 2 * u.size, 2),
    ),
    Effect(
        "base.process_noise",
        3,
        2.0,
        60.0,
        "",
        "grow",
        lambda r, m, u, _: r + u.size * (np.abs(m.v) + 0.5 * np.abs(m.w)),
    ),
    Effect(
        "base.understeer",
        2,
        0.1,
        2.0,
        "k",
        "w",
        lambda r, m, u, _: r / (1 + u.size * m.v**2),
        lambda r, m, u, _: r / (1 + u.size * np.maximum(np.abs(m.v) - 0.2, 0.0)),
    ),
    Effect(
        "base.caster_reversal",
        3,
        0.1,
        1.5,
        "",
        "w",
        lambda r, m, u, _: r + u.size * (np.abs(m.cv) > 0) * np.exp(-since_reversal(m) / u.aux["length"]),
        lambda r, m, u, _: r + u.size * m.v / 0.3 * np.maximum(1 - since_reversal(m) / u.aux["length"] / 2, 0) ** 2,
    ),
    Effect(
        "base.lateral_slip",
        3,
        0.05,
        0.5,
        "c",
        "vy",
        lambda r, m, u, _: r - u.size * m.v * m.w,
        lambda r, m, u, _: r - u.size * 0.08 * np.tanh(m.v * m.w / 0.08),
    ),
    Effect(
        "base.slope",
        4,
        0.02,
        0.4,
        "",
        "v",
        lambda r, m, u, _: r - u.size * _rise(m, u),
        lambda r, m, u, _: r - u.size * 1.4 * _rise(m, u) * (r * _rise(m, u) > 0),
    ),
    Effect(
        "base.cross_w_to_v",
        2,
        0.03,
        0.8,
        "lever",
        "v",
        lambda r, m, u, _: r + u.size * m.w,
        lambda r, m, u, _: r + u.size * m.w * np.abs(m.w) / 0.5,
    ),
    _mark(0),
    _mark(1),
    _mark(2),
    Effect("base.clock_scale", 5, 0.001, 0.009, "", "clock", lambda r, m, u, _: u.size),
]
BASE = {effect.id: effect for effect in _ALL}
DISCRETE = ("base.steering_law",)


def cap(u: Use, axis: str) -> float:
    """The rate at which an axis saturates."""
    return (0.8 if axis == "v" else 1.0) * (1 - u.size)
