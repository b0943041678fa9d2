# SPDX-License-Identifier: BSD-3-Clause
"""Models that walk by themselves: along their waypoints, straight on or giving way by the social force."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from kurumaisu._core import Clearance
from kurumaisu.sim.robots import social_force
from kurumaisu.types import FloatArray, IntArray
from kurumaisu.world.model import Walk

_LOW, _HIGH = 0.1, 1.8  # [m] walls that are in a walker's way are somewhere between these heights
_WALLS_WITHIN = 2.0  # [m] ten times the range of a wall's force
_ARRIVED = 0.5  # [m] from a waypoint one who gives way goes on to the next, for somebody may stand on it


class Pedestrians:
    """The walks of some bodies of a world."""

    def __init__(self, walks: Sequence[Walk], rows: IntArray, walls: FloatArray) -> None:
        """Start walks (n,) of the bodies in rows (n,), among solid walls (m, 6): ax, ay, bx, by, z_low, z_high."""
        self._walks = tuple(walks)
        self._rows = rows
        self._walls = walls[(walls[:, 4] < _HIGH) & (walls[:, 5] > _LOW)]
        self._finder = Clearance(self._walls, np.zeros(len(self._walls), dtype=np.int64))
        self._point = np.array([self._finder.add_body(np.empty((0, 6)), -1)], dtype=np.int64)
        self._social = np.array([walk.social for walk in walks], dtype=np.bool_)
        self._speeds = np.array([walk.speed for walk in walks])
        self.begin()

    @property
    def rows(self) -> IntArray:
        """Rows (n,) of the walking bodies."""
        return self._rows

    def begin(self) -> None:
        """Head for the first waypoints."""
        self._targets = np.zeros(len(self._walks), dtype=np.int64)
        self._steps = np.ones(len(self._walks), dtype=np.int64)  # 1: to the next waypoint, -1: back, 0: has arrived

    def velocities(self, poses: FloatArray, before: FloatArray, dt: float) -> FloatArray:
        """Return what the walkers want (n, 3) in their own frames; poses (b, 4) of all bodies, now and dt [s] before.

        To be called once for each step: waypoints that are reached give way to the next ones.
        """
        places = poses[self._rows, :2]
        wanted = np.array([self._straight(i, place, dt) for i, place in enumerate(places)]).reshape(-1, 2)
        social = np.flatnonzero(self._social)
        if len(social):
            wanted[social] = self._giving_way(social, wanted[social], (poses, (poses - before) / dt), dt)
        c, s = np.cos(poses[self._rows, 3]), np.sin(poses[self._rows, 3])
        x, y = wanted.T
        return np.stack([c * x + s * y, c * y - s * x, np.zeros(len(wanted))], axis=1)

    def state(self) -> dict[str, IntArray]:
        """Return where everybody is on his walk: copies."""
        return {"targets": self._targets.copy(), "steps": self._steps.copy()}

    def restore(self, state: dict[str, IntArray]) -> None:
        """Go back to a state."""
        self._targets[:] = state["targets"]
        self._steps[:] = state["steps"]

    def _straight(self, i: int, place: FloatArray, dt: float) -> FloatArray:
        """Return the velocity (2,) that leads to the waypoint, exactly onto it in the step that reaches it."""
        walk = self._walks[i]
        if not self._steps[i]:
            return np.zeros(2)
        way = walk.waypoints[self._targets[i]] - place
        distance = float(np.hypot(*way))
        if distance <= (_ARRIVED if walk.social else walk.speed * dt):
            self._next(i)
            if not walk.social:
                return np.asarray(way / dt)
        return np.asarray(way * (walk.speed / max(distance, 1e-9)))

    def _next(self, i: int) -> None:
        walk = self._walks[i]
        last = len(walk.waypoints) - 1
        following = int(self._targets[i] + self._steps[i])
        if walk.mode == "yoyo" and not 0 <= following <= last:
            self._steps[i] *= -1
            following = int(np.clip(self._targets[i] + self._steps[i], 0, last))
        elif walk.mode == "once" and following > last:
            self._steps[i], following = 0, last
        self._targets[i] = following % (last + 1)

    def _giving_way(
        self, walkers: IntArray, wanted: FloatArray, bodies: tuple[FloatArray, FloatArray], dt: float
    ) -> FloatArray:
        """Return the velocities (k, 2) a step later under the forces of others and walls."""
        poses, rates = bodies
        rows = self._rows[walkers]
        places, velocities = poses[rows, :2], rates[rows, :2]
        force = social_force.drive(velocities, wanted)
        force += social_force.repulsion(places, wanted, poses[:, :2], rates[:, :2])
        force += np.array([social_force.wall_repulsion(pose[:2], self._near(pose)) for pose in poses[rows]])
        after = velocities + force * dt
        speed = np.hypot(*after.T)
        most = social_force.FASTEST * self._speeds[walkers]
        return np.asarray(after * np.minimum(1.0, most / np.maximum(speed, 1e-9))[:, None])

    def _near(self, pose: FloatArray) -> FloatArray:
        return self._walls[self._finder.near(self._point, pose[None], _WALLS_WITHIN), :4]
