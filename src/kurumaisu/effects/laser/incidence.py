# SPDX-License-Identifier: BSD-3-Clause
"""laser.incidence_bias and laser.incidence_noise: oblique walls are read longer, and less repeatably."""

from dataclasses import replace

import numpy as np

from kurumaisu.effects.laser.base import Echoes, LaserStage, ReadingEffect
from kurumaisu.effects.mechanism import Parameter
from kurumaisu.types import FloatArray

_STEEPEST = np.deg2rad(80.0)  # nothing is known beyond


_TANGENT = Parameter("tangent", "1", null=0.0, scale=1.0, lower=0.0, upper=1.0)
_FORMS = ({"tangent": 0.0}, {"tangent": 1.0})


def _obliqueness(incidence: FloatArray, tangent: float) -> FloatArray:
    """Return how much longer than its beam's the footprint on the wall is, less 1; or how deep for its width."""
    angle = np.minimum(incidence, _STEEPEST)
    return np.asarray((1 - tangent) * (1 / np.cos(angle) - 1) + tangent * np.tan(angle))


class IncidenceBias(ReadingEffect):
    """An offset that grows with the footprint's length, or, where tangent is 1, with its depth along the beam."""

    id = "laser.incidence_bias"
    stage = LaserStage.BIAS
    oblique = True
    parameters = (Parameter("k", "m", null=0.0, scale=0.003, lower=-0.1, upper=0.1), _TANGENT)
    forms = _FORMS
    sentence = "walls at oblique incidence read too long or too short"
    formula = "µ + k · (1 / cos a − 1), a up to 80°; tangent: of tan a in its place, the share"
    source = "Kneip 2009, Ye and Borenstein 2002, Okubo 2009; 1-10 mm at 60°"
    empirical = True

    def apply(self, echoes: Echoes) -> Echoes:
        """Shift the mean by the incidence."""
        return replace(
            echoes, mean=echoes.mean + self.values["k"] * _obliqueness(echoes.incidence, self.values["tangent"])
        )


class IncidenceNoise(ReadingEffect):
    """Noise that grows with the footprint's length, or, where tangent is 1, with its depth along the beam."""

    id = "laser.incidence_noise"
    stage = LaserStage.SPREAD
    oblique = True
    parameters = (Parameter("gain", "1", null=0.0, scale=0.5, lower=0.0, upper=10.0), _TANGENT)
    forms = _FORMS
    sentence = "walls at oblique incidence have noisier readings"
    formula = "σ · (1 + gain · (1 / cos a − 1)), a up to 80°; tangent: of tan a in its place, the share"
    source = "paper, on figure 9: noise at short range is from oblique incidence; gain 0-1"
    empirical = True

    def apply(self, echoes: Echoes) -> Echoes:
        """Widen the noise by the incidence."""
        return replace(
            echoes, sd=echoes.sd * (1 + self.values["gain"] * _obliqueness(echoes.incidence, self.values["tangent"]))
        )
