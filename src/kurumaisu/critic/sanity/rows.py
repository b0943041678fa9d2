# SPDX-License-Identifier: BSD-3-Clause
"""Rows and scans that no real sensor gives: repeated, stuck, on a coarse grid, without readings, mirrored."""

from __future__ import annotations

import numpy as np

from kurumaisu import geometry
from kurumaisu.critic.rates.mean_rates import Rates
from kurumaisu.critic.values.digits import moment
from kurumaisu.critic.values.recording import LaserMount, Series
from kurumaisu.types import BoolArray, FloatArray, IntArray

_FROZEN = 2.0  # [s] of standing while far more than usual is asked for
_BLOCK = 8  # rows that repeat earlier ones exactly, in their order
_COPIED = 20  # poses of a moving robot that are another run's, at least
_GRID = 0.02  # [m] a grid finer than this is no harm
_DECIMALS = 9
# A reference may be written twice as often as it measures, but not this often.
_REPEATS = 3.0
# Every row twice is such a reference; some rows twice is a buffer that was stuck.
_SOME_TWICE = (1.04, 1.7)
MOVING = 0.05  # [m/s, rad/s] above this a robot is on its way
_GOES_ON = 0.7  # share of the lower of its speeds around rows that repeat, from which it moved meanwhile, too
_FEW = 0.01  # share of readings that are valid, below which nothing was measured
_STUCK = 0.5  # share of scans that equal the one before while the robot moves
_PILED = 0.01  # share of readings that are exactly the largest one, from which it is no distance
_GAP = 0.05  # relative gap below a largest value that is no distance
_TURN = (0.04, 0.5)  # [rad] between scans that tell which way beams are counted
_SHIFT = 0.08  # [m] driven between them at most
_PAIRS = 10
_MOST = 4000  # scans that are looked at


def frozen(pose: Series, asked: Rates) -> str | None:
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


def stale(pose: Series) -> BoolArray:
    """Return which rows (n,) only repeat the one before, to the last bit, while the robot goes on as around them.

    A robot that stood begins to move when it does so: behind a reference that was stuck it is elsewhere at once.
    """
    out = np.zeros(len(pose.t), dtype=np.bool_)
    for a, b in zip(*stretches(_still(pose)), strict=True):
        lasts = pose.t[min(b + 1, len(out) - 1)] - pose.t[a]
        before, after = np.searchsorted(pose.t, [pose.t[a] - lasts, pose.t[a] + 2 * lasts]).tolist()
        if before < a and b + 1 < after < len(out):
            first, meanwhile, then = (_speed(pose, *ends) for ends in ((before, a), (a, b + 1), (b + 1, after)))
            goes_on = meanwhile > np.maximum(MOVING, _GOES_ON * np.minimum(first, then))
            out[a + 1 : b + 1] = bool(goes_on.any())
    return out


def _speed(pose: Series, first: int, last: int) -> FloatArray:
    """Return the mean speeds (2,) [m/s, rad/s] from a row to another."""
    way = geometry.between(pose.values[first, :3], pose.values[last, :3])
    return np.asarray(np.array([np.hypot(way[0], way[1]), abs(way[2])]) / (pose.t[last] - pose.t[first]))


def repeated(pose: Series, driven: Rates) -> str | None:
    """Tell of poses that were written again under new times while the robot moved.

    A robot that rests under a reference without noise repeats its pose, too: whether it moves is asked in the middle of
    such a stretch, for next to its ends the means of the rates are those of the motion before and behind.
    """
    still = _still(pose)
    speed = np.nan_to_num(np.abs(driven.values)).max(axis=1)
    asked = pose.t[:-1].copy()
    for a, b in zip(*stretches(still), strict=True):
        asked[a:b] = 0.5 * (pose.t[a] + pose.t[b])
    moving = np.interp(asked, driven.t, speed) > MOVING
    # Rounding makes equal rows of a slow robot.
    if moving.sum() < 20 or grid_of(pose.values[:, 0]) >= 1e-4:
        return None
    times = float(1 / (1 - min(still[moving].mean(), 0.99)))  # that each was written, on the mean
    if not (times > _REPEATS or _SOME_TWICE[0] < times < _SOME_TWICE[1]):
        return None
    how = f"each {times:.2g} times on average" if times >= 2 else f"{1 - 1 / times:.0%} of them"
    return f"duplicate rows: poses repeat under new times, {how}, while the robot moves: keep the first"


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


