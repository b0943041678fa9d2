# SPDX-License-Identifier: BSD-3-Clause
"""base.cross_w_to_v and base.cross_v_to_w: one axis leaks into the other."""

from dataclasses import replace

import numpy as np

from kurumaisu.effects.base import Effect, Follows, Motion, Parameter, Rate, Stage


class CrossWToV(Effect):
    """Forward speed plus a share of the yaw rate: base_link is not on the axis about which the chair turns.

    even: 1 where turns to both sides do the same, as when the wheels that turn it are not alike loaded.
    """

    id = "base.cross_w_to_v"
    stage = Stage.FLOOR  # it follows how the chair turns, as a marker beside base_link does
    parameters = (
        Parameter("lever", "m", null=0.0, scale=0.03, lower=-1.0, upper=1.0),
        Parameter("even", "1", null=0.0, scale=1.0, lower=0.0, upper=1.0),
    )
    forms = ({"even": 0.0}, {"even": 1.0})
    sentence = "turning moves the chair forward or backward"
    formula = "v + lever · w; with even = 1, v + lever · |w|"
    source = "UMBmark 1996; exactly like base.marker_y with y = −lever to a reference pose, but for even = 1"
    shows_in = Rate.V
    follows = Follows.W

    def apply(self, motion: Motion) -> Motion:
        """Add a share of w to v."""
        turning = np.abs(motion.w) if self.values["even"] >= 0.5 else motion.w
        return replace(motion, v=motion.v + self.values["lever"] * turning)


class CrossVToW(Effect):
    """The yaw rate that a share of V_f makes on the steering input: crosstalk of the joystick's two lines.

    Other than base.veer it has the jump of V_f where the chair starts to move. rests: 1 where the dead zone of the
    steering swallows a leak: a chair that is to go straight does not turn, nor any to the other side than it is to.
    """

    id = "base.cross_v_to_w"
    stage = Stage.GAIN
    of_voltages = True
    parameters = (
        Parameter("share", "1", null=0.0, scale=0.01, lower=-0.5, upper=0.5),
        Parameter("rests", "1", null=0.0, scale=1.0, lower=0.0, upper=1.0),
    )
    forms = ({"rests": 0.0}, {"rests": 1.0})
    sentence = "the translation voltage leaks into the steering"
    formula = "w + share · V_f(v) · gain of V_s(w); with rests = 1, 0 of another sign, w where no turn is asked for"
    source = "paper, section on identification: weak, correlation 0.003"
    shows_in = Rate.W
    follows = Follows.V

    def apply(self, motion: Motion) -> Motion:
        """Add what a share of V_f makes to w."""
        leak = self.values["share"] * self.context.translation.volts(motion.v)
        w = motion.w + leak * self.context.steering.gain(motion.w)
        if self.values["rests"] >= 0.5:
            straight = motion.known.get("w_asked", motion.w) == 0
            w = np.where(straight, motion.w, np.where(w * motion.w < 0, 0.0, w))
        return replace(motion, w=w)
