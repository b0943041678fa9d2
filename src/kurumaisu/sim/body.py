# SPDX-License-Identifier: BSD-3-Clause
"""The chair's body: on the arc of equation (3) where it is free, by pymunk where it touches obstacles."""

from __future__ import annotations

import math

import numpy as np
import pymunk

from kurumaisu import _core
from kurumaisu.effects import Motion
from kurumaisu.geometry import between
from kurumaisu.params import Chassis
from kurumaisu.sim.plant import path
from kurumaisu.sim.settings import Physics
from kurumaisu.types import FloatArray


class ChairBody:
    """A rigid footprint whose rates the motors impose and obstacles limit."""

    def __init__(self, chassis: Chassis, obstacles: FloatArray, physics: Physics, start: FloatArray) -> None:
        """Stand at rest at a start pose (3,) among obstacles: segments (n, 4) [m].

        A new run needs a new body: pymunk's contacts remember the forces of the last steps.
        """
        self._physics = physics
        self._pose = np.array(start, dtype=np.float64)
        self._imposed = (0.0, 0.0, 0.0)
        self._space = pymunk.Space()
        self._space.iterations = physics.iterations
        self._space.collision_slop = physics.collision_slop
        self._space.collision_bias = physics.collision_bias
        self._body, self._footprint = _chair(chassis, physics.friction)
        self._body.velocity_func = self._impose
        self._space.add(self._body, self._footprint)
        for ax, ay, bx, by in obstacles.tolist():
            wall = pymunk.Segment(self._space.static_body, (ax, ay), (bx, by), 0.0)
            wall.friction = physics.friction
            self._space.add(wall)
        self._follow_pose()

    @property
    def pose(self) -> FloatArray:
        """Pose (3,) in the map; theta is not wrapped."""
        return self._pose.copy()

    def touches(self) -> bool:
        """Return whether the footprint overlaps an obstacle."""
        return bool(self._space.shape_query(self._footprint))

    def move(self, v: float, w: float, u: float) -> tuple[FloatArray, bool]:
        """Drive one step at v forward [m/s], w [rad/s], and u leftward [m/s], which the wheels slip.

        Return the step's mean rates (3,): forward, leftward [m/s], yaw [rad/s]; and if it met an obstacle.
        """
        step = self._physics.step
        before = self._pose
        self._pose = _advance(before, (v, u, w), step)
        self._follow_pose()
        if not self.touches():
            return np.array([v, u, w]), False
        self._pose = before
        self._follow_pose()
        self._push(v, w, u)
        return between(before, self._pose) / step, True

    def _push(self, v: float, w: float, u: float) -> None:
        """Take a step against obstacles: contacts first, then what they leave of the motion, in substeps.

        pymunk's own order, motion first, would drive the chair into the wall at every substep.
        """
        substep = self._physics.step / self._physics.contact_substeps
        self._imposed = (v, u, w)
        for _ in range(self._physics.contact_substeps):
            self._body.velocity = (0.0, 0.0)  # of itself the step only pushes overlaps apart
            self._body.angular_velocity = 0.0
            self._space.step(substep)  # leaves the allowed rates in the body
            self._body.position += self._body.velocity * substep
            self._body.angle += self._body.angular_velocity * substep
        self._pose = np.array([*self._body.position, self._body.angle])

    def _impose(self, body: pymunk.Body, _gravity: tuple[float, float], _damping: float, _substep: float) -> None:
        v, u, w = self._imposed
        c, s = math.cos(body.angle), math.sin(body.angle)
        body.velocity = (c * v - s * u, s * v + c * u)
        body.angular_velocity = w

    def _follow_pose(self) -> None:
        x, y, theta = self._pose.tolist()
        self._body.position = (x, y)
        self._body.angle = theta
        self._space.reindex_shapes_for_body(self._body)


def _chair(chassis: Chassis, friction: float) -> tuple[pymunk.Body, pymunk.Poly]:
    """Return a body whose origin is base_link, with its footprint."""
    front, rear = chassis.axle_to_front, chassis.axle_to_front - chassis.length
    half = chassis.width / 2
    corners = [(front, half), (rear, half), (rear, -half), (front, -half)]
    # The motors turn the chair about base_link, so contacts see its mass there as well.
    body = pymunk.Body(chassis.mass, pymunk.moment_for_poly(chassis.mass, corners))
    footprint = pymunk.Poly(body, corners)
    footprint.friction = friction
    return body, footprint


def _advance(pose: FloatArray, rates: tuple[float, float, float], step: float) -> FloatArray:
    """Return where forward, leftward speed and yaw rate lead in a step; nearly always nothing slips."""
    v, u, w = (np.array([rate]) for rate in rates)
    if rates[1]:
        return np.asarray(path(Motion(step, v, w, u), pose)[1])
    return np.asarray(_core.integrate(v, w, np.array([step]), pose.tolist())[1])
