# SPDX-License-Identifier: BSD-3-Clause
"""Rover of Mines ParisTech: whether a tick of its wheels is what its reader says, or half or twice that."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from kurumaisu.real.by_hand import best_shift, least_squares, range_flow, robust
from kurumaisu.real.criticise import criticise, recording, there
from kurumaisu.types import FloatArray

RADIUS, TRACK = 0.077, 0.330  # [m] of the wheels, between them: as its own reader has them
TICKS = 2000  # a turn, as its own reader has them
AHEAD = 0.145  # [m] laser before the axle, likewise
ANGLE_MIN, INCREMENT, BEAMS = -2.0862138, 2 * np.pi / 1024, 682  # [rad] a URG-04LX from step 44 on
_CODES = 0.020  # [m] readings below are error codes
_ROWS = 10  # a second: windows over which scans and ticks are compared
_FAST = 0.12  # [rad] between two scans: more makes the range flow unsure
# Metres that a tick stands for are multiplied by: the wheel's circumference over its ticks, in each way of reading.
READINGS = {"half": 0.5, "plain": 1.0, "twice": 2.0}


@dataclass(frozen=True)
class Log:
    """t (n,) [s]; way (n, 2) of left and right wheel [m], plainly read; speed (n,) [m/s]; ranges (n, beams) [m]."""

    t: FloatArray
    way: FloatArray
    speed: FloatArray
    ranges: FloatArray


def load(data: Path) -> Log:
    """Read the log. Raise Error where it is not there."""
    rows = np.loadtxt(there(data / "breezyslam_mines/exp1.dat"))
    way = np.unwrap(rows[:, 2:4], period=65536, axis=0) * 2 * np.pi * RADIUS / TICKS
    ranges = 1e-3 * rows[:, 24 : 24 + BEAMS]
    ranges[ranges < _CODES] = np.nan
    return Log((rows[:, 0] - rows[0, 0]) * 1e-6, way - way[0], rows[:, 4], ranges)


def odometry(log: Log, factor: float) -> FloatArray:
    """Return rows (n, 6) of t, x, y, theta, v, w of dead reckoning, a tick read as factor times the plain way."""
    steps = factor * np.diff(log.way, axis=0, prepend=log.way[:1])
    ahead, turn = steps.mean(axis=1), (steps[:, 1] - steps[:, 0]) / TRACK
    theta = np.cumsum(turn)
    course = theta - turn / 2
    rates = np.column_stack([ahead, turn])[1:] / np.diff(log.t)[:, None]
    rates = np.vstack([rates[:1], rates])
    return np.column_stack([log.t, np.cumsum(ahead * np.cos(course)), np.cumsum(ahead * np.sin(course)), theta, rates])


def run(data: Path, output: Path) -> None:
    """Print what can be said of the rover."""
    log = load(data)
    print("## By hand")
    steps = np.diff(log.t)
    print(
        f"{len(log.t)} rows in {log.t[-1]:.1f} s; interval {1e3 * steps.mean():.1f} ms, sd {1e3 * steps.std():.1f} ms"
    )
    print(f"{np.isnan(log.ranges).mean():.1%} of the readings are error codes (below {1e3 * _CODES:.0f} mm)")
    spun = np.diff(log.way, axis=0)
    ahead, turn = spun.mean(axis=1), (spun[:, 1] - spun[:, 0]) / TRACK
    plain = ahead / steps
    said = log.speed[1:]
    good = steps > 0.05
    shift, alike = best_shift(log.t[1:], plain, said, 1.0)
    line = least_squares(plain[good, None], said[good])
    print(f"speed that the log states over plain ticks: {line.told(0, 3)} (correlation {alike:.2f} at {shift:+.2f} s)")
    for told in _against_scans(log, ahead, turn):
        print(told)
    scan = np.column_stack([log.t, log.ranges])
    mount = {"x": AHEAD, "y": 0.0, "yaw": 0.0, "angle_min": ANGLE_MIN, "angle_increment": INCREMENT, "beams": BEAMS}
    for name, factor in READINGS.items():
        folder = recording(output / name, {"drive": {"odom": odometry(log, factor), "scan": scan}}, laser=mount)
        criticise(folder, output / name, f"ticks read as {factor:g} of the plain way")


def _against_scans(log: Log, ahead: FloatArray, turn: FloatArray) -> list[str]:
    """Return in words how far the scans say that the rover went and turned, over what plain ticks say."""
    seen = range_flow(log.ranges, ANGLE_MIN + INCREMENT * np.arange(BEAMS), AHEAD)
    count = len(seen) // _ROWS
    shape = (count, _ROWS)
    used = count * _ROWS
    still = np.isfinite(seen[:used, 0]).reshape(shape).all(1) & (np.abs(turn[:used]).reshape(shape).max(1) < _FAST)
    told = []
    for name, i, x in (("way ahead", 0, ahead), ("turn", 1, turn)):
        late, alike = best_shift(log.t[1:], x, np.nan_to_num(seen[:, i]), 1.0)
        moved = np.roll(x, round(late / float(np.median(np.diff(log.t)))))
        asked, got = moved[:used].reshape(shape).sum(1)[still], seen[:used, i].reshape(shape).sum(1)[still]
        rng = np.random.default_rng(1)
        drawn = [rng.integers(0, still.sum(), still.sum()) for _ in range(200)]
        sd = float(np.std([robust(asked[k, None], got[k])[0] for k in drawn]))
        told.append(
            f"{name}, scans (range flow) over plain ticks: {robust(asked[:, None], got)[0]:.2f} +- {sd:.2f}, "
            f"{still.sum()} windows of 1 s (scans come {late:+.2f} s after ticks, correlation {alike:.2f})"
        )
    return told
