# SPDX-License-Identifier: BSD-3-Clause
"""base.payload: another weight makes the chair slower and more sluggish in both axes at once."""

from collections.abc import Mapping
from dataclasses import replace

from kurumaisu.effects.base import Context, Effect, Follows, Motion, Parameter, Rate, Stage
from kurumaisu.effects.first_order import FirstOrder


class Payload(Effect):
    """Both rates lose the same share, and follow with the same time constant."""

    id = "base.payload"
    stage = Stage.RESPONSE
    parameters = (
        Parameter("droop", "1", null=0.0, scale=0.05, lower=-0.5, upper=0.9),
        Parameter("tau", "s", null=0.0, scale=0.1, lower=0.0, upper=3.0),
    )
    empirical = True
    sentence = "the chair is slower and reacts later in both axes, as under a load"
    formula = "tau · dv'/dt = (1 − droop) · v − v', and w alike"
    source = "assumed: mass and rolling resistance; 5 %, 0.1 s for a bag or a lighter person"
    shows_in = Rate.V
    follows = Follows.V

    def __init__(self, values: Mapping[str, float], context: Context) -> None:
        super().__init__(values, context)
        self._lags = FirstOrder(), FirstOrder()

    def apply(self, motion: Motion) -> Motion:
        """Scale and filter v and w."""
        left, tau = 1 - self.values["droop"], self.values["tau"]
        both = zip(self._lags, (motion.v, motion.w), strict=True)
        v, w = (lag.follow(left * rate, motion.dt, tau) for lag, rate in both)
        return replace(motion, v=v, w=w)

    def settle(self, motion: Motion) -> None:
        """Have driven without the load, which is put on now."""
        for lag, rate in zip(self._lags, (motion.v, motion.w), strict=True):
            lag.level = float(rate[-1])
