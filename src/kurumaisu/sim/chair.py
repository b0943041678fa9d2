# SPDX-License-Identifier: BSD-3-Clause
"""The chair simulated: voltages in, poses and scans out; one seed, one run."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kurumaisu import effects
from kurumaisu.effects import Reference, Volts
from kurumaisu.errors import Error
from kurumaisu.params import Model
from kurumaisu.sim.body import ChairBody
from kurumaisu.sim.plant import Plant
from kurumaisu.sim.scanner import Scan, Scanner
from kurumaisu.sim.settings import Physics
from kurumaisu.sim.walls import Walls
from kurumaisu.types import FloatArray
from kurumaisu.world import World


@dataclass(frozen=True)
class Command:
    """What the D/A puts out: voltages [V], and the signs of the rates they stand for, NaN where unknown."""

    v_f: float
    v_s: float
    sign_v: float
    sign_w: float


NEUTRAL = Command(0.0, 0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Observation:
    """The truth after a step, and the scan that ended in it, if one did.

    time [s] since the reset; pose (3,) of base_link in the map, theta not wrapped; rates (3,) over the step:
    forward, leftward [m/s], yaw [rad/s]; contact: an obstacle limited the motion; reference: what is measured of
    time, pose and rates, with the effects that act on that.
    """

    time: float
    pose: FloatArray
    rates: FloatArray
    contact: bool
    scan: Scan | None
    reference: Reference


class ChairSimulator:
    """One chair in one world."""

    def __init__(self, model: Model, world: World, physics: Physics) -> None:
        """Build the world; the effects that act are the model's. Call reset before step.

        Raise Error for effects that are unknown or whose parameters do not fit, and if the world has no start pose or
        the chair does not fit there.
        """
        self._model = model
        self._physics = physics
        self._world = world
        effects.check(model.effects)
        self._build_walls(())
        if self._new_body().touches():
            raise Error(f"{world.path}: the chair, as large as in the model, overlaps a wall at its start pose")

    def reset(self, seed: int) -> Observation:
        """Put the chair back to its start, at rest, and start time and randomness anew."""
        plant_rng, laser_rng, effects_rng, world_rng = map(np.random.default_rng, np.random.SeedSequence(seed).spawn(4))
        self._plant = Plant(self._model, self._physics.step, plant_rng)
        self._build_walls(effects.build_world(self._model.effects, world_rng))
        chain = effects.build_laser(self._model.effects, effects_rng)
        self._scanner = Scanner(self._model.laser, self._walls, chain, laser_rng)
        self._steps = 0
        self._body = self._new_body()
        return self._observe(0.0, np.zeros(3), False)

    def step(self, command: Command) -> Observation:
        """Advance by one physics step with the command held."""
        motion = self._plant.from_voltages(_volts(command), float(self._body.pose[2]))
        u = 0.0 if motion.u is None else float(motion.u[0])
        rates, contact = self._body.move(float(motion.v[0]), float(motion.w[0]), u)
        self._steps += 1
        time = self._steps * self._physics.step
        return self._observe(time, rates, contact)

    def _observe(self, time: float, rates: FloatArray, contact: bool) -> Observation:
        pose = self._body.pose
        reference = self._plant.seen(Reference(np.array(time), pose, rates))
        return Observation(time, pose, rates, contact, self._scanner.observe(time, pose), reference)

    def _build_walls(self, errors: tuple[effects.WorldEffect, ...]) -> None:
        """Build what is seen and what is solid, with effects on what the world file says."""
        walls = np.concatenate([self._world.segments, self._world.obstacles])
        for effect in errors:
            walls = effect.apply(walls)  # both at once, as what is seen is mostly also solid
        seen = len(self._world.segments)
        self._walls, self._obstacles = Walls(walls[:seen], self._world.returns), walls[seen:]

    def _new_body(self) -> ChairBody:
        return ChairBody(self._model.chassis, self._obstacles, self._physics, self._world.start)

    @property
    def step_time(self) -> float:
        """Length of a step [s]."""
        return self._physics.step

    @property
    def ambiguous_samples(self) -> int:
        """Steps since the reset whose voltages stood for two rates."""
        return self._plant.ambiguous_samples


def _volts(command: Command) -> Volts:
    return Volts(*(np.array([value]) for value in (command.v_f, command.v_s, command.sign_v, command.sign_w)))
