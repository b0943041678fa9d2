# SPDX-License-Identifier: BSD-3-Clause
"""laser.mixed_pixels: at edges a beam meets two surfaces and reads something in between."""

from dataclasses import replace

import numpy as np

from kurumaisu.effects.laser.base import Echoes, LaserStage, ReadingEffect
from kurumaisu.effects.mechanism import Parameter


class MixedPixels(ReadingEffect):
    """Beams beside a jump of the range read, with a probability, a point anywhere between both sides."""

    id = "laser.mixed_pixels"
    stage = LaserStage.OUTLIER
    parameters = (
        Parameter("probability", "1", null=0.0, scale=0.5, lower=0.0, upper=1.0),
        Parameter("jump", "m", null=0.1, scale=0.1, lower=0.01, upper=10.0),
    )
    sentence = "at edges the laser reads points between foreground and background"
    formula = "beside |r_i − r_(i+1)| > jump, with probability: reading between both, uniformly"
    source = "Ye and Borenstein 2002, Okubo 2009; probability 0.3-1"
    empirical = True
    random = True

    def apply(self, echoes: Echoes) -> Echoes:
        """Replace readings beside jumps."""
        n = len(echoes.ranges)
        chance, mix = self.rng.random((2, n))
        with np.errstate(invalid="ignore"):  # no return beside no return: inf - inf
            jumps = np.abs(np.diff(echoes.ranges))
        at = np.flatnonzero((jumps > self.values["jump"]) & np.isfinite(jumps))
        other = np.full(n, -1)  # the neighbour across the jump
        other[at], other[at + 1] = at + 1, at
        mixed = (other >= 0) & (chance < self.values["probability"])
        readings = echoes.readings.copy()
        across = echoes.readings[other[mixed]]
        readings[mixed] += mix[mixed] * (across - readings[mixed])
        return replace(echoes, readings=readings)
