# SPDX-License-Identifier: BSD-3-Clause
"""laser.beam_correlation: neighbouring beams are off together."""

from dataclasses import replace

import numpy as np

from kurumaisu.effects.laser.base import Echoes, LaserStage, ReadingEffect
from kurumaisu.effects.mechanism import Parameter


class BeamCorrelation(ReadingEffect):
    """Noise made autoregressive along the beams, of the same standard deviation."""

    id = "laser.beam_correlation"
    stage = LaserStage.NOISE
    parameters = (Parameter("rho", "1", null=0.0, scale=0.3, lower=-0.99, upper=0.99),)
    sentence = "errors of neighbouring beams are correlated"
    formula = "z_i = rho · z_(i−1) + √(1 − rho²) · n_i"
    source = "a real URG-04LX: 0.52, 0.31, 0.18, 0.09 at lags 1, 2, 3, 5"
    empirical = True
    random = True

    def apply(self, echoes: Echoes) -> Echoes:
        """Filter the noise."""
        rho = self.values["rho"]
        innovations = np.sqrt(1 - rho**2) * echoes.noise
        innovations[..., :1] = echoes.noise[..., :1]  # stationary from the first beam on
        from scipy.signal import lfilter  # half a second to load, for those who have no lag or noise

        return replace(echoes, noise=np.asarray(lfilter([1.0], [1.0, -rho], innovations)))
