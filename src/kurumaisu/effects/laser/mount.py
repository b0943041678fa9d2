# SPDX-License-Identifier: BSD-3-Clause
"""laser.mount_x, laser.mount_y and laser.mount_yaw: the laser is not where the model file says."""

from dataclasses import replace

import numpy as np

from kurumaisu.effects.laser.base import BeamEffect, Beams
from kurumaisu.effects.mechanism import Parameter


def _moved(beams: Beams, x: float, y: float, yaw: float) -> Beams:
    return replace(beams, mount=beams.mount + np.array([x, y, yaw]))


class MountX(BeamEffect):
    """The laser sits further forward."""

    id = "laser.mount_x"
    parameters = (Parameter("x", "m", null=0.0, scale=0.02, lower=-0.5, upper=0.5),)
    sentence = "the laser is mounted further forward or back than in the model"
    formula = "mount ⊕ x along base_link's x"
    source = "Censi 2013; 10-50 mm"

    def apply(self, beams: Beams) -> Beams:
        """Move the mount."""
        return _moved(beams, self.values["x"], 0.0, 0.0)


class MountY(BeamEffect):
    """The laser sits further to the left."""

    id = "laser.mount_y"
    parameters = (Parameter("y", "m", null=0.0, scale=0.02, lower=-0.5, upper=0.5),)
    sentence = "the laser is mounted further to one side than in the model"
    formula = "mount ⊕ y along base_link's y"
    source = "Censi 2013; 10-50 mm"

    def apply(self, beams: Beams) -> Beams:
        """Move the mount."""
        return _moved(beams, 0.0, self.values["y"], 0.0)


class MountYaw(BeamEffect):
    """The laser looks further to the left."""

    id = "laser.mount_yaw"
    parameters = (Parameter("yaw", "rad", null=0.0, scale=0.02, lower=-0.5, upper=0.5),)
    sentence = "the laser is turned further to one side than in the model"
    formula = "mount's yaw + yaw"
    source = "Censi 2013; 0.5-3°"

    def apply(self, beams: Beams) -> Beams:
        """Turn the mount."""
        return _moved(beams, 0.0, 0.0, self.values["yaw"])
