# SPDX-License-Identifier: BSD-3-Clause
"""Standard deviations that outliers and motion do not change."""

from __future__ import annotations

import numpy as np

from kurumaisu.robust import SIGMA_PER_MAD
from kurumaisu.types import FloatArray


def third_difference_sd(values: FloatArray, axis: int | None = 0) -> FloatArray:
    """Return the sd of errors that differ from row to row, by third differences: motion hardly has any.

    axis: 0 for each column of values (n, m), None for all of them together.
    """
    return np.asarray(SIGMA_PER_MAD * np.median(np.abs(np.diff(values, n=3, axis=0)), axis=axis) / np.sqrt(20))
