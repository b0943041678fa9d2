# SPDX-License-Identifier: BSD-3-Clause
"""base.gain_v and base.gain_w: a rate is larger or smaller than its law says, in proportion."""

from dataclasses import replace

from kurumaisu.effects.base import Effect, Follows, Motion, Parameter, Rate, Stage

_GAIN = (Parameter("gain", "1", null=0.0, scale=0.05, lower=-0.9, upper=4.0),)


class GainV(Effect):
    """Forward speed times (1 + gain): wheel radius, tyre pressure, payload."""

    id = "base.gain_v"
    stage = Stage.GAIN
    of_wheels = True
    parameters = _GAIN
    sentence = "the chair drives faster or slower than commanded, in proportion to the speed"
    formula = "v · (1 + gain)"
    source = "UMBmark 1996; wheel radius, tyre pressure; ±5 %"
    shows_in = Rate.V
    follows = Follows.V

    def apply(self, motion: Motion) -> Motion:
        """Scale v."""
        return replace(motion, v=motion.v * (1 + self.values["gain"]))


class GainW(Effect):
    """Yaw rate times (1 + gain): effective track."""

    id = "base.gain_w"
    stage = Stage.GAIN
    of_wheels = True
    parameters = _GAIN
    sentence = "the chair turns more or less than commanded, in proportion to the yaw rate (effective track)"
    formula = "w · (1 + gain)"
    source = "UMBmark 1996, E_b: effective track; ±10 %"
    shows_in = Rate.W
    follows = Follows.W

    def apply(self, motion: Motion) -> Motion:
        """Scale w."""
        return replace(motion, w=motion.w * (1 + self.values["gain"]))
