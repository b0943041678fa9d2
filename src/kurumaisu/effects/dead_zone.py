# SPDX-License-Identifier: BSD-3-Clause
"""base.dead_zone_v and base.dead_zone_w: the joystick input swallows more volts than the law says."""

from dataclasses import replace

import numpy as np

from kurumaisu._core import AxisLaw
from kurumaisu.effects.base import Effect, Follows, Motion, Parameter, Rate, Stage
from kurumaisu.types import FloatArray

_WIDTH = (Parameter("width", "V", null=0.0, scale=0.03, lower=-0.3, upper=0.5),)


def _swallow(rate: FloatArray, width: float, law: AxisLaw) -> FloatArray:
    """Return rates without what the width [V] stands for on their branch; a negative width adds it."""
    lost = width * np.abs(law.gain(rate))
    return np.asarray(np.sign(rate) * np.maximum(np.abs(rate) - lost, 0.0))


class DeadZoneV(Effect):
    """V_f must exceed its threshold by another width before the chair moves."""

    id = "base.dead_zone_v"
    stage = Stage.THRESHOLD
    parameters = _WIDTH
    empirical = True
    sentence = "small translation voltages are swallowed: the dead zone of V_f is wider than modelled"
    formula = "sign(v) · max(0, |v| − width · |gain of V_f|)"
    source = "assumed: joystick inputs have a neutral zone; 5-50 mV"
    shows_in = Rate.V
    follows = Follows.V

    def apply(self, motion: Motion) -> Motion:
        """Shrink v towards 0."""
        return replace(motion, v=_swallow(motion.v, self.values["width"], self.context.translation))


class DeadZoneW(Effect):
    """V_s must exceed its threshold by another width before the chair turns."""

    id = "base.dead_zone_w"
    stage = Stage.THRESHOLD
    parameters = _WIDTH
    empirical = True
    sentence = "small steering voltages are swallowed: the dead zone of V_s is wider than modelled"
    formula = "sign(w) · max(0, |w| − width · |gain of V_s|)"
    source = "assumed: joystick inputs have a neutral zone; 5-50 mV"
    shows_in = Rate.W
    follows = Follows.W

    def apply(self, motion: Motion) -> Motion:
        """Shrink w towards 0."""
        return replace(motion, w=_swallow(motion.w, self.values["width"], self.context.steering))
