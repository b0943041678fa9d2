# SPDX-License-Identifier: BSD-3-Clause
"""Who is due in a step: Stage's update intervals, rounded up to whole steps, at most once per step."""

from __future__ import annotations

import math

import numpy as np

from kurumaisu.types import IntArray


def period(update_interval: float, step: float) -> int:
    """Return after how many steps of step [s] an update_interval [s] has passed."""
    rounding = 1e-9  # of intervals that are multiples of the step but for the last bit
    return max(1, math.ceil(update_interval / step - rounding))


class Schedule:
    """Says which rows are due; each counts its steps from its birth."""

    def __init__(self, periods: IntArray, born: IntArray) -> None:
        """Note periods and births (n,) [steps]."""
        self._periods = periods
        self._phases = born % periods if len(periods) else born
        same = len(periods) == 0 or bool((periods == periods[0]).all() and (self._phases == self._phases[0]).all())
        self._common = (int(periods[0]), int(self._phases[0])) if same and len(periods) else None

    def due(self, step: int) -> slice | IntArray | None:
        """Return the rows that are due in a step, counted from 1, None if none."""
        if self._common is not None:
            every, phase = self._common
            return slice(None) if step % every == phase else None
        rows = np.flatnonzero(step % self._periods == self._phases)
        return rows if len(rows) else None
