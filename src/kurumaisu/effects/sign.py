# SPDX-License-Identifier: BSD-3-Clause
"""base.sign: an axis is reversed, swapped with the other, or in another unit."""

from dataclasses import replace

from kurumaisu.effects.base import Effect, Follows, Motion, Parameter, Rate, Stage

_DEGREES = 57.29577951308232  # in a radian
_FACTORS = {"null": 1.0, "scale": 1.0, "lower": -60.0, "upper": 60.0}


class Sign(Effect):
    """Both rates as numbers times factors, -1 being a reversed axis; swap 1: each is taken for the other."""

    id = "base.sign"
    stage = Stage.TRANSPORT
    parameters = (
        Parameter("factor_v", "1", **_FACTORS),
        Parameter("factor_w", "1", **_FACTORS),
        Parameter("swap", "1", null=0.0, scale=1.0, lower=0.0, upper=1.0),
    )
    sentence = "an axis is reversed, swapped with the other, or in another unit"
    formula = "factor_v · ((1 − swap) · v + swap · w), factor_w · ((1 − swap) · w + swap · v), as numbers"
    source = "wrong wiring or units; −1, 57.3 or 1/57.3, swap 1"
    choices = (
        {"factor_v": -1.0, "factor_w": 1.0, "swap": 0.0},
        {"factor_v": 1.0, "factor_w": -1.0, "swap": 0.0},
        {"factor_v": -1.0, "factor_w": -1.0, "swap": 0.0},
        {"factor_v": 1.0, "factor_w": _DEGREES, "swap": 0.0},
        {"factor_v": 1.0, "factor_w": 1 / _DEGREES, "swap": 0.0},
        {"factor_v": 1.0, "factor_w": 1.0, "swap": 1.0},
    )
    shows_in = Rate.W
    follows = Follows.W

    def apply(self, motion: Motion) -> Motion:
        """Mix and scale v and w."""
        swap = self.values["swap"]
        return replace(
            motion,
            v=self.values["factor_v"] * ((1 - swap) * motion.v + swap * motion.w),
            w=self.values["factor_w"] * ((1 - swap) * motion.w + swap * motion.v),
        )
