# SPDX-License-Identifier: BSD-3-Clause
"""A first-order lag, which more than one effect has."""

from kurumaisu import _core
from kurumaisu.types import FloatArray


class FirstOrder:
    """First-order lag, exact for an input held over the grid's step; a sample is the step's mean rate."""

    def __init__(self, level: float = 0.0) -> None:
        """Start at a level that has long been asked for: at rest, if none is given."""
        self.level = level  # of the rate at the end of the last step

    def follow(self, target: FloatArray, dt: float, tau: float) -> FloatArray:
        """Return the mean rates (n,) over steps of dt [s] for targets (n,); tau [s]."""
        if tau < 1e-6:  # [s]; no lag, the step is much longer
            self.level = float(target[-1])
            return target
        rates, self.level = _core.lag(target, tau, dt, self.level)
        return rates
