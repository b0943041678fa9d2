# SPDX-License-Identifier: BSD-3-Clause
"""world.map_error: walls are not quite where the map has them."""

import numpy as np

from kurumaisu.effects.mechanism import Parameter, WorldEffect
from kurumaisu.types import FloatArray


class MapError(WorldEffect):
    """The world scaled about the map's origin, and each of its corners moved at random, so that walls stay closed."""

    id = "world.map_error"
    parameters = (
        Parameter("scale", "1", null=0.0, scale=0.005, lower=-0.2, upper=0.2),
        Parameter("sd", "m", null=0.0, scale=0.005, lower=0.0, upper=0.2),
    )
    sentence = "walls are not exactly where the map shows them"
    formula = "corner · (1 + scale) + n, n drawn once per corner with sd in x and in y"
    source = "assumed: maps and worlds made by hand; walls off by 2-10 mm, askew by 0.1-0.5°"
    random = True

    def apply(self, segments: FloatArray) -> FloatArray:
        """Move the corners; equal ones stay equal."""
        corners, index = np.unique(segments.reshape(-1, 2), axis=0, return_inverse=True)
        moved = corners * (1 + self.values["scale"])
        moved += self.values["sd"] * self.rng.standard_normal(corners.shape)
        return np.asarray(moved[index.reshape(-1)].reshape(segments.shape))
