# SPDX-License-Identifier: BSD-3-Clause
"""laser.crosstalk: another laser's light makes bursts of random ranges, whose place in the fan drifts."""

from dataclasses import replace

import numpy as np

from kurumaisu.effects.laser.base import Echoes, LaserStage, ReadingEffect
from kurumaisu.effects.mechanism import Parameter
from kurumaisu.geometry import wrap


class Crosstalk(ReadingEffect):
    """Within a sector that drifts round, beams read anything up to a reach, with a probability."""

    id = "laser.crosstalk"
    stage = LaserStage.OUTLIER
    parameters = (
        Parameter("probability", "1", null=0.0, scale=0.3, lower=0.0, upper=1.0),
        Parameter("width", "rad", null=0.3, scale=0.3, lower=0.0, upper=6.3),
        Parameter("drift", "rad/s", null=0.5, scale=0.5, lower=-100.0, upper=100.0),
        Parameter("reach", "m", null=4.0, scale=2.0, lower=1.0, upper=100.0),
    )
    sentence = "bursts of random ranges come and go, as from another laser's light"
    formula = "where |φ − drift · t| < width / 2 (mod 2π), with probability: reading uniform in 0 to reach"
    source = "assumed; 0.1-10 % of the readings"
    empirical = True
    random = True

    def apply(self, echoes: Echoes) -> Echoes:
        """Replace readings in the sector."""
        chance, spread = self.draws(2, echoes)
        away = np.abs(wrap(echoes.bearings - self.values["drift"] * (echoes.stamp - self.since)))
        hit = (away < self.values["width"] / 2) & (chance < self.values["probability"])
        return replace(echoes, readings=np.where(hit, spread * self.values["reach"], echoes.readings))
