# SPDX-License-Identifier: BSD-3-Clause
"""laser.saturation: readings stop at a nearest and a farthest value."""

from dataclasses import replace

import numpy as np

from kurumaisu.effects.laser.base import Echoes, LaserStage, ReadingEffect
from kurumaisu.effects.mechanism import Parameter


class LaserSaturation(ReadingEffect):
    """Readings clipped; the inverse of the farthest is the parameter, so that 0 is none.

    lost: 1 where what lies beyond the ends is no reading at all.
    """

    id = "laser.saturation"
    stage = LaserStage.OUTLIER
    parameters = (
        Parameter("near", "m", null=0.0, scale=0.1, lower=0.0, upper=10.0),
        Parameter("inverse_far", "1/m", null=0.0, scale=0.3, lower=0.0, upper=20.0),
        Parameter("lost", "1", null=0.0, scale=1.0, lower=0.0, upper=1.0),
    )
    forms = ({"lost": 0.0}, {"lost": 1.0})
    sentence = "ranges are cut off at a smallest and a largest value"
    formula = "min(max(reading, near), 1 / inverse_far); with lost = 1, no return where that changes it"
    source = "data sheet: 60 mm and 4 m"

    def apply(self, echoes: Echoes) -> Echoes:
        """Clip what has been read; no return stays none."""
        near, inverse = self.values["near"], self.values["inverse_far"]
        far = 1 / inverse if inverse > 0 else np.inf
        clipped = np.clip(echoes.readings, near if near > 0 else -np.inf, far)
        if self.values["lost"] >= 0.5:
            clipped = np.where(clipped == echoes.readings, clipped, np.inf)
        return replace(echoes, readings=np.where(np.isfinite(echoes.readings), clipped, echoes.readings))
