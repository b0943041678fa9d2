# SPDX-License-Identifier: BSD-3-Clause
"""base.lag_v and base.lag_w: a rate approaches its target with a time constant."""

from dataclasses import replace

import numpy as np
from scipy.signal import lfilter

from kurumaisu.effects.base import Effect, Follows, Motion, Parameter, Rate, Stage
from kurumaisu.types import FloatArray

_TAU = (Parameter("tau", "s", null=0.0, scale=0.1, lower=0.0, upper=3.0),)


class _Lag(Effect):
    """First-order lag, exact for an input held over the grid's step; the sample is the step's mean rate."""

    _level = 0.0  # of the rate at the end of the last step

    def _follow(self, target: FloatArray, dt: float) -> FloatArray:
        tau = self.values["tau"]
        if tau < 1e-6:  # [s]; no lag, and the limit below would divide by it
            return target
        decay = np.exp(-dt / tau)
        ends = lfilter([1 - decay], [1, -decay], target, zi=[decay * self._level])[0]
        starts = np.concatenate([[self._level], ends[:-1]])
        self._level = float(ends[-1])
        return np.asarray(target + (starts - target) * (tau / dt) * (1 - decay))


class LagV(_Lag):
    """Forward speed lags."""

    id = "base.lag_v"
    stage = Stage.RESPONSE
    parameters = _TAU
    sentence = "the forward speed follows its command with a first-order lag"
    formula = "tau · dv'/dt = v − v'"
    source = "electric wheelchairs' step responses; 50-500 ms"
    shows_in = Rate.V
    follows = Follows.V_CHANGE

    def apply(self, motion: Motion) -> Motion:
        """Filter v."""
        return replace(motion, v=self._follow(motion.v, motion.dt))


class LagW(_Lag):
    """Yaw rate lags."""

    id = "base.lag_w"
    stage = Stage.RESPONSE
    parameters = _TAU
    sentence = "the yaw rate follows its command with a first-order lag"
    formula = "tau · dw'/dt = w − w'"
    source = "electric wheelchairs' step responses; 50-500 ms"
    shows_in = Rate.W
    follows = Follows.W_CHANGE

    def apply(self, motion: Motion) -> Motion:
        """Filter w."""
        return replace(motion, w=self._follow(motion.w, motion.dt))
