# SPDX-License-Identifier: BSD-3-Clause
"""How bodies move: the protocol, and Stage's motion, which takes a whole step or none of it."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from kurumaisu._core import step
from kurumaisu.geometry import attached, relative
from kurumaisu.sim.motion.collisions import Collisions
from kurumaisu.sim.motion.partition import Bodies
from kurumaisu.types import BoolArray, FloatArray, IntArray

StateArray = FloatArray | BoolArray


class MotionModel(Protocol):
    """Moves all bodies of a world, robots or not, in the order of Bodies, and tells the Arena of it.

    The simulator makes a new Motion whenever bodies come or go or a wall is moved.
    """

    def place(self, poses: FloatArray) -> None:
        """Put all bodies at poses (b, 4) of x, y, z [m], heading [rad], at rest and not stalled."""

    def move(self, velocities: FloatArray, dt: float) -> tuple[FloatArray, BoolArray]:
        """Move for dt [s] with wanted velocities (b, 3): forward, leftward [m/s], turn [rad/s]; 0 where nobody drives.

        Return poses (b, 4) and whether each was stopped by something (b,). The arrays may be the Motion's own: the
        caller copies what it keeps.
        """

    def state(self) -> dict[str, StateArray]:
        """Return all that the next moves depend on, by name, arrays (b, ...), copies."""

    def restore(self, state: dict[str, StateArray]) -> None:
        """Go back to a state; its arrays have a row for each body."""


class StageMotion:
    """Stage's: along the old heading, all or nothing; a body at rest keeps what was said of its last move."""

    def __init__(self, collisions: Collisions, bodies: Bodies) -> None:
        """Move bodies as far as collisions let them."""
        count = len(bodies)
        self._collisions = collisions
        self._poses = np.zeros((count, 4))
        self._stalled = np.zeros(count, dtype=np.bool_)
        self._new = np.zeros((count, 4))
        carriers = set(bodies.carrier.tolist())
        self._riders = [_riders(bodies, body) if body in carriers else [] for body in range(count)]
        self._carries = np.array([len(riders) > 0 for riders in self._riders], dtype=np.bool_)
        self._apart = not self._carries.any()

    def place(self, poses: FloatArray) -> None:
        """Put all bodies at poses (b, 4), not stalled."""
        self._poses[:] = poses
        self._stalled[:] = False
        self._collisions.place(self._poses)

    def move(self, velocities: FloatArray, dt: float) -> tuple[FloatArray, BoolArray]:
        """Move each body whose velocity is not zero, in order, those that carry others first; see Motion."""
        self._collisions.begin_step()
        all_drive = self._apart and np.count_nonzero(velocities[:, 0]) == len(velocities)  # as in most steps
        if all_drive or np.count_nonzero(velocities):  # faster than any()
            self._new = step(self._poses, velocities, dt)
            if all_drive:
                self._settle(slice(None))
            else:
                self._settle_some(velocities, dt)
            self._collisions.end_step(self._poses)
        return self._poses, self._stalled

    def state(self) -> dict[str, StateArray]:
        """Return poses and stalls."""
        return {"poses": self._poses.copy(), "stalled": self._stalled.copy(), **self._collisions.state()}

    def restore(self, state: dict[str, StateArray]) -> None:
        """Go back to a state."""
        self.place(np.asarray(state["poses"], dtype=np.float64))
        self._stalled[:] = state["stalled"]
        self._collisions.restore(state)

    def _settle_some(self, velocities: FloatArray, dt: float) -> None:
        """Let those bodies take their steps whose velocity is not zero."""
        moving = velocities.any(axis=1)
        if not self._apart:
            for body in np.flatnonzero(moving & self._carries):
                self._settle_stack(int(body))
                self._new = step(self._poses, velocities, dt)  # of those that were carried
            moving &= ~self._carries
        self._settle(slice(None) if np.count_nonzero(moving) == len(moving) else np.flatnonzero(moving))

    def _settle(self, which: slice | IntArray) -> None:
        """Let bodies take their steps, each on its own."""
        stalled = self._collisions.move(which, self._new[which])
        self._stalled[which] = stalled
        if isinstance(which, slice) and not np.count_nonzero(stalled):
            self._poses[:] = self._new
        elif isinstance(which, slice):
            np.copyto(self._poses, self._new, where=~stalled[:, np.newaxis])
        else:
            free = which[~stalled]
            self._poses[free] = self._new[free]

    def _settle_stack(self, body: int) -> None:
        """Let a body take its step with all that stand on it, or none of them."""
        old = self._poses[body]
        together = np.array([body, *self._riders[body]])
        new = attached(self._new[body], relative(old, self._poses[together]))
        stalled = bool(self._collisions.move(together, new, np.zeros(len(together), dtype=np.int64))[0])
        self._stalled[body] = stalled
        if not stalled:
            self._poses[together] = new


def _riders(bodies: Bodies, body: int) -> list[int]:
    """Return the bodies that stand on one, at whatever height."""
    riders: list[int] = []
    for other, below in enumerate(bodies.carrier.tolist()):
        if below == body or below in riders:
            riders.append(other)
    return riders
