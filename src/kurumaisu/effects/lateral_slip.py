# SPDX-License-Identifier: BSD-3-Clause
"""base.lateral_slip: in bends the chair drifts outwards."""

from dataclasses import replace

from kurumaisu.effects.base import Effect, Follows, Motion, Parameter, Rate, Stage


class LateralSlip(Effect):
    """A leftward speed in proportion to the centripetal acceleration, away from the bend's centre."""

    id = "base.lateral_slip"
    stage = Stage.FLOOR
    parameters = (Parameter("c", "s", null=0.0, scale=0.02, lower=-0.5, upper=0.5),)
    empirical = True
    sentence = "the chair drifts outwards in curves"
    formula = "u − c · v · w"
    source = "assumed: slip of tyres under side force; 0.01-0.05 s"
    shows_in = Rate.V
    follows = Follows.W

    def apply(self, motion: Motion) -> Motion:
        """Slip to the right in left bends."""
        slip = -self.values["c"] * motion.v * motion.w
        return replace(motion, u=slip if motion.u is None else motion.u + slip)
