# SPDX-License-Identifier: BSD-3-Clause
"""Where the models of a world stand, and how high."""

from __future__ import annotations

import numpy as np

from kurumaisu.types import FloatArray
from kurumaisu.world.model import Fan, Model, Position
from kurumaisu.world.world import World


def moves(world: World, model: Model) -> bool:
    """Return whether a model is a robot or walks, or stands on one that does."""
    while not isinstance(model.device, Position) and model.walk is None:
        if model.parent < 0:
            return False
        model = world.models[model.parent]
    return True


def beam_height(world: World, model: Model, fan: Fan) -> float:
    """Return the height above the ground [m] of the beams of a ranger's fan: half way up its sensor, as in Stage."""
    return float(world.poses[model.index, 2] + model.origin[2] + fan.pose[2] + fan.height / 2)


def in_map(segments: FloatArray, pose: FloatArray) -> FloatArray:
    """Return segments (m, 4) in the map, being given in the frame of a pose (4,)."""
    c, s = np.cos(pose[3]), np.sin(pose[3])
    points = segments.reshape(-1, 2) @ np.array([[c, s], [-s, c]]) + pose[:2]
    return np.asarray(points).reshape(-1, 4)


def outline_in_map(world: World, model: Model) -> FloatArray:
    """Return a model's borders (m, 6): x and y of both ends, lowest and highest z, in the map [m]."""
    pose = world.poses[model.index]
    return np.hstack([in_map(model.shape.segments, pose), model.shape.heights + pose[2]])
