# SPDX-License-Identifier: BSD-3-Clause
"""laser.quantisation: readings come in coarser steps than the model says."""

from dataclasses import replace

import numpy as np

from kurumaisu.effects.laser.base import Echoes, LaserStage, ReadingEffect
from kurumaisu.effects.mechanism import Parameter


class Quantisation(ReadingEffect):
    """Readings rounded to multiples of a step, before the rounding that the model file gives."""

    id = "laser.quantisation"
    stage = LaserStage.GRID
    parameters = (Parameter("step", "m", null=0.0, scale=0.01, lower=0.0, upper=1.0),)
    sentence = "ranges come in coarser steps than modelled"
    formula = "step · round(reading / step)"
    source = "data sheet: 1 mm"

    def apply(self, echoes: Echoes) -> Echoes:
        """Round the readings."""
        step = self.values["step"]
        return echoes if step == 0 else replace(echoes, readings=step * np.rint(echoes.readings / step))
