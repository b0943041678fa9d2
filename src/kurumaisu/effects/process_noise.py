# SPDX-License-Identifier: BSD-3-Clause
"""base.process_noise: floor, tyres and casters disturb the rates."""

from dataclasses import replace

import numpy as np

from kurumaisu.effects.base import Effect, Follows, Motion, Parameter, Rate, Stage

_USUAL = 0.8  # [m/s, rad/s] rates in whose units the noise grows


class ProcessNoise(Effect):
    """Ornstein-Uhlenbeck noise on both rates; it starts at rest and acts only on a moving chair."""

    id = "base.process_noise"
    stage = Stage.FLOOR
    parameters = (
        Parameter("sd_v", "m/s", null=0.0, scale=0.01, lower=0.0, upper=1.0),
        Parameter("sd_w", "rad/s", null=0.0, scale=0.02, lower=0.0, upper=2.0),
        Parameter("tau", "s", null=0.3, scale=0.3, lower=1.0e-3, upper=30.0),
        Parameter("growth", "1", null=0.0, scale=0.5, lower=0.0, upper=100.0),
    )
    sentence = "the rates fluctuate about their command"
    formula = (
        "v + n_v · g, w + n_w · g while moving; n: Ornstein-Uhlenbeck, sd, tau; g = 1 + growth · (|v| + |w|) / 0.8"
    )
    source = "assumed: floor, tyres, casters; 10 mm/s, 20 mrad/s, 0.3 s"
    shows_in = Rate.W
    follows = Follows.W
    random = True

    _level = (0.0, 0.0)  # of the unit noises of v and w

    def apply(self, motion: Motion) -> Motion:
        """Add noise to v and w where the chair moves."""
        decay = np.exp(-motion.dt / self.values["tau"])
        draws = np.sqrt(1 - decay**2) * self.context.rng.standard_normal((len(motion.v), 2))
        from scipy.signal import lfilter  # half a second to load, for those who have no lag or noise

        noise = [lfilter([1], [1, -decay], draws[:, i], zi=[decay * self._level[i]])[0] for i in range(2)]
        self._level = (float(noise[0][-1]), float(noise[1][-1]))
        size = motion.moving * (1 + self.values["growth"] * (np.abs(motion.v) + np.abs(motion.w)) / _USUAL)
        return replace(
            motion,
            v=motion.v + size * self.values["sd_v"] * noise[0],
            w=motion.w + size * self.values["sd_w"] * noise[1],
        )
