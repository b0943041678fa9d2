# SPDX-License-Identifier: BSD-3-Clause
"""The chair simulated: voltages in, poses and scans out; one seed, one run."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from kurumaisu import effects
from kurumaisu.effects import Reference, Volts
from kurumaisu.errors import Error
from kurumaisu.params import Model, shipped
from kurumaisu.sim.chair_body import seat
from kurumaisu.sim.plant import Plant
from kurumaisu.sim.scanner import Scan, Scanner
from kurumaisu.sim.sensing import Sensing
from kurumaisu.sim.sensors.settings import EVERY_ROBOT, SensorSettings
from kurumaisu.sim.sensors.suite import Reading
from kurumaisu.sim.settings import Physics, load_dynamics
from kurumaisu.sim.sight import Sight
from kurumaisu.sim.surroundings import Surroundings
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
    time, pose and rates, with the effects that act on that; readings: of further sensors that were due.
    """

    time: float
    pose: FloatArray
    rates: FloatArray
    contact: bool
    scan: Scan | None
    reference: Reference
    readings: tuple[Reading, ...]


class ChairSimulator:
    """One chair in one world, among all that is in it."""

    def __init__(self, model: Model, world: World, physics: Physics, sensors: Sequence[SensorSettings] = ()) -> None:
        """Build the world; the effects that act are the model's. Call reset before step.

        Raise Error for effects that are unknown or whose parameters do not fit, for sensors of a robot that the world
        has not, and if the world has no start pose or the chair does not fit there.
        """
        self._model = model
        self._dynamics = replace(load_dynamics(shipped("launch/physical.yaml")), contacts=physics)
        self._scene = seat(world, model.chassis)
        effects.check(model.effects)
        self._surroundings = self._build(())
        if self._surroundings.overlaps():
            raise Error(
                f"{world.path}: the chair, as large as in the model, overlaps a wall at its start pose, "
                "or something else that is solid"
            )
        name = self._scene.models[self._scene.chair].name
        own = [replace(s, robot=name) if s.robot == EVERY_ROBOT and name else s for s in sensors]
        self._sensors = tuple(own)
        self.reset(0)

    def reset(self, seed: int) -> Observation:
        """Put all back to the start, at rest, and start time and randomness anew."""
        streams = np.random.SeedSequence(seed).spawn(5)
        plant_rng, laser_rng, effects_rng, world_rng, sensor_rng = map(np.random.default_rng, streams)
        self._plant = Plant(self._model, self.step_time, plant_rng)
        errors = effects.build_world(self._model.effects, world_rng)
        if errors:
            self._surroundings = self._build(errors)
        self._surroundings.begin()
        chain = effects.build_laser(self._model.effects, effects_rng)
        self._scanner = Scanner(self._model.laser, Sight(self._surroundings), chain, laser_rng)
        self._steps = 0
        self._sensing = None
        if self._sensors:
            self._sensing = Sensing(self._sensors, self._surroundings.machinery, 0.0, sensor_rng)
        return self._observe(np.zeros(3), False)

    def step(self, command: Command) -> Observation:
        """Advance by one physics step with the command held."""
        surroundings = self._surroundings
        motion = self._plant.from_voltages(_volts(command), float(surroundings.pose[2]))
        u = 0.0 if motion.u is None else float(motion.u[0])
        rates, contact = surroundings.drive(float(motion.v[0]), float(motion.w[0]), u)
        self._steps += 1
        return self._observe(rates, contact)

    def _observe(self, rates: FloatArray, contact: bool) -> Observation:
        time, pose = self.time, self._surroundings.pose
        reference = self._plant.seen(Reference(np.array(time), pose, rates))
        readings = self._sensing.read(time) if self._sensing is not None and self._steps else ()
        return Observation(time, pose, rates, contact, self._scanner.observe(time, pose), reference, readings)

    def _build(self, errors: tuple[effects.WorldEffect, ...]) -> Surroundings:
        """Build the world with effects on what its file says of walls."""

        def distort(walls: FloatArray) -> FloatArray:
            for effect in errors:
                walls = effect.apply(walls)
            return walls

        return Surroundings(self._scene, self._model.chassis, self._dynamics, distort if errors else None)

    @property
    def time(self) -> float:
        """Simulated time [s] since the reset."""
        return self._steps * self.step_time

    @property
    def step_time(self) -> float:
        """Length of a step [s]."""
        return self._dynamics.contacts.step

    @property
    def ambiguous_samples(self) -> int:
        """Steps since the reset whose voltages stood for two rates."""
        return self._plant.ambiguous_samples


def _volts(command: Command) -> Volts:
    return Volts(*(np.array([value]) for value in (command.v_f, command.v_s, command.sign_v, command.sign_w)))
