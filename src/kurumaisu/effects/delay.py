# SPDX-License-Identifier: BSD-3-Clause
"""base.delay: everything happens later than commanded."""

from dataclasses import replace

import numpy as np

from kurumaisu.effects.base import Effect, Follows, Motion, Parameter, Rate, Stage
from kurumaisu.types import FloatArray


class Delay(Effect):
    """Both rates late by a pure delay; between samples of the grid the motion is interpolated."""

    id = "base.delay"
    stage = Stage.TRANSPORT
    parameters = (Parameter("delay", "s", null=0.0, scale=0.05, lower=0.0, upper=1.0),)
    sentence = "the motion follows the command after a pure delay"
    formula = "v, w of t − delay"
    source = "assumed: buses and motor controllers; 20-300 ms"
    shows_in = Rate.V
    follows = Follows.V_CHANGE

    _past: FloatArray | None = None  # the last samples of v and w, (2, m)

    def apply(self, motion: Motion) -> Motion:
        """Shift v and w; before the first sample the chair was at rest."""
        whole, part = divmod(self.values["delay"] / motion.dt, 1.0)
        keep = int(whole) + 1
        if self._past is None:
            self._past = np.zeros((2, keep))
        past = self._past[:, -keep:]
        missing = keep - past.shape[1]  # where the delay has been lengthened: the oldest sample was held
        samples = np.hstack([past[:, :1].repeat(missing, axis=1), past, np.stack([motion.v, motion.w])])
        n = len(motion.v)
        shifted = (1 - part) * samples[:, 1 : n + 1] + part * samples[:, :n]
        self._past = samples[:, -keep:]
        return replace(motion, v=shifted[0], w=shifted[1])

    def settle(self, motion: Motion) -> None:
        """Have v and w under way."""
        self._past = np.array([[motion.v[-1]], [motion.w[-1]]])
