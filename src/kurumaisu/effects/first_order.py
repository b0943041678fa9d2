# SPDX-License-Identifier: BSD-3-Clause
"""A first-order lag, which more than one effect has."""

import numpy as np

from kurumaisu.types import FloatArray


class FirstOrder:
    """First-order lag, exact for an input held over the grid's step; a sample is the step's mean rate."""

    def __init__(self, level: float = 0.0) -> None:
        """Start at a level that has long been asked for: at rest, if none is given."""
        self.level = level  # of the rate at the end of the last step

    def follow(self, target: FloatArray, dt: float, tau: float) -> FloatArray:
        """Return the mean rates (n,) over steps of dt [s] for targets (n,); tau [s]."""
        if tau < 1e-6:  # [s]; no lag, and the limit below would divide by it
            self.level = float(target[-1])
            return target
        decay = np.exp(-dt / tau)
        from scipy.signal import lfilter  # half a second to load, for those who have no lag or noise

        ends = lfilter([1 - decay], [1, -decay], target, zi=[decay * self.level])[0]
        starts = np.concatenate([[self.level], ends[:-1]])
        self.level = float(ends[-1])
        return np.asarray(target + (starts - target) * (tau / dt) * (1 - decay))
