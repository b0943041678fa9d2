# SPDX-License-Identifier: BSD-3-Clause
"""A chair that nobody told where it is, and one that was carried away."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from kurumaisu.geometry import between, compose
from kurumaisu.localization import Localizer
from kurumaisu.slam import ScanLog
from kurumaisu.types import FloatArray

_SCANS = 1200  # two minutes
_BEFORE = 150  # scans before the chair is carried away
_WRONG, _RIGHT = 1.0, 0.5  # [m]
_FAR = 3.0  # [m] it is carried at least; less it may take for a slip
_FIRST_SEED = 1000

Logs = Sequence[tuple[ScanLog, FloatArray]]
Make = Callable[[int], Localizer]


@dataclass(frozen=True)
class Found:
    """right at the end; wrong: ever sure of a wrong place; times [s], inf = never; slowest scan [ms]."""

    right: bool
    wrong: bool
    noticed_after: float
    found_after: float
    slowest: float


def from_nowhere(make: Make, logs: Logs, case: int, first_seed: int = _FIRST_SEED) -> Found:
    """Follow two minutes of a log from a random scan on, the start unknown."""
    log, truth = logs[case % len(logs)]
    rng = np.random.default_rng(first_seed + case)
    begin = int(rng.integers(50, len(log.times) - _SCANS - 50))
    localizer = make(case + 1)
    localizer.forget()
    return _judge(*_run(localizer, log, truth, begin, np.zeros(3), 0.0))


def carried_away(make: Make, logs: Logs, case: int, first_seed: int = _FIRST_SEED) -> Found:
    """Follow 15 s of a log, then two minutes from elsewhere in it, as if the chair had been put there."""
    log, truth = logs[case % len(logs)]
    rng = np.random.default_rng(first_seed + case)
    there = int(rng.integers(50, len(log.times) - _SCANS - 50))
    far = np.hypot(*(truth[_BEFORE:] - truth[there])[:, :2].T) > _FAR
    here = int(rng.choice(np.flatnonzero(far)))
    localizer = make(case + 1)
    localizer.set_pose(truth[here].tolist(), np.diag([0.01, 0.01, 0.005]))
    for i in range(here, here + _BEFORE):
        localizer.add(
            log.times[i] - log.times[here], log.ranges[i], log.fan, log.odom[i].tolist(), log.odom_end[i].tolist()
        )
    # Odometry goes on as if nothing had happened.
    shift = compose(log.odom[here + _BEFORE - 1], between(log.odom[there], np.zeros(3)))
    return _judge(*_run(localizer, log, truth, there, shift, _BEFORE * 0.1))


def _run(
    localizer: Localizer, log: ScanLog, truth: FloatArray, begin: int, shift: FloatArray, clock: float
) -> tuple[FloatArray, FloatArray, FloatArray, float]:
    """Return times [s], whether it was sure, how far it was off [m], and the slowest scan [ms]."""
    sure, off, slowest = [], [], 0.0
    index = range(begin, begin + _SCANS)
    times = log.times[begin : begin + _SCANS] - log.times[begin]
    for i, t in zip(index, times, strict=True):
        start, end = compose(shift, log.odom[i]), compose(shift, log.odom_end[i])
        before = time.process_time()
        said = localizer.add(clock + t, log.ranges[i], log.fan, start.tolist(), end.tolist())
        slowest = max(slowest, 1000 * (time.process_time() - before))
        sure.append(said["knowledge"] == "tracking")
        off.append(np.hypot(*(np.array(said["pose"]) - truth[i])[:2]))
    return times, np.array(sure, dtype=np.float64), np.array(off), slowest


def _judge(times: FloatArray, sure: FloatArray, off: FloatArray, slowest: float) -> Found:
    doubted = np.flatnonzero(sure == 0)
    noticed = float(times[doubted[0]]) if len(doubted) else np.inf
    since = times >= noticed
    good = np.flatnonzero(since & (sure == 1) & (off < _RIGHT))
    return Found(
        right=bool(sure[-1] and off[-1] < _RIGHT),
        wrong=bool(np.any(since & (sure == 1) & (off > _WRONG))),
        noticed_after=noticed,
        found_after=float(times[good[0]]) if len(good) else np.inf,
        slowest=slowest,
    )
