# SPDX-License-Identifier: BSD-3-Clause
"""Counters of wheels that overflow, or begin anew when their driver does: what they would have counted without."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kurumaisu.critic.data.clean import HICCUP_SHARE, Faults
from kurumaisu.critic.values.digits import moment
from kurumaisu.types import BoolArray, FloatArray, IntArray

Spans = tuple[tuple[float, float], ...]
_RANGES = (2.0**8, 2.0**16, 2.0**32)  # of counters, beside a turn of the wheel
_FASTER = 1.5  # times the largest of the other steps that a wheel may take
_ANEW = 10.0  # times that which a jump from or to 0 has at least, and
_NEAR = 0.1  # share of the jump by which one end of it may be off 0
_LEAST = 0.1  # [rad] that any wheel may turn in a step, or
_LEAST_SHARE = 1 / 16  # of the range
_FASTEST = 100.0  # [m/s] no wheel drives faster


@dataclass(frozen=True)
class Counter:
    """A counter: where it is read, in words; how far its wheel turns for 1 [rad], and drives [m]."""

    where: str
    turn: float
    way: float


def counted(counter: Counter, t: FloatArray, counts: FloatArray, faults: Faults) -> tuple[FloatArray, Spans]:
    """Return counts (n,) at times (n,) [s] without overflows, and spans [s] in which it is not known what was counted.

    An overflow is a jump to the other end of the smallest range that holds all counts, if the wheel, had it turned past
    that end, would not have turned faster than elsewhere, but otherwise much faster. In other jumps nothing is counted.
    faults gets the jumps of each kind: how many, and where the first is.
    """
    steps = np.diff(counts)
    if not len(steps):
        return counts, ()
    whole = 2 * np.pi / counter.turn
    size = _range(counts, whole)
    around = np.where(np.abs(steps) > size / 2, steps - np.sign(steps) * size, steps)
    overflows, unsure, jumps = _jumps(counter, t, counts, around, size)
    lost = unsure | jumps
    told = _Told(counter.where, t, counts, faults)
    kind = "begins each turn of the wheel anew" if size == whole else f"overflows, as it counts to {size:.0f}"
    told.add(overflows, kind, "it is counted on")
    told.add(unsure, "may have turned either way", "that time is left out")
    told.add(jumps, "jumps, which is neither an overflow nor motion", "that time is left out")
    if lost.sum() > HICCUP_SHARE * len(lost):
        faults.add(
            f"{counter.where}: it is too often not known what was counted: {lost.sum()} of {len(lost)}", fatal=True
        )
    moved = np.where(lost, 0.0, np.where(overflows, around, steps))
    return counts[0] + np.append(0.0, np.cumsum(moved)), tuple(
        (float(t[i]), float(t[i + 1])) for i in np.flatnonzero(lost)
    )


def _range(counts: FloatArray, whole: float) -> float:
    """Return the smallest range that holds all counts, from 0 or from minus its half; inf: there is none."""
    low, high = float(counts.min()), float(counts.max())
    for size in sorted({*_RANGES, whole}):
        slack = 1e-3 * size if size == whole else 0.0  # angles are rounded
        if (low >= -slack and high <= size + slack) or (low >= -size / 2 - slack and high <= size / 2 + slack):
            return size
    return float("inf")


def _jumps(
    counter: Counter, t: FloatArray, counts: FloatArray, around: FloatArray, size: float
) -> tuple[BoolArray, BoolArray, BoolArray]:
    """Return which steps are overflows, which may have gone either way, and which are no motion, (n - 1,) each.

    around: the steps, or the shorter way past the end of the range.
    """
    steps, times = np.abs(np.diff(counts)), np.diff(t)
    usual = float(np.median(times))
    slow = np.maximum(times / usual, 1.0)
    over = steps > size / 2
    at_zero = np.minimum(np.abs(counts[:-1]), np.abs(counts[1:])) <= _NEAR * steps
    wild = steps * counter.way > _FASTEST * usual * slow
    others = (steps / slow)[~(over | at_zero | wild)]
    least = max(float(others.max(initial=0.0)), min(_LEAST / counter.turn, _LEAST_SHARE * size))
    may = _FASTER * slow * least
    possible = np.abs(around) <= may
    overflows = over & possible & (steps > may)
    unsure = over & possible & (steps <= may)
    if overflows.any():  # then any step may have gone around
        unsure |= ~over & (size - steps <= may)
    jumps = (over & ~possible & (steps > may)) | (at_zero & (steps > _ANEW * slow * least)) | wild
    return overflows, unsure, jumps & ~overflows & ~unsure


@dataclass(frozen=True)
class _Told:
    where: str
    t: FloatArray
    counts: FloatArray
    faults: Faults

    def add(self, which: BoolArray, what: str, so: str) -> None:
        """Say of some steps what they are, how many they are, and where the first is."""
        rows: IntArray = np.flatnonzero(which)
        if not len(rows):
            return
        first = int(rows[0])
        a, b = self.counts[first], self.counts[first + 1]
        times = "once" if len(rows) == 1 else f"{len(rows)} times"
        place = f"(first: from {a:.10g} to {b:.10g} at t = {moment(float(self.t[first + 1]))})"
        self.faults.add(f"{self.where}: {what}, {times} {place}: {so}")
