# SPDX-License-Identifier: BSD-3-Clause
"""laser.tilt: the plane of the beams is not level."""

from dataclasses import replace

import numpy as np

from kurumaisu.effects.laser.base import BeamEffect, Beams
from kurumaisu.effects.mechanism import Parameter


class Tilt(BeamEffect):
    """The laser turned by pitch about its y, nose down, after roll about its x, left side up (REP-103)."""

    id = "laser.tilt"
    parameters = (
        Parameter("pitch", "rad", null=0.0, scale=0.02, lower=-0.5, upper=0.5),
        Parameter("roll", "rad", null=0.0, scale=0.02, lower=-0.5, upper=0.5),
    )
    sentence = "the laser is tilted, so that it reads longer ranges, or the floor"
    formula = "direction R_y(pitch) R_x(roll) (cos φ, sin φ, 0); range / cos(elevation), at most the floor's"
    source = "geometry; 1-5°. Its part alike in all directions is exactly laser.scale"

    def apply(self, beams: Beams) -> Beams:
        """Turn the directions of the beams."""
        pitch, roll = self.values["pitch"], self.values["roll"]
        level = np.cos(beams.elevations)
        x, y, z = level * np.cos(beams.bearings), level * np.sin(beams.bearings), np.sin(beams.elevations)
        y, z = np.cos(roll) * y - np.sin(roll) * z, np.sin(roll) * y + np.cos(roll) * z
        x, z = np.cos(pitch) * x + np.sin(pitch) * z, -np.sin(pitch) * x + np.cos(pitch) * z
        if pitch == 0 and roll == 0:
            return beams  # bearings beyond half a turn would come back as others
        return replace(beams, bearings=np.arctan2(y, x), elevations=np.arcsin(np.clip(z, -1, 1)))
