# SPDX-License-Identifier: BSD-3-Clause
"""Bodies that touch: pymunk finds the velocities that contacts, motors and floor allow, step by adaptive step."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from kurumaisu._core import Clearance
from kurumaisu.geometry import PLANAR
from kurumaisu.sim.motion.contact_space import ContactSpace, Exchange
from kurumaisu.sim.motion.joints import Hinges
from kurumaisu.sim.motion.rigid import Ground, Rigid
from kurumaisu.sim.motion.slip import turned
from kurumaisu.sim.settings import Dynamics
from kurumaisu.types import BoolArray, FloatArray, IntArray

_AT_REST = 1.0e-9  # [m/s, rad/s] slower is none
_CREEP = 1.0e-6  # [m, rad] what rests at the end and is no farther has moved by the solver's first guess only
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


@dataclass(frozen=True)
class Surroundings:
    """What all islands of a world have in common."""

    ground: Ground
    clearance: Clearance
    dynamics: Dynamics
    exchange: Exchange


class Island:
    """Some bodies of a world, and the walls about them, in a space of their own.

    A new one for every step of the world: nothing is remembered but poses and velocities. New contacts are met at 3/4
    of both skins.
    """

    def __init__(self, numbers: IntArray, rigids: Sequence[Rigid], world: Surroundings) -> None:
        """Gather bodies, of all of a world, by their numbers, which clearance knows, too."""
        self._numbers = numbers
        self._world = world
        self._skin = world.dynamics.contacts.collision_slop
        self._longest = world.dynamics.contacts.step
        self._rigids = [rigids[n] for n in numbers.tolist()]
        self._hinges = Hinges([r.pivot for r in self._rigids])
        self._driven = np.array([r.driven for r in self._rigids])
        self._imposed = self._driven & (not world.dynamics.slip)  # wheels that slip give all speeds by force
        brakes = [(0.0, 0.0) if r.driven else (r.grip / r.mass, r.twist_grip / r.moment) for r in self._rigids]
        self._brakes = np.array(brakes)  # [m/s^2], [rad/s^2] of those that the floor brakes

    def run(self, moving: Moving, seconds: float) -> BoolArray:
        """Move the bodies on, in place; return who was hindered meanwhile."""
        reach = 2 * _fastest(moving) * seconds + _NEAR
        contacts = self._world.dynamics.contacts
        self._space = ContactSpace(self._rigids, moving.poses, contacts, self._world.exchange)
        self._add_walls(moving.poses, reach)
        left, travelled = seconds, 0.0
        ever, begun = moving.hindered.copy(), moving.poses
        while left > 1e-12 * seconds:
            rest = moving.poses, moving.velocities
            taken = self._advance(moving, min(left, self._longest))
            left -= taken
            ever |= moving.hindered
            if all(np.abs(change).max() < _AT_REST for change in (moving.poses - rest[0], rest[1], moving.velocities)):
                if np.abs(moving.poses - begun).max() < _CREEP:
                    moving.poses = begun
                break  # the next substep would be like this one
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
            touch = self._world.clearance.first_touch(
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
        moving.poses[:, PLANAR] += ways * step
        self._hinges.project(moving.poses, velocities)
        moving.velocities, moving.hindered = velocities, hindered
        return step

    def _solve(self, moving: Moving, step: float) -> tuple[FloatArray, BoolArray, FloatArray]:
        """Return the velocities for a substep, who is hindered, and the poses, overlaps pushed apart."""
        targets = chords(moving.poses[:, 3], moving.commands, step)
        start = np.where((self._imposed & ~moving.hindered)[:, None], targets, moving.velocities)
        planar, velocities = self._space.solve(moving.poses[:, PLANAR], start, targets[self._driven], step)
        poses = moving.poses.copy()
        poses[:, PLANAR] = planar
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

    def _add_walls(self, poses: FloatArray, reach: float) -> None:
        self._space.add_walls(self._world.clearance.near(self._numbers, poses, reach), self._world.ground)


def chords(headings: FloatArray, commands: FloatArray, step: float) -> FloatArray:
    """Return constant velocities (n, 3) in the map that end where arcs of commands (n, 3) end after a step."""
    half = 0.5 * commands[:, 2] * step
    shorter = np.stack([np.sinc(half / np.pi)] * 2 + [np.ones(len(half))], axis=1)
    return turned(commands * shorter, headings + half)


def _fastest(moving: Moving) -> float:
    return float(max(np.hypot(*rates[:, :2].T).max() for rates in (moving.velocities, moving.commands)))
