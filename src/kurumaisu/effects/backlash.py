# SPDX-License-Identifier: BSD-3-Clause
"""base.backlash: the yaw rate hangs behind where the command comes from."""

from dataclasses import replace

import numpy as np

from kurumaisu import _core
from kurumaisu.effects.base import Effect, Follows, Motion, Parameter, Rate, Stage
from kurumaisu.types import FloatArray


class Backlash(Effect):
    """Yaw rate dragged along by its command with play; a chair commanded to rest rests.

    onset: with 0 a rate that grows and one that falls miss the command by half of the play each. With 0.5 each side
    does so by itself, and a chair that is asked to drive straight does. With 1 the play is taken up by what begins to
    turn, so that a rate that grows misses all of it and one that falls nothing.
    """

    id = "base.backlash"
    stage = Stage.THRESHOLD
    parameters = (
        Parameter("play", "rad/s", null=0.0, scale=0.03, lower=0.0, upper=1.0),
        Parameter("onset", "1", null=0.0, scale=1.0, lower=0.0, upper=1.0),
    )
    forms = ({"onset": 0.0}, {"onset": 0.5}, {"onset": 1.0})
    empirical = True
    sentence = "the yaw rate has play: it depends on the direction in which its command changed"
    formula = (
        "w' = min(max(w', w − play/2), w + play/2) while moving, or with onset >= 0.5 to each side by itself, "
        "w − sign(w) · play · (onset − 0.5) in place of w"
    )
    source = "assumed: play of joystick or gear; 5-50 mrad/s"
    shows_in = Rate.W
    follows = Follows.W_CHANGE

    _level = _left = _right = 0.0

    def apply(self, motion: Motion) -> Motion:
        """Drag w."""
        half = self.values["play"] / 2
        if self.values["onset"] >= 0.5:
            left, self._left = _core.play(self._side(motion.w), half, self._left)
            right, self._right = _core.play(self._side(-motion.w), half, self._right)
            return replace(motion, w=np.maximum(left, 0.0) - np.maximum(right, 0.0))
        w, self._level = _core.play(motion.w, half, self._level)
        return replace(motion, w=motion.moving * w)

    def _side(self, w: FloatArray) -> FloatArray:
        """Return what drags the rate (n,) to one side along: asked for nothing there, it lets go of it."""
        shift = self.values["play"] * (self.values["onset"] - 0.5)
        return np.where(w > 0, w - shift, -self.values["play"] / 2)

    def settle(self, motion: Motion) -> None:
        """Stand in the middle of the play."""
        at = motion.w[-1:]
        self._level = float(at[0])
        self._left, self._right = float(self._side(at)[0]), float(self._side(-at)[0])
