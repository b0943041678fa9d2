# SPDX-License-Identifier: BSD-3-Clause
"""From the rows of commands to rates that the motors are asked for: voltages, dead zones, play, delay."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kurumaisu.bench.strangers.scree.basics import STEP, Array, Cause, Rows
from kurumaisu.bench.strangers.scree.robots import Robot, from_volts, to_volts


@dataclass(frozen=True)
class Asked:
    """Rates on the grid as they arrive at the motors."""

    v: Array
    w: Array


def cells(t: Array, u: Array, edges: Array) -> Array:
    """Means over the cells between edges of what holds from each t until the next."""
    whole = np.concatenate([[0.0], np.cumsum(u[:-1] * np.diff(t))])
    k = np.searchsorted(t, edges, side="right") - 1
    to = np.where(k >= 0, whole[k] + u[k] * (edges - t[k]), 0.0)
    return np.asarray(np.diff(to) / np.diff(edges))


def _codes(volts: Array, c: Cause) -> Array:
    """A converter of few codes; the other one is a ladder whose odd codes lie a little low."""
    code = np.round(volts / c.size)
    low = 0.25 * (np.abs(code) % 2) if c.other else 0.0
    return np.where(volts == 0, 0.0, (code - low) * c.size)


def _through_volts(rows: Rows, causes: tuple[Cause, ...], robot: Robot, dead: Array) -> tuple[Array, Array]:
    f, s = to_volts(rows.v, 0, robot.published), to_volts(rows.w, 1, robot.published)
    for c in causes:
        if c.id == "base.dac_zero_f":
            f = f + c.size * (1 + (0.15 * np.tanh(rows.v / 0.3) if c.other else 0.0))
        elif c.id == "base.dac_zero_s":
            s = s + c.size * (1 + (0.15 * np.tanh(rows.w / 0.4) if c.other else 0.0))
        elif c.id == "base.dac_quantisation":
            f, s = _codes(f, c), _codes(s, c)
        elif c.id == "base.cross_v_to_w":
            s = s + c.size * (f * np.sqrt(np.abs(f) / 0.6 + 1e-9) if c.other else f)
    law = any(c.id == "base.steering_law" for c in causes)
    w = from_volts(s, 1, float(dead[1]))
    if robot.published and not law:
        w = rows.w.copy()
    return from_volts(f, 0, float(dead[0])), w


def _dead(u: Array, c: Cause) -> Array:
    """Stiction: what is asked for below the width is lost, here all of it, above it little by little less of it."""
    if not c.other:
        return np.asarray(np.sign(u) * np.maximum(np.abs(u) - c.size, 0.0))
    lost = c.size * np.exp(-(np.maximum(np.abs(u) / c.size - 1, 0.0) ** 1.5) / 6.0)
    return np.asarray(np.sign(u) * np.maximum(np.abs(u) - lost, 0.0))


def _play(u: Array, c: Cause) -> Array:
    """Play in a linkage: the output stays until the input has crossed it."""
    half = 0.5 * c.size
    out = np.empty_like(u)
    at = 0.0
    for k, x in enumerate(u.tolist()):
        at = min(max(at, x - half), x + half)
        out[k] = at
    stiff = np.tanh(np.abs(u) / (3 * half + 1e-9)) if c.other else np.ones_like(u)
    return np.where(u == 0, 0.0, u + (out - u) * stiff)


def asked(rows: Rows, causes: tuple[Cause, ...], robot: Robot, n: int) -> Asked:
    """Rates that arrive at the motors in the first n cells."""
    v, w = rows.v, rows.w
    dead = np.zeros(2)
    late = np.zeros(2)
    for c in causes:
        if c.id == "base.dead_zone_v" and robot.volts and not c.other:
            dead[0] = c.size
        elif c.id == "base.dead_zone_w" and robot.volts and not c.other:
            dead[1] = c.size
    if robot.volts:
        v, w = _through_volts(rows, causes, robot, dead)
    for c in causes:
        if c.id == "base.dead_zone_v" and not dead[0]:
            v = _dead(v, c)
        elif c.id == "base.dead_zone_w" and not dead[1]:
            w = _dead(w, c)
        elif c.id == "base.backlash":
            w = _play(w, c)
        elif c.id == "base.delay":
            late = late + c.size * (np.array([0.85, 1.15]) if c.other else np.ones(2))
    edges = STEP * np.arange(n + 1)
    return Asked(cells(rows.t, v, edges - late[0]), cells(rows.t, w, edges - late[1]))
