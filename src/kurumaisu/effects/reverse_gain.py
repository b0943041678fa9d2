# SPDX-License-Identifier: BSD-3-Clause
"""base.reverse_gain: in reverse the chair is faster or slower than its law says."""

from dataclasses import replace

import numpy as np

from kurumaisu.effects.base import Effect, Follows, Motion, Parameter, Rate, Stage


class ReverseGain(Effect):
    """Forward speed times (1 + gain) where it is negative."""

    id = "base.reverse_gain"
    stage = Stage.GAIN
    parameters = (Parameter("gain", "1", null=0.0, scale=0.05, lower=-0.9, upper=4.0),)
    sentence = "in reverse the chair drives faster or slower than commanded, in proportion to the speed"
    formula = "v · (1 + gain) where v < 0"
    source = "wheelchairs limit reverse; (1) has a ratio of 0.64 already"
    shows_in = Rate.V
    follows = Follows.V

    def apply(self, motion: Motion) -> Motion:
        """Scale v in reverse."""
        return replace(motion, v=np.where(motion.v < 0, (1 + self.values["gain"]) * motion.v, motion.v))
