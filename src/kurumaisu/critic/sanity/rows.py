# SPDX-License-Identifier: BSD-3-Clause
"""Rows that repeat, stand still or lie on a coarse grid: what a real reference of a robot that moves never does."""

from __future__ import annotations

import numpy as np

from kurumaisu.critic.sanity.rates import Rates
from kurumaisu.critic.values.digits import moment
from kurumaisu.critic.values.recording import Series
from kurumaisu.types import BoolArray, FloatArray, IntArray

_FROZEN = 2.0  # [s] of standing while far more than usual is asked for
_BLOCK = 8  # rows that repeat earlier ones exactly, in their order
_COPIED = 20  # poses of a moving robot that are another run's, at least
_GRID = 0.02  # [m] a grid finer than this is no harm
_DECIMALS = 9
MOVING = 0.05  # [m/s, rad/s] above this a robot is on its way


def frozen(pose: Series, asked: Rates, driven: Rates) -> str | None:
    """Tell of poses that stand still, to the last bit, while the input drives as it does elsewhere."""
    size = np.abs(asked.values) @ np.array([1.0, 0.5])
    known = np.isfinite(size)
    if not known.any() or float(size[known].max()) < 0.05:
        return None
    much = np.where(known, size, 0.0) > 0.5 * float(np.quantile(size[known & (size > 0.02)], 0.75))
    still = _still(pose)
    starts, ends = stretches(still)
    worst, at, total = 0.0, 0.0, 0.0
    for a, b in zip(starts, ends, strict=True):
        inside = (asked.t > pose.t[a]) & (asked.t < pose.t[b])
        seconds = float(np.median(np.diff(asked.t))) * int(np.count_nonzero(much & inside))
        total += seconds if seconds > _FROZEN / 2 else 0.0
        if seconds > worst:
            worst, at = seconds, float(pose.t[a])
    if worst < _FROZEN:
        return None
    return (
        f"the reference pose stands still, to the last bit, for {total:.3g} s while the input commands motion (longest "
        f"{worst:.3g} s, from t = {moment(at)}): frozen; cut these rows out"
    )


def marks(pose: Series) -> set[bytes]:
    """Return the poses of a robot that moves, each as what tells it from all others."""
    return {row.tobytes() for row in np.round(pose.values[1:, :3][~_still(pose)], _DECIMALS)}


def copied(own: set[bytes], earlier: set[bytes]) -> bool:
    """Tell by their marks whether poses are an earlier run's: measured again, none is the same to the last bit."""
    return len(own) >= _COPIED and len(own & earlier) > len(own) / 2


def _still(pose: Series) -> BoolArray:
    return np.asarray((np.diff(pose.values[:, :3], axis=0) == 0).all(axis=1))


def stretches(flags: BoolArray) -> tuple[IntArray, IntArray]:
    """Return first and last row of every stretch of rows that are equal."""
    edges = np.diff(np.r_[False, flags, False].astype(int))
    return np.flatnonzero(edges == 1), np.flatnonzero(edges == -1)


def repeats(pose: Series, driven: Rates) -> float:
    """Return how many times each pose was written under new times while the robot moved, on the mean.

    A robot that rests under a reference without noise repeats its pose, too: whether it moves is asked in the middle of
    such a stretch, for next to its ends the means of the rates are those of the motion before and behind.
    """
    still = _still(pose)
    speed = np.nan_to_num(np.abs(driven.values)).max(axis=1)
    asked = pose.t[:-1].copy()
    for a, b in zip(*stretches(still), strict=True):
        asked[a:b] = 0.5 * (pose.t[a] + pose.t[b])
    moving = np.interp(asked, driven.t, speed) > MOVING
    if moving.sum() < 20 or not _exact(pose):
        return 1.0
    return float(1 / (1 - min(still[moving].mean(), 0.99)))


def repeats_problem(times: float) -> str:
    """Return the words for poses that repeat so many times."""
    how = f"each {times:.2g} times on average" if times >= 2 else f"{1 - 1 / times:.0%} of them"
    return f"duplicate rows: poses repeat under new times, {how}, while the robot moves: keep the first"


def _exact(pose: Series) -> bool:
    """Tell whether positions are not just rounded: rounding makes equal rows of a slow robot."""
    return grid_of(pose.values[:, 0]) < 1e-4


def blocks(part: Series, name: str) -> str | None:
    """Tell of a stretch of rows that repeats an earlier one exactly under later times."""
    rows = np.ascontiguousarray(np.round(part.values, _DECIMALS) + 0.0)
    keys = rows.view([("", rows.dtype)] * rows.shape[1]).ravel()
    _, first = np.unique(keys, return_index=True)
    _, inverse = np.unique(keys, return_inverse=True)
    earlier = first[inverse]
    index = np.arange(len(rows))
    again = earlier < index
    changes = np.r_[False, (np.diff(rows, axis=0) != 0).any(axis=1)]
    follows = again & np.r_[False, (np.diff(earlier) == 1) & again[:-1]] & changes
    starts, ends = stretches(follows)
    lengths = ends - starts
    if not len(lengths) or lengths.max() < _BLOCK:
        return None
    k = int(np.argmax(lengths))
    row, source = int(starts[k]) - 1, int(earlier[starts[k]]) - 1
    return (
        f"rows of {name} repeat earlier ones exactly: {int(lengths[k]) + 1} rows from t = {moment(part.t[row])} on "
        f"equal those from t = {moment(part.t[source])} on; {int(follows.sum())} in total; cut them out"
    )


def grid_of(values: FloatArray) -> float:
    """Return the step of which all differences of values are multiples, 0 when there is none."""
    levels = np.unique(np.round(values, _DECIMALS))
    gaps = np.diff(levels)
    if len(levels) < 3 or len(values) < 10 * len(levels):
        return 0.0
    step = float(np.median(gaps[gaps <= 1.5 * gaps.min()]))
    return step if float(np.abs(gaps / step - np.round(gaps / step)).max()) < 0.02 else 0.0


def coarse(pose: Series, driven: Rates) -> str | None:
    """Tell of positions on a grid coarser than what the robot drives in a second."""
    x, y = (grid_of(pose.values[:, i]) for i in range(2))
    step = min(x, y) if min(x, y) > 0 else 0.0
    speed = np.abs(driven.values[:, 0])
    moving = speed[np.isfinite(speed) & (speed > 0.02)]
    usual = float(np.median(moving)) if len(moving) else 0.0
    if step < _GRID or step < 0.5 * usual:
        return None
    return (
        f"positions lie on a grid of {step:.3g} m, while the robot drives {usual:.2g} m per second: too coarse to "
        f"judge motion; record more digits"
    )
