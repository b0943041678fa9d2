# SPDX-License-Identifier: BSD-3-Clause
"""Rows of a reference that are elsewhere for a while: jumps away, paired with those that come back."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from kurumaisu.critic.sanity.pose_jumps import jumps
from kurumaisu.critic.values.recording import Series
from kurumaisu.types import FloatArray

_BACK = 5.0  # [s] within which a reference that was elsewhere is back
_SAME = 0.5  # share of its first jump that is left when it is back
NEAR = 2  # rows
_GAP = 5.0  # usual intervals

Spans = list[tuple[int, int, float]]  # first row, end and distance [m] of each stretch that is off


def displaced_rows(pose: Series, command: Series | None) -> Spans:
    """Return what is off, however it jumps about meanwhile: what leaves fewest jumps, and then most rows.

    A jump may end what lasts for longer, or be what a single row does.
    """
    lasting, single = jumps(pose, 1.0, command)
    jumped = sorted({*lasting, *single})
    step = _beyond_motion(pose, jumped)
    alone = [(row, row + 1, float(np.hypot(*step[row - 1]))) for row in _singles(pose, jumped)]
    ways = []
    known: Spans
    for known in ([], alone) if alone else ([],):
        rest = [i for i in jumped if i not in _ends(known)]
        found = [*known, *_returns(pose, rest, set(single), step)]
        found += _next_to_gaps(pose, [i for i in jumped if i not in _ends(found)])
        left = len(set(jumped) - _ends(found))
        ways.append((left, sum(end - first for first, end, _ in found), sorted(found)))
    return min(ways)[2]


def _ends(spans: Spans) -> set[int]:
    return {row for first, end, _ in spans for row in (first, end)}


def _singles(pose: Series, jumped: Sequence[int]) -> list[int]:
    """Return the rows that jump away alone, and back with the next."""
    out: list[int] = []
    for i in jumped:
        if i + 1 in jumped and i - 1 not in out and _alone(pose, i):
            out.append(i)
    return out


def _returns(pose: Series, jumped: Sequence[int], single: set[int], step: FloatArray) -> Spans:
    """Return the stretches from a jump to the one that brings it back; step (n - 1, 2) [m]: beyond the motion."""
    found: Spans = []
    away, last = 0, 0  # rows at which it left, and jumped last
    off, far = np.zeros(2), 0.0  # how far it is off, and was at most
    for i in jumped:
        if away in single and last == away and i > away + 1 and _alone(pose, away):
            found.append((away, away + 1, far))  # its way back was no jump
            away = 0
        if not away or pose.t[i] - pose.t[away] >= _BACK:
            away, off, far = i, np.zeros(2), 0.0
        off, last = off + step[i - 1], i
        far = max(far, float(np.hypot(*off)))
        if np.hypot(*off) < _SAME * np.hypot(*step[away - 1]):
            found.append((away, i, far))
            away = 0
    if away in single and last == away and away + 1 < len(pose.t) and _alone(pose, away):
        found.append((away, away + 1, far))
    return found


def _next_to_gaps(pose: Series, jumped: Sequence[int]) -> Iterator[tuple[int, int, float]]:
    """Yield the same of the few rows between a jump and a gap, or an end: where it came from, or went to, is hidden."""
    lasts = np.diff(pose.t)
    gaps = [0, *(np.flatnonzero(lasts > _GAP * np.median(lasts)) + 1).tolist(), len(pose.t)]
    for i in jumped:
        far = float(np.hypot(*(pose.values[i, :2] - pose.values[i - 1, :2])))
        yield from ((min(i, gap), max(i, gap), far) for gap in gaps if 0 < abs(gap - i) <= NEAR)


def _beyond_motion(pose: Series, jumped: Sequence[int]) -> FloatArray:
    """Return by how much each row (n - 1, 2) [m] is off the one before, beyond what the rows about jumps move."""
    step, lasts = np.diff(pose.values[:, :2], axis=0), np.diff(pose.t)[:, np.newaxis]
    quiet = np.setdiff1d(np.arange(1, len(pose.t)), jumped)
    if not len(quiet):
        return step
    rates = (step / lasts)[quiet - 1]
    return np.asarray(step - lasts * np.column_stack([np.interp(pose.t[1:], pose.t[quiet], one) for one in rates.T]))


def _alone(pose: Series, row: int) -> bool:
    """Tell whether the row after one that jumped is back where it jumped from."""
    jump, left = pose.values[row : row + 2, :2] - pose.values[row - 1, :2]
    return bool(np.hypot(*left) < _SAME * np.hypot(*jump))
