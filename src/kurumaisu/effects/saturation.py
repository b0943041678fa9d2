# SPDX-License-Identifier: BSD-3-Clause
"""base.saturation: the chair has a top speed and a fastest turn."""

from dataclasses import replace

import numpy as np

from kurumaisu.effects.base import Effect, Follows, Motion, Parameter, Rate, Stage
from kurumaisu.types import FloatArray


def _clip(rate: FloatArray, inverse: float) -> FloatArray:
    return rate if inverse == 0 else np.clip(rate, -1 / inverse, 1 / inverse)


class Saturation(Effect):
    """Both rates clipped; the inverse of a limit is the parameter, so that 0 is none."""

    id = "base.saturation"
    stage = Stage.GAIN
    parameters = (
        Parameter("inverse_v", "s/m", null=0.0, scale=2.0, lower=0.0, upper=20.0),
        Parameter("inverse_w", "s/rad", null=0.0, scale=2.0, lower=0.0, upper=20.0),
    )
    separable = True
    empirical = True
    sentence = "the chair is slower than commanded above a certain rate"
    formula = "|v| ≤ 1 / inverse_v, |w| ≤ 1 / inverse_w"
    source = "paper: the MD-100's speed knob; 0.5-1.5 m/s"
    shows_in = Rate.V
    follows = Follows.V

    def apply(self, motion: Motion) -> Motion:
        """Clip v and w."""
        return replace(motion, v=_clip(motion.v, self.values["inverse_v"]), w=_clip(motion.w, self.values["inverse_w"]))
