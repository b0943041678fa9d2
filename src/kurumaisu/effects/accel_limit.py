# SPDX-License-Identifier: BSD-3-Clause
"""base.accel_limit: the motor controller ramps its rates."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from kurumaisu import _core
from kurumaisu.effects.base import LATE, Context, Effect, Follows, Motion, Parameter, Rate, Stage
from kurumaisu.types import FloatArray

_LATEST = 0.98  # of a step: what is left then tells little of the new target
_SETTLED = 1e-9  # [m/s], [rad/s] rounding of a rate


class AccelLimit(Effect):
    """Both rates run after their targets with a limited slope; its inverse is the parameter, so that 0 is none."""

    id = "base.accel_limit"
    stage = Stage.RESPONSE
    parameters = (
        Parameter("slowness_v", "s^2/m", null=0.0, scale=1.0, lower=0.0, upper=20.0),
        Parameter("slowness_w", "s^2/rad", null=0.0, scale=0.5, lower=0.0, upper=20.0),
    )
    separable = True
    empirical = True
    sentence = "the rates are ramped: large changes take longer than small ones"
    formula = "|dv'/dt| ≤ 1 / slowness_v, |dw'/dt| ≤ 1 / slowness_w, towards v, w"
    source = "assumed: motor controllers ramp; 0.3-1.5 m/s²"
    shows_in = Rate.V
    follows = Follows.V_CHANGE

    def __init__(self, values: Mapping[str, float], context: Context) -> None:
        super().__init__(values, context)
        self._v = self._w = 0.0  # at the end of the last step

    def apply(self, motion: Motion) -> Motion:
        """Ramp v and w; a sample is the step's mean rate."""
        slow_v, slow_w = self.values["slowness_v"], self.values["slowness_w"]
        v, self._v = _ramped(motion, motion.v, slow_v, self._v)
        w, self._w = _ramped(motion, motion.w, slow_w, self._w)
        return replace(motion, v=v, w=w)

    def settle(self, motion: Motion) -> None:
        """Have reached v and w."""
        self._v, self._w = float(motion.v[-1]), float(motion.w[-1])


def _ramped(motion: Motion, target: FloatArray, slowness: float, level: float) -> tuple[FloatArray, float]:
    """Return the steps' mean rates (n,) on the way to targets (n,), and the rate at the end."""
    late = motion.known.get(LATE)
    if late is None or slowness == 0:
        return _core.ramp(target, slowness, motion.dt, level)
    before = np.concatenate([[level], target[:-1]])
    left = np.where(late > 0, 1 - np.minimum(late, _LATEST), 1.0)
    begun = _begun(target, before, left, motion.dt / slowness)
    means, end = _core.ramp(begun, slowness, motion.dt, level)
    # Until its target changed, a chair that had reached the one before kept to that.
    way = begun - before
    settled = np.abs(before + way - way * np.abs(way) * slowness / (2 * motion.dt) - means) < _SETTLED
    return np.where(settled, means - (1 - left) * way, means), end


def _begun(target: FloatArray, before: FloatArray, left: FloatArray, reach: float) -> FloatArray:
    """Return targets (n,) with, where one changed within a step, how far a ramp can come in what is left of it.

    The mean of the step would have it begin with the step, which is half a step too early on average.
    reach: of a whole step.
    """
    change = (target - before) / left
    return np.where(left < 1, before + np.clip(change, -left * reach, left * reach), target)
