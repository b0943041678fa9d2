# SPDX-License-Identifier: BSD-3-Clause
"""Scans that are wrong whatever the map: no readings, stuck ones, no return written as a number, a mirrored fan."""

from __future__ import annotations

import numpy as np

from kurumaisu import geometry
from kurumaisu.critic.values.digits import moment
from kurumaisu.critic.values.recording import LaserMount, Series
from kurumaisu.types import FloatArray, IntArray

_FEW = 0.01  # share of readings that are valid, below which nothing was measured
_STUCK = 0.5  # share of scans that equal the one before while the robot moves
_PILED = 0.01  # share of readings that are exactly the largest one, from which it is no distance
_GAP = 0.05  # relative gap below a largest value that is no distance
_TURN = (0.04, 0.5)  # [rad] between scans that tell which way beams are counted
_SHIFT = 0.08  # [m] driven between them at most
_PAIRS = 10
_MOST = 4000  # scans that are looked at


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
        a, b = scan.values[i], scan.values[i + 1]
        for sign in change:
            # A wall at bearing phi is at phi - by after a turn by that.
            moved = np.interp(beams - sign * by / laser.angle_increment, beams, _held(b), left=np.nan, right=np.nan)
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


def _held(ranges: FloatArray) -> FloatArray:
    return np.where(np.isfinite(ranges), ranges, np.nan)
