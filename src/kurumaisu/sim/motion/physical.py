# SPDX-License-Identifier: BSD-3-Clause
"""Physical motion: what is free drives its arc, what touches obeys masses, motors, friction."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from kurumaisu._core import Clearance, arcs
from kurumaisu.errors import Error
from kurumaisu.geometry import PLANAR, compose
from kurumaisu.sim.motion.contact_space import Exchange
from kurumaisu.sim.motion.gripping import Grips
from kurumaisu.sim.motion.island import Island, Moving, Surroundings
from kurumaisu.sim.motion.joints import settled
from kurumaisu.sim.motion.resting import Resting
from kurumaisu.sim.motion.rigid import Ground, Rigid
from kurumaisu.sim.motion.slip import hold, turned
from kurumaisu.sim.settings import Dynamics
from kurumaisu.types import BoolArray, FloatArray, IntArray


@dataclass(frozen=True)
class _Course:
    """How driven bodies go if nothing stops them: (b, 3) in their own frames, dt [s].

    commands; rates before and after the step, and those whose arcs they drive meanwhile.
    """

    commands: FloatArray
    before: FloatArray
    rates: FloatArray
    after: FloatArray
    dt: float


class PhysicalMotion:
    """Moves bodies, a row each, in the order of the pieces it is given."""

    def __init__(self, rigids: Sequence[Rigid], ground: Ground, dynamics: Dynamics) -> None:
        """Put everything in one place: call place before move."""
        self._dynamics = dynamics
        self._clearance = Clearance(ground.walls, ground.trees)
        self._numbers = np.array([self._clearance.add_body(r.edges, r.tree) for r in rigids], dtype=np.int64)
        self._world = Surroundings(ground, self._clearance, dynamics, Exchange())
        self._resting = Resting(len(rigids))
        self._grips = Grips(rigids, self._clearance, self._numbers)
        self._driven = np.array([r.driven for r in rigids], dtype=np.bool_)
        self._pivots = [r.pivot for r in rigids]
        self._centres = np.array([[*r.centre, 0.0] for r in rigids]).reshape(-1, 3)
        self._off_centre = bool(self._centres.any())
        self._distance = 2 * dynamics.contacts.collision_slop  # [m] that is touching
        self.place(np.zeros((len(rigids), 4)))

    def place(self, poses: FloatArray) -> None:
        """Put all bodies at poses (b, 4) of x, y, z [m], heading [rad], at rest; open all grippers.

        Raise Error if one is not finite.
        """
        _require_finite("pose", poses, (len(self._numbers), 4))
        for row in range(len(poses)):
            self._grips.open(row)
        self._poses = settled(_shifted(poses, self._centres), self._pivots)
        self._velocities = np.zeros((len(poses), 3))
        self._hindered = np.zeros(len(poses), dtype=np.bool_)
        self._survey()

    def move(self, velocities: FloatArray, dt: float) -> tuple[FloatArray, BoolArray]:
        """Move all bodies on by dt [s]; velocities (b, 3) forward, leftward [m/s], turn [rad/s] are for driven ones.

        Return poses (b, 4), headings not wrapped, and stalled (b,): something kept it from what its motors imposed.
        Raise Error if a velocity is not finite.
        """
        _require_finite("velocity", velocities, (len(self._numbers), 3))
        commands = np.where(self._driven[:, None], velocities, 0.0)
        glided = self.glide(commands, dt)
        if glided is not None:
            return glided, np.zeros(len(glided), dtype=np.bool_)
        course = self._course(commands, dt)
        times, pairs = self._meetings(course)
        islands = _islands(pairs, times < dt)
        poses = arcs(self._poses, course.rates, dt)
        stalled = np.zeros(len(poses), dtype=np.bool_)
        met = np.isin(np.arange(len(poses)), np.concatenate([np.empty(0, np.int64), *islands]))
        self._hindered &= met
        for rows in islands:
            stalled[rows] = self._collide(rows, poses, course, float(times[rows].min()))
        if self._dynamics.slip:
            free = self._driven & ~met
            self._velocities[free] = turned(course.after, poses[:, 3])[free]
        else:
            self._velocities[self._driven & ~self._hindered] = 0.0  # nobody asks: they start as commanded
        if self._holding:
            self._grips.carry(poses)
        self._poses = poses
        self._rest()
        return self.poses, stalled

    def glide(self, velocities: FloatArray, dt: float) -> FloatArray | None:
        """Move all bodies on by dt [s] and return their poses (b, 4), or None, and nothing moved, if that takes more.

        That is if something slides, or may meet something else. velocities (b, 3) are finite, and 0 where not driven.
        """
        if not self._quiet:
            return None
        times, _ = self._free_times(velocities, dt)
        if min(times.tolist(), default=dt) < dt:
            return None
        self._poses = arcs(self._poses, velocities, dt)
        if self._holding:
            self._grips.carry(self._poses)
        return self.poses

    def shift(self, rows: IntArray, poses: FloatArray) -> None:
        """Put driven bodies to poses (k, 4) without a change of what they are about to do."""
        self._poses[rows] = poses

    def grip(self, row: int, closed: bool) -> bool:
        """Close or open the gripper of a body; return whether it holds something now."""
        if not closed:
            self._grips.open(row)
        held = closed and self._grips.close(row, self._poses)
        self._survey()
        return held

    @property
    def slips(self) -> bool:
        """Whether wheels lag behind their commands."""
        return self._dynamics.slip

    @property
    def driven(self) -> BoolArray:
        """Which bodies (b,) have motors."""
        return self._driven

    @property
    def poses(self) -> FloatArray:
        """Poses (b, 4) now."""
        return _shifted(self._poses, -self._centres) if self._off_centre else self._poses.copy()

    def state(self) -> dict[str, FloatArray | BoolArray]:
        """Return copies of all that the next moves depend on, by name, a row for each body."""
        return {
            "centres": self._poses.copy(),
            "velocities": self._velocities.copy(),
            "hindered": self._hindered.copy(),
            "holders": self._grips.holders.astype(np.float64),
            "offsets": self._grips.offsets.copy(),
        }

    def restore(self, state: dict[str, FloatArray | BoolArray]) -> None:
        """Go back to a state of the same bodies."""
        self._poses = np.array(state["centres"], dtype=np.float64)
        self._velocities = np.array(state["velocities"], dtype=np.float64)
        self._hindered = np.array(state["hindered"], dtype=np.bool_)
        self._grips.restore(state["holders"].astype(np.int64), np.array(state["offsets"], dtype=np.float64))
        self._survey()

    def _survey(self) -> None:
        """Note what the pieces are now, which changes as grippers close and open."""
        rigids = self._grips.rigids
        self._resting.forget()
        self._solid = np.flatnonzero([len(r.parts) > 0 for r in rigids])
        self._holding = bool(self._grips.held.any())
        self._velocities[self._grips.held] = 0.0
        self._rest()
        most = [(r.grip / r.mass, r.twist_grip / r.moment) for r in rigids]
        self._most = np.array(most, dtype=np.float64).reshape(-1, 2)  # [m/s^2], [rad/s^2] that wheels give

    def _rest(self) -> None:
        """Note whether the next step depends on nothing but poses and commands."""
        self._quiet = not (self._dynamics.slip or self._velocities.any() or self._hindered.any())

    def _course(self, commands: FloatArray, dt: float) -> _Course:
        if not self._dynamics.slip:
            return _Course(commands, commands, commands, commands, dt)
        before = np.where(self._driven[:, None], turned(self._velocities, -self._poses[:, 3]), 0.0)
        rates, after = hold(before, commands, self._most, dt)
        return _Course(commands, before, rates, after, dt)

    def _meetings(self, course: _Course) -> tuple[FloatArray, IntArray]:
        """Return times (b,) [s] until each body touches something, and pairs (p, 2) that could meet in this step."""
        sliding = self._velocities.any(axis=1) & ~self._driven
        twists = np.where(sliding[:, None], self._velocities, course.rates)  # of those sliding only the speed matters
        times = np.full(len(twists), course.dt)
        times[self._solid], pairs = self._free_times(twists, course.dt)
        times[sliding] = 0.0
        return times, self._solid[pairs]

    def _free_times(self, twists: FloatArray, dt: float) -> tuple[FloatArray, IntArray]:
        """Return what Clearance.free_times does, of those bodies that are solid."""
        if len(self._solid) == len(self._numbers):  # as nearly always: nothing to choose
            return self._clearance.free_times(self._numbers, self._poses, twists, dt, self._distance)
        solid = self._solid
        return self._clearance.free_times(self._numbers[solid], self._poses[solid], twists[solid], dt, self._distance)

    def _collide(self, rows: IntArray, poses: FloatArray, course: _Course, touch: float) -> BoolArray:
        """Move some bodies in place from the first touch [s] to the end of the step; return who stalled."""
        start = arcs(self._poses[rows], course.rates[rows], touch)
        if self._dynamics.slip:
            driven = rows[self._driven[rows]]
            passed = course.before + touch / course.dt * (course.after - course.before)
            self._velocities[driven] = turned(passed[driven], start[self._driven[rows], 3])
        moving = Moving(
            poses=start,
            velocities=self._velocities[rows],
            commands=course.commands[rows],
            hindered=self._hindered[rows],
        )

        def gather() -> Island:
            return Island(self._numbers[rows], self._grips.rigids, self._world)

        stalled = self._resting.run(rows, gather, moving, course.dt - touch)
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
    moved[:, PLANAR] = compose(poses[:, PLANAR], by)
    return moved


def _require_finite(what: str, values: FloatArray, shape: tuple[int, int]) -> None:
    if values.shape != shape:
        raise Error(f"{what}: must have shape {shape}, not {values.shape}")
    bad = np.flatnonzero(~np.isfinite(values).all(axis=1))
    if len(bad):
        raise Error(f"{what}: body {bad[0]}: not finite: {values[bad[0]].tolist()}")
