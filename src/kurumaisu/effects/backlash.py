# SPDX-License-Identifier: BSD-3-Clause
"""base.backlash: the yaw rate hangs behind where the command comes from."""

from dataclasses import replace

from kurumaisu import _core
from kurumaisu.effects.base import Effect, Follows, Motion, Parameter, Rate, Stage


class Backlash(Effect):
    """Yaw rate dragged along by its command with play; a chair commanded to rest rests."""

    id = "base.backlash"
    stage = Stage.THRESHOLD
    parameters = (Parameter("play", "rad/s", null=0.0, scale=0.03, lower=0.0, upper=1.0),)
    empirical = True
    sentence = "the yaw rate has play: it depends on the direction in which its command changed"
    formula = "w' = min(max(w', w − play/2), w + play/2) while moving"
    source = "assumed: play of joystick or gear; 5-50 mrad/s"
    shows_in = Rate.W
    follows = Follows.W_CHANGE

    _level = 0.0

    def apply(self, motion: Motion) -> Motion:
        """Drag w."""
        w, self._level = _core.play(motion.w, self.values["play"] / 2, self._level)
        return replace(motion, w=motion.moving * w)

    def settle(self, motion: Motion) -> None:
        """Stand in the middle of the play."""
        self._level = float(motion.w[-1])
