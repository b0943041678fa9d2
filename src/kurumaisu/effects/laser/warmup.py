# SPDX-License-Identifier: BSD-3-Clause
"""laser.warmup: ranges drift until the laser has warmed up."""

from dataclasses import replace

import numpy as np

from kurumaisu.effects.laser.base import Echoes, LaserStage, ReadingEffect
from kurumaisu.effects.mechanism import Parameter


class WarmUp(ReadingEffect):
    """An offset that dies away with the time since the laser was switched on, which is time 0.

    Or that grows from then on (cold = 1), where the laser, or the map, was measured with a cold one.
    """

    id = "laser.warmup"
    stage = LaserStage.BIAS
    parameters = (
        Parameter("amplitude", "m", null=0.0, scale=0.01, lower=-0.2, upper=0.2),
        Parameter("tau", "s", null=900.0, scale=600.0, lower=1.0, upper=2.0e4),
        Parameter("cold", "1", null=0.0, scale=1.0, lower=0.0, upper=1.0),
    )
    forms = ({"cold": 0.0}, {"cold": 1.0})
    sentence = "ranges drift after the laser is switched on"
    formula = "µ + amplitude · (exp(−t / tau) − cold)"
    source = "Kneip 2009, Okubo 2009; 5-20 mm over 5-40 min"
    empirical = True

    def apply(self, echoes: Echoes) -> Echoes:
        """Shift the mean by what is left."""
        left = np.exp(-(echoes.stamp - self.since) / self.values["tau"])
        return replace(echoes, mean=echoes.mean + self.values["amplitude"] * (left - self.values["cold"]))