def problems(scan: Series, pose: Series | None, laser: LaserMount | None, farthest: float) -> list[str]:
    """Return what is wrong with scans, in words; farthest: where the laser's range ends [m]."""
    few = np.unique(np.linspace(0, len(scan.t) - 1, min(len(scan.t), _MOST)).astype(int))
    ranges = scan.values[few]
    valid = np.isfinite(ranges)
    if valid.mean() < _FEW and not np.isinf(ranges).any():
        return [f"scans have almost no readings: {valid.mean():.2%} of {ranges.size} are numbers above 0"]
    if valid.any() and np.ptp(ranges[valid]) == 0 and valid.sum() > 100:
        return [f"all ranges are {ranges[valid][0]:g}: the laser measured nothing"]
    told = [_stuck(scan, pose), _piled(ranges, farthest), _degrees(laser)]
    if pose is not None and laser is not None:
        told.append(_mirrored(scan, pose, laser))
    return [line for line in told if line is not None]


def _stuck(scan: Series, pose: Series | None) -> str | None:
    """Tell of scans that stay the same while the robot moves."""
    if pose is None or len(scan.t) < 10:
        return None
    at = geometry.interpolate(pose.t, pose.values[:, :3], scan.t)
    # Where nothing is in sight, every scan is like the other.
    seen = np.isfinite(scan.values[1:]).any(axis=1)
    moved = (np.abs(np.diff(at, axis=0)).max(axis=1) > 0.02) & seen
    same = np.array([np.array_equal(a, b, equal_nan=True) for a, b in zip(scan.values, scan.values[1:], strict=False)])
    if moved.sum() < 10 or same[moved].mean() < _STUCK:
        return None
    first = float(scan.t[:-1][moved & same][0])
    return (
        f"{same[moved].mean():.0%} of the scans equal the one before while the robot moves (first: t = {moment(first)})"
    )


def _piled(ranges: FloatArray, farthest: float) -> str | None:
    values = ranges[np.isfinite(ranges)]
    if len(values) < 100 or np.isinf(ranges).any():
        return None
    largest = float(values.max())
    share = float((values == largest).mean())
    below = float(values[values < largest].max(initial=0.0))
    if share < _PILED or (below > largest * (1 - _GAP) and largest < farthest - 1e-3):
        return None
    return (
        f"{share:.1%} of the ranges are exactly {largest:g}, and none is inf: missing returns are written as a number; "
        f"try inf for {largest:g}"
    )


def _degrees(laser: LaserMount | None) -> str | None:
    if laser is None:
        return None
    span = abs(laser.angle_increment) * (laser.beams - 1)
    if span < 2 * np.pi * 1.01 and abs(laser.angle_min) < 2 * np.pi:
        return None
    return (
        f"the beams span {span:.4g} rad from {laser.angle_min:.4g} rad on, more than a turn: degrees? "
        f"try angle_min and angle_increment * pi / 180"
    )


def _mirrored(scan: Series, pose: Series, laser: LaserMount) -> str | None:
    """Tell whether the surroundings turn the wrong way while the robot turns."""
    pairs, turn = _turning(scan, pose)
    if len(pairs) < _PAIRS:
        return None
    beams = np.arange(scan.values.shape[1])
    change = {1.0: 0.0, -1.0: 0.0}
    for i, by in zip(pairs, turn, strict=True):
        a, b = scan.values[i], np.where(np.isfinite(scan.values[i + 1]), scan.values[i + 1], np.nan)
        for sign in change:
            # A wall at bearing phi is at phi - by after a turn by that.
            moved = np.interp(beams - sign * by / laser.angle_increment, beams, b, left=np.nan, right=np.nan)
            good = np.isfinite(a) & np.isfinite(moved)
            if good.sum() > 20:
                change[sign] += float(np.median(np.abs(a[good] - moved[good])))
    if change[-1.0] >= 0.5 * change[1.0]:
        return None
    apart = [change[sign] / len(pairs) for sign in (1.0, -1.0)]
    return (
        f"beams are counted the other way round (clockwise): over {len(pairs)} turns, scans before and after "
        f"differ by {apart[0]:.3g} m as given, by {apart[1]:.3g} m with the beams reversed; try r reversed"
    )


def _turning(scan: Series, pose: Series) -> tuple[IntArray, FloatArray]:
    """Return scans after which the robot turned on the spot till the next one, and by how much [rad]."""
    inside = (scan.t[:-1] >= pose.t[0]) & (scan.t[1:] <= pose.t[-1])
    at = geometry.interpolate(pose.t, pose.values[:, :3], scan.t)
    step = np.diff(at, axis=0)
    size = np.abs(step[:, 2])
    pairs = np.flatnonzero(inside & (size > _TURN[0]) & (size < _TURN[1]) & (np.hypot(*step[:, :2].T) < _SHIFT))
    pairs = pairs[np.unique(np.linspace(0, len(pairs) - 1, 60).astype(int))] if len(pairs) > 60 else pairs
    return pairs, step[pairs, 2]
