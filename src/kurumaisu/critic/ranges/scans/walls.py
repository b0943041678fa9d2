# SPDX-License-Identifier: BSD-3-Clause
"""The walls that level beams meet, and the rays that meet them."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from kurumaisu._core import Scene
from kurumaisu.critic.ranges.scans.pixel_lines import straightened
from kurumaisu.types import FloatArray
from kurumaisu.world import World
from kurumaisu.world.layout import outline, travels


@dataclass(frozen=True)
class Walls:
    """Walls at the height of a laser: segments (m, 4), x and y of both ends [m]; returns (m,): reflectance of each.

    drawn: the same as a map of pixels has them, askew ones as stairs; None: it has none, or it is known which they are.
    stairs: whether most of what might be straight are stairs.
    """

    segments: FloatArray
    returns: FloatArray
    drawn: Walls | None = None
    stairs: bool = False


def walls_at(world: World, height: float) -> Walls:
    """Return what a laser at a height [m] sees of a world, without what drives or walks."""
    lines, borders, returns = [np.empty((0, 4))], [np.empty((0, 4))], []
    for model in world.models:
        if model.ranger_return >= 0 and not travels(model, world.models):
            border = outline(model, world.poses[model.index])
            borders.append(border[(border[:, 4] <= height) & (border[:, 5] >= height), :4])
            lines.append(borders[-1] if model.shape.polygons else straightened(borders[-1]))
            returns.append(model.ranger_return)
    straight, drawn = (
        Walls(np.concatenate(each), np.repeat(returns, [len(part) for part in each[1:]])) for each in (lines, borders)
    )
    return straight if np.array_equal(straight.segments, drawn.segments) else replace(straight, drawn=drawn)


class Rays:
    """Casts rays against walls."""

    def __init__(self, walls: Walls) -> None:
        order = np.argsort(walls.returns, kind="stable")  # where walls coincide, the first one counts: the darkest
        self._scene = Scene(walls.segments[order])
        self._returns = np.append(walls.returns[order], 1.0)  # the last: of nothing

    def ranges(self, poses: FloatArray, bearings: FloatArray) -> FloatArray:
        """Return ranges (n,) [m] of beams from poses (n, 3) along bearings (n,) [rad]; +inf: nothing there."""
        return self._scene.cast(poses, bearings, np.inf)

    def cast(self, poses: FloatArray, bearings: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return ranges as above, and the reflectance (n,) of what is met; 1 where that is nothing."""
        ranges, met = self._scene.meet(poses, bearings)
        return ranges, self._returns[met]
