# SPDX-License-Identifier: BSD-3-Clause
"""The chair as a plant: voltages (or commands) in, rates out, with the effects of the model."""

from __future__ import annotations

import numpy as np

from kurumaisu import effects
from kurumaisu._core import AxisInverse
from kurumaisu.params import Model
from kurumaisu.types import FloatArray


class Plant:
    """Turns inputs into rates on a uniform time grid, chunk by chunk."""

    def __init__(self, model: Model, dt: float, rng: np.random.Generator) -> None:
        """Start at rest, with the effects of the model; dt [s] is the grid's step.

        Raise Error for effects that are unknown or whose parameters do not fit.
        """
        self.dt = dt
        self._translation = AxisInverse(model.translation)
        self._steering = AxisInverse(model.steering)
        self._effects = effects.build(
            model.effects, effects.Context(translation=model.translation, steering=model.steering, rng=rng)
        )

    @property
    def ambiguous_samples(self) -> int:
        """Samples so far whose voltages stood for two rates."""
        return int(self._translation.ambiguous_samples + self._steering.ambiguous_samples)

    def from_voltages(
        self, v_f: FloatArray, v_s: FloatArray, sign_v: FloatArray, sign_w: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return v [m/s], w [rad/s] for voltages [V], all (n,); signs as commanded, NaN where unknown."""
        return self.from_rates(self._translation.rates(v_f, sign_v), self._steering.rates(v_s, sign_w))

    def from_rates(self, v: FloatArray, w: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return v, w for commanded rates, all (n,)."""
        motion = effects.Motion(self.dt, v, w)
        for effect in self._effects:
            motion = effect.apply(motion)
        return motion.v, motion.w
