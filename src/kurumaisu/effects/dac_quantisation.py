# SPDX-License-Identifier: BSD-3-Clause
"""base.dac_quantisation: the D/A converter puts out whole steps only."""

from dataclasses import replace

import numpy as np

from kurumaisu.effects.base import Follows, Parameter, Rate, Stage, VoltageEffect, Volts
from kurumaisu.types import FloatArray


class DacQuantisation(VoltageEffect):
    """Both voltages in steps, alike on both sides of 0: rounded, or as a converter has them that knows no 0, or cuts.

    phase: where the levels lie, in steps from 0: 1/2 for a converter whose 0 is an edge (mid-rise). cut: 1 where the
    rest is cut off instead of rounded, which lowers a level by half a step.
    """

    id = "base.dac_quantisation"
    stage = Stage.CONVERTER
    parameters = (
        Parameter("step", "V", null=0.0, scale=0.005, lower=0.0, upper=1.0),
        Parameter("phase", "1", null=0.0, scale=0.5, lower=-0.5, upper=0.5),
        Parameter("cut", "1", null=0.0, scale=1.0, lower=0.0, upper=1.0),
    )
    forms = ({"phase": 0.0, "cut": 0.0}, {"phase": 0.5, "cut": 0.0}, {"phase": 0.5, "cut": 1.0})
    sentence = "the voltages come in steps of the D/A converter"
    formula = "± step · (round(|V| / step − phase) + phase − cut / 2), ±: sign of V"
    source = "resolution of any D/A converter; 1-5 mV"
    shows_in = Rate.W
    follows = Follows.W

    def apply(self, volts: Volts) -> Volts:
        """Step V_f and V_s."""
        if self.values["step"] == 0:
            return volts
        return replace(volts, v_f=self._stepped(volts.v_f), v_s=self._stepped(volts.v_s))

    def _stepped(self, volts: FloatArray) -> FloatArray:
        step, phase, cut = (self.values[name] for name in ("step", "phase", "cut"))
        level = np.floor(np.abs(volts) / step - phase + 0.5) + phase - cut / 2
        return np.asarray(np.sign(volts) * step * np.maximum(level, 0.0))
