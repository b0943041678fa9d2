# SPDX-License-Identifier: BSD-3-Clause
"""laser.cyclic: the error of a phase-shift laser repeats with the range."""

from dataclasses import replace

import numpy as np

from kurumaisu.effects.laser.base import Echoes, LaserStage, ReadingEffect
from kurumaisu.effects.mechanism import Parameter


class Cyclic(ReadingEffect):
    """A sine of the range."""

    id = "laser.cyclic"
    stage = LaserStage.BIAS
    parameters = (
        Parameter("amplitude", "m", null=0.0, scale=0.003, lower=-0.1, upper=0.1),
        Parameter("wavelength", "m", null=3.0, scale=1.0, lower=0.1, upper=4.0),
        Parameter("phase", "rad", null=0.0, scale=1.0, lower=-6.3, upper=6.3),
    )
    sentence = "the range error repeats with the range, as with a phase-shift laser"
    formula = "µ + amplitude · sin(2π r / wavelength + phase)"
    source = "Kawata 2005: the phase of amplitude-modulated light; 1-10 mm"
    empirical = True

    def apply(self, echoes: Echoes) -> Echoes:
        """Shift the mean by the sine."""
        angle = 2 * np.pi * echoes.ranges / self.values["wavelength"] + self.values["phase"]
        return replace(echoes, mean=echoes.mean + self.values["amplitude"] * np.sin(angle))
