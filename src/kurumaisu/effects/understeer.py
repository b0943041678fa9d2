# SPDX-License-Identifier: BSD-3-Clause
"""base.understeer: the faster the chair drives, the less it turns."""

from dataclasses import replace

import numpy as np

from kurumaisu.effects.base import Effect, Follows, Motion, Parameter, Rate, Stage


class Understeer(Effect):
    """Yaw rate less a share that grows with the square of the speed."""

    id = "base.understeer"
    stage = Stage.FLOOR
    parameters = (Parameter("k", "s^2/m^2", null=0.0, scale=0.1, lower=-2.0, upper=2.0),)
    empirical = True
    sentence = "the chair turns less when it drives fast (understeer)"
    formula = "w · max(0, 1 − k · v²)"
    source = "assumed: slip of the drive wheels; 0.05-0.2 s²/m²"
    shows_in = Rate.W
    follows = Follows.W

    def apply(self, motion: Motion) -> Motion:
        """Scale w by the speed."""
        return replace(motion, w=motion.w * np.maximum(1 - self.values["k"] * motion.v**2, 0.0))
