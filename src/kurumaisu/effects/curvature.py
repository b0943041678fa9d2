# SPDX-License-Identifier: BSD-3-Clause
"""base.curvature_v and base.curvature_w: a rate falls behind its law the more, the larger it is."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from kurumaisu.effects.base import Effect, Follows, Motion, Parameter, Rate, Stage
from kurumaisu.types import FloatArray

_POWER = Parameter("power", "1", null=1.0, scale=1.0, lower=1.0, upper=4.0)
_FORMS = ({"power": 1.0}, {"power": 2.0})


def _bend(rate: FloatArray, values: Mapping[str, float]) -> FloatArray:
    """Return rates bent; where the curve would turn back beyond 0 there is none."""
    return np.asarray(rate * np.maximum(1 - values["curvature"] * np.abs(rate) ** values["power"], 0.0))


class CurvatureV(Effect):
    """Forward speed less its square: the voltage law is bent (expo)."""

    id = "base.curvature_v"
    stage = Stage.GAIN
    parameters = (Parameter("curvature", "s/m", null=0.0, scale=0.05, lower=-1.0, upper=1.0), _POWER)
    forms = _FORMS
    empirical = True
    sentence = "the forward speed is not proportional to its command: the gain falls with the speed"
    formula = "v · max(0, 1 − curvature · |v|^power), the curvature as at 1 m/s"
    source = "assumed: expo of joystick inputs; ±0.1 s/m"
    shows_in = Rate.V
    follows = Follows.V

    def apply(self, motion: Motion) -> Motion:
        """Bend v."""
        return replace(motion, v=_bend(motion.v, self.values))


class CurvatureW(Effect):
    """Yaw rate less its square: the voltage law is bent (expo)."""

    id = "base.curvature_w"
    stage = Stage.GAIN
    parameters = (Parameter("curvature", "s/rad", null=0.0, scale=0.05, lower=-1.0, upper=1.0), _POWER)
    forms = _FORMS
    empirical = True
    sentence = "the yaw rate is not proportional to its command: the gain falls with the yaw rate"
    formula = "w · max(0, 1 − curvature · |w|^power), the curvature as at 1 rad/s"
    source = "assumed: expo of joystick inputs; ±0.1 s/rad"
    shows_in = Rate.W
    follows = Follows.W

    def apply(self, motion: Motion) -> Motion:
        """Bend w."""
        return replace(motion, w=_bend(motion.w, self.values))
