# SPDX-License-Identifier: BSD-3-Clause
"""laser.heavy_tails: large errors are more frequent than normal ones."""

from dataclasses import replace

import numpy as np

from kurumaisu.effects.laser.base import Echoes, LaserStage, ReadingEffect
from kurumaisu.effects.mechanism import Parameter


class HeavyTails(ReadingEffect):
    """Student's t in place of the normal distribution, of the same standard deviation; 0: normal."""

    id = "laser.heavy_tails"
    stage = LaserStage.NOISE
    parameters = (Parameter("inverse_nu", "1", null=0.0, scale=0.2, lower=0.0, upper=0.45),)
    sentence = "large errors of the ranges are more frequent than of normal noise"
    formula = "z · √((1 − 2 / ν) · ν / χ²_ν), ν = 1 / inverse_nu"
    source = "assumed; ν 3-10"
    random = True

    def apply(self, echoes: Echoes) -> Echoes:
        """Scale each beam's noise at random."""
        if self.values["inverse_nu"] == 0:
            return echoes
        nu = 1 / self.values["inverse_nu"]
        factors = np.sqrt((nu - 2) / self.rng.chisquare(nu, len(echoes.noise)))
        return replace(echoes, noise=echoes.noise * factors)
