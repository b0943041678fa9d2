# SPDX-License-Identifier: BSD-3-Clause
"""base.veer: the chair turns while it should drive straight."""

from dataclasses import replace

from kurumaisu.effects.base import Effect, Follows, Motion, Parameter, Rate, Stage


class Veer(Effect):
    """Yaw rate plus curvature times forward speed: unequal wheels (UMBmark type B)."""

    id = "base.veer"
    stage = Stage.GAIN
    parameters = (Parameter("curvature", "rad/m", null=0.0, scale=0.03, lower=-2.0, upper=2.0),)
    sentence = "the chair veers to one side in proportion to the distance driven (unequal wheels)"
    formula = "w + curvature · v"
    source = "UMBmark 1996, E_d: unequal wheels; 0.02-0.1 rad/m"
    shows_in = Rate.W
    follows = Follows.V

    def apply(self, motion: Motion) -> Motion:
        """Add a turn in proportion to v."""
        return replace(motion, w=motion.w + self.values["curvature"] * motion.v)
