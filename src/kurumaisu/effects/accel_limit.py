# SPDX-License-Identifier: BSD-3-Clause
"""base.accel_limit: the motor controller ramps its rates."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from kurumaisu import _core
from kurumaisu.effects.base import LATE, Context, Effect, Follows, Motion, Parameter, Rate, Stage
from kurumaisu.effects.first_order import FirstOrder
from kurumaisu.types import FloatArray, IntArray

_LATEST = 0.98  # of a step: what is left then tells little of the new target
_REACHED = 0.01  # share of a change by which a ramp may be off the old target, to have reached it


class AccelLimit(Effect):
    """Both rates run after their targets with a limited slope; its inverse is the parameter, so that 0 is none.

    round: time constant that rounds the corners of the ramps, as a share of the time that a change by 1 takes: few
    controllers change the acceleration at once.
    """

    id = "base.accel_limit"
    stage = Stage.RESPONSE
    parameters = (
        Parameter("slowness_v", "s^2/m", null=0.0, scale=1.0, lower=0.0, upper=20.0),
        Parameter("slowness_w", "s^2/rad", null=0.0, scale=0.5, lower=0.0, upper=20.0),
        Parameter("round", "1", null=0.0, scale=0.05, lower=0.0, upper=1.0),
    )
    separable = True
    forms = ({"round": 0.0}, {"round": 0.04})
    empirical = True
    sentence = "acceleration is limited: the rates change in ramps"
    formula = (
        "|dv'/dt| ≤ 1 / slowness_v, |dw'/dt| ≤ 1 / slowness_w, towards v, w; then first-order lags of round · slowness"
    )
    source = "assumed: motor controllers ramp; 0.3-1.5 m/s²"
    shows_in = Rate.V
    follows = Follows.V_CHANGE

    def __init__(self, values: Mapping[str, float], context: Context) -> None:
        super().__init__(values, context)
        self._v = self._w = 0.0  # at the end of the last step
        self._lags = FirstOrder(), FirstOrder()

    def apply(self, motion: Motion) -> Motion:
        """Ramp v and w; a sample is the step's mean rate."""
        slow_v, slow_w = self.values["slowness_v"], self.values["slowness_w"]
        late = motion.known.get(LATE, np.empty(0))
        at = np.flatnonzero(late)
        late = np.minimum(late[at], _LATEST)
        v, self._v = _ramped(motion.v, slow_v, motion.dt, self._v, at, late)
        w, self._w = _ramped(motion.w, slow_w, motion.dt, self._w, at, late)
        share = self.values["round"]
        v, w = (
            lag.follow(rate, motion.dt, share * slowness)
            for lag, rate, slowness in zip(self._lags, (v, w), (slow_v, slow_w), strict=True)
        )
        return replace(motion, v=v, w=w)

    def settle(self, motion: Motion) -> None:
        """Have reached v and w."""
        self._v, self._w = float(motion.v[-1]), float(motion.w[-1])
        self._lags[0].level, self._lags[1].level = self._v, self._w


def _ramped(
    target: FloatArray, slowness: float, dt: float, level: float, at: IntArray, late: FloatArray
) -> tuple[FloatArray, float]:
    """Return the mean rates (n,) of the steps, and the last step's at its end; late (k,): shares of steps at (k,).

    Where a target changed within a step, a ramp goes as far as it can in what is left of it, and begins no sooner:
    one from the step's beginning would be early, and a delay seem to act.
    """
    if len(at) == 0 or slowness == 0:
        return _core.ramp(target, slowness, dt, level)
    before = np.where(at > 0, target[at - 1], level)
    change = (target[at] - before) / (1 - late)
    reach = (1 - late) * dt / slowness
    begun = target.copy()
    begun[at] = before + np.clip(change, -reach, reach)
    rates, end = _core.ramp(begun, slowness, dt, level)
    # One that was still on its way goes on meanwhile.
    gone = begun[at] - before
    waiting = np.abs(np.where(at > 0, rates[at - 1], level) - before) <= _REACHED * np.abs(gone)
    rates[at] -= np.where(waiting, late * gone, 0.0)
    return rates, end
