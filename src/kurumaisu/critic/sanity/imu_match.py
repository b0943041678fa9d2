# SPDX-License-Identifier: BSD-3-Clause
"""Headings of a reference against how far a gyro says that the robot turned: one of both may be wrong.

A gyro's bias is free here, and its scale within some per cent: no gyro is better than that.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from kurumaisu.critic.rates.yaw_rate import heading
from kurumaisu.critic.values.digits import moment, times
from kurumaisu.critic.values.recording import Run, Series
from kurumaisu.robust import SIGMA_PER_MAD
from kurumaisu.types import BoolArray, FloatArray, IntArray

_APART = 1.0  # [s] between the rows that are compared, at least
_LONGEST = 5.0  # [s] between them at most
_GAP = 0.5  # [s] without rows of the gyro
_FEWEST = 20  # intervals
_TURNING = 0.05  # [rad/s] rms of turning below which neither scale nor clock shows
_LAGS = np.arange(-10.0, 10.01, 0.05)  # [s] by which a reference may come after the gyro
_LATE = 0.5  # [s] more is no delay of a reference
_SCALE = 0.05  # share by which a gyro's scale may be off, and more
_FAR, _TURN = 8.0, 0.1  # sd, and [rad], from which an interval is odd
_MOST = 0.1  # share of the intervals that may be set aside
_AGREES = 0.03  # share by which two that agree may differ


@dataclass(frozen=True)
class Comparison:
    """How a reference turned beside a gyro: late by [s]; scale times as far, with its sd; odd intervals.

    spans [s] and sizes [rad] of what is odd; share: of all that were compared.
    """

    late: float
    scale: float
    sd: float
    spans: tuple[tuple[float, float], ...]
    sizes: tuple[float, ...]
    share: float


def compare(run: Run) -> Comparison | None:
    """Return how the headings of a run's reference follow its gyro; None where too little can be compared."""
    if run.imu is None or run.pose is None or run.courses or run.pose_source != "measured":
        return None
    return _compared(run.pose, run.imu)


def problems(run: Run) -> list[str]:
    """Return what the reference's headings and the gyro do not agree on, in words."""
    found = compare(run)
    return [] if found is None else list(_problems(run, found))


def odd(run: Run) -> tuple[tuple[tuple[float, float], ...], str]:
    """Return the spans [s] in which a reference turns as no gyro says, and in words; few enough to set them aside."""
    found = compare(run)
    if found is None or not found.spans or found.share > _MOST or list(_clock_and_scale(run, found)):
        return (), ""
    return found.spans, f"{run.name}: {_odd_words(found)}; set aside"


def _problems(run: Run, found: Comparison) -> Iterator[str]:
    told = list(_clock_and_scale(run, found))
    yield from told
    if not told and found.share > _MOST:
        yield f"{_odd_words(found)}; that is {100 * found.share:.0f} % of the time"


def _clock_and_scale(run: Run, found: Comparison) -> Iterator[str]:
    out = " (or leave the imu out: `imu: {axis: none}`)"
    if abs(found.late) > _LATE:
        way = "after" if found.late > 0 else "before"
        mend = f"try t of the reference pose {-found.late:+.2f} s"
        yield f"clocks differ: the reference turns {abs(found.late):.2f} s {way} the imu; {mend}{out}"
    elif abs(found.scale - 1) > _SCALE + 3 * found.sd:
        allowed = f"whose scale may be off by {100 * _SCALE:.0f} %"
        turns = f"the heading of the reference turns {found.scale:.3f} times as far as the imu says, {allowed}"
        yield f"{turns}{_witness(run, found)}{out}"


def _witness(run: Run, found: Comparison) -> str:
    """Return in words with which of both the odometry agrees."""
    assert run.imu is not None
    other = None if run.odom is None else _compared(run.odom, run.imu)
    if other is None:
        return ""
    near = [name for name, scale in (("imu", 1.0), ("reference", found.scale)) if abs(other.scale - scale) < _AGREES]
    return f"; the odometry turns {other.scale:.3f} times as far{f', as the {near[0]}' if near else ''}"


def _odd_words(found: Comparison) -> str:
    first, size = found.spans[0], found.sizes[0]
    return (
        f"the heading of the reference turns otherwise than the imu says {times(len(found.spans))} (first: by "
        f"{size:+.2g} rad from t = {moment(first[0])} to {moment(first[1])}): relocalised, or a gyro that was shaken"
    )


def _compared(pose: Series, imu: Series) -> Comparison | None:
    t, theta = _thinned(pose)
    whole = heading(imu)
    gaps = np.flatnonzero(np.diff(imu.t) > _GAP)
    best: tuple[float, float] | None = None
    for late in _LAGS:
        use, turned, seen, dt = _intervals(t, theta, imu.t, whole, gaps, late)
        if use.sum() < _FEWEST or np.sqrt(np.mean((turned[use] / dt[use]) ** 2)) < _TURNING:
            continue
        # Moduli, not squares: some intervals may hold jumps.
        cost = float(np.abs(_line(turned[use], seen[use], dt[use])[0]).mean())
        best = min(best, (cost, float(late))) if best is not None else (cost, float(late))
    if best is None:
        return None
    use, turned, seen, dt = _intervals(t, theta, imu.t, whole, gaps, best[1])
    left, scale, sd = _line(turned[use], seen[use], dt[use])
    noise = SIGMA_PER_MAD * float(np.median(np.abs(left - np.median(left))))
    far = np.abs(left) > np.maximum(_FAR * noise, _TURN)
    since, until = t[:-1][use][far], t[1:][use][far]
    spans = tuple((float(a), float(b)) for a, b in zip(since, until, strict=True))
    return Comparison(best[1], scale, sd, spans, tuple(left[far].tolist()), float(far.mean()))


def _thinned(pose: Series) -> tuple[FloatArray, FloatArray]:
    keep = [0]
    for i, t in enumerate(pose.t):
        if t - pose.t[keep[-1]] >= _APART:
            keep.append(i)
    return pose.t[keep], pose.column("theta")[keep]


def _intervals(
    t: FloatArray, theta: FloatArray, gyro: FloatArray, whole: FloatArray, gaps: IntArray, late: float
) -> tuple[BoolArray, FloatArray, FloatArray, FloatArray]:
    """Return which intervals between times (n + 1,) count, how far gyro and reference turned, and how long they are."""
    at = t - late
    use = (at[:-1] >= gyro[0]) & (at[1:] <= gyro[-1]) & (np.diff(t) < _LONGEST)
    for gap in gaps:
        use &= (at[1:] < gyro[gap]) | (at[:-1] > gyro[gap + 1])
    return use, np.diff(np.interp(at, gyro, whole)), np.diff(theta), np.diff(t)


def _line(turned: FloatArray, seen: FloatArray, dt: FloatArray) -> tuple[FloatArray, float, float]:
    """Return what is left of turns seen (n,) after scale * turned + bias * dt, the scale and its sd, robustly."""
    columns, weight = np.column_stack([turned, dt]), np.ones(len(dt))
    for _ in range(4):
        found, *_ = np.linalg.lstsq(columns * weight[:, None], seen * weight, rcond=None)
        left = seen - columns @ found
        noise = max(SIGMA_PER_MAD * float(np.median(np.abs(left))), 1e-6)
        weight = np.where(np.abs(left) > 4 * noise, 0.0, 1.0)
    return left, float(found[0]), noise / float(np.linalg.norm(turned * weight) + 1e-12)
