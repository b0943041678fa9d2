# SPDX-License-Identifier: BSD-3-Clause
"""From commands to rates, and from rates to a path."""

from __future__ import annotations

import numpy as np
from scipy.signal import lfilter

from kurumaisu.bench.strangers.loess import robots
from kurumaisu.bench.strangers.loess.base_effects import BASE, law_of
from kurumaisu.bench.strangers.loess.unknown_rates import UNKNOWN_RATES
from kurumaisu.bench.strangers.loess.values import STEP, Array, Hidden, Rates, ordered

CATALOGUE = {**BASE, **UNKNOWN_RATES}


def motion(law: str, commands: Array, pose: Array, columns: dict[str, Array], hidden: list[Hidden]) -> Array:
    """The rates v, w and sideways that commands (v, w by time) cause, without noise."""
    n = len(commands)
    v, w = commands[:, 0].copy(), commands[:, 1].copy()
    m = Rates(np.arange(n) * STEP, v, w, v, w, pose, np.zeros(n), columns, law=law)
    for effect, h in ordered(hidden, CATALOGUE, "command"):
        effect.act(m, h)
    m.v, m.w = m.cmd_v, m.cmd_w
    volts = ordered(hidden, CATALOGUE, "volt")
    if law and volts:
        m.f, m.s = robots.volts(law, m.cmd_v, m.cmd_w)
        for effect, h in volts:
            effect.act(m, h)
        law_of(m)
    for stage in ("rate", "slow", "path"):
        for effect, h in ordered(hidden, CATALOGUE, stage):
            effect.act(m, h)
    return np.column_stack([m.v, m.w, m.side])


def integrate(rates: Array, start: Array) -> Array:
    """The path of poses that rates drive from a start; as long as the rates, the first pose being the start."""
    turned = np.concatenate([[0.0], np.cumsum(rates[:-1, 1]) * STEP])
    heading = start[2] + turned
    middle = heading[:-1] + rates[:-1, 1] * STEP / 2
    c, s = np.cos(middle), np.sin(middle)
    dx = (rates[:-1, 0] * c - rates[:-1, 2] * s) * STEP
    dy = (rates[:-1, 0] * s + rates[:-1, 2] * c) * STEP
    x = start[0] + np.concatenate([[0.0], np.cumsum(dx)])
    y = start[1] + np.concatenate([[0.0], np.cumsum(dy)])
    return np.column_stack([x, y, heading])


def at(path: Array, t: Array) -> Array:
    """Poses of a path (or rates) at times since its start."""
    grid = np.arange(len(path)) * STEP
    return np.column_stack([np.interp(t, grid, path[:, i]) for i in range(path.shape[1])])


def between(first: Array, second: Array) -> Array:
    """The second poses in the frames of the first."""
    d = second - first
    c, s = np.cos(first[:, 2]), np.sin(first[:, 2])
    return np.column_stack([c * d[:, 0] + s * d[:, 1], -s * d[:, 0] + c * d[:, 1], d[:, 2]])


def beyond(first: Array, step: Array) -> Array:
    """Poses that are a step, given in their frames, from the first."""
    c, s = np.cos(first[:, 2]), np.sin(first[:, 2])
    x = first[:, 0] + c * step[:, 0] - s * step[:, 1]
    y = first[:, 1] + s * step[:, 0] + c * step[:, 1]
    return np.column_stack([x, y, first[:, 2] + step[:, 2]])


def wander(rng: np.random.Generator, n: int, step: float, tau: float) -> Array:
    """Noise of unit sd that forgets within tau."""
    keep = np.exp(-step / tau)
    white = rng.standard_normal(n) * np.sqrt(1 - keep**2)
    white[0] = rng.standard_normal()
    return np.asarray(lfilter([1.0], [1, -keep], white))
