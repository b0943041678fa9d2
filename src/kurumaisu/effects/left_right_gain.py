# SPDX-License-Identifier: BSD-3-Clause
"""base.left_right_gain: left turns are stronger than right turns, or the reverse."""

from dataclasses import replace

import numpy as np

from kurumaisu.effects.base import Effect, Follows, Motion, Parameter, Rate, Stage


class LeftRightGain(Effect):
    """Yaw rate times (1 + asymmetry) to the left and (1 - asymmetry) to the right."""

    id = "base.left_right_gain"
    stage = Stage.GAIN
    parameters = (Parameter("asymmetry", "1", null=0.0, scale=0.05, lower=-0.9, upper=0.9),)
    sentence = "left and right turns have different gains"
    formula = "w · (1 + asymmetry · sign(w))"
    source = "branches of (2) differ; ±8 %"
    shows_in = Rate.W
    follows = Follows.W

    def apply(self, motion: Motion) -> Motion:
        """Scale w by the side of the turn."""
        return replace(motion, w=motion.w * (1 + self.values["asymmetry"] * np.sign(motion.w)))
