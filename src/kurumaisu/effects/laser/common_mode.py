# SPDX-License-Identifier: BSD-3-Clause
"""laser.common_mode: all beams of a scan are off together, and the next scan's nearly as much."""

from dataclasses import replace

import numpy as np

from kurumaisu.effects.laser.base import Echoes, LaserStage, ReadingEffect
from kurumaisu.effects.mechanism import Parameter


class CommonMode(ReadingEffect):
    """An offset per scan, autoregressive of first order, stationary from the first scan on."""

    id = "laser.common_mode"
    stage = LaserStage.NOISE
    parameters = (
        Parameter("sd", "m", null=0.0, scale=5.0e-4, lower=0.0, upper=0.1),
        Parameter("rho", "1", null=0.8, scale=0.1, lower=0.0, upper=0.9999),
    )
    sentence = "all ranges of a scan share one error"
    formula = "µ + s_k, s_k = rho · s_(k−1) + √(1 − rho²) · sd · n"
    source = "assumed; 0.1-1 mm, rho 0-0.99"
    random = True

    _unit: float | None = None  # of the last scan, in sd

    def apply(self, echoes: Echoes) -> Echoes:
        """Shift the mean of the scan."""
        rho, units = self.values["rho"], np.empty(np.shape(echoes.stamp))
        for i, draw in enumerate(self.rng.standard_normal(units.size)):
            self._unit = draw if self._unit is None else rho * self._unit + np.sqrt(1 - rho**2) * draw
            units.flat[i] = self._unit
        return replace(echoes, mean=echoes.mean + self.values["sd"] * units)
