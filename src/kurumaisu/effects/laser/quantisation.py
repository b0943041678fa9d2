# SPDX-License-Identifier: BSD-3-Clause
"""laser.quantisation: readings come in coarser steps than the model says."""

from dataclasses import replace

import numpy as np

from kurumaisu.effects.laser.base import Echoes, LaserStage, ReadingEffect
from kurumaisu.effects.mechanism import Parameter


class Quantisation(ReadingEffect):
    """Readings rounded to multiples of a step, before the rounding that the model file gives; cut: 1 down, -1 up."""

    id = "laser.quantisation"
    stage = LaserStage.GRID
    parameters = (
        Parameter("step", "m", null=0.0, scale=0.01, lower=0.0, upper=1.0),
        Parameter("cut", "1", null=0.0, scale=1.0, lower=-1.0, upper=1.0),
    )
    forms = ({"cut": 0.0}, {"cut": 1.0}, {"cut": -1.0})
    sentence = "ranges come in coarser steps than modelled"
    formula = "step · round(reading / step − cut / 2): cut = 1 cuts off the remainder"
    source = "data sheet: 1 mm"

    def apply(self, echoes: Echoes) -> Echoes:
        """Round the readings."""
        step = self.values["step"]
        if step == 0:
            return echoes
        return replace(echoes, readings=step * np.rint(echoes.readings / step - self.values["cut"] / 2))
