# SPDX-License-Identifier: BSD-3-Clause
"""The walls that level beams meet, and the rays that meet them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kurumaisu._core import Scene
from kurumaisu.types import FloatArray
from kurumaisu.world import World
from kurumaisu.world.layout import outline, travels


@dataclass(frozen=True)
class Walls:
    """Walls at the height of a laser: segments (m, 4), x and y of both ends [m]; returns (m,): reflectance of each."""

    segments: FloatArray
    returns: FloatArray


def walls_at(world: World, height: float) -> Walls:
    """Return what a laser at a height [m] sees of a world, without what drives or walks."""
    borders, returns = [np.empty((0, 6))], [np.empty(0)]
    for model in world.models:
        if model.ranger_return >= 0 and not travels(model, world.models):
            border = outline(model, world.poses[model.index])
            borders.append(border[(border[:, 4] <= height) & (border[:, 5] >= height)])
            returns.append(np.full(len(borders[-1]), model.ranger_return))
    return Walls(np.concatenate(borders)[:, :4], np.concatenate(returns))


class Rays:
    """Casts rays against walls; builds a scene per reflectance, of which there are few."""

    def __init__(self, walls: Walls) -> None:
        self._returns = np.unique(walls.returns)
        self._scenes = [Scene(walls.segments[walls.returns == value]) for value in self._returns]

    def ranges(self, poses: FloatArray, bearings: FloatArray) -> FloatArray:
        """Return ranges (n,) [m] of beams from poses (n, 3) along bearings (n,) [rad]; +inf: nothing there."""
        return np.asarray(np.min([scene.cast(poses, bearings, np.inf) for scene in self._scenes], axis=0))

    def cast(self, poses: FloatArray, bearings: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return ranges as above, and the reflectance (n,) of what is met; 1 where that is nothing."""
        each = np.array([scene.cast(poses, bearings, np.inf) for scene in self._scenes])
        nearest = each.argmin(axis=0)
        ranges = each[nearest, np.arange(len(nearest))]
        return ranges, np.where(np.isfinite(ranges), self._returns[nearest], 1.0)
