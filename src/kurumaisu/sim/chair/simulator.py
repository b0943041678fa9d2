# SPDX-License-Identifier: BSD-3-Clause
"""The chair simulated: voltages in, poses and scans out; one seed, one run."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from kurumaisu import effects
from kurumaisu.effects import Reference, Volts
from kurumaisu.errors import Error
from kurumaisu.params import EffectSetting, Model
from kurumaisu.sim.chair.body import seat
from kurumaisu.sim.chair.data import NEUTRAL, Command, Observation
from kurumaisu.sim.chair.scanner import Scan, Scanner
from kurumaisu.sim.chair.sight import Sight
from kurumaisu.sim.chair.walls import Walls
from kurumaisu.sim.memory import recall, remember
from kurumaisu.sim.plant import Plant
from kurumaisu.sim.robots import state
from kurumaisu.sim.robots.machinery import Machinery
from kurumaisu.sim.robots.sensing import Sensing
from kurumaisu.sim.sensors.settings import EVERY_ROBOT, SensorSettings
from kurumaisu.sim.sensors.suite import Reading
from kurumaisu.sim.settings import Dynamics
from kurumaisu.types import FloatArray
from kurumaisu.world import World
from kurumaisu.world.model import Model as WorldModel

__all__ = ["NEUTRAL", "ChairSimulator", "Command", "Observation"]


class ChairSimulator:
    """One chair in one world, among all that is in it."""

    def __init__(self, model: Model, world: World, dynamics: Dynamics, sensors: Sequence[SensorSettings] = ()) -> None:
        """Build the world; the effects that act are the model's. Call reset before step.

        Raise Error for effects that are unknown or whose parameters do not fit, for sensors of a robot that the world
        has not, and if the world has no start pose or the chair does not fit there.
        """
        self._model = model
        self._dynamics = dynamics
        self._scene = seat(world, model.chassis)
        effects.check(model.effects)
        self._walls = Walls(self._scene, model.chassis, dynamics)
        self._world = self._walls.as_drawn()
        if self._world.overlaps():
            raise Error(
                f"{world.path}: the chair, with its size in the model, overlaps a wall at its start pose, "
                "or another solid object"
            )
        self._seed = 0
        name = self._scene.models[self._scene.chair].name
        own = [replace(s, robot=name) if s.robot == EVERY_ROBOT and name else s for s in sensors]
        self._sensors = tuple(own)
        self._fingerprint = self._print()
        self.reset(0)

    def reset(self, seed: int) -> Observation:
        """Put all back to the start, at rest, and start time and randomness anew."""
        self._seed = seed
        plant_rng, laser_rng, effects_rng, _walls, self._sensor_rng = _streams(seed)
        self._plant = Plant(self._model, self.step_time, plant_rng)
        if effects.of_world(self._model.effects):
            self._world = self._walls.built(self._model.effects, seed)
        self._world.begin()
        chain = effects.build_laser(self._model.effects, effects_rng)
        self._scanner = Scanner(self._model.laser, Sight(self._world), chain, laser_rng)
        self._steps = 0
        self._power_up()
        return self._observe(np.zeros(3), False)

    def step(self, command: Command) -> Observation:
        """Advance by one physics step with the command held."""
        around = self._world
        x, y, heading = around.pose[0:1], around.pose[1:2], float(around.pose[2])
        motion = self._plant.from_voltages(_volts(command), heading, {"x": x, "y": y})
        u = 0.0 if motion.u is None else float(motion.u[0])
        rates, contact = around.drive(float(motion.v[0]), float(motion.w[0]), u)
        self._steps += 1
        return self._observe(rates, contact)

    def switch(self, settings: tuple[EffectSetting, ...]) -> None:
        """Go on with these effects in place of those so far, between two steps; a reset keeps them.

        Those that act already keep their state, with values that may be others; time begins at 0 for the others.
        Raise Error, with nothing changed, for effects that are unknown or whose parameters do not fit, and for walls
        that would overlap the chair where it is.
        """
        effects.check(settings)
        if effects.of_world(settings) != effects.of_world(self._model.effects):
            self._move_walls(settings)
        self._plant.switch(settings, self.time)
        self._scanner.switch(settings, self.time, _streams(self._seed)[2])
        self._model = replace(self._model, effects=settings)
        self._fingerprint = self._print()

    def _move_walls(self, settings: tuple[EffectSetting, ...]) -> None:
        """Put all that moves among the walls that these effects make."""
        self._world = self._walls.among(self._world, settings, self._seed)
        self._scanner.sight.enter(self._world)
        if self._sensing is not None:
            known, random = self._sensing.state(), remember(self._sensor_rng)
            self._power_up()
            self._sensing.restore(known)
            recall(self._sensor_rng, random)

    def command(self, robot: str, velocity: FloatArray | Sequence[float]) -> None:
        """Let another robot drive on at forward, leftward [m/s], turn [rad/s], as its world file bounds it.

        From a reset on it drives as its file says. Raise Error for an unknown robot, or numbers that are none.
        """
        self._world.command(robot, np.asarray(velocity, dtype=np.float64))

    @property
    def seed(self) -> int:
        """Seed of this run: of the last reset, or of the state that was loaded."""
        return self._seed

    def set_pose(self, name: str, pose: FloatArray | Sequence[float]) -> None:
        """Put a model, with all that stands on it, to a pose (4,) in the map: x, y, z [m], heading [rad].

        Raise Error, with nothing changed, for an unknown one and for a pose at which the chair does not fit.
        """
        before = self._world.machinery
        self._world.set_pose(name, np.asarray(pose, dtype=np.float64))
        if self._world.machinery is not before:
            self._others_changed()
        else:
            self._scanner.sight.restart()

    def spawn(self, models: Sequence[WorldModel], pose: FloatArray | Sequence[float]) -> str:
        """Add a model with all that stands on it, numbered from 0, parents first, at a pose (4,) in the map.

        Return what it can be called by: `#` and its key. Raise Error, with nothing changed, for a robot, for a pose
        that makes no sense, and if the chair is in the way.
        """
        key = self._world.spawn(models, np.asarray(pose, dtype=np.float64), self._steps)
        self._others_changed()
        return key

    def delete(self, name: str) -> None:
        """Take a model away, with all that stands on it. Raise Error for an unknown one, and for a robot."""
        self._world.delete(name)
        self._others_changed()

    def restore(self, name: str) -> None:
        """Bring a model back that was deleted, by its name or `#` and key. Raise Error if it cannot be."""
        self._world.restore_model(name, self._steps)
        self._others_changed()

    def _others_changed(self) -> None:
        self._scanner.sight.restart()
        self._power_up()

    def save(self) -> bytes:
        """Return the whole state, from which load continues bit for bit."""
        return state.pack(self._state())

    def load(self, saved: bytes) -> Observation:
        """Continue from a state that was saved of the same world, chassis, effects and sensors.

        Raise Error, with nothing changed, for another one. Voltage laws and the laser's law are not compared.
        """
        known = state.unpack(saved)
        if known.get("world") != self._fingerprint:
            raise Error("state: belongs to another world, chassis, list of effects or of sensors")
        state.restored(known, self._state, self._restore)
        return self._seen(None, ())

    def _restore(self, known: dict[str, Any]) -> None:
        self.reset(known["seed"])
        self._steps = known["steps"]
        self._world.restore(known["motion"])
        self._power_up()
        if self._sensing is not None:
            self._sensing.restore(known["sensors"])
        self._scanner.restore(known["scanner"])
        recall(self._plant, known["plant"])
        recall(self._sensor_rng, known["random"])
        self._rates, self._contact = known["rates"], known["contact"]

    def state_hash(self) -> str:
        """Return a digest of the whole state, randomness included."""
        return state.digest(self._state())

    def _state(self) -> dict[str, Any]:
        return {
            "world": self._fingerprint,
            "seed": self._seed,
            "steps": self._steps,
            "rates": self._rates,
            "contact": self._contact,
            "motion": self._world.state(),
            "sensors": self._sensing.state() if self._sensing is not None else None,
            "scanner": self._scanner.state(),
            "plant": remember(self._plant),
            "random": remember(self._sensor_rng),
        }

    @property
    def models(self) -> tuple[WorldModel, ...]:
        """All models that there are, the chair among them."""
        return self._world.machinery.population.models

    @property
    def machinery(self) -> Machinery:
        """What runs, to be looked at; another one when models come, go, or walls move."""
        return self._world.machinery

    @property
    def chair_pose(self) -> FloatArray:
        """Where the chair is (3,), theta not wrapped."""
        return self._world.pose.copy()

    @property
    def row(self) -> int:
        """The chair's place among the bodies that move."""
        return self._world.body

    @property
    def robot(self) -> int:
        """Number of the chair among the robots, as readings have it."""
        return self._world.robot

    @property
    def others(self) -> tuple[str, ...]:
        """Names of the other robots that have one."""
        robots = self._world.machinery.robots
        return tuple(r.name for i, r in enumerate(robots) if i != self.robot and r.name is not None)

    @property
    def model_poses(self) -> FloatArray:
        """Poses (m, 4) of all models in the map now."""
        return self._world.machinery.model_poses()

    @property
    def chair(self) -> WorldModel:
        """The model that the chair is."""
        return self.models[self._world.chair]

    def _observe(self, rates: FloatArray, contact: bool) -> Observation:
        self._rates, self._contact = rates, contact
        readings = self._sensing.read(self.time) if self._sensing is not None and self._steps else ()
        return self._seen(self._scanner.observe(self.time, self._world.pose), readings)

    def _seen(self, scan: Scan | None, readings: tuple[Reading, ...]) -> Observation:
        time, pose, rates = self.time, self._world.pose, self._rates
        reference = self._plant.seen(Reference(np.array(time), pose, rates))
        return Observation(time, pose, rates, self._contact, scan, reference, readings)

    def _print(self) -> str:
        """Return what a state must be of."""
        scene, model = self._scene, self._model
        return state.digest((scene.models, scene.poses, model.chassis, model.effects, self._sensors, self._dynamics))

    def _power_up(self) -> None:
        """Start the further sensors."""
        self._sensing = None
        if self._sensors:
            self._sensing = Sensing(self._sensors, self._world.machinery, self.time, self._sensor_rng)

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


def _streams(seed: int) -> list[np.random.Generator]:
    """Return the randomness of plant, laser, the laser's effects, walls (drawn by themselves) and sensors."""
    return [np.random.default_rng(stream) for stream in np.random.SeedSequence(seed).spawn(5)]


def _volts(command: Command) -> Volts:
    return Volts(*np.array([[command.v_f], [command.v_s], [command.sign_v], [command.sign_w]]))
