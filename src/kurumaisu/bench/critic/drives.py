# SPDX-License-Identifier: BSD-3-Clause
"""Drives with effects of all sizes, made fast by code that shares nothing with the package's effects or ray caster.

Rates are arrays at 200 Hz; a lag is a recursive filter, noise an AR(1) series, a wall is a line that a ray is cut with.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.signal import lfilter

from kurumaisu.sim.chair.joystick import joystick
from kurumaisu.types import FloatArray

DT = 0.005  # [s]
Tables = dict[str, FloatArray]


@dataclass(frozen=True)
class Motion:
    """At times t (n,) [s]: v, u (leftward) [m/s], w [rad/s]."""

    t: FloatArray
    v: FloatArray
    u: FloatArray
    w: FloatArray


# How each changes v, u, w (n,) for a size in its own unit; and the largest size of either sign or of one.
_Change = Callable[[Motion, float], tuple[FloatArray, FloatArray, FloatArray]]
EFFECTS: dict[str, tuple[float, bool, _Change]] = {
    "base.gain_v": (0.4, True, lambda m, s: (m.v * (1 + s), m.u, m.w)),
    "base.gain_w": (0.4, True, lambda m, s: (m.v, m.u, m.w * (1 + s))),
    "base.veer": (0.6, True, lambda m, s: (m.v, m.u, m.w + s * m.v)),
    "base.left_right_gain": (0.4, True, lambda m, s: (m.v, m.u, m.w + s * abs(m.w))),
    "base.reverse_gain": (0.6, True, lambda m, s: (m.v * np.where(m.v < 0, 1 + s, 1), m.u, m.w)),
    "base.dead_zone_v": (0.2, False, lambda m, s: (_shrunk(m.v, s), m.u, m.w)),
    "base.dead_zone_w": (0.25, False, lambda m, s: (m.v, m.u, _shrunk(m.w, s))),
    "base.curvature_v": (0.5, True, lambda m, s: (m.v - s * m.v * abs(m.v), m.u, m.w)),
    "base.curvature_w": (0.5, True, lambda m, s: (m.v, m.u, m.w - s * m.w * abs(m.w))),
    "base.lag_v": (1.0, False, lambda m, s: (_slow(m.v, s), m.u, m.w)),
    "base.lag_w": (1.0, False, lambda m, s: (m.v, m.u, _slow(m.w, s))),
    "base.delay": (0.8, False, lambda m, s: (_late(m.v, s), m.u, _late(m.w, s))),
    "base.accel_limit": (4.0, False, lambda m, s: (_ramped(m.v, s), m.u, _ramped(m.w, s / 2))),
    "base.saturation": (4.0, False, lambda m, s: (np.clip(m.v, -1 / s, 1 / s), m.u, m.w)),
    "base.battery_sag": (0.5, False, lambda m, s: (_sag(m, s) * m.v, m.u, _sag(m, s) * m.w)),
    "base.understeer": (0.8, False, lambda m, s: (m.v, m.u, m.w / (1 + s * m.v**2))),
    "base.lateral_slip": (0.15, True, lambda m, s: (m.v, -s * m.v * m.w, m.w)),
    "base.slope": (0.12, False, lambda m, s: (m.v - s * np.cos(np.cumsum(m.w) * DT) * (m.v != 0), m.u, m.w)),
    "base.cross_w_to_v": (0.15, True, lambda m, s: (m.v + s * m.w, m.u, m.w)),
    "base.cross_v_to_w": (0.2, True, lambda m, s: (m.v, m.u, m.w + s * m.v)),
    "base.marker_x": (0.2, True, lambda m, s: (m.v, m.u + s * m.w, m.w)),
    "base.marker_y": (0.2, True, lambda m, s: (m.v - s * m.w, m.u, m.w)),
    "base.payload": (0.6, False, lambda m, s: (_slow(m.v * (1 - s / 2), s), m.u, _slow(m.w * (1 - s / 2), s))),
    "base.dac_zero_f": (0.08, True, lambda m, s: (m.v + s * (m.v != 0), m.u, m.w)),
    "base.dac_zero_s": (0.12, True, lambda m, s: (m.v, m.u, m.w + s * (m.w != 0))),
    "base.clock_scale": (0.01, True, lambda m, s: (m.v, m.u, m.w)),  # acts on the times of the poses
}
STYLES = ("joystick", "spins", "straight", "square", "sweep", "gentle")


@dataclass(frozen=True)
class Case:
    """What a drive is like: style of the commands, effect and size, noise of rates (relative) and pose sd [m, rad]."""

    style: str
    effect: str | None
    size: float
    noise: float
    tau: float
    pose_sd: float
    seconds: float
    rate: float


def draw(rng: np.random.Generator, *, easy: bool = False) -> Case:
    """Return a case; easy: driven so that whatever is wrong can show."""
    effect = None if rng.random() < 0.3 else str(rng.choice(list(EFFECTS)))
    size = 0.0
    if effect is not None:
        largest, signed, _ = EFFECTS[effect]
        size = largest * float(np.exp(rng.uniform(np.log(0.03), 0))) * (float(rng.choice([-1, 1])) if signed else 1.0)
    return Case(
        style="joystick" if easy else str(rng.choice(STYLES)),
        effect=effect,
        size=size,
        noise=float(np.exp(rng.uniform(np.log(0.3), np.log(3)))),
        tau=float(np.exp(rng.uniform(np.log(0.05), np.log(2)))),
        pose_sd=float(np.exp(rng.uniform(np.log(0.001), np.log(0.03)))),
        seconds=float(rng.uniform(40, 120)),
        rate=float(rng.choice([5.0, 10.0, 20.0, 50.0])),
    )


def make(case: Case, rng: np.random.Generator) -> Tables:
    """Return command (t, v, w), voltage (t, v_f, v_s), pose (t, x, y, theta) and truth (t, x, y, theta) at 200 Hz."""
    command = _commands(case, rng)
    t = np.arange(0.0, command[-1, 0] + 2.0, DT)
    asked = command[np.searchsorted(command[:, 0], t, side="right") - 1, 1:]
    motion = Motion(t, asked[:, 0], np.zeros(len(t)), asked[:, 1])
    if case.effect is not None:
        motion = Motion(t, *EFFECTS[case.effect][2](motion, case.size))
    moving = (asked != 0).any(axis=1)
    kicks = case.noise * np.array([0.01, 0.02])
    v, w = (
        rate + moving * _noise(len(t), sd, case.tau, rng) for rate, sd in zip((motion.v, motion.w), kicks, strict=True)
    )
    theta = np.concatenate([[0.0], np.cumsum(w) * DT])[:-1] + rng.uniform(-np.pi, np.pi)
    middle = theta + 0.5 * DT * w
    x = np.cumsum(v * np.cos(middle) - motion.u * np.sin(middle)) * DT + rng.uniform(-3, 3)
    y = np.cumsum(v * np.sin(middle) + motion.u * np.cos(middle)) * DT + rng.uniform(-3, 3)
    truth = np.column_stack([t, x, y, theta])
    pose = truth[:: round(1 / case.rate / DT)].copy()
    pose[:, 1:] += rng.standard_normal(pose[:, 1:].shape) * case.pose_sd * np.array([1, 1, 0.7])
    if case.effect == "base.clock_scale":
        pose[:, 0] *= 1 + case.size
    volts = np.column_stack([command[:, 0], *(volts_of(command[:, 1 + i], i) for i in range(2))])
    return {"command": command, "voltage": volts, "pose": pose, "truth": truth}


def volts_of(rate: FloatArray, axis: int) -> FloatArray:
    """Return the voltages [V] of equation (1), axis 0, or (2), axis 1, typed from the paper."""
    (up, at_up), (down, at_down) = (
        ((1.32402, 0.127906), (2.07369, -0.108783)),
        ((-0.499211, 0.104181), (-0.469278, -0.169476)),
    )[axis]
    return np.asarray(np.where(rate > 0, up * rate + at_up, np.where(rate < 0, down * rate + at_down, 0.0)))


def _commands(case: Case, rng: np.random.Generator) -> FloatArray:
    if case.style in ("joystick", "gentle"):
        return joystick(case.seconds, rng) * ([1, 1, 1] if case.style == "joystick" else [1, 0.4, 0.3])
    period = rng.uniform(1.5, 6.0)
    starts = np.arange(1.0, case.seconds, period)
    level = rng.uniform(0.2, 0.7)
    if case.style == "straight":
        rows = [(t, rng.choice([0.2, 0.4, 0.7, 0.0]), 0.0) for t in starts]
    elif case.style == "spins":
        rows = [(t, 0.0, rng.choice([-0.7, -0.4, 0.4, 0.7, 0.0])) for t in starts]
    elif case.style == "square":
        rows = [(t, 0.3, level * (-1) ** i) for i, t in enumerate(starts)]
    else:
        fine = np.arange(1.0, case.seconds, 0.1)
        rows = [(t, 0.0, 0.7 * np.sin(2 * np.pi * t / 60)) for t in fine]
    return np.array([(0.0, 0.0, 0.0), *rows, (case.seconds, 0.0, 0.0)])


def _noise(n: int, sd: float, tau: float, rng: np.random.Generator) -> FloatArray:
    keep = np.exp(-DT / tau)
    return np.asarray(lfilter([np.sqrt(1 - keep**2)], [1, -keep], sd * rng.standard_normal(n)))


def _shrunk(rate: FloatArray, by: float) -> FloatArray:
    return np.asarray(np.where(abs(rate) > by, rate - np.sign(rate) * by, 0.0))


def _slow(rate: FloatArray, tau: float) -> FloatArray:
    share = DT / (tau + DT)
    return np.asarray(lfilter([share], [1, share - 1], rate))


def _late(rate: FloatArray, delay: float) -> FloatArray:
    k = round(delay / DT)
    return np.concatenate([np.zeros(k), rate[: len(rate) - k]])


def _sag(m: Motion, share: float) -> FloatArray:
    return np.asarray(1 - share * m.t / m.t[-1])


def _ramped(rate: FloatArray, slowness: float) -> FloatArray:
    most = DT / slowness
    out, level = np.empty(len(rate)), 0.0
    for i, goal in enumerate(rate.tolist()):
        level += min(max(goal - level, -most), most)
        out[i] = level
    return out
