# SPDX-License-Identifier: BSD-3-Clause
"""laser.range_noise: readings are more or less noisy than equation (4) says."""

from dataclasses import replace

import numpy as np

from kurumaisu.effects.laser.base import Echoes, LaserStage, ReadingEffect
from kurumaisu.effects.mechanism import Parameter

_MIDDLE = 2.0  # [m]


class RangeNoise(ReadingEffect):
    """The law's standard deviation scaled, and what grows with the range besides; never negative.

    The range counts from 2 m on, amid what such a laser measures: so `share` is how noisy it is where it is used, and
    one number may be known without the other.
    """

    id = "laser.range_noise"
    stage = LaserStage.SPREAD
    parameters = (
        Parameter("share", "1", null=0.0, scale=0.3, lower=-1.0, upper=20.0),
        Parameter("slope", "1", null=0.0, scale=0.001, lower=-0.1, upper=0.1),
    )
    sentence = "the range noise is larger or smaller than modelled"
    formula = "max(0, σ · (1 + share) + slope · (r − 2 m))"
    source = "Pomerleau 2012 gives 8-14 times equation (4)'s σ; a real unit 2.3-3.6 mm"
    empirical = True

    def apply(self, echoes: Echoes) -> Echoes:
        """Scale the noise."""
        sd = echoes.sd * (1 + self.values["share"]) + self.values["slope"] * (echoes.ranges - _MIDDLE)
        return replace(echoes, sd=np.maximum(sd, 0.0))
