# SPDX-License-Identifier: BSD-3-Clause
"""A first-order lag, which more than one effect has."""

import numpy as np

from kurumaisu.types import FloatArray


class FirstOrder:
    """First-order lag, exact for an input held over the grid's step; a sample is the step's mean rate."""

    def __init__(self, tau: float) -> None:
        """Start at rest; tau [s]."""
        self._tau = tau
        self._level = 0.0  # of the rate at the end of the last step

    def follow(self, target: FloatArray, dt: float) -> FloatArray:
        """Return the mean rates (n,) over steps of dt [s] for targets (n,)."""
        if self._tau < 1e-6:  # [s]; no lag, and the limit below would divide by it
            return target
        decay = np.exp(-dt / self._tau)
        from scipy.signal import lfilter  # half a second to load, for those who have no lag or noise

        ends = lfilter([1 - decay], [1, -decay], target, zi=[decay * self._level])[0]
        starts = np.concatenate([[self._level], ends[:-1]])
        self._level = float(ends[-1])
        return np.asarray(target + (starts - target) * (self._tau / dt) * (1 - decay))
