# SPDX-License-Identifier: BSD-3-Clause
"""Where the chair stood: poses measured again and again there are one pose, with one error."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from kurumaisu.critic.values.robust import third_difference_sd
from kurumaisu.types import FloatArray

_PAUSE = 5.0  # [s] without a pose, after which the chair may stand elsewhere
_APART = 1e-3  # [s] from the middle of a pause, at which the stand before ends and the next one begins
_STEP = 8.0  # sds of the poses' jitter that lie between two of them where the chair stands
_SPREAD = 2.2  # sds of the jitter, itself known to a third from few poses, that poses of one place scatter by
_FEWEST = 5  # poses of a stand
_MOSTLY = 0.5  # share of what might be a stand that is one: of a slow drive some poses always lie together
_OFF = 4.0  # sds of the jitter by which poses at the ends of a stand are off where the chair still rolls, or does again


def stands_averaged(times: FloatArray, poses: FloatArray, creeping: Sequence[float] = ()) -> FloatArray:
    """Return poses (n, 3), those of each stand replaced by their mean; times (n,) [s].

    creeping: times [s] in stands that are none.

    A reference errs alike while the chair stands. Taken for so many independent poses it would seem to be far better
    known than it is. One scan taken while the chair rolls out would be off by all that it rolls.
    """
    if len(times) < _FEWEST:
        return poses
    jitter = np.maximum(third_difference_sd(poses), 1e-9)
    step = np.abs(np.diff(poses, axis=0)) / jitter
    pauses = np.flatnonzero(np.diff(times) > _PAUSE) + 1
    cuts = np.union1d(np.flatnonzero((step > _STEP).any(axis=1)) + 1, pauses)
    apart = {0, len(times), *pauses.tolist()}  # nobody drove there
    out, inside = poses.copy(), np.clip(creeping, times[0], times[-1])
    for rows in np.split(np.arange(len(times)), cuts):
        still = rows[_still(poses[rows], jitter, rows[0] not in apart, rows[-1] + 1 not in apart)]
        if len(still) and ((inside >= times[still[0]]) & (inside <= times[still[-1]])).any():
            continue
        if len(still) >= max(_FEWEST, _MOSTLY * len(rows)) and _stands(poses[still], jitter):
            out[still] = poses[still].mean(axis=0)
    return out


def with_pause_rows(times: FloatArray, poses: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return times (m,) [s] and poses (m, 3) with rows in the middle of pauses: until or from there a stand lasts.

    Between two stands the chair was carried, nobody knows when. A straight way from one to the other would have it
    creep at the first and the last scans of both, and a late stamp or a long sweep would seem to show.
    """
    same = np.r_[False, (poses[1:] == poses[:-1]).all(axis=1), False]
    row = np.arange(len(times) - 1)
    gap = (np.diff(times) > _PAUSE) & ~same[1:-1]
    late, early = row[gap & same[row]], row[gap & same[row + 2]]
    middle = 0.5 * (times[1:] + times[:-1])
    order = np.argsort(np.r_[np.arange(len(times)), late + 0.25, early + 0.75], kind="stable")
    every = np.r_[times, middle[late] - _APART, middle[early] + _APART]
    return every[order], np.concatenate([poses, poses[late], poses[early + 1]])[order]


def _stands(poses: FloatArray, jitter: FloatArray) -> bool:
    """Tell whether poses scatter as much as their jitter, and no more."""
    return bool((poses.std(axis=0) <= _SPREAD * jitter).all())


def _still(poses: FloatArray, jitter: FloatArray, before: bool, behind: bool) -> slice:
    """Return the rows of a stand (n, 3) without those at its ends in which the chair may still roll.

    before, behind: whether it was driven there, so that nobody knows when within the last interval it came to rest.
    """
    off = (poses - np.median(poses, axis=0)) / jitter
    one = (np.abs(off) > _OFF).any(axis=1)
    two = (np.abs(off[1:] + off[:-1]) > np.sqrt(2) * _OFF).any(axis=1)  # each with the next one
    ahead, back = ~(one | np.r_[two, False]), ~(one | np.r_[False, two])[::-1]
    low = int(np.argmax(ahead)) + 1 if before else 0
    high = len(poses) - (int(np.argmax(back)) + 1 if behind else 0)
    return slice(low, max(high, low))
