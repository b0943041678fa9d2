# SPDX-License-Identifier: BSD-3-Clause
"""The quantities that an unknown may follow."""

from collections.abc import Callable

import numpy as np

from kurumaisu.bench.strangers.delta.core import DT, Array, Drive, Setup
from kurumaisu.bench.strangers.delta.mechanics import Motion, lag, reversals, since
from kurumaisu.bench.strangers.delta.room import Hits


def of_motion(setup: Setup, drive: Drive, m: Motion, name: str) -> Array:
    """A quantity of the drive, per cell."""
    if name in setup.columns:
        return setup.columns[name](drive.session + m.t)
    rest = (np.abs(m.ask_v) < 1e-6) & (np.abs(m.ask_w) < 1e-6)
    step = np.full(len(m.t), DT)
    way = np.abs(m.ask_v) * DT
    known: dict[str, Callable[[], Array]] = {
        "time": lambda: m.t,
        "v": lambda: m.ask_v,
        "w": lambda: m.ask_w,
        "abs_v": lambda: np.abs(m.ask_v),
        "abs_w": lambda: np.abs(m.ask_w),
        "acceleration": lambda: np.gradient(lag(m.ask_v, 0.1), DT),
        "yaw_acceleration": lambda: np.gradient(lag(m.ask_w, 0.1), DT),
        "distance": lambda: np.cumsum(way),
        "time_since_rest": lambda: np.minimum(since(step, rest), 1e3),
        "distance_since_rest": lambda: np.minimum(since(way, rest), 1e3),
        "time_since_reversal": lambda: np.minimum(since(step, reversals(m.ask_v)), 1e3),
        "distance_since_reversal": lambda: np.minimum(since(way, reversals(m.ask_v)), 1e3),
    }
    return known[name]()


def of_hits(setup: Setup, drive: Drive, hits: Hits, name: str) -> Array:
    """A quantity of readings."""
    if name in setup.columns:
        return setup.columns[name](drive.session + hits.t)
    known: dict[str, Callable[[], Array]] = {
        "time": lambda: hits.t,
        "abs_v": lambda: np.abs(hits.v),
        "abs_w": lambda: np.abs(hits.w),
        "w": lambda: hits.w,
        "direction": lambda: hits.direction,
        "hit_x": lambda: hits.x,
        "hit_y": lambda: hits.y,
        "range": lambda: hits.r,
        "incidence": lambda: np.arccos(hits.cos),
        "bearing": lambda: hits.bearing,
    }
    return known[name]()
