# SPDX-License-Identifier: BSD-3-Clause
"""laser.heavy_tails: large errors are more frequent than normal ones."""

from dataclasses import replace

import numpy as np

from kurumaisu.effects.laser.base import Echoes, LaserStage, ReadingEffect
from kurumaisu.effects.mechanism import Parameter

_LEAST = 1e-9  # [m] a deviation that is none: then there is nothing to add noise to


class HeavyTails(ReadingEffect):
    """Student's t in place of the normal distribution; 0: normal.

    core 0: of the same standard deviation, so that most readings err less; core 1: its middle as it was, and the tails
    come on top. outliers: share of readings, anywhere and at any time, that are off by about `reach` besides.
    """

    id = "laser.heavy_tails"
    stage = LaserStage.NOISE
    parameters = (
        Parameter("inverse_nu", "1", null=0.0, scale=0.2, lower=0.0, upper=0.45),
        Parameter("core", "1", null=0.0, scale=0.5, lower=0.0, upper=1.5),
        Parameter("outliers", "1", null=0.0, scale=0.02, lower=0.0, upper=0.5),
        Parameter("reach", "m", null=0.1, scale=0.1, lower=0.001, upper=10.0),
        Parameter("anywhere", "1", null=0.0, scale=1.0, lower=0.0, upper=1.0),
    )
    forms = ({"anywhere": 0.0}, {"anywhere": 1.0})
    sentence = "large range errors are more frequent than with normal noise"
    formula = (
        "z · (1 − 2 / ν)^((1 − core) / 2) · √(ν / χ²_ν), ν = 1 / inverse_nu; "
        "with probability outliers: reach / σ · n added, n normal; "
        "with anywhere = 1: in its place a reading even from 0 to the most that the laser reads"
    )
    source = "assumed; ν 3-10; outliers 1e-4 to 1e-2 of the readings; anywhere: Thrun, Burgard, Fox 2005, z_rand"
    empirical = True
    random = True

    def apply(self, echoes: Echoes) -> Echoes:
        """Scale each beam's noise at random, and throw some readings far off."""
        noise = echoes.noise
        if self.values["inverse_nu"] > 0:
            nu = 1 / self.values["inverse_nu"]
            narrower = (1 - 2 / nu) ** ((1 - self.values["core"]) / 2)
            noise = noise * (narrower * np.sqrt(nu / self.rng.chisquare(nu, noise.shape)))
        if self.values["outliers"] > 0:
            wild = self.rng.random(noise.shape) < self.values["outliers"]
            if self.values["anywhere"] > 0.5:
                off = echoes.farthest * self.rng.random(noise.shape) - echoes.mean
            else:
                off = self.values["reach"] * self.rng.standard_normal(noise.shape)
            noise = noise + np.where(wild, off / np.maximum(echoes.sd, _LEAST), 0.0)
        return replace(echoes, noise=noise)
