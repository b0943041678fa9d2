# SPDX-License-Identifier: BSD-3-Clause
"""What runs a population: bodies in an arena, their motion, drives, odometry, rangers."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, cast

import numpy as np

from kurumaisu.errors import Error
from kurumaisu.geometry import PLANAR, attached, between, relative, wrap
from kurumaisu.sim.motion.cells import build_cell_rays, build_cells
from kurumaisu.sim.motion.collisions import Collisions, Crossing, SharedCells
from kurumaisu.sim.motion.motion import StageMotion
from kurumaisu.sim.motion.partition import Distort, build_arena, is_robot, sort
from kurumaisu.sim.motion.slopes import Slopes
from kurumaisu.sim.options import Options
from kurumaisu.sim.rangers import fans
from kurumaisu.sim.rangers.rangers import Rangers
from kurumaisu.sim.rangers.ray_casters import CellRayCaster, ExactRayCaster, RayCaster
from kurumaisu.sim.robots.drive import Drive, Rows
from kurumaisu.sim.robots.fleet_effects import FleetEffects
from kurumaisu.sim.robots.odometry import StageLocalization
from kurumaisu.sim.robots.pedestrians import Pedestrians
from kurumaisu.sim.robots.population import Population
from kurumaisu.sim.robots.schedule import Schedule, period
from kurumaisu.sim.settings import Dynamics
from kurumaisu.types import BoolArray, FloatArray, IntArray
from kurumaisu.world.model import Model, Position

if TYPE_CHECKING:
    from kurumaisu.effects import Reference
    from kurumaisu.sim.motion.following import Followed


class Machinery:
    """Built once for a population; a new one takes over from an old one when models come, go, or walls move."""

    def __init__(
        self,
        population: Population,
        options: Options,
        interval: float,
        dynamics: Dynamics | None,
        distort: Distort | None = None,
        resolution: float | None = None,
    ) -> None:
        """Place all bodies where they begin; interval [s] is a step's length; dynamics: None for Stage's semantics.

        distort: says where the walls are in truth; resolution [m]: of cells in which outlines collide, if options say
        so. Raise Error if there would be too many cells.
        """
        models = population.models
        self.population = population
        self.interval = interval
        self.resolution = resolution
        self.options = options
        self.dynamics = dynamics
        self.distort = distort
        self.bodies = sort(models, _moving(models, physical=dynamics is not None))
        self.arena, self.numbers, self.walls = build_arena(
            models, population.poses, self.bodies, options.threads, distort=distort
        )
        self.robot_rows = np.array([i for i, head in enumerate(self.bodies.heads) if is_robot(models[head])], np.int64)
        self.robots = tuple(models[self.bodies.heads[row]] for row in self.robot_rows)
        self._everybody_drives = len(self.robot_rows) == len(self.bodies)
        self.fans = fans.find(models, population.poses, self.bodies, self.robot_rows.tolist())
        self.collisions = self._make_collisions()
        self.motion = self._make_motion()
        self._eyes = self._make_eyes()
        self.pedestrians = self._make_pedestrians()
        self._slopes = self._make_slopes()
        self._sideways = np.array([cast(Position, model.device).drive == "omni" for model in self.robots], np.bool_)
        self.frames = np.zeros((len(self.bodies) + 1, 4))  # of the bodies, and of the map at the end
        self.before = self.frames.copy()  # those one step ago
        self.stalled = np.zeros(len(self.bodies), dtype=np.bool_)
        self.place(population.poses[self.bodies.heads])
        self._velocities = np.zeros((len(self.bodies), 3))
        self.begin(0)

    def of(self, population: Population) -> Machinery:
        """Return new machinery of the same kind for another population."""
        new = Machinery(population, self.options, self.interval, self.dynamics, self.distort, self.resolution)
        if self.seed:
            new.begin(self.seed)
        return new

    def begin(self, seed: int) -> None:
        """Make drives, odometry, rangers and effects anew, as they are before the first step; seed: of the effects."""
        self.seed = seed
        self.pedestrians.begin()
        devices = [cast(Position, model.device) for model in self.robots]
        starts = self.robot_poses
        born = self.population.born
        periods = self._periods([model.update_interval for model in self.robots], always=self.dynamics is not None)
        self.rhythm = Schedule(periods, born[[model.index for model in self.robots]].astype(np.int64))
        self.drive = Drive(devices, periods * self.interval, self.options.limit_acceleration)
        self.localization = StageLocalization(
            devices, starts, self.interval, self.options.odometry_walk, self.dynamics is not None
        )
        looks = self._periods([fan.model.update_interval for fan in self.fans], always=False)
        births = born[[fan.model.index for fan in self.fans]].astype(np.int64)
        sweep = self.options.scan_sweep / self.interval
        self.effects = FleetEffects(self.options, self.robots, self.robot_keys, self.interval)
        self.effects.begin(seed)
        touched = self.effects.begin_fans(self.fans, self.population.keys, self.arena)
        self.rangers = Rangers(self._eyes, self.fans, np.stack([looks, births], axis=-1), sweep, touched)

    def _make_motion(self) -> StageMotion | Followed:
        if self.dynamics is None:
            return StageMotion(self.collisions, self.bodies)
        # these load pymunk, which Stage's semantics need not pay for
        from kurumaisu.sim.motion.bodies import assemble, ground
        from kurumaisu.sim.motion.following import Followed
        from kurumaisu.sim.motion.physical import PhysicalMotion

        start = self.population
        pieces = assemble(start.models, start.poses, self.dynamics)
        motion = PhysicalMotion(pieces, ground(self.walls), self.dynamics)
        return Followed(self.arena, self.numbers, motion, self.bodies.carrier)

    def _make_slopes(self) -> Slopes:
        """Return the slopes of what stands still; Stage knows none."""
        models, body_of = self.population.models, self.bodies.body_of
        still = [m for m, body in zip(models, body_of, strict=True) if body < 0] if self.dynamics else []
        return Slopes(still, self.population.poses, self.dynamics.slope_speed if self.dynamics else 0.0)

    def _make_pedestrians(self) -> Pedestrians:
        walks = [self.population.models[head].walk for head in self.bodies.heads]
        rows = np.array([row for row, walk in enumerate(walks) if walk is not None], dtype=np.int64)
        return Pedestrians([walk for walk in walks if walk is not None], rows, self.walls.faces[self.walls.solid])

    def _make_collisions(self) -> Collisions:
        if self.options.collision == "exact" or self.dynamics is not None or self.resolution is None:
            return Crossing(self.arena, self.numbers)
        layers = 2 if self.options.collision == "cells_stale" else 1
        start = self.population
        cells, known_as = build_cells(start.models, start.poses, self.bodies, self.resolution, layers)
        return SharedCells(self.arena, self.numbers, cells, known_as, layers)

    def _make_eyes(self) -> RayCaster:
        if self.options.ray_casting == "exact" or self.dynamics is not None or self.resolution is None:
            return ExactRayCaster(self.arena)
        start = self.population
        threads = self.options.threads
        rays, known_as = build_cell_rays(start.models, start.poses, self.bodies, self.resolution, threads)
        return CellRayCaster(rays, known_as, self.collisions.drawn, self.fans)

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

    def wheels(self) -> FloatArray:
        """Return what effects and the floor there make of the drives' velocities (n, 3)."""
        wanted = self.drive.velocities
        if self.effects.moves:
            wanted = self.effects.driven(wanted, self.frames[self.robot_rows])
        if not len(self._slopes):
            return wanted
        return self._slopes.slowed(wanted, self.frames[self.robot_rows], self._sideways, self.interval)

    def move(self) -> None:
        """Move all bodies as the drives want, or as effects and slopes let them."""
        if self._everybody_drives:
            velocities = self.wheels()
        else:
            velocities = self._velocities
            velocities[self.robot_rows] = self.wheels()
            if len(self.pedestrians.rows):
                now, before = self.frames[:-1], self.before[:-1]
                velocities[self.pedestrians.rows] = self.pedestrians.velocities(now, before, self.interval)
        poses, stalled = self.motion.move(velocities, self.interval)
        self.before, self.frames = self.frames, self.before
        self.frames[:-1] = poses
        self.stalled[:] = stalled

    def rates(self) -> FloatArray:
        """Return how the robots (n, 3) moved in the last step: forward, leftward [m/s], turn [rad/s]; stalled: 0."""
        rows = self.robot_rows
        way = between(self.before[rows][:, PLANAR], self.frames[rows][:, PLANAR])
        way[:, 2] = wrap(way[:, 2])
        return way / self.interval

    def reference(self, time: float) -> Reference | None:
        """Return what a reference measures of the robots; None: the truth."""
        if not self.effects.referred:
            return None
        return self.effects.seen(time, self.robot_poses[:, PLANAR], self.rates())

    def grip(self, robot: int, closed: bool) -> bool:
        """Close or open a robot's gripper; return whether it holds something now. Raise Error in Stage's semantics."""
        motion = self.motion
        if isinstance(motion, StageMotion):
            raise Error("grip: needs semantics physical, not stage")
        return bool(motion.grip(int(self.robot_rows[robot]), closed))

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
        return [is_robot(model) or model.walk is not None for model in models]
    from kurumaisu.sim.motion.bodies import movable

    moving = set(movable(models))
    return [model.index in moving for model in models]
