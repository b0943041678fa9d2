# SPDX-License-Identifier: BSD-3-Clause
"""Where the models of a world stand, and how high."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from kurumaisu.geometry import attached
from kurumaisu.types import FloatArray
from kurumaisu.world.model import Fan, Model, Position


def travels(model: Model, models: Sequence[Model]) -> bool:
    """Return whether a model is a robot or walks, or stands on one that does."""
    while not isinstance(model.device, Position) and model.walk is None:
        if model.parent < 0:
            return False
        model = models[model.parent]
    return True


def family(models: Sequence[Model], index: int) -> list[int]:
    """Return the places of a model and of all that stand on it, directly or not, in order."""
    members = {index}
    for model in models[index + 1 :]:
        if model.parent in members:
            members.add(model.index)
    return sorted(members)


def beam_place(ranger: Model, pose: FloatArray, fan: Fan) -> FloatArray:
    """Return where the beams of a ranger at a pose (4,) start (4,): half way up its sensor."""
    return attached(attached(pose, ranger.origin), fan.pose + np.array([0.0, 0.0, fan.height / 2, 0.0]))


def beam_height(ranger: Model, pose: FloatArray, fan: Fan) -> float:
    """Return the height above the ground [m] of the beams of a ranger at a pose (4,)."""
    return float(beam_place(ranger, pose, fan)[2])


def placed(segments: FloatArray, pose: FloatArray) -> FloatArray:
    """Return segments (m, 4), given in the frame of a pose (4,), in the frame that the pose is in."""
    c, s = np.cos(pose[3]), np.sin(pose[3])
    points = segments.reshape(-1, 2) @ np.array([[c, s], [-s, c]]) + pose[:2]
    return np.asarray(points).reshape(-1, 4)


def outline(model: Model, pose: FloatArray) -> FloatArray:
    """Return the borders (m, 6) of a model at a pose (4,): x and y of both ends, lowest and highest z [m]."""
    return np.concatenate([placed(model.shape.segments, pose), model.shape.heights + pose[2]], axis=1)
