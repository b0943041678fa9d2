# SPDX-License-Identifier: BSD-3-Clause
"""base.lag_v and base.lag_w: a rate approaches its target with a time constant."""

from collections.abc import Mapping
from dataclasses import replace

from kurumaisu.effects.base import Context, Effect, Follows, Motion, Parameter, Rate, Stage
from kurumaisu.effects.first_order import FirstOrder

_TAU = (Parameter("tau", "s", null=0.0, scale=0.1, lower=0.0, upper=3.0),)


class _Lag(Effect):
    """First-order lag of one rate."""

    def __init__(self, values: Mapping[str, float], context: Context) -> None:
        super().__init__(values, context)
        self._lag = FirstOrder()


class LagV(_Lag):
    """Forward speed lags."""

    id = "base.lag_v"
    stage = Stage.RESPONSE
    parameters = _TAU
    empirical = True
    sentence = "the forward speed follows its command with a first-order lag"
    formula = "tau · dv'/dt = v − v'"
    source = "Wang 2009: settling times of a wheelchair on four floors; 50-500 ms"
    shows_in = Rate.V
    follows = Follows.V_CHANGE

    def apply(self, motion: Motion) -> Motion:
        """Filter v."""
        return replace(motion, v=self._lag.follow(motion.v, motion.dt, self.values["tau"]))

    def settle(self, motion: Motion) -> None:
        """Have followed v."""
        self._lag.level = float(motion.v[-1])


class LagW(_Lag):
    """Yaw rate lags."""

    id = "base.lag_w"
    stage = Stage.RESPONSE
    parameters = _TAU
    empirical = True
    sentence = "the yaw rate follows its command with a first-order lag"
    formula = "tau · dw'/dt = w − w'"
    source = "Wang 2009: settling times of a wheelchair on four floors; 50-500 ms"
    shows_in = Rate.W
    follows = Follows.W_CHANGE

    def apply(self, motion: Motion) -> Motion:
        """Filter w."""
        return replace(motion, w=self._lag.follow(motion.w, motion.dt, self.values["tau"]))

    def settle(self, motion: Motion) -> None:
        """Have followed w."""
        self._lag.level = float(motion.w[-1])
