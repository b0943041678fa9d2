# SPDX-License-Identifier: BSD-3-Clause
"""base.dac_zero_f and base.dac_zero_s: the D/A converter's zero is off."""

from dataclasses import replace

from kurumaisu.effects.base import Follows, Parameter, Rate, Stage, VoltageEffect, Volts

_OFFSET = (Parameter("offset", "V", null=0.0, scale=0.01, lower=-0.5, upper=0.5),)


class DacZeroF(VoltageEffect):
    """V_f plus a constant."""

    id = "base.dac_zero_f"
    stage = Stage.CONVERTER
    parameters = _OFFSET
    sentence = "the translation voltage is off by a constant"
    formula = "V_f + offset"
    source = "offset error of any D/A converter; 2-20 mV"
    shows_in = Rate.V
    follows = Follows.V

    def apply(self, volts: Volts) -> Volts:
        """Shift V_f."""
        return replace(volts, v_f=volts.v_f + self.values["offset"])


class DacZeroS(VoltageEffect):
    """V_s plus a constant."""

    id = "base.dac_zero_s"
    stage = Stage.CONVERTER
    parameters = _OFFSET
    sentence = "the steering voltage is off by a constant"
    formula = "V_s + offset"
    source = "offset error of any D/A converter; 2-20 mV"
    shows_in = Rate.W
    follows = Follows.W

    def apply(self, volts: Volts) -> Volts:
        """Shift V_s."""
        return replace(volts, v_s=volts.v_s + self.values["offset"])
