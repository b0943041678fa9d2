# SPDX-License-Identifier: BSD-3-Clause
"""How the chair would have driven, by the board's log: rates, slopes and distances."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from kurumaisu._core import AxisInverse, AxisLaw
from kurumaisu.bench.guard_rig import Change
from kurumaisu.types import FloatArray

_REST = 0.002  # [V] more than a code of the board: the rounding of rest


def rates(law: AxisLaw, samples: Sequence[tuple[float, float]]) -> tuple[FloatArray, FloatArray]:
    """Return times [s] and speeds [m/s] of samples, each a time [s] and V_f [V]; rest is 0.

    Of samples at the same time the first counts.
    """
    times, volts = (np.array(column) for column in zip(*samples, strict=True))
    kept = np.r_[True, np.diff(times) > 0]
    times, volts = times[kept], volts[kept]
    return times, np.where(np.abs(volts) < _REST, 0.0, AxisInverse(law).rates(volts, np.sign(volts)))


def samples(changes: Sequence[Change]) -> list[tuple[float, float]]:
    """Return the board's changes as rates() takes them."""
    return [(change.time, change.volts[0]) for change in changes if change.volts is not None]


def distance(law: AxisLaw, changes: Sequence[Change], until: float) -> float:
    """Return how far [m] the chair would have driven from the first change to a time [s], each voltage held."""
    times, speeds = rates(law, samples(changes))
    return float(np.sum(speeds * np.diff(np.r_[times, until])))


def steepest(times: FloatArray, speeds: FloatArray, span: float) -> float:
    """Return the largest |slope| [m/s^2] over so long a time [s]."""
    later = np.searchsorted(times, times + span)
    first = np.flatnonzero(later < len(times))
    later = later[first]
    slopes = np.abs(speeds[later] - speeds[first]) / (times[later] - times[first])
    return float(np.max(slopes, initial=0.0))


def sharpest(times: FloatArray, speeds: FloatArray, span: float) -> float:
    """Return the largest second difference, as a jerk [m/s^3], over twice so long a time [s]."""
    middle = np.searchsorted(times, times + span)
    middle = middle[middle < len(times)]
    later = np.searchsorted(times, times[middle] + span)
    later = later[later < len(times)]
    middle, first = middle[: len(later)], np.arange(len(later))
    before = (speeds[middle] - speeds[first]) / (times[middle] - times[first])
    after = (speeds[later] - speeds[middle]) / (times[later] - times[middle])
    return float(np.max(2 * np.abs(after - before) / (times[later] - times[first]), initial=0.0))
