# SPDX-License-Identifier: BSD-3-Clause
"""laser.reflectance: dark and bright surfaces read differently."""

from dataclasses import replace

import numpy as np

from kurumaisu.effects.laser.base import Echoes, LaserStage, ReadingEffect
from kurumaisu.effects.mechanism import Parameter


class Reflectance(ReadingEffect):
    """Offset and noise by how far a surface's reflectance is below 1, which is a world file's ranger_return."""

    id = "laser.reflectance"
    stage = LaserStage.BIAS
    parameters = (
        Parameter("bias", "m", null=0.0, scale=0.02, lower=-0.2, upper=0.2),
        Parameter("noise", "1", null=0.0, scale=1.0, lower=0.0, upper=20.0),
    )
    sentence = "ranges depend on the reflectance of the surface"
    formula = "µ + bias · (1 − ρ), σ · max(0, 1 + noise · (1 − ρ)); ρ: the world's ranger_return"
    source = "Kneip 2009: strongly dependent on the target; 5-30 mm"
    empirical = True

    def apply(self, echoes: Echoes) -> Echoes:
        """Shift and widen by the darkness."""
        darkness = 1 - echoes.returns
        widened = echoes.sd * np.maximum(1 + self.values["noise"] * darkness, 0.0)
        return replace(echoes, mean=echoes.mean + self.values["bias"] * darkness, sd=widened)
