# SPDX-License-Identifier: BSD-3-Clause
"""Bodies that touch: pymunk finds the velocities that contacts, motors and floor allow, step by adaptive step."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pymunk
from pymunk.batch import BodyFields, Buffer, get_space_bodies, set_space_bodies

from kurumaisu._core import Clearance
from kurumaisu.sim.joints import Hinges, constraints
from kurumaisu.sim.layers import Layers
from kurumaisu.sim.rigid import Ground, Rigid
from kurumaisu.sim.settings import Dynamics
from kurumaisu.sim.slip import turned
from kurumaisu.types import BoolArray, FloatArray, IntArray

_STATE = (
    BodyFields.POSITION
    | BodyFields.ANGLE
    | BodyFields.VELOCITY
    | BodyFields.ANGULAR_VELOCITY
    | BodyFields.FORCE
    | BodyFields.TORQUE
)
_AT_REST = 1.0e-9  # [m/s, rad/s] slower is none
_NEAR = 0.05  # [m] walls that are looked up beyond what the bodies can reach


@dataclass
class Moving:
    """Bodies on their way, all (k, ...).

    poses of the centres; velocities (x, y, turn) in the map; commands in the body's frame; hindered: the last
    velocities were not the commanded ones.
    """

    poses: FloatArray
    velocities: FloatArray
    commands: FloatArray
    hindered: BoolArray


class Island:
    """Some bodies of a world, and the walls about them, in a space of their own.

    A new one for every step of the world: nothing is remembered but poses and velocities. Shapes have a skin of
    collision_slop, so that contacts act before bodies overlap; new contacts are met at 3/4 of both skins.
    """

    def __init__(
        self, numbers: IntArray, rigids: Sequence[Rigid], ground: Ground, clearance: Clearance, dynamics: Dynamics
    ) -> None:
        """Gather bodies by their numbers, which clearance knows, too."""
        self._numbers = numbers
        self._ground = ground
        self._clearance = clearance
        self._skin = dynamics.contacts.collision_slop
        self._friction = dynamics.contacts.friction
        self._longest = dynamics.contacts.step
        self._rigids = [rigids[n] for n in numbers.tolist()]
        self._hinges = Hinges([r.pivot for r in self._rigids])
        self._driven = np.array([r.driven for r in self._rigids])
        self._masses = np.array([[r.mass, r.mass, r.moment] for r in self._rigids])
        self._imposed = self._driven & (not dynamics.slip)  # wheels that slip give all speeds by force
        brakes = [(0.0, 0.0) if r.driven else (r.grip / r.mass, r.twist_grip / r.moment) for r in self._rigids]
        self._brakes = np.array(brakes)  # [m/s^2], [rad/s^2] of those that the floor brakes
        self._walls: set[int] = set()
        self._floor = pymunk.Body(body_type=pymunk.Body.STATIC)
        self._motors: list[pymunk.Body] = []
        self._grips: list[tuple[pymunk.Constraint, float]] = []  # with their largest force [N] or torque [N m]
        self._limited_for = 0.0  # [s] the substep that these are set for
        self._space = pymunk.Space()
        self._space.iterations = dynamics.contacts.iterations
        self._space.collision_slop = self._skin
        self._space.collision_bias = dynamics.contacts.collision_bias

    def run(self, moving: Moving, seconds: float) -> BoolArray:
        """Move the bodies on, in place; return who was hindered meanwhile."""
        fastest = _fastest(moving)
        reach = 2 * fastest * seconds + _NEAR
        self._layers = Layers(self._rigids, moving.poses)
        self._add_bodies(moving.poses)
        self._add_walls(moving.poses, reach)
        left, travelled = seconds, 0.0
        ever = moving.hindered.copy()
        while left > 1e-12 * seconds:
            taken = self._advance(moving, min(left, self._longest))
            left -= taken
            ever |= moving.hindered
            travelled += taken * float(np.hypot(*moving.velocities[:, :2].T).max())
            if travelled > reach - _NEAR:
                self._add_walls(moving.poses, reach)
                travelled = 0.0
        moving.velocities[np.abs(moving.velocities).max(axis=1) < _AT_REST] = 0.0
        return ever

    def _advance(self, moving: Moving, longest: float) -> float:
        """Take one substep, no longer than to the next touch; return its length [s]."""
        step = longest
        for _ in range(2):  # what touches earlier shortens the substep, and with it the impulses of motors and floor
            velocities, hindered, poses = self._solve(moving, step)
            ways = self._ways(moving.velocities, velocities, step)
            limit = self._hinges.time(poses, velocities, step)
            touch = self._clearance.first_touch(
                self._numbers,
                poses,
                ways,
                known=2 * self._skin,
                distance=1.5 * self._skin,
                give=0.5 * self._skin,
                limit=limit,
            )
            if touch >= step:
                break
            step = touch
        moving.poses = poses
        moving.poses[:, [0, 1, 3]] += ways * step
        self._hinges.project(moving.poses, velocities)
        moving.velocities, moving.hindered = velocities, hindered
        return step

    def _solve(self, moving: Moving, step: float) -> tuple[FloatArray, BoolArray, FloatArray]:
        """Return the velocities for a substep, who is hindered, and the poses, overlaps pushed apart.

        pymunk moves bodies first and solves afterwards: it gets no velocities to move by but forces that restore them.
        Its own step is always the same: it would scale the last impulses, which it starts from, by the steps' ratio,
        though that of an impact is no force. The largest impulses of motors and floor go by the true step.
        """
        self._limit_grips(step)
        targets = chords(moving.poses[:, 3], moving.commands, step)
        start = np.where((self._imposed & ~moving.hindered)[:, None], targets, moving.velocities)
        state = np.zeros((len(start) + len(self._motors) + 1, 9))
        bodies = state[: len(start)]
        bodies[:, :3] = moving.poses[:, [0, 1, 3]]
        bodies[:, 6:] = self._masses * start / self._longest
        state[len(start) : -1, 3:6] = targets[self._driven]
        self._write(state)
        self._space.step(self._longest)
        result = self._read()[: len(start)]
        poses = moving.poses.copy()
        poses[:, [0, 1, 3]] = result[:, :3]
        velocities = result[:, 3:6].copy()
        hindered = self._driven & (np.abs(velocities - targets).max(axis=1) > _AT_REST)
        return velocities, hindered, poses

    def _ways(self, before: FloatArray, after: FloatArray, step: float) -> FloatArray:
        """Return mean velocities (k, 3) over a substep: half-way, where nothing but the floor braked a body.

        Otherwise contacts were solved for, and they allow the velocity at the end only.
        """
        ways = after.copy()
        for columns, brakes in ((slice(0, 2), self._brakes[:, 0]), (slice(2, 3), self._brakes[:, 1])):
            speed = np.hypot.reduce(before[:, columns], axis=1)
            loss = np.minimum(speed, brakes * step)
            left = np.divide(speed - loss, speed, out=np.zeros_like(speed), where=speed > 0)
            expected = before[:, columns] * left[:, None]
            braked = (loss > 0) & (np.abs(after[:, columns] - expected).max(axis=1) < _AT_REST)
            mean = np.where(speed > loss, (1 + left) / 2, speed / (2 * np.maximum(brakes * step, 1e-300)))
            ways[:, columns][braked] = (before[:, columns] * mean[:, None])[braked]
        return ways

    def _write(self, state: FloatArray) -> None:
        buffer = Buffer()
        buffer.set_float_buf(state)
        set_space_bodies(self._space, _STATE, buffer)

    def _read(self) -> FloatArray:
        buffer = Buffer()
        get_space_bodies(self._space, _STATE, buffer)
        return np.array(np.frombuffer(buffer.float_buf(), dtype=np.float64)).reshape(-1, 9)  # the buffer dies here

    def _add_bodies(self, poses: FloatArray) -> None:
        """Add bodies, then motors, then the floor: in this order pymunk reads and writes them."""
        for row, rigid in enumerate(self._rigids):
            body = pymunk.Body(rigid.mass, rigid.moment)
            body.position, body.angle = tuple(poses[row, :2]), float(poses[row, 3])
            self._space.add(body)
            for part, layers in zip(rigid.parts, self._layers.parts[row], strict=True):
                shape = _shape(body, part.corners, self._skin)
                shape.filter = pymunk.ShapeFilter(rigid.tree + 1, layers, layers)
                shape.friction = self._friction
                self._space.add(shape)
            if rigid.driven:
                self._motors.append(pymunk.Body(body_type=pymunk.Body.KINEMATIC))
            self._add_grip(self._motors[-1] if rigid.driven else self._floor, body, rigid)
        self._space.add(*self._motors, self._floor)

    def _add_grip(self, floor: pymunk.Body, body: pymunk.Body, rigid: Rigid) -> None:
        """Let the floor, or a motor that moves as commanded, drag a body with limited force."""
        for joint, most in [
            (pymunk.PivotJoint(floor, body, (0, 0), (0, 0)), rigid.grip),
            (pymunk.GearJoint(floor, body, 0.0, 1.0), rigid.twist_grip),
        ]:
            joint.max_bias = 0.0  # it drags, and never pulls back
            self._grips.append((joint, most))
            self._space.add(joint)
        if rigid.pivot is not None:
            self._space.add(*constraints(floor, body, rigid.pivot))

    def _limit_grips(self, step: float) -> None:
        if step != self._limited_for:
            for joint, most in self._grips:
                joint.max_force = most * step / self._longest
            self._limited_for = step

    def _add_walls(self, poses: FloatArray, reach: float) -> None:
        for number in self._clearance.near(self._numbers, poses, reach):
            if number not in self._walls:
                self._walls.add(number)
                wall = self._ground.walls[number]
                shape = _shape(self._floor, wall[:4].reshape(2, 2), self._skin)
                layers = self._layers.of(wall[4], wall[5])
                shape.filter = pymunk.ShapeFilter(int(self._ground.trees[number]) + 1, layers, layers)
                shape.friction = self._friction
                self._space.add(shape)


def chords(headings: FloatArray, commands: FloatArray, step: float) -> FloatArray:
    """Return constant velocities (n, 3) in the map that end where arcs of commands (n, 3) end after a step."""
    half = 0.5 * commands[:, 2] * step
    shorter = np.stack([np.sinc(half / np.pi)] * 2 + [np.ones(len(half))], axis=1)
    return turned(commands * shorter, headings + half)


def _shape(body: pymunk.Body, corners: FloatArray, skin: float) -> pymunk.Shape:
    if len(corners) == 2:
        return pymunk.Segment(body, tuple(corners[0].tolist()), tuple(corners[1].tolist()), skin)
    return pymunk.Poly(body, corners.tolist(), radius=skin)


def _fastest(moving: Moving) -> float:
    return float(max(np.hypot(*rates[:, :2].T).max() for rates in (moving.velocities, moving.commands)))
