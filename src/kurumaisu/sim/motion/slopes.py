# SPDX-License-Identifier: BSD-3-Clause
"""Ramps: what a slope takes from, or gives to, the speed of a robot that drives on it; effects.slope has the law."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from kurumaisu.sim.motion.slip import turned
from kurumaisu.types import BoolArray, FloatArray
from kurumaisu.world.model import Model, Shape


class Slopes:
    """The slopes of all models that stand still; where some lie on each other, their rises add up."""

    def __init__(self, models: Sequence[Model], poses: FloatArray, speed: float) -> None:
        """Lay out slopes of models at poses (n, 4) in the map; speed [m/s]: what a rise of 1 m per metre costs."""
        sloped = [model for model in models if model.slope is not None]
        self._poses = np.array([poses[model.index] for model in sloped]).reshape(-1, 4)
        rises = np.array([[*np.asarray(model.slope), 0.0] for model in sloped]).reshape(-1, 3)
        self._costs = speed * turned(rises, self._poses[:, 3])[:, :2]  # [m/s] along x and y of the map
        self._rings = [_rings(model.shape) for model in sloped]

    def __len__(self) -> int:
        return len(self._rings)

    def slowed(self, velocities: FloatArray, poses: FloatArray, sideways: BoolArray, dt: float) -> FloatArray:
        """Return what slopes leave of velocities (n, 3) forward, leftward [m/s], turn [rad/s] in a step of dt [s].

        Of robots at poses (n, 4) that move; one at rest is held by its brakes. sideways (n,): its wheels drive it
        leftward as well; those of the others hold it.
        """
        cost = np.zeros((len(velocities), 3))
        for pose, rings, (x, y) in zip(self._poses, self._rings, self._costs, strict=True):
            places = turned(np.column_stack([poses[:, :2] - pose[:2], poses[:, 3]]), np.full(len(poses), -pose[3]))
            cost[_inside(places[:, :2], rings), :2] += x, y
        middle = poses[:, 3] + velocities[:, 2] * dt / 2
        loss = turned(cost, -middle)
        loss[~sideways, 1] = 0.0
        loss[~velocities.any(axis=1)] = 0.0
        return velocities - loss


def _rings(shape: Shape) -> list[FloatArray]:
    """Return closed outlines, each (k, 4) of both ends: of the polygons, or all of a bitmap's borders as one."""
    rings = [np.hstack([p.corners, np.roll(p.corners, -1, axis=0)]) for p in shape.polygons]
    return rings or [shape.segments]


def _inside(points: FloatArray, rings: Sequence[FloatArray]) -> BoolArray:
    """Return which points (n, 2) are in any outline: a ray towards +x crosses it an odd number of times."""
    inside = np.zeros(len(points), dtype=np.bool_)
    x, y = points[:, :1], points[:, 1:]
    for ax, ay, bx, by in (ring.T for ring in rings):
        spans = (ay > y) != (by > y)
        rise = np.where(by == ay, 1.0, by - ay)  # level borders are spanned by no ray
        inside |= (spans & (x < ax + (y - ay) * (bx - ax) / rise)).sum(axis=1) % 2 == 1
    return inside
