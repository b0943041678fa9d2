# SPDX-License-Identifier: BSD-3-Clause
"""Rows of a reference that are off by less than a jump is: there and back again, beside what a model drives meanwhile.

Even a poor model says of the next moment how far the chair goes. What it gets wrong lasts, and does not come back.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from kurumaisu.critic.base import replay
from kurumaisu.critic.base.drive import prepare
from kurumaisu.critic.values.recording import Run
from kurumaisu.errors import Error
from kurumaisu.params import Model
from kurumaisu.robust import SIGMA_PER_MAD
from kurumaisu.types import BoolArray, FloatArray

_FAR = 8.0  # sds of what a model leaves between two rows
_LONGEST = 1.0  # [s]
_BACK = 0.4  # share of the way out, of which the way back may differ
_QUIET = 0.35  # the same, that another row near by may be off
_NEAR = 2  # rows
# Of a normal vector's components, by the number of them, over the median of its norm.
_SD = {1: SIGMA_PER_MAD, 2: 0.8493}


def brief_errors(run: Run, model: Model) -> BoolArray:
    """Return which rows of a run's reference are off for a moment, (n,)."""
    assert run.pose is not None
    off = np.zeros(len(run.pose.t), dtype=np.bool_)
    try:
        drive = prepare(run, model, interval=1e-9)
    except Error:
        return off
    left = drive.in_map(drive.measured - replay.increments(drive, model, ()))
    rows = np.zeros(len(drive.times), dtype=np.bool_)
    for part in (left[:, :2], left[:, 2:]):
        for first, end in _excursions(part, drive.times):
            rows[first:end] = True
    off[np.searchsorted(run.pose.t, drive.times[rows])] = True
    return off


def _excursions(left: FloatArray, times: FloatArray) -> list[tuple[int, int]]:
    """Return first row and end of each excursion, by what is left of increments (m, k) between rows at times (m + 1,).

    A chair that is late is off throughout the time that it is, and a row that is off only in its first step and last.
    """
    size = np.linalg.norm(left, axis=1)
    limit = _FAR * _SD[left.shape[1]] * float(np.median(size)) if len(size) else 0.0
    found = []
    loud = np.flatnonzero(size > max(limit, 1e-6))
    for i, j in pairwise(loud):
        between = np.r_[max(i - _NEAR, 0) : i, i + 1 : j, j + 1 : min(j + _NEAR + 1, len(size))]
        back = np.linalg.norm(left[i] + left[i + 1 : j + 1].sum(axis=0)) < _BACK * size[i]
        if back and times[j + 1] - times[i] < _LONGEST and (size[between] < _QUIET * size[i]).all():
            found.append((int(i) + 1, int(j) + 1))
    return found
