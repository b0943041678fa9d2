# SPDX-License-Identifier: BSD-3-Clause
"""What runs a population: bodies in an arena, their motion, drives, odometry, rangers."""

from __future__ import annotations

from collections.abc import Sequence
from typing import cast

import numpy as np

from kurumaisu.sim import fans
from kurumaisu.sim.cells import build_cell_rays, build_cells
from kurumaisu.sim.collisions import Collisions, Crossing, SharedCells
from kurumaisu.sim.drive import Drive, Rows
from kurumaisu.sim.motion import Motion, StageMotion
from kurumaisu.sim.odometry import Localization
from kurumaisu.sim.options import Options
from kurumaisu.sim.partition import attached, build_arena, is_robot, relative, sort
from kurumaisu.sim.population import Population
from kurumaisu.sim.rangers import Rangers
from kurumaisu.sim.rhythm import Rhythm, period
from kurumaisu.sim.settings import Dynamics
from kurumaisu.sim.sight import CellSight, ExactSight, Sight
from kurumaisu.types import BoolArray, FloatArray, IntArray
from kurumaisu.world.model import Model, Position


class Machinery:
    """Built once for a population; a new one takes over from an old one when models come, go, or walls move."""

    def __init__(
        self,
        population: Population,
        options: Options,
        interval: float,
        resolution: float,
        dynamics: Dynamics | None,
    ) -> None:
        """Place all bodies where they begin.

        interval [s]: a step's length; resolution [m]: of the world; dynamics: None for Stage's semantics.
        """
        models = population.models
        self.population = population
        self.interval = interval
        self.resolution = resolution
        self.options = options
        self.dynamics = dynamics
        self.bodies = sort(models, _moving(models, physical=dynamics is not None))
        self.arena, self.numbers, self.walls = build_arena(models, population.poses, self.bodies, options.threads)
        self.robot_rows = np.array([i for i, head in enumerate(self.bodies.heads) if is_robot(models[head])], np.int64)
        self.robots = tuple(models[self.bodies.heads[row]] for row in self.robot_rows)
        self._everybody_drives = len(self.robot_rows) == len(self.bodies)
        self.fans = fans.find(models, population.poses, self.bodies, self.robot_rows.tolist())
        self.collisions = self._make_collisions()
        self.motion = self._make_motion()
        self._sight = self._make_sight()
        self.frames = np.zeros((len(self.bodies) + 1, 4))  # of the bodies, and of the map at the end
        self.before = self.frames.copy()  # those one step ago
        self.stalled = np.zeros(len(self.bodies), dtype=np.bool_)
        self.place(population.poses[self.bodies.heads])
        self._velocities = np.zeros((len(self.bodies), 3))
        self.begin()

    def begin(self) -> None:
        """Make drives, odometry and rangers anew, as they are before the first step."""
        devices = [cast(Position, model.device) for model in self.robots]
        starts = self.robot_poses
        born = self.population.born
        periods = self._periods([model.update_interval for model in self.robots], always=self.dynamics is not None)
        self.rhythm = Rhythm(periods, born[[model.index for model in self.robots]].astype(np.int64))
        self.drive = Drive(devices, periods * self.interval, self.options.limit_acceleration)
        self.localization = Localization(
            devices, starts, self.interval, self.options.odometry_walk, self.dynamics is not None
        )
        looks = self._periods([fan.model.update_interval for fan in self.fans], always=False)
        births = born[[fan.model.index for fan in self.fans]].astype(np.int64)
        sweep = self.options.scan_sweep / self.interval
        self.rangers = Rangers(self._sight, self.fans, np.stack([looks, births], axis=-1), sweep)

    def _make_motion(self) -> Motion:
        if self.dynamics is None:
            return StageMotion(self.collisions, self.bodies)
        from kurumaisu.sim.following import Followed  # loads pymunk, which Stage's semantics need not pay for

        start = self.population
        return Followed(self.arena, self.numbers, start.models, start.poses, self.dynamics)

    def _make_collisions(self) -> Collisions:
        if self.options.collision == "exact" or self.dynamics is not None:
            return Crossing(self.arena, self.numbers)
        layers = 2 if self.options.collision == "cells_stale" else 1
        start = self.population
        cells, known_as = build_cells(start.models, start.poses, self.bodies, self.resolution, layers)
        return SharedCells(self.arena, self.numbers, cells, known_as, layers)

    def _make_sight(self) -> Sight:
        if self.options.ray_casting == "exact" or self.dynamics is not None:
            return ExactSight(self.arena)
        start = self.population
        options = self.options
        rays, known_as = build_cell_rays(start.models, start.poses, self.bodies, self.resolution, options.threads)
        return CellSight(rays, known_as, self.collisions.drawn, self.fans)

    @property
    def robot_keys(self) -> IntArray:
        """What the robots (n,) are known by for life."""
        keys: IntArray = self.population.keys[self.bodies.heads[self.robot_rows]]
        return keys

    @property
    def robot_poses(self) -> FloatArray:
        """Poses (n, 4) of the robots, a copy."""
        return self.frames[:-1].copy() if self._everybody_drives else self.frames[self.robot_rows]

    @property
    def robots_stalled(self) -> BoolArray:
        """Which robots (n,) were stopped in their last move, a copy."""
        return self.stalled.copy() if self._everybody_drives else self.stalled[self.robot_rows]

    def place(self, poses: FloatArray) -> None:
        """Put all bodies at poses (b, 4)."""
        self.motion.place(poses)
        self.frames[:-1] = poses
        self.before[:-1] = poses
        self.stalled[:] = False

    def put(self, rows: IntArray, poses: FloatArray) -> None:
        """Put some bodies at poses (k, 4), at rest; the others go on as they were."""
        known = self.motion.state()
        self.frames[rows], self.before[rows] = poses, poses
        self.stalled[rows] = False
        self.motion.place(self.frames[:-1])
        placed = self.motion.state()
        for name, values in known.items():
            values[rows] = placed[name][rows]
        self.motion.restore(known)

    def locate(self, due: Rows, rng: np.random.Generator) -> None:
        """Update the odometry of the robots that are due."""
        poses = self.frames if self._everybody_drives else self.frames[self.robot_rows]
        self.localization.update(due, poses[: len(self.robots)], self.drive.velocities, rng)

    def move(self) -> None:
        """Move all bodies as the drives want."""
        if self._everybody_drives:
            velocities = self.drive.velocities
        else:
            velocities = self._velocities
            velocities[self.robot_rows] = self.drive.velocities
        poses, stalled = self.motion.move(velocities, self.interval)
        self.before, self.frames = self.frames, self.before
        self.frames[:-1] = poses
        self.stalled[:] = stalled

    def model_poses(self) -> FloatArray:
        """Return where all models are now (models, 4)."""
        start, body = self.population.poses, self.bodies.body_of
        frames = np.concatenate([start[self.bodies.heads], np.zeros((1, 4))])  # body -1: the map
        return attached(self.frames[body], relative(frames[body], start))

    def touching(self) -> BoolArray:
        """Return which robots (n,) touch something where they are."""
        return self.collisions.touching()[self.robot_rows]

    def _periods(self, intervals: list[float], always: bool) -> IntArray:
        return np.array([1 if always else period(i, self.interval) for i in intervals], dtype=np.int64)


def _moving(models: Sequence[Model], physical: bool) -> list[bool]:
    """Return which models (m,) have poses of their own to move."""
    if not physical:
        return [is_robot(model) for model in models]
    from kurumaisu.sim.bodies import movable

    moving = set(movable(models))
    return [model.index in moving for model in models]
