# SPDX-License-Identifier: BSD-3-Clause
"""A pymunk space of some bodies, their motors, the floor that drags them, and walls."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Sequence

import numpy as np
import pymunk
from pymunk.batch import BodyFields, Buffer, get_space_bodies, set_space_bodies

from kurumaisu.sim.motion.joints import constraints
from kurumaisu.sim.motion.layers import Layers
from kurumaisu.sim.motion.rigid import Ground, Rigid
from kurumaisu.sim.settings import Physics
from kurumaisu.types import FloatArray

_STATE = (
    BodyFields.POSITION
    | BodyFields.ANGLE
    | BodyFields.VELOCITY
    | BodyFields.ANGULAR_VELOCITY
    | BodyFields.FORCE
    | BodyFields.TORQUE
)
_NUMBERS = 9  # of a body's state: x, y, angle, velocity, turn, force, torque


class Exchange:
    """Reads and writes all bodies of a space at once. pymunk never frees a Buffer, so one serves for long."""

    def __init__(self) -> None:
        self._read, self._write = Buffer(), Buffer()

    def write(self, space: pymunk.Space, state: FloatArray) -> None:
        """Set the states (n, 9) of all bodies of a space: those that move first, in the order they were added."""
        self._write.set_float_buf(state)
        set_space_bodies(space, _STATE, self._write)

    def read(self, space: pymunk.Space) -> FloatArray:
        """Return the states (n, 9) of all bodies of a space."""
        self._read.clear()
        get_space_bodies(space, _STATE, self._read)
        return np.array(np.frombuffer(self._read.float_buf(), dtype=np.float64)).reshape(-1, _NUMBERS)


class ContactSpace:
    """Bodies with a skin of collision_slop, so that contacts act before they overlap."""

    def __init__(self, rigids: Sequence[Rigid], poses: FloatArray, contacts: Physics, exchange: Exchange) -> None:
        """Put bodies at poses (k, 4) of their centres; walls come later."""
        self._contacts = contacts
        self._exchange = exchange
        self._layers = Layers(rigids, poses)
        self._walls: set[int] = set()
        self._floor = pymunk.Body(body_type=pymunk.Body.STATIC)
        self._motors: list[pymunk.Body] = []
        self._grips: list[tuple[pymunk.Constraint, float]] = []  # with their largest force [N] or torque [N m]
        self._limited_for = 0.0  # [s] the substep that these are set for
        self._masses = np.array([[r.mass, r.mass, r.moment] for r in rigids])
        self._space = pymunk.Space()
        self._space.iterations = contacts.iterations
        self._space.collision_slop = contacts.collision_slop
        self._space.collision_bias = contacts.collision_bias
        self._add_bodies(rigids, poses)

    def __del__(self) -> None:
        """Take everything apart: a garbage collector would free bodies before or after their shapes, as it comes."""
        space = getattr(self, "_space", None)
        if space is not None and not sys.is_finalizing():
            space.remove(*space.constraints, *space.shapes, *space.bodies)

    def add_walls(self, numbers: Iterable[int], ground: Ground) -> None:
        """Add walls of the ground that are not there yet."""
        for number in sorted(set(numbers) - self._walls):
            wall = ground.walls[number]
            layers = self._layers.of(wall[4], wall[5])
            self._add_shape(self._floor, wall[:4].reshape(2, 2), int(ground.trees[number]), layers)
            self._walls.add(number)

    def solve(
        self, poses: FloatArray, velocities: FloatArray, motors: FloatArray, step: float
    ) -> tuple[FloatArray, FloatArray]:
        """Return the poses (k, 3), overlaps pushed apart, and velocities (k, 3) that contacts allow for a step [s].

        From poses and velocities; motors: the velocities that those of the driven ones impose. pymunk moves bodies
        first and solves afterwards: it gets no velocities to move by but forces that restore them. Its own step is
        always the same: it would scale the last impulses, which it starts from, by the steps' ratio, though that of
        an impact is no force. The largest impulses of motors and floor go by the true step.
        """
        self._limit_grips(step)
        count = len(poses)
        state = np.zeros((count + len(motors) + 1, _NUMBERS))
        state[:count, :3] = poses
        state[:count, 6:] = self._masses * velocities / self._contacts.step
        state[count:-1, 3:6] = motors
        self._exchange.write(self._space, state)
        self._space.step(self._contacts.step)
        result = self._exchange.read(self._space)[:count]
        return result[:, :3], result[:, 3:6]

    def _add_bodies(self, rigids: Sequence[Rigid], poses: FloatArray) -> None:
        """Add bodies, then motors, then the floor: in this order they are read and written."""
        for rigid, pose, layers in zip(rigids, poses, self._layers.parts, strict=True):
            body = pymunk.Body(rigid.mass, rigid.moment)
            body.position, body.angle = tuple(pose[:2]), float(pose[3])
            self._space.add(body)
            for part, bits in zip(rigid.parts, layers, strict=True):
                self._add_shape(body, part.corners, rigid.tree, bits)
            if rigid.driven:
                self._motors.append(pymunk.Body(body_type=pymunk.Body.KINEMATIC))
            self._add_grip(self._motors[-1] if rigid.driven else self._floor, body, rigid)
        self._space.add(*self._motors, self._floor)

    def _add_shape(self, body: pymunk.Body, corners: FloatArray, tree: int, layers: int) -> None:
        skin = self._contacts.collision_slop
        ends = [(x, y) for x, y in corners.tolist()]
        shape = pymunk.Segment(body, ends[0], ends[1], skin) if len(ends) == 2 else pymunk.Poly(body, ends, radius=skin)
        shape.filter = pymunk.ShapeFilter(tree + 1, layers, layers)
        shape.friction = self._contacts.friction
        self._space.add(shape)

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
                joint.max_force = most * step / self._contacts.step
            self._limited_for = step
