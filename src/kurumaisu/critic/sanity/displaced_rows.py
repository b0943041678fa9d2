# SPDX-License-Identifier: BSD-3-Clause
"""Rows of a reference that are elsewhere for a while: between a jump away and one back, a gap, or an end."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from kurumaisu.critic.sanity.pose_jumps import jumps
from kurumaisu.critic.values.recording import Series
from kurumaisu.types import FloatArray

_BACK = 5.0  # [s] within which a reference that was elsewhere is back
_SAME = 0.5  # share of its first jump that is left when it is back
NEAR = 2  # rows
_GAP = 5.0  # usual intervals

Spans = list[tuple[int, int, float]]  # first row, end and distance [m] of each stretch that is off
_Way = tuple[int, int, Spans]  # jumps left, rows set aside, and which


def displaced_rows(pose: Series, command: Series | None) -> Spans:
    """Return what is off, however it jumps about meanwhile: what leaves fewest jumps, and then most rows."""
    lasting, single = jumps(pose, 1.0, command)
    jumped = {*lasting, *single}
    if not jumped:
        return []
    lasts = np.diff(pose.t)
    hidden = {0, *(np.flatnonzero(lasts > _GAP * np.median(lasts)) + 1).tolist(), len(pose.t)}
    turns = jumped | {row + 1 for row in single}  # a single row is back with the next, be it by a jump or not
    step = _beyond_motion(pose, sorted(jumped))

    def off(first: int, end: int) -> float | None:
        """Return how far [m] rows are off; None where they are not, or nobody knows."""
        if end - first <= NEAR and ({first, end} & jumped) and ({first, end} & hidden):
            return float(np.hypot(*step[(first if first in jumped else end) - 1]))
        if first not in jumped or end not in turns or end == len(pose.t) or pose.t[end] - pose.t[first] >= _BACK:
            return None
        away = np.hypot(*np.cumsum([step[row - 1] for row in range(first, end + 1) if row in turns], axis=0).T)
        back = away < _SAME * away[0]
        return float(away.max()) if back[-1] and not back[:-1].any() else None

    cuts = sorted(turns | hidden)
    kept: dict[int, _Way] = {0: (0, 0, [])}  # the best way to each cut, up to which rows are kept,
    aside: dict[int, _Way] = {}  # and up to which they are set aside
    near = 0
    for k, (before, end) in enumerate(pairwise(cuts)):
        left, rows, spans = kept[before]
        kept[end] = min((left + (before in jumped), rows, spans), aside.get(before, (len(cuts), 0, [])))
        while near <= k and pose.t[end - 1] - pose.t[cuts[near]] >= _BACK:
            near += 1
        for first in cuts[near : k + 1]:
            if (far := off(first, end)) is not None:
                left, rows, spans = kept[first]
                way = (left, rows + end - first, [*spans, (first, end, far)])
                aside[end] = min(way, aside.get(end, way))
    return min(kept[len(pose.t)], aside.get(len(pose.t), kept[len(pose.t)]))[2]


def _beyond_motion(pose: Series, jumped: Sequence[int]) -> FloatArray:
    """Return by how much each row (n - 1, 2) [m] is off the one before, beyond what the rows about jumps move."""
    step, lasts = np.diff(pose.values[:, :2], axis=0), np.diff(pose.t)[:, np.newaxis]
    quiet = np.setdiff1d(np.arange(1, len(pose.t)), jumped)
    if not len(quiet):
        return step
    rates = (step / lasts)[quiet - 1]
    return np.asarray(step - lasts * np.column_stack([np.interp(pose.t[1:], pose.t[quiet], one) for one in rates.T]))
