# SPDX-License-Identifier: BSD-3-Clause
"""Two iRobot Create of the UTIAS MRCLAM data set: commands, and poses by motion capture."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from kurumaisu.critic.data.reading import read_recording
from kurumaisu.params import robot_called
from kurumaisu.real.by_hand import best_shift
from kurumaisu.real.criticise import criticise, strangers
from kurumaisu.types import BoolArray, FloatArray

_STEP = 0.05  # [s] between samples
_HALF = 2  # samples either way, over which the measured speed is a mean
_STEADY = 1.0  # [s] without a change, after which a command counts as followed
_STRAIGHT, _TURNING = 0.02, 0.1  # [rad/s] asked for, at most and at least
_DRIVEN = 0.03  # [m/s] asked for, from which the robot is to drive
_BEFORE, _AFTER = 1.0, 1.2  # [s] about a start or stop in which nothing else is asked for
_SAME = 0.004  # [m/s] by which a command may vary there
_FEW = 3  # stretches, or steps, below which nothing is said


@dataclass(frozen=True)
class Log:
    """Evenly spaced times t (n,) [s]; v [m/s] and w [rad/s] as asked for and as the poses say, (n, 2) each."""

    t: FloatArray
    asked: FloatArray
    seen: FloatArray


def run(data: Path, output: Path) -> None:
    """Print what both robots make of commands, by hand and by the critic."""
    for name in ("create_r5", "create_r3"):
        folder = strangers(data, name)
        print(f"## By hand: {name}")
        for line in by_hand(load(folder)):
            print(line)
        criticise(folder, output / name, name, robot_called("velocity"))
        print()


def load(folder: Path) -> Log:
    """Return what was asked for and what was measured. Raise Error as read_recording does."""
    (drive,) = read_recording(folder).runs
    assert drive.pose is not None
    assert drive.command is not None
    times, pose, command = drive.pose.t, drive.pose.values, drive.command
    t = np.arange(max(times[0], command.t[0]), min(times[-1], command.t[-1]), _STEP)
    x, y, theta = (np.interp(t, times, part) for part in (pose[:, 0], pose[:, 1], np.unwrap(pose[:, 2])))
    dx, dy, w = ((part[2 * _HALF :] - part[: -2 * _HALF]) / (2 * _HALF * _STEP) for part in (x, y, theta))
    t, theta = t[_HALF:-_HALF], theta[_HALF:-_HALF]
    held = np.searchsorted(command.t, t, side="right") - 1
    return Log(t, command.values[held, :2], np.column_stack([dx * np.cos(theta) + dy * np.sin(theta), w]))


def by_hand(log: Log) -> Iterator[str]:
    """Yield what a careful person finds: how late it comes, how it starts and stops, and what it keeps."""
    for k, name in enumerate("vw"):
        shift, correlation = best_shift(log.t, log.asked[:, k], log.seen[:, k], 1.0)
        yield f"{name} comes {shift:.2f} s after its command (largest correlation, {correlation:.2f})"
    for word, start in (("start", True), ("stop", False)):
        steps = responses(log, start=start)
        if len(steps) >= _FEW:
            reached = [_reached(np.median(steps, axis=0), share) for share in (0.1, 0.5, 0.9)]
            yield (
                f"{len(steps)} {word}s: a tenth, half, nine tenths after "
                + ", ".join(f"{s:.2f}" for s in reached)
                + " s"
            )
    w, driven = log.asked[:, 1], log.asked[:, 0] > _DRIVEN
    for words, column, these in (
        ("v straight ahead", 0, driven & (np.abs(w) < _STRAIGHT)),
        ("v in bends", 0, driven & (np.abs(w) > _TURNING)),
        ("w to the left", 1, w > _TURNING),
        ("w to the right", 1, w < -_TURNING),
    ):
        asked, seen = steady(log, column, these)
        if len(asked) >= _FEW:
            shares = seen / asked
            sd = float(np.sqrt(np.pi / 2) * np.std(shares) / np.sqrt(len(shares)))
            usual = float(np.median(np.abs(asked)))
            yield f"{words}: {np.median(shares):.3f} +- {sd:.3f} of a usual {usual:.3f}, {len(shares)} steady stretches"


def steady(log: Log, column: int, these: BoolArray) -> FloatArray:
    """Return v or w (2, k), as asked for and as seen, in stretches of these (n,) in which nothing changed for long."""
    changed = np.append(True, np.any(np.diff(log.asked, axis=0) != 0, axis=1))
    stretch = np.cumsum(changed)
    since = log.t - log.t[changed][stretch - 1]
    these = these & (since > _STEADY)
    some = [these & (stretch == one) for one in np.unique(stretch[these])]
    return np.array([[part[one, column].mean() for one in some] for part in (log.asked, log.seen)])


def responses(log: Log, *, start: bool) -> FloatArray:
    """Return the share of each step of v from or to rest, straight ahead, that is seen after 0, 0.05 ... s."""
    v, driven = log.asked[:, 0], log.asked[:, 0] > _DRIVEN
    before, after = round(_BEFORE / _STEP), round(_AFTER / _STEP)
    out = []
    for i in np.flatnonzero(np.diff(driven.astype(int)) == (1 if start else -1)) + 1:
        if i < before or i + after > len(v):
            continue
        quiet = np.ptp(v[i - before : i]) < _SAME and np.ptp(v[i : i + after]) < _SAME
        if quiet and np.abs(log.asked[i - before : i + after, 1]).max() < _TURNING:
            out.append((log.seen[i : i + after, 0] - v[i - 1]) / (v[i] - v[i - 1]))
    return np.array(out)


def _reached(response: FloatArray, share: float) -> float:
    """Return when a response first has a share [s]."""
    k = int(np.argmax(response >= share))
    if k == 0:
        return 0.0
    low, high = response[k - 1], response[k]
    return float(_STEP * (k - 1 + (share - low) / (high - low)))
