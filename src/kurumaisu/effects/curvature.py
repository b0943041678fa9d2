# SPDX-License-Identifier: BSD-3-Clause
"""base.curvature_v and base.curvature_w: a rate falls behind its law the more, the larger it is."""

from dataclasses import replace

import numpy as np

from kurumaisu.effects.base import Effect, Follows, Motion, Parameter, Rate, Stage
from kurumaisu.types import FloatArray


def _bend(rate: FloatArray, curvature: float) -> FloatArray:
    """Return rates bent; where the parabola would turn back beyond 0 there is none."""
    return np.asarray(rate * np.maximum(1 - curvature * np.abs(rate), 0.0))


class CurvatureV(Effect):
    """Forward speed less its square: the voltage law is bent (expo)."""

    id = "base.curvature_v"
    stage = Stage.GAIN
    parameters = (Parameter("curvature", "s/m", null=0.0, scale=0.05, lower=-1.0, upper=1.0),)
    empirical = True
    sentence = "the forward speed is not proportional to its command: the gain falls with the speed"
    formula = "v · max(0, 1 − curvature · |v|)"
    source = "assumed: expo of joystick inputs; ±0.1 s/m"
    shows_in = Rate.V
    follows = Follows.V

    def apply(self, motion: Motion) -> Motion:
        """Bend v."""
        return replace(motion, v=_bend(motion.v, self.values["curvature"]))


class CurvatureW(Effect):
    """Yaw rate less its square: the voltage law is bent (expo)."""

    id = "base.curvature_w"
    stage = Stage.GAIN
    parameters = (Parameter("curvature", "s/rad", null=0.0, scale=0.05, lower=-1.0, upper=1.0),)
    empirical = True
    sentence = "the yaw rate is not proportional to its command: the gain falls with the yaw rate"
    formula = "w · max(0, 1 − curvature · |w|)"
    source = "assumed: expo of joystick inputs; ±0.1 s/rad"
    shows_in = Rate.W
    follows = Follows.W

    def apply(self, motion: Motion) -> Motion:
        """Bend w."""
        return replace(motion, w=_bend(motion.w, self.values["curvature"]))
