# SPDX-License-Identifier: BSD-3-Clause
"""base.dead_zone_v and base.dead_zone_w: the joystick input swallows more volts than the law says."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from kurumaisu._core import AxisLaw
from kurumaisu.effects.base import Effect, Follows, Motion, Parameter, Rate, Stage
from kurumaisu.types import FloatArray

_PARAMETERS = (
    Parameter("width", "V", null=0.0, scale=0.03, lower=-0.3, upper=0.5),
    Parameter("even", "1", null=0.0, scale=1.0, lower=0.0, upper=1.0),
    Parameter("whole", "1", null=0.0, scale=1.0, lower=0.0, upper=1.0),
    Parameter("side", "1", null=0.0, scale=1.0, lower=-1.0, upper=1.0),
)
_FORMS = (
    {"even": 0.0, "whole": 0.0, "side": 0.0},
    {"even": 1.0, "whole": 0.0, "side": 0.0},
    {"even": 1.0, "whole": 1.0, "side": 0.0},
    {"even": 0.0, "whole": 0.0, "side": 1.0},
    {"even": 0.0, "whole": 0.0, "side": -1.0},
)


def _swallow(rate: FloatArray, values: Mapping[str, float], law: AxisLaw) -> FloatArray:
    """Return rates without what the zone swallows; a negative width adds it.

    width [V]: of the branch of each rate, or with even = 1 of the positive one for both, so that as much of the rate
    is lost on either side. whole: 1 where a rate beyond the zone is left as it is, else all rates are less by the zone.
    side: 1 where only positive rates have the zone, as each branch of the law has its own threshold, -1: negative ones.
    """
    branch = np.ones_like(rate) if values["even"] >= 0.5 else rate
    zone = values["width"] * np.abs(law.gain(branch)) * (np.round(values["side"]) * rate >= 0)
    if values["whole"] >= 0.5:
        return np.where(np.abs(rate) > zone, rate, 0.0)
    return np.asarray(np.sign(rate) * np.maximum(np.abs(rate) - zone, 0.0))


class DeadZoneV(Effect):
    """V_f must exceed its threshold by another width before the chair moves."""

    id = "base.dead_zone_v"
    stage = Stage.THRESHOLD
    parameters = _PARAMETERS
    forms = _FORMS
    empirical = True
    sentence = "small forward speeds that are asked for have no effect: their dead zone is wider than modelled"
    formula = (
        "sign(v) · max(0, |v| − width · |gain of V_f|), or with whole = 1: 0 up to there, beyond it v; "
        "with side = ±1: only forward (+1) or back (−1)"
    )
    source = "assumed: joystick inputs have a neutral zone; 5-50 mV"
    shows_in = Rate.V
    follows = Follows.V

    def apply(self, motion: Motion) -> Motion:
        """Shrink v towards 0."""
        return replace(motion, v=_swallow(motion.v, self.values, self.context.translation))


class DeadZoneW(Effect):
    """V_s must exceed its threshold by another width before the chair turns."""

    id = "base.dead_zone_w"
    stage = Stage.THRESHOLD
    parameters = _PARAMETERS
    forms = _FORMS
    empirical = True
    sentence = "small yaw rates that are asked for have no effect: their dead zone is wider than modelled"
    formula = (
        "sign(w) · max(0, |w| − width · |gain of V_s|), or with whole = 1: 0 up to there, beyond it w; "
        "with side = ±1: only to the left (+1) or right (−1)"
    )
    source = "assumed: joystick inputs have a neutral zone; 5-50 mV"
    shows_in = Rate.W
    follows = Follows.W

    def apply(self, motion: Motion) -> Motion:
        """Shrink w towards 0."""
        return replace(motion, w=_swallow(motion.w, self.values, self.context.steering))
