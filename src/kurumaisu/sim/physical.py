# SPDX-License-Identifier: BSD-3-Clause
"""Physical motion: what is free drives its arc, what touches obeys masses, motors, friction."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from kurumaisu._core import Clearance, arcs
from kurumaisu.errors import Error
from kurumaisu.geometry import compose
from kurumaisu.sim.island import Island, Moving
from kurumaisu.sim.joints import settled
from kurumaisu.sim.rigid import Ground, Rigid
from kurumaisu.sim.settings import Dynamics
from kurumaisu.types import BoolArray, FloatArray, IntArray


class PhysicalMotion:
    """Moves bodies, a row each, in the order of the pieces it is given."""

    def __init__(self, rigids: Sequence[Rigid], ground: Ground, dynamics: Dynamics) -> None:
        """Put nothing anywhere yet: call place before move."""
        self._rigids = tuple(rigids)
        self._ground = ground
        self._dynamics = dynamics
        self._clearance = Clearance(ground.walls, ground.trees)
        self._numbers = np.array([self._clearance.add_body(r.edges, r.tree) for r in rigids], dtype=np.int64)
        self._driven = np.array([r.driven for r in rigids], dtype=np.bool_)
        self._solid = np.array([len(r.parts) > 0 for r in rigids], dtype=np.bool_)
        self._centres = np.array([[*r.centre, 0.0] for r in rigids]).reshape(-1, 3)
        self.place(np.zeros((len(rigids), 4)))

    def place(self, poses: FloatArray) -> None:
        """Put all bodies at poses (b, 4) of x, y, z [m], heading [rad], at rest. Raise Error if one is not finite."""
        _require_finite("pose", poses, (len(self._rigids), 4))
        self._poses = settled(_shifted(poses, self._centres), [r.pivot for r in self._rigids])
        self._velocities = np.zeros((len(poses), 3))
        self._hindered = np.zeros(len(poses), dtype=np.bool_)

    def move(self, velocities: FloatArray, dt: float) -> tuple[FloatArray, BoolArray]:
        """Move all bodies on by dt [s]; velocities (b, 3) forward, leftward [m/s], turn [rad/s] are for driven ones.

        Return poses (b, 4), headings not wrapped, and stalled (b,): something kept it from what its motors imposed.
        Raise Error if a velocity is not finite.
        """
        _require_finite("velocity", velocities, (len(self._rigids), 3))
        commands = np.where(self._driven[:, None], velocities, 0.0)
        times, pairs = self._meetings(commands, dt)
        poses = arcs(self._poses, commands, dt)
        stalled = np.zeros(len(commands), dtype=np.bool_)
        islands = _islands(pairs, times < dt)
        self._hindered[np.setdiff1d(np.arange(len(commands)), np.concatenate([np.empty(0, np.int64), *islands]))] = (
            False
        )
        for rows in islands:
            stalled[rows] = self._collide(rows, poses, commands, (float(times[rows].min()), dt))
        self._velocities[self._driven & ~self._hindered] = 0.0  # nobody asks: it starts as commanded
        self._poses = poses
        return _shifted(poses, -self._centres), stalled

    @property
    def poses(self) -> FloatArray:
        """Poses (b, 4) now."""
        return _shifted(self._poses, -self._centres)

    def state(self) -> dict[str, FloatArray | BoolArray]:
        """Return copies of all that the next moves depend on, by name, a row for each body."""
        return {
            "centres": self._poses.copy(),
            "velocities": self._velocities.copy(),
            "hindered": self._hindered.copy(),
        }

    def restore(self, state: dict[str, FloatArray | BoolArray]) -> None:
        """Go back to a state of the same bodies."""
        self._poses = np.array(state["centres"], dtype=np.float64)
        self._velocities = np.array(state["velocities"], dtype=np.float64)
        self._hindered = np.array(state["hindered"], dtype=np.bool_)

    def _meetings(self, commands: FloatArray, dt: float) -> tuple[FloatArray, IntArray]:
        """Return times (b,) [s] until each body touches something, and pairs (p, 2) that could meet within dt."""
        solid = np.flatnonzero(self._solid)
        sliding = self._velocities.any(axis=1) & ~self._driven
        twists = np.where(sliding[:, None], self._velocities, commands)  # of those sliding only the speed matters
        times = np.full(len(commands), dt)
        distance = 2 * self._dynamics.contacts.collision_slop
        times[solid], pairs = self._clearance.free_times(
            self._numbers[solid], self._poses[solid], twists[solid], dt, distance
        )
        times[sliding] = 0.0
        return times, solid[pairs]

    def _collide(self, rows: IntArray, poses: FloatArray, commands: FloatArray, span: tuple[float, float]) -> BoolArray:
        """Move some bodies in place from the first touch to the end of a span [s]; return who stalled."""
        touch, end = span
        moving = Moving(
            poses=arcs(self._poses[rows], commands[rows], touch),
            velocities=self._velocities[rows],
            commands=commands[rows],
            hindered=self._hindered[rows],
        )
        island = Island(self._numbers[rows], self._rigids, self._ground, self._clearance, self._dynamics)
        stalled = island.run(moving, end - touch)
        poses[rows] = moving.poses
        self._velocities[rows] = moving.velocities
        self._hindered[rows] = moving.hindered
        return stalled


def _islands(pairs: IntArray, seeds: BoolArray) -> list[IntArray]:
    """Return rows that may meet, directly or through others, one array for each group that holds a seed."""
    group = np.arange(len(seeds))
    while True:  # the smallest row of a group spreads along its pairs
        lowest = group.copy()
        np.minimum.at(lowest, pairs[:, 0], group[pairs[:, 1]])
        np.minimum.at(lowest, pairs[:, 1], group[pairs[:, 0]])
        lowest = lowest[lowest]
        if (lowest == group).all():
            break
        group = lowest
    return [np.flatnonzero(group == g) for g in np.unique(group[seeds])]


def _shifted(poses: FloatArray, by: FloatArray) -> FloatArray:
    """Return poses (b, 4) moved in their own frames."""
    moved = poses.copy()
    moved[:, [0, 1, 3]] = compose(poses[:, [0, 1, 3]], by)
    return moved


def _require_finite(what: str, values: FloatArray, shape: tuple[int, int]) -> None:
    if values.shape != shape:
        raise Error(f"{what}: must have shape {shape}, not {values.shape}")
    bad = np.flatnonzero(~np.isfinite(values).all(axis=1))
    if len(bad):
        raise Error(f"{what}: body {bad[0]}: not finite: {values[bad[0]].tolist()}")
