# SPDX-License-Identifier: BSD-3-Clause
"""What the first robot of a world sees from given poses, by either ray caster."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from kurumaisu.geometry import attached
from kurumaisu.sim.motion import partition
from kurumaisu.sim.motion.cells import build_cell_rays
from kurumaisu.sim.rangers import fans
from kurumaisu.types import BoolArray, FloatArray, IntArray
from kurumaisu.world import World
from kurumaisu.world.model import Model

_BEND = 3.0  # [cells] of a beam's range between its neighbours': no wall does that within a cell, but at its ends


@dataclass(frozen=True)
class Seen:
    """What beams see, (poses, beams).

    ranges [m]; models (5, poses, beams): the number of the model met by the beam and by four within two cells beside
    it, 0 also for none; edges: the range jumps within a cell.
    """

    ranges: FloatArray
    models: FloatArray
    edges: BoolArray


class Observer:
    """The first robot of a world, whose rangers report which model they meet."""

    def __init__(self, world: World) -> None:
        """Sort the world's models into bodies."""
        self._world = world
        self._models = tuple(_reporting(model) for model in world.models)
        self._robot = next(model for model in self._models if partition.is_robot(model))
        self._bodies = partition.sort(self._models, [partition.is_robot(model) for model in self._models])
        self._body = int(self._bodies.body_of[self._robot.index])
        every = fans.find(self._models, world.poses, self._bodies, [self._body])
        self._fans = [fan for fan in every if fan.body == self._body]

    def cells(self, poses: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return ranges [m] over cells and the models met (n, beams) from poses (n, 3)."""
        world = self._world
        rays, numbers = build_cell_rays(self._models, world.poses, self._bodies, world.resolution, 1)
        heads = self._frames(poses)
        layout = np.array([[*fans.spread(f.fan), f.fan.samples, f.fan.range_max] for f in self._fans])
        ranges, models = [], []
        for frame in heads:
            rays.set_poses(numbers[self._body : self._body + 1], frame[np.newaxis])
            origins = np.array([attached(frame, fan.mount) for fan in self._fans])
            distances, met = rays.scan(origins, self._trees(len(origins)), layout)
            ranges.append(np.where(np.isinf(distances), self._reach, distances))
            models.append(met)
        return np.array(ranges), np.array(models)

    def exact(self, poses: FloatArray) -> Seen:
        """Return what is seen exactly from poses (n, 3)."""
        world, frames, cell = self._world, self._frames(poses), self._world.resolution
        arena, numbers, _ = partition.build_arena(self._models, world.poses, self._bodies, 1)
        rays = []
        for fan in self._fans:
            origins = attached(frames, fan.mount)[:, np.newaxis].repeat(fan.fan.samples, axis=1)
            origins[..., 3] += fan.bearings
            rays.append(origins)
        eyes, reach = np.concatenate(rays, axis=1), self._reach

        def look(sideways: float) -> tuple[FloatArray, FloatArray]:
            shifted = _shifted(eyes, sideways).reshape(-1, 4)
            ranges, met = arena.cast(shifted, self._trees(len(shifted)), float(reach.max()))
            ranges, met = ranges.reshape(eyes.shape[:2]), met.reshape(eyes.shape[:2])
            beyond = ranges > reach
            return np.where(beyond, reach, ranges), np.where(beyond, 0.0, met)

        arena.set_poses(numbers[self._body : self._body + 1], frames[:1])
        looks = [look(side * cell) for side in (0, -2, -1, 1, 2)]
        ranges = [ranges for ranges, _ in looks]
        return Seen(ranges[0], np.array([met for _, met in looks]), _edges(ranges, cell))

    @property
    def _reach(self) -> FloatArray:
        """Greatest range of each beam (beams,) [m]."""
        return np.concatenate([np.full(fan.fan.samples, fan.fan.range_max) for fan in self._fans])

    def _frames(self, poses: FloatArray) -> FloatArray:
        return np.insert(poses, 2, self._world.poses[self._robot.index, 2], axis=1)

    def _trees(self, count: int) -> IntArray:
        return np.full(count, self._robot.root)


def _reporting(model: Model) -> Model:
    return replace(model, ranger_return=float(model.index)) if model.ranger_return >= 0 else model


def _shifted(eyes: FloatArray, distance: float) -> FloatArray:
    """Return rays (..., 4) that leave at a distance [m] to the left of others."""
    shifted = eyes.copy()
    shifted[..., 0] -= distance * np.sin(eyes[..., 3])
    shifted[..., 1] += distance * np.cos(eyes[..., 3])
    return shifted


def _edges(ranges: Sequence[FloatArray], cell: float) -> BoolArray:
    """Return where the range jumps within a cell: it bends more than a wall does.

    ranges: of a beam, and of those that leave two cells and one to its right, one and two to its left [m].
    """
    here, right2, right, left, left2 = ranges
    bends = (right - 2 * here + left, right2 - 2 * right + here, left2 - 2 * left + here)
    return np.asarray(np.max(np.abs(bends), axis=0) > _BEND * cell)
