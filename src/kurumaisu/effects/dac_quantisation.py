# SPDX-License-Identifier: BSD-3-Clause
"""base.dac_quantisation: the D/A converter puts out whole steps only."""

from dataclasses import replace

import numpy as np

from kurumaisu.effects.base import Follows, Parameter, Rate, Stage, VoltageEffect, Volts


class DacQuantisation(VoltageEffect):
    """Both voltages rounded to multiples of a step."""

    id = "base.dac_quantisation"
    stage = Stage.CONVERTER
    parameters = (Parameter("step", "V", null=0.0, scale=0.005, lower=0.0, upper=1.0),)
    sentence = "the voltages come in steps of the D/A converter"
    formula = "step · round(V / step)"
    source = "resolution of any D/A converter; 1-5 mV"
    shows_in = Rate.W
    follows = Follows.W

    def apply(self, volts: Volts) -> Volts:
        """Round V_f and V_s."""
        step = self.values["step"]
        if step == 0:
            return volts
        return replace(volts, v_f=step * np.rint(volts.v_f / step), v_s=step * np.rint(volts.v_s / step))
