# SPDX-License-Identifier: BSD-3-Clause
"""base.dac_quantisation: the D/A converter puts out whole steps only."""

from dataclasses import replace

import numpy as np

from kurumaisu.effects.base import Follows, Parameter, Rate, Stage, VoltageEffect, Volts
from kurumaisu.effects.branch import beyond_branch
from kurumaisu.types import FloatArray

_NO_REST = 1.0e-12  # [V] nothing, but for the inverse of the law, to which 0 V is rest


class DacQuantisation(VoltageEffect):
    """Both voltages in steps, alike on both sides of 0: rounded, or as a converter has them that knows no 0, or cuts.

    phase: where the levels lie, in steps from 0: 1/2 for a converter whose 0 is an edge (mid-rise). cut: 1 where the
    rest is cut off instead of rounded, which lowers a level by half a step. rests: by equation (2) as printed, 0 V lie
    on both branches; 1 where a turn whose level is 0 V is rest, else it goes on on the branch meant. What a level is
    beyond the end of that branch turns to the other side; with rests = -1 it is rest.
    """

    id = "base.dac_quantisation"
    stage = Stage.CONVERTER
    in_odometry = True
    parameters = (
        Parameter("step", "V", null=0.0, scale=0.005, lower=0.0, upper=1.0),
        Parameter("phase", "1", null=0.0, scale=0.5, lower=-0.5, upper=0.5),
        Parameter("cut", "1", null=0.0, scale=1.0, lower=0.0, upper=1.0),
        Parameter("rests", "1", null=0.0, scale=1.0, lower=-1.0, upper=1.0),
    )
    forms = (
        {"phase": 0.0, "cut": 0.0, "rests": 0.0},
        {"phase": 0.5, "cut": 0.0, "rests": 0.0},
        {"phase": 0.5, "cut": 1.0, "rests": 0.0},
        {"phase": 0.0, "cut": 0.0, "rests": 1.0},
        {"phase": 0.0, "cut": 0.0, "rests": -1.0},
    )
    sentence = "the voltages come in steps of the D/A converter"
    formula = (
        "± step · (round(|V| / step − phase) + phase − cut / 2), ±: sign of V; with rests = 1, 0 V is rest; with "
        "rests = −1, so is what is beyond the branch meant"
    )
    source = "resolution of any D/A converter; 1-5 mV"
    shows_in = Rate.W
    follows = Follows.W

    def apply(self, volts: Volts) -> Volts:
        """Step V_f and V_s."""
        if self.values["step"] == 0:
            return volts
        v_s = self._stepped(volts.v_s)
        if self.values["rests"] < -0.5:
            beyond = beyond_branch(self.context.steering, v_s, volts.sign_w)
            v_s = np.where(beyond, 0.0, np.where(v_s == 0, _NO_REST * volts.sign_w, v_s))
        elif self.values["rests"] < 0.5:
            v_s = np.where((v_s == 0) & (np.abs(volts.sign_w) > 0), _NO_REST, v_s)
        return replace(volts, v_f=self._stepped(volts.v_f), v_s=v_s)

    def _stepped(self, volts: FloatArray) -> FloatArray:
        step, phase, cut = (self.values[name] for name in ("step", "phase", "cut"))
        level = np.floor(np.abs(volts) / step - phase + 0.5) + phase - cut / 2
        return np.asarray(np.sign(volts) * step * np.maximum(level, 0.0))
