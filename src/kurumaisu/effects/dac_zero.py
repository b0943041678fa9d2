# SPDX-License-Identifier: BSD-3-Clause
"""base.dac_zero_f and base.dac_zero_s: the D/A converter's zero is off."""

from dataclasses import replace

import numpy as np

from kurumaisu.effects.base import Follows, Parameter, Rate, Stage, VoltageEffect, Volts
from kurumaisu.effects.branch import beyond_branch, end_of_branch

_OFFSET = (Parameter("offset", "V", null=0.0, scale=0.01, lower=-0.5, upper=0.5),)
_RESTS = Parameter("rests", "1", null=0.0, scale=1.0, lower=-1.0, upper=1.0)


class DacZeroF(VoltageEffect):
    """V_f plus a constant; a chair asked to rest is held by its brakes, however far V_f is off then.

    rests: -1 where it creeps by as much then, as without brakes and neutral zone.
    """

    id = "base.dac_zero_f"
    stage = Stage.CONVERTER
    parameters = (*_OFFSET, _RESTS)
    forms = ({"rests": 0.0}, {"rests": -1.0})
    sentence = "the translation voltage has a constant offset"
    formula = "V_f + offset, 0 at rest; with rests = −1, the end of a branch + offset at rest"
    source = "offset error of any D/A converter; 2-20 mV"
    shows_in = Rate.V
    follows = Follows.V

    def apply(self, volts: Volts) -> Volts:
        """Shift V_f."""
        offset, rests = self.values["offset"], volts.v_f == 0
        if self.values["rests"] > -0.5:
            return replace(volts, v_f=np.where(rests, 0.0, volts.v_f + offset))
        law = self.context.translation
        side = np.where(rests, np.sign(offset / law.positive.slope), volts.sign_v)
        return replace(volts, v_f=np.where(rests, end_of_branch(law, side), volts.v_f) + offset, sign_v=side)


class DacZeroS(VoltageEffect):
    """V_s plus a constant.

    By equation (2) as printed, a voltage beyond the branch that was meant lies on the other one: the chair turns to
    the wrong side, and fast; and so does V_s = 0 of a chair that was to go straight, with an offset beyond the end of a
    branch. rests: 1 where it does not turn at all then; -1 where it turns by as much when it is to drive straight, as
    with a steering that has no neutral zone.
    """

    id = "base.dac_zero_s"
    stage = Stage.CONVERTER
    parameters = (*_OFFSET, _RESTS)
    forms = ({"rests": 0.0}, {"rests": 1.0}, {"rests": -1.0})
    sentence = "the steering voltage has a constant offset"
    formula = (
        "V_s + offset; with rests = 1, 0 where that is beyond the branch meant, or no turn is; with rests = −1, "
        "the end of a branch + offset where the chair is to drive straight"
    )
    source = "offset error of any D/A converter; 2-20 mV"
    shows_in = Rate.W
    follows = Follows.W

    def apply(self, volts: Volts) -> Volts:
        """Shift V_s."""
        v_s = volts.v_s + self.values["offset"]
        if abs(self.values["rests"]) < 0.5:
            return replace(volts, v_s=v_s)
        law = self.context.steering
        side, straight = volts.sign_w, np.zeros(len(v_s), dtype=bool)
        if self.values["rests"] < 0:
            straight = (side == 0) & (volts.v_f != 0)
            side = np.where(straight, np.sign(self.values["offset"] / law.positive.slope), side)
        v_s = np.where(straight, end_of_branch(law, side) + self.values["offset"], v_s)
        beyond = beyond_branch(law, v_s, side)
        return replace(volts, v_s=np.where(beyond | (side == 0), 0.0, v_s), sign_w=side)
