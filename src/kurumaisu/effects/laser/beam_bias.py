# SPDX-License-Identifier: BSD-3-Clause
"""laser.beam_bias: each beam is off by an amount of its own, and all by a mirror that runs out of true."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from kurumaisu.effects.laser.base import Echoes, LaserStage, ReadingEffect
from kurumaisu.effects.mechanism import Parameter
from kurumaisu.types import FloatArray


class BeamBias(ReadingEffect):
    """Offsets of the beams, drawn once, and a cosine of the bearing."""

    id = "laser.beam_bias"
    stage = LaserStage.BIAS
    parameters = (
        Parameter("sd", "m", null=0.0, scale=0.001, lower=0.0, upper=0.1),
        Parameter("amplitude", "m", null=0.0, scale=0.003, lower=-0.1, upper=0.1),
        Parameter("phase", "rad", null=0.0, scale=1.0, lower=-6.3, upper=6.3),
    )
    sentence = "each beam has its own offset"
    formula = "µ + b_i + amplitude · cos(φ − phase), b_i drawn once per beam with sd"
    source = "Olivka 2016: internal geometry of the URG-04LX; sd 0.5-2 mm, mirror 1-5 mm"
    random = True

    def __init__(self, values: Mapping[str, float], rng: np.random.Generator) -> None:
        super().__init__(values, rng)
        self._unit: FloatArray | None = None  # offsets of the beams, in sd

    def apply(self, echoes: Echoes) -> Echoes:
        """Shift the mean of each beam."""
        if self._unit is None:
            self._unit = self.rng.standard_normal(echoes.bearings.shape[-1])
        mirror = self.values["amplitude"] * np.cos(echoes.bearings - self.values["phase"])
        return replace(echoes, mean=echoes.mean + self.values["sd"] * self._unit + mirror)
