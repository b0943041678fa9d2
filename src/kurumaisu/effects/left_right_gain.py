# SPDX-License-Identifier: BSD-3-Clause
"""base.left_right_gain: left turns are stronger than right turns, or the reverse."""

from dataclasses import replace

import numpy as np

from kurumaisu.effects.base import Effect, Follows, Motion, Parameter, Rate, Stage


class LeftRightGain(Effect):
    """Yaw rate times (1 + asymmetry) to the left and (1 - asymmetry) to the right; side: only to one of them."""

    id = "base.left_right_gain"
    stage = Stage.GAIN
    parameters = (
        Parameter("asymmetry", "1", null=0.0, scale=0.05, lower=-0.9, upper=0.9),
        Parameter("side", "1", null=0.0, scale=1.0, lower=-1.0, upper=1.0),
    )
    forms = ({"side": 0.0}, {"side": 1.0}, {"side": -1.0})
    sentence = "left and right turns have different gains"
    formula = "w · (1 + asymmetry · sign(w)), or with side = ±1: only to the left (+1) or to the right (−1)"
    source = "branches of (2) differ; ±8 %"
    shows_in = Rate.W
    follows = Follows.W

    def apply(self, motion: Motion) -> Motion:
        """Scale w by the side of the turn."""
        turn = np.sign(motion.w)
        acts = np.where(self.values["side"] * turn >= 0, turn, 0.0)
        return replace(motion, w=motion.w * (1 + self.values["asymmetry"] * acts))
