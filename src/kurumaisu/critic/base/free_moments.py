# SPDX-License-Identifier: BSD-3-Clause
"""What a drive does in moments in which a rate is free, as columns to integrate out."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from kurumaisu.critic.base import replay
from kurumaisu.critic.base.drive import GRID, Drive
from kurumaisu.critic.base.sensitivity import Sensitivity
from kurumaisu.params import Model
from kurumaisu.types import FloatArray


def free_columns(drive: Drive, model: Model) -> FloatArray:
    """Return the columns (3 m, k) of a drive's increments, whose normal shares are its free moments before the data."""
    free = drive.free
    if free is None:
        return np.empty((3 * (len(drive.times) - 1), 0))
    near = (free.middles > drive.times[0] - free.width) & (free.middles < drive.times[-1] + free.width)
    motion = replay.motion(drive, model, ())
    moments = hats(drive, len(motion.moving), free.middles[near], free.width)
    return free.sd * Sensitivity(drive, motion).increments(free.channel, moments)


def all_free_columns(drives: Sequence[Drive], model: Model) -> list[FloatArray]:
    """Return the free columns of each of several drives, (3 m, k) each, k for the moments of all."""
    own = [free_columns(drive, model) for drive in drives]
    ends = np.cumsum([0, *(columns.shape[1] for columns in own)])
    return [
        np.pad(columns, ((0, 0), (before, ends[-1] - after)))
        for columns, (before, after) in zip(own, pairwise(ends.tolist()), strict=True)
    ]


def hats(drive: Drive, cells: int, middles: FloatArray, width: float, again: float = np.inf) -> FloatArray:
    """Return a hat about each of some middles [s], and again every so many, over a drive's grid, (cells, k)."""
    off = drive.start + GRID * (np.arange(cells) + 0.5)[:, np.newaxis] - middles
    if np.isfinite(again):
        off -= again * np.rint(off / again)
    return np.asarray(np.maximum(1 - np.abs(off) / width, 0.0))
