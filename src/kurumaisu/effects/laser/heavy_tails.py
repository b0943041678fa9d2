# SPDX-License-Identifier: BSD-3-Clause
"""laser.heavy_tails: large errors are more frequent than normal ones."""

from dataclasses import replace

import numpy as np

from kurumaisu.effects.laser.base import Echoes, LaserStage, ReadingEffect
from kurumaisu.effects.mechanism import Parameter


class HeavyTails(ReadingEffect):
    """Student's t in place of the normal distribution; 0: normal.

    core 0: of the same standard deviation, so that most readings err less; core 1: its middle as it was, and the tails
    come on top.
    """

    id = "laser.heavy_tails"
    stage = LaserStage.NOISE
    parameters = (
        Parameter("inverse_nu", "1", null=0.0, scale=0.2, lower=0.0, upper=0.45),
        Parameter("core", "1", null=0.0, scale=0.5, lower=0.0, upper=1.5),
    )
    sentence = "large errors of the ranges are more frequent than of normal noise"
    formula = "z · (1 − 2 / ν)^((1 − core) / 2) · √(ν / χ²_ν), ν = 1 / inverse_nu"
    source = "assumed; ν 3-10"
    random = True

    def apply(self, echoes: Echoes) -> Echoes:
        """Scale each beam's noise at random."""
        if self.values["inverse_nu"] == 0:
            return echoes
        nu = 1 / self.values["inverse_nu"]
        narrower = (1 - 2 / nu) ** ((1 - self.values["core"]) / 2)
        factors = narrower * np.sqrt(nu / self.rng.chisquare(nu, len(echoes.noise)))
        return replace(echoes, noise=echoes.noise * factors)
