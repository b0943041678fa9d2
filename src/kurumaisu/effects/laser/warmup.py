# SPDX-License-Identifier: BSD-3-Clause
"""laser.warmup: ranges drift until the laser has warmed up."""

from dataclasses import replace

import numpy as np

from kurumaisu.effects.laser.base import Echoes, LaserStage, ReadingEffect
from kurumaisu.effects.mechanism import Parameter


class WarmUp(ReadingEffect):
    """An offset that dies away with the time since the laser was switched on, which is time 0."""

    id = "laser.warmup"
    stage = LaserStage.BIAS
    parameters = (
        Parameter("amplitude", "m", null=0.0, scale=0.01, lower=-0.2, upper=0.2),
        Parameter("tau", "s", null=900.0, scale=600.0, lower=1.0, upper=2.0e4),
    )
    sentence = "ranges drift after the laser is switched on"
    formula = "µ + amplitude · exp(−t / tau)"
    source = "Kneip 2009, Okubo 2009; 5-20 mm over 5-40 min"
    empirical = True

    def apply(self, echoes: Echoes) -> Echoes:
        """Shift the mean by what is left."""
        left = np.exp(-(echoes.stamp - self.since) / self.values["tau"])
        return replace(echoes, mean=echoes.mean + self.values["amplitude"] * left)
