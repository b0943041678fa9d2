# SPDX-License-Identifier: BSD-3-Clause
"""base.steering_law: the chair follows equation (2) with intercepts of the other sign."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from kurumaisu._core import AxisInverse, AxisLaw, Branch
from kurumaisu.effects.base import Context, Follows, Parameter, Rate, Stage, VoltageEffect, Volts


class SteeringLaw(VoltageEffect):
    """The motor controller turns V_s into the yaw rate by a law whose intercepts are scaled by (1 - 2 flip).

    meant: 1 where it knows the side that was meant, as by a second line, and rests rather than turn to the other.
    """

    id = "base.steering_law"
    stage = Stage.CONTROLLER
    parameters = (
        Parameter("flip", "1", null=0.0, scale=1.0, lower=0.0, upper=1.0),
        Parameter("meant", "1", null=0.0, scale=1.0, lower=0.0, upper=1.0),
    )
    sentence = "the intercepts of the steering law have the opposite sign"
    formula = "w of V_s by (2) with intercepts · (1 − 2 flip); with meant = 1, 0 where that is a turn to the other side"
    source = "paper, equation (2): as printed, its two branches overlap"
    choices = ({"flip": 1.0, "meant": 0.0}, {"flip": 1.0, "meant": 1.0})
    shows_in = Rate.W
    follows = Follows.W

    def __init__(self, values: Mapping[str, float], context: Context) -> None:
        self.context = context
        super().__init__(values, context)

    def change(self, values: Mapping[str, float]) -> None:
        """Take another law, which knows nothing yet of the branch that it is on."""
        super().change(values)
        factor = 1 - 2 * self.values["flip"]
        sides = self.context.steering.positive, self.context.steering.negative
        self._inverse = AxisInverse(AxisLaw(*(Branch(side.slope, factor * side.intercept) for side in sides)))

    def apply(self, volts: Volts) -> Volts:
        """Return the voltage that by the model's law stands for the yaw rate that the chair takes."""
        if self.values["flip"] == 0:
            return volts
        w = self._inverse.rates(volts.v_s, volts.sign_w)
        if self.values["meant"] >= 0.5:
            w = np.where(w * volts.sign_w < 0, 0.0, w)
        return replace(volts, v_s=self.context.steering.volts(w), sign_w=np.sign(w))
