# SPDX-License-Identifier: BSD-3-Clause
"""base.veer: the chair turns while it should drive straight."""

from collections.abc import Mapping
from dataclasses import replace

from kurumaisu.effects.base import Effect, Follows, Motion, Parameter, Rate, Stage


class Veer(Effect):
    """Yaw rate plus curvature times forward speed: unequal wheels (UMBmark type B).

    apart: of the wheels, where it is they that differ; then a turn drives the chair, too. 0: nothing but a turn.
    """

    id = "base.veer"
    stage = Stage.GAIN
    of_wheels = True
    parameters = (
        Parameter("curvature", "rad/m", null=0.0, scale=0.03, lower=-2.0, upper=2.0),
        Parameter("apart", "m", null=0.0, scale=0.55, lower=0.0, upper=10.0),
    )
    forms = ({"apart": 0.0}, {"apart": 0.55})  # [m] wheels of a wheelchair
    sentence = "the chair veers to one side in proportion to the distance driven (unequal wheels)"
    formula = "w + curvature · v, v + curvature · (apart / 2)² · w"
    source = "UMBmark 1996, E_d: unequal wheels; 0.02-0.1 rad/m"
    shows_in = Rate.W
    follows = Follows.V

    @classmethod
    def forms_of(cls, track: float | None) -> tuple[Mapping[str, float], ...]:
        """Return that the wheels differ, where it is known how far apart they are."""
        return cls.forms if track is None else ({"apart": track},)

    def apply(self, motion: Motion) -> Motion:
        """Add a turn in proportion to v, and what each wheel's error makes of a turn."""
        curvature, half = self.values["curvature"], self.values["apart"] / 2
        return replace(motion, v=motion.v + curvature * half**2 * motion.w, w=motion.w + curvature * motion.v)
