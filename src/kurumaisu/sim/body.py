# SPDX-License-Identifier: BSD-3-Clause
"""The chair's body: on the arc of equation (3) where it is free, by pymunk where it touches obstacles."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pymunk

from kurumaisu.geometry import between
from kurumaisu.params import Chassis, shipped
from kurumaisu.sim.physical import PhysicalMotion
from kurumaisu.sim.rigid import Ground, Part, Rigid, rigid
from kurumaisu.sim.settings import Physics, load_dynamics
from kurumaisu.types import FloatArray

_HEIGHTS = np.array([0.0, 1.0])  # [m] any: a chair and its obstacles are as high as each other
_CHAIR, _OBSTACLE = 0, 1  # trees


class ChairBody:
    """A rigid footprint whose rates the motors impose and obstacles limit."""

    def __init__(self, chassis: Chassis, obstacles: FloatArray, physics: Physics, start: FloatArray) -> None:
        """Stand at rest at a start pose (3,) among obstacles: segments (n, 4) [m]."""
        dynamics = replace(load_dynamics(shipped("launch/physical.yaml")), contacts=physics, slip=False)
        self._step = physics.step
        self._obstacles = obstacles
        self._chair = _chair(chassis, dynamics.wheel_friction)
        heights = np.broadcast_to(_HEIGHTS, (len(obstacles), 2))
        ground = Ground(np.concatenate([obstacles, heights], axis=1), np.full(len(obstacles), _OBSTACLE))
        self._motion = PhysicalMotion([self._chair], ground, dynamics)
        self._motion.place(np.array([[start[0], start[1], 0.0, start[2]]]))

    @property
    def pose(self) -> FloatArray:
        """Pose (3,) in the map; theta is not wrapped."""
        return np.array(self._motion.poses[0, [0, 1, 3]])

    def touches(self) -> bool:
        """Return whether the footprint overlaps an obstacle."""
        space = pymunk.Space()
        for ax, ay, bx, by in self._obstacles.tolist():
            space.add(pymunk.Segment(space.static_body, (ax, ay), (bx, by), 0.0))
        x, y, theta = self.pose.tolist()
        body = pymunk.Body(body_type=pymunk.Body.KINEMATIC)
        body.position, body.angle = (x, y), theta
        footprint = pymunk.Poly(body, self._chair.parts[0].corners.tolist())
        space.add(body, footprint)
        return bool(space.shape_query(footprint))

    def move(self, v: float, w: float) -> tuple[FloatArray, bool]:
        """Drive one step at v [m/s], w [rad/s].

        Return the step's mean rates (3,): forward, leftward [m/s], yaw [rad/s]; and if an obstacle limited them.
        """
        before = self.pose
        _, stalled = self._motion.move(np.array([[v, 0.0, w]]), self._step)
        if not stalled[0]:
            return np.array([v, 0.0, w]), False
        return between(before, self.pose) / self._step, True


def _chair(chassis: Chassis, friction: float) -> Rigid:
    """Return a piece whose origin is base_link, with the chair's footprint."""
    front, rear = chassis.axle_to_front, chassis.axle_to_front - chassis.length
    half = chassis.width / 2
    corners = np.array([(front, half), (rear, half), (rear, -half), (front, -half)])
    edges = np.concatenate([corners, np.roll(corners, -1, axis=0), np.broadcast_to(_HEIGHTS, (4, 2))], axis=1)
    return rigid([Part(corners, _HEIGHTS)], edges, driven=True, tree=_CHAIR, mass=chassis.mass, friction=friction)
