# SPDX-License-Identifier: BSD-3-Clause
"""Means over a covariate in bins, and how much of a signal they explain."""

from __future__ import annotations

import numpy as np

from kurumaisu.critic.values.story import Bins
from kurumaisu.critic.values.verdict import NORMAL90
from kurumaisu.types import FloatArray

_BINS = 15  # at most


_FEWEST = 5  # points of which a mean has an interval


FOLLOWED = 0.3  # share of an effect that means over a covariate must explain, to be drawn over it


def explained(x: FloatArray, y: FloatArray) -> float:
    """Return the share of the sum of squares of y that means in bins of x explain."""
    means = bins(x, y, 1)
    return 1.0 - float(np.mean((y - np.interp(x, means.centre, means.mean)) ** 2) / max(np.mean(y**2), 1e-300))


def bins(x: FloatArray, y: FloatArray, fewest: int = _FEWEST) -> Bins:
    """Return means of y in bins of x of equal width; bins with fewer points are left out."""
    count = int(np.clip(len(x) // (2 * _FEWEST), 3, _BINS))
    low, high = np.quantile(x, [0.005, 0.995])
    index = np.clip(np.floor((x - low) / max(high - low, 1e-12) * count), 0, count - 1)
    rows = []
    for i in np.unique(index):
        inside = index == i
        if inside.sum() >= fewest:
            error = NORMAL90 * y[inside].std() / np.sqrt(inside.sum())
            rows.append((x[inside].mean(), y[inside].mean(), y[inside].mean() - error, y[inside].mean() + error))
    centre, mean, lo, hi = np.array(rows).reshape(-1, 4).T
    return Bins(centre, mean, lo, hi)
