# SPDX-License-Identifier: BSD-3-Clause
"""base.saturation: the chair has a top speed and a fastest turn."""

from dataclasses import replace

import numpy as np

from kurumaisu.effects.base import Effect, Follows, Motion, Parameter, Rate, Stage
from kurumaisu.types import FloatArray

_CORNER = 1e-3  # knee below which there is none


def _limited(rate: FloatArray, inverse: float, knee: float) -> FloatArray:
    """Return rates of at most 1 / inverse; knee: share of the limit, or so, over which the corner is round."""
    if inverse == 0:
        return rate
    share = np.abs(rate) * inverse
    if knee < _CORNER:
        return np.asarray(rate / np.maximum(share, 1.0))
    # share (1 + share^(1 / knee))^-knee, of the larger part, so that no power overflows
    small, large = np.minimum(share, 1.0), np.maximum(share, 1.0)
    return np.asarray(rate / large * (1 + (small / large) ** (1 / knee)) ** -knee)


class Saturation(Effect):
    """Both rates limited; the inverse of a limit is the parameter, so that 0 is none.

    With knee = 0 each is clipped; what has little voltage or torque to spare gives way before.
    """

    id = "base.saturation"
    stage = Stage.GAIN
    parameters = (
        Parameter("inverse_v", "s/m", null=0.0, scale=2.0, lower=0.0, upper=20.0),
        Parameter("inverse_w", "s/rad", null=0.0, scale=2.0, lower=0.0, upper=20.0),
        Parameter("knee", "1", null=0.0, scale=0.1, lower=0.0, upper=1.0),
    )
    separable = True
    forms = ({"knee": 0.0}, {"knee": 0.1}, {"knee": 0.4})
    empirical = True
    sentence = "the rates saturate: above some rate the chair is slower than commanded"
    formula = "v (1 + |v · inverse_v|^(1/knee))^−knee, w likewise; knee → 0: |v| ≤ 1 / inverse_v, |w| ≤ 1 / inverse_w"
    source = "paper: the MD-100's speed knob; 0.5-1.5 m/s"
    shows_in = Rate.V
    follows = Follows.V

    def apply(self, motion: Motion) -> Motion:
        """Limit v and w."""
        v, w = (
            _limited(rate, self.values[name], self.values["knee"])
            for rate, name in ((motion.v, "inverse_v"), (motion.w, "inverse_w"))
        )
        return replace(motion, v=v, w=w)
