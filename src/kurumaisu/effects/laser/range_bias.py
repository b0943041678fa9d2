# SPDX-License-Identifier: BSD-3-Clause
"""laser.offset, laser.scale and laser.quadratic: the mean reading is off by a polynomial of the range."""

from dataclasses import replace

from kurumaisu.effects.laser.base import Echoes, LaserStage, ReadingEffect
from kurumaisu.effects.mechanism import Parameter

_SOURCE = "calibrations of the URG-04LX differ, Okubo 2009; "


class RangeOffset(ReadingEffect):
    """A constant."""

    id = "laser.offset"
    stage = LaserStage.BIAS
    parameters = (Parameter("offset", "m", null=0.0, scale=0.01, lower=-0.5, upper=0.5),)
    sentence = "all ranges have a constant offset"
    formula = "µ + offset"
    source = _SOURCE + "10 mm"

    def apply(self, echoes: Echoes) -> Echoes:
        """Shift the mean."""
        return replace(echoes, mean=echoes.mean + self.values["offset"])


class RangeScale(ReadingEffect):
    """A share of the range."""

    id = "laser.scale"
    stage = LaserStage.BIAS
    parameters = (Parameter("scale", "1", null=0.0, scale=0.005, lower=-0.5, upper=0.5),)
    sentence = "the range error is proportional to the range"
    formula = "µ + scale · r"
    source = _SOURCE + "0.5 %"

    def apply(self, echoes: Echoes) -> Echoes:
        """Shift the mean in proportion."""
        return replace(echoes, mean=echoes.mean + self.values["scale"] * echoes.ranges)


class RangeQuadratic(ReadingEffect):
    """A share of the range's square."""

    id = "laser.quadratic"
    stage = LaserStage.BIAS
    parameters = (Parameter("quadratic", "1/m", null=0.0, scale=0.002, lower=-0.1, upper=0.1),)
    sentence = "the range error is proportional to the square of the range"
    formula = "µ + quadratic · r²"
    source = _SOURCE + "2 mm/m²"
    empirical = True

    def apply(self, echoes: Echoes) -> Echoes:
        """Shift the mean with the square."""
        return replace(echoes, mean=echoes.mean + self.values["quadratic"] * echoes.ranges**2)
