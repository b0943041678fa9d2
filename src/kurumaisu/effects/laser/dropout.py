# SPDX-License-Identifier: BSD-3-Clause
"""laser.dropout: some beams give no valid reading."""

from dataclasses import replace

import numpy as np

from kurumaisu.effects.laser.base import Echoes, LaserStage, ReadingEffect
from kurumaisu.effects.mechanism import Parameter


class Dropout(ReadingEffect):
    """Error codes, NaN here, with a probability that grows with range, obliqueness and darkness."""

    id = "laser.dropout"
    stage = LaserStage.OUTLIER
    oblique = True
    parameters = (
        Parameter("probability", "1", null=0.0, scale=0.05, lower=0.0, upper=1.0),
        Parameter("per_metre", "1/m", null=0.0, scale=0.02, lower=0.0, upper=1.0),
        Parameter("oblique", "1", null=0.0, scale=0.1, lower=0.0, upper=1.0),
        Parameter("dark", "1", null=0.0, scale=0.1, lower=0.0, upper=1.0),
    )
    sentence = "some beams return no valid reading"
    formula = "NaN with probability + per_metre · r + oblique · (1 − cos a) + dark · (1 − ρ), within 0 and 1"
    source = "codes 0-19 of the URG-04LX; 12 % of the beams of a real one"
    empirical = True
    random = True

    def apply(self, echoes: Echoes) -> Echoes:
        """Drop readings; beams that met nothing have none to drop."""
        hit = np.isfinite(echoes.ranges)
        values = self.values
        chance = values["probability"] + values["per_metre"] * np.where(hit, echoes.ranges, 0.0)
        chance += values["oblique"] * (1 - np.cos(echoes.incidence)) + values["dark"] * (1 - echoes.returns)
        dropped = hit & (self.rng.random(chance.shape) < chance)
        return replace(echoes, readings=np.where(dropped, np.nan, echoes.readings))
