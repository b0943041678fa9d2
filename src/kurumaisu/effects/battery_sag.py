# SPDX-License-Identifier: BSD-3-Clause
"""base.battery_sag: the chair gets slower as its battery runs down."""

from dataclasses import replace

import numpy as np

from kurumaisu.effects.base import Effect, Follows, Motion, Parameter, Rate, Stage
from kurumaisu.effects.smooth_covariates import RECORDING_TIME


class BatterySag(Effect):
    """Both rates shrink in proportion to the time since the start, until the chair stands still."""

    id = "base.battery_sag"
    stage = Stage.GAIN
    parameters = (
        Parameter("sag", "1/s", null=0.0, scale=1.0e-3, lower=-0.01, upper=0.1),
        Parameter("through", "1", null=0.0, scale=1.0, lower=0.0, upper=1.0),
    )
    forms = ({"through": 0.0}, {"through": 1.0})
    empirical = True
    sentence = "the chair gets slower during a drive, as with a battery that runs down"
    formula = "v, w · max(0, 1 − sag · t); t since the start, or with through = 1 since the first run of the recording"
    source = "assumed: battery voltage; 5-15 % in a recording"
    shows_in = Rate.V
    follows = Follows.V

    _count = 0  # of samples before the next chunk

    def apply(self, motion: Motion) -> Motion:
        """Scale v and w by what is left in the middle of each step; nobody knows an earlier run: t since the start."""
        middles = motion.dt * (self._count + 0.5 + np.arange(len(motion.v)))
        self._count += len(motion.v)
        if self.values["through"] >= 0.5:
            middles = np.asarray(motion.known.get(RECORDING_TIME, middles))
        left = np.maximum(1 - self.values["sag"] * middles, 0.0)
        return replace(motion, v=motion.v * left, w=motion.w * left)
