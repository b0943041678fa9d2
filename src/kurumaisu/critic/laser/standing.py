# SPDX-License-Identifier: BSD-3-Clause
"""Where the chair stood: poses measured again and again there are one pose, with one error."""

from __future__ import annotations

import numpy as np

from kurumaisu.types import FloatArray

_PAUSE = 5.0  # [s] without a pose, after which the chair may stand elsewhere
_APART = 1e-3  # [s] from the middle of a pause, at which the stand before ends and the next one begins
_STEP = 8.0  # sds of the poses' jitter that lie between two of them where the chair stands
_SPREAD = 2.2  # sds of the jitter, itself known to a third from few poses, that poses of one place scatter by
_FEWEST = 5  # poses of a stand


def steadied(times: FloatArray, poses: FloatArray) -> FloatArray:
    """Return poses (n, 3), those of each stand replaced by their mean; times (n,) [s].

    A reference errs alike while the chair stands. Taken for so many independent poses it would seem to be far better
    known than it is.
    """
    if len(times) < _FEWEST:
        return poses
    jitter = np.maximum(_jitter(poses), 1e-9)
    step = np.abs(np.diff(poses, axis=0)) / jitter
    cuts = np.flatnonzero((step > _STEP).any(axis=1) | (np.diff(times) > _PAUSE)) + 1
    out = poses.copy()
    for rows in np.split(np.arange(len(times)), cuts):
        if len(rows) >= _FEWEST and _stands(poses[rows], jitter):
            out[rows] = poses[rows].mean(axis=0)
    return out


def held(times: FloatArray, poses: FloatArray) -> tuple[FloatArray, FloatArray]:
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


def _jitter(poses: FloatArray) -> FloatArray:
    """Return the sd (3,) of errors that differ from pose to pose, by third differences: motion hardly has any."""
    return np.asarray(1.4826 * np.median(np.abs(np.diff(poses, n=3, axis=0)), axis=0) / np.sqrt(20))
