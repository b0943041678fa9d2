# SPDX-License-Identifier: BSD-3-Clause
"""Where the models of a world stand, and how high."""

from __future__ import annotations

import numpy as np

from kurumaisu.types import FloatArray
from kurumaisu.world.model import Fan, Model, Position
from kurumaisu.world.shapes import transform
from kurumaisu.world.world import World


def moves(world: World, model: Model) -> bool:
    """Return whether a model is a robot or stands on one."""
    while not isinstance(model.device, Position):
        if model.parent < 0:
            return False
        model = world.models[model.parent]
    return True


def beam_height(world: World, model: Model, fan: Fan) -> float:
    """Return the height above the ground [m] of the beams of a ranger's fan: half way up its sensor, as in Stage."""
    return float(world.poses[model.index, 2] + model.origin[2] + fan.pose[2] + fan.height / 2)


def outline_in_map(world: World, model: Model) -> FloatArray:
    """Return a model's borders (m, 6): x and y of both ends, lowest and highest z, in the map [m]."""
    pose = world.poses[model.index]
    return np.hstack([transform(model.shape.segments, pose[[0, 1, 3]]), model.shape.heights + pose[2]])
