# SPDX-License-Identifier: BSD-3-Clause
"""Physical motion with an Arena that follows it, so that rangers see what moved."""

from __future__ import annotations

import numpy as np

from kurumaisu._core import Arena
from kurumaisu.geometry import wrap
from kurumaisu.sim.motion.motion import StateArray
from kurumaisu.sim.motion.physical import PhysicalMotion
from kurumaisu.sim.motion.riding import Riding
from kurumaisu.types import BoolArray, FloatArray, IntArray


class Followed:
    """PhysicalMotion as the simulator wants its Motion."""

    def __init__(self, arena: Arena, numbers: IntArray, motion: PhysicalMotion, carrier: IntArray) -> None:
        """Move bodies that have numbers (b,) in the arena and stand on others, carrier (b,), or on the ground: -1."""
        self._arena = arena
        self._numbers = numbers
        self._motion = motion
        self._riding = Riding(carrier, motion.driven)

    def place(self, poses: FloatArray) -> None:
        """Put all bodies at poses (b, 4), at rest."""
        self._motion.place(poses)
        self._arena.set_poses(self._numbers, poses)

    def move(self, velocities: FloatArray, dt: float) -> tuple[FloatArray, BoolArray]:
        """Move all bodies; see Motion."""
        poses, stalled = self._motion.move(velocities, dt) if not len(self._riding.rows) else self._ride(velocities, dt)
        poses[:, 3] = wrap(poses[:, 3])
        self._arena.set_poses(self._numbers, poses)
        return poses, stalled

    def _ride(self, velocities: FloatArray, dt: float) -> tuple[FloatArray, BoolArray]:
        """Move bodies of which some are carried; where wheels slip, contacts do not know that they are."""
        total, expected = velocities, self._motion.poses
        if not self._motion.slips:
            total, expected = self._riding.along(velocities, expected, dt)
        poses, stalled = self._motion.move(total, dt)
        rows = self._riding.rows
        poses[rows] = self._riding.held_back(expected, poses)
        self._motion.shift(rows, poses[rows])
        return poses, stalled

    def glide(self, velocities: FloatArray, dt: float) -> FloatArray | None:
        """Move all bodies if none meets anything, without telling the arena; see PhysicalMotion."""
        return self._motion.glide(velocities, dt)

    def grip(self, body: int, closed: bool) -> bool:
        """Close or open the gripper of a body; return whether it holds something now."""
        return self._motion.grip(body, closed)

    def state(self) -> dict[str, StateArray]:
        """Return what the next moves depend on."""
        return self._motion.state()

    def restore(self, state: dict[str, StateArray]) -> None:
        """Go back to a state."""
        self._motion.restore(state)
        self._arena.set_poses(self._numbers, np.ascontiguousarray(self._motion.poses))
