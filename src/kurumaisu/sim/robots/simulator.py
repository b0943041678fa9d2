# SPDX-License-Identifier: BSD-3-Clause
"""The simulator of a world file: N robots as arrays, one step at a time, one seed, one run."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from kurumaisu.errors import Error
from kurumaisu.params import shipped
from kurumaisu.sim.motion.partition import is_robot
from kurumaisu.sim.options import Options
from kurumaisu.sim.rangers.fans import RangerFan
from kurumaisu.sim.rangers.scans import Scans
from kurumaisu.sim.robots import snapshot, state
from kurumaisu.sim.robots.drive import without_nonsense
from kurumaisu.sim.robots.fleet_effects import check_names
from kurumaisu.sim.robots.machinery import Machinery
from kurumaisu.sim.robots.model_changes import (
    checked_pose,
    moved,
    rebuilt,
    same_fans,
    stuck,
    with_newcomers,
    without,
)
from kurumaisu.sim.robots.observation import Observation
from kurumaisu.sim.robots.population import Population
from kurumaisu.sim.robots.sensing import Sensing
from kurumaisu.sim.settings import load_dynamics
from kurumaisu.types import FloatArray
from kurumaisu.world import World, read_snippet
from kurumaisu.world.model import Model

if TYPE_CHECKING:
    from kurumaisu.sim.robots.devices import Value
    from kurumaisu.sim.sensors.settings import SensorSettings
    from kurumaisu.sim.sensors.suite import Reading


class Simulator:
    """All robots of one world; several simulators do not know of each other."""

    def __init__(self, world: World, options: Options, sensors: Sequence[SensorSettings] = ()) -> None:
        """Build the world and reset it with seed 0; sensors: those that a world file cannot describe.

        Raise Error for options or sensors that do not fit the world.
        """
        self._sensors = tuple(sensors)
        self._readings: tuple[Reading, ...] = ()
        self._devices: dict[int, Value] = {}
        options = options.of_world(world.semantics)
        if options.scan_sweep > world.interval:
            raise Error(
                f"scan_sweep: {options.scan_sweep:g} s is more than a step of {world.path}: {world.interval:g} s"
            )
        self._world = world
        self._options = options
        self._late = options.timing == "consistent"
        dynamics = load_dynamics(shipped("launch/physical.yaml")) if options.semantics == "physical" else None
        check_names(options.effects, [model for model in world.models if is_robot(model)])
        start = Population.first(world.models, world.poses)
        self._home = Machinery(start, options, world.interval, dynamics, resolution=world.resolution)
        self.reset(0)
        self.warnings = (*world.warnings, *stuck(self._home))

    def reset(self, seed: int) -> Observation:
        """Go back to the world file's start, time 0, and start randomness anew."""
        self._machinery = self._home
        home = self._home
        streams = map(np.random.default_rng, np.random.SeedSequence(seed).spawn(3))
        self._odometry_rng, self._ranger_rng, self._sensor_rng = streams
        self._step = 0
        self._dropped = 0
        home.place(home.population.poses[home.bodies.heads])
        home.begin(seed)
        home.localization.draw_errors(self._odometry_rng)
        home.rangers.start(0.0, home.frames, self._ranger_rng)
        self._power_up()
        return self.observe()

    def step(self, commands: FloatArray) -> Observation:
        """Advance by one interval of the world.

        commands (n, 3): forward, leftward [m/s], turn [rad/s], or of a car the steering angle [rad]. Those with a
        number that is not finite count as zero and are counted. Raise Error for another shape.
        """
        machinery = self._machinery
        commands = self._heard(commands)
        self._step += 1
        due = machinery.rhythm.due(self._step)
        if due is not None:
            machinery.drive.update(commands, due)
        if self._late:
            machinery.move()
        if due is not None:
            machinery.locate(due, self._odometry_rng)
        way, time = (machinery.before, machinery.frames), self.time
        machinery.rangers.update(self._step, time, way, self._ranger_rng)
        if not self._late:
            machinery.move()
        self._readings, self._devices = self._sensing.read(time), self._sensing.devices(self._step)
        return self.observe()

    def observe(self) -> Observation:
        """Return what the last step has, and what was changed since by hand; nothing is measured anew."""
        machinery, time = self._machinery, self.time
        return Observation(
            time=time,
            poses=machinery.robot_poses,
            odometry=machinery.localization.estimates.copy(),
            velocities=machinery.drive.velocities.copy(),
            stalled=machinery.robots_stalled,
            scans=machinery.rangers.scans,
            dropped=self._dropped,
            readings=self._readings,
            devices=self._devices,
            reference=machinery.reference(time),
        )

    def reset_positions(self) -> None:
        """Put all that moves back to where it began; as in Stage, time, odometry and commands go on."""
        machinery = self._machinery
        machinery.place(machinery.population.poses[machinery.bodies.heads])

    @property
    def seed(self) -> int:
        """Seed of this run: of the last reset, or of the state that was loaded."""
        return self._machinery.seed

    def set_pose(self, model: str | int | Model, pose: FloatArray | Sequence[float]) -> None:
        """Put a model, with all that stands on it, to a pose (4,) in the map: x, y, z [m], heading [rad].

        The model is given by its name, its number in models, or itself.

        A robot's odometry goes on as if nothing had happened. Raise Error for an unknown model.
        """
        self._have(moved(self._machinery, self._index(model), checked_pose(pose)))

    def spawn(self, models: str | Sequence[Model], pose: FloatArray | Sequence[float]) -> str:
        """Add a model with all that stands on it, parents first, the first one at a pose (4,) in the map.

        Return what it can be called by: `#` and its key.
        Text is read in the words of the world file, as `pioneer ( name "guest" )`. Raise Error with line and column.
        """
        if isinstance(models, str):
            snippet = read_snippet(models, self._world.vocabulary)
            models, self.warnings = snippet.models, (*self.warnings, *snippet.warnings)
        before = self._machinery.population
        self._have(rebuilt(self._machinery, with_newcomers(before, models, checked_pose(pose), self._step)))
        return f"#{before.fresh}"

    def delete(self, model: str | int | Model) -> None:
        """Remove a model with all that stands on it. Raise Error for an unknown one."""
        self._have(without(self._machinery, self._index(model)))

    def restore(self, name: str) -> None:
        """Bring a model back that was deleted, with all that stood on it, by its name or `#` and key.

        Raise Error if it cannot be.
        """
        self._have(rebuilt(self._machinery, self._machinery.population.restored(name, self._step)))

    def grip(self, robot: int, closed: bool) -> bool:
        """Close or open the gripper of a robot, by its number; return whether it holds something now.

        It takes what is between its paddles and has a gripper_return. Raise Error in Stage's semantics.
        """
        return self._machinery.grip(robot, closed)

    def save(self) -> bytes:
        """Return the whole state, from which load continues bit for bit."""
        return state.pack(self._state())

    def load(self, saved: bytes) -> Observation:
        """Continue from a state that a simulator of the same world and options saved.

        Raise Error, with nothing changed, for another one.
        """
        known = state.unpack(saved)
        if known.get("world") != self._fingerprint:
            raise Error(f"state: belongs to another world than {self._world.path}, or to other options")
        state.restored(known, self._state, self._restore)
        return self.observe()

    def _restore(self, known: dict[str, Any]) -> None:
        machinery = self._home
        if known["population"] is not None:
            machinery = self._home.of(known["population"])
        self._machinery = machinery
        self._step, self._dropped = known["step"], known["dropped"]
        snapshot.restore(machinery, known["machinery"])
        self._power_up()
        self._sensing.restore(known["sensors"])
        for rng, random in zip(self._rngs, known["random"], strict=True):
            rng.bit_generator.state = random

    def state_hash(self) -> str:
        """Return a digest of the whole state, randomness included."""
        return state.digest(self._state())

    @property
    def time(self) -> float:
        """Simulated time [s] since the reset."""
        return self._step * self._world.interval

    @property
    def interval(self) -> float:
        """Length of a step [s]."""
        return self._world.interval

    @property
    def robots(self) -> tuple[Model, ...]:
        """Models of the robots, in the order of commands and observations."""
        return self._machinery.robots

    @property
    def rangers(self) -> tuple[RangerFan, ...]:
        """All fans of all rangers, in the order of an observation's scans."""
        return self._machinery.fans

    @property
    def scans(self) -> Scans:
        """The newest scan of each fan."""
        return self._machinery.rangers.scans

    @property
    def machinery(self) -> Machinery:
        """What runs, to be looked at; another one when models come or go."""
        return self._machinery

    @property
    def models(self) -> tuple[Model, ...]:
        """All models that there are now."""
        return self._machinery.population.models

    @property
    def model_poses(self) -> FloatArray:
        """Poses (m, 4) of all models in the map now."""
        return self._machinery.model_poses()

    @cached_property
    def _fingerprint(self) -> str:
        """Tells worlds and options apart; takes a while to make, and most runs never need it."""
        world = self._world
        what = world.models, world.poses, world.interval, replace(self._options, threads=1), self._sensors
        return state.digest(what)

    @property
    def _rngs(self) -> tuple[np.random.Generator, ...]:
        return self._odometry_rng, self._ranger_rng, self._sensor_rng

    def _state(self) -> dict[str, Any]:
        machinery = self._machinery
        return {
            "world": self._fingerprint,
            "population": None if machinery is self._home else machinery.population,
            "step": self._step,
            "dropped": self._dropped,
            "random": tuple(rng.bit_generator.state for rng in self._rngs),
            "machinery": snapshot.take(machinery),
            "sensors": self._sensing.state(),
        }

    def _power_up(self) -> None:
        """Start the sensors of sensors.yaml and the world's devices; they start anew when models come or go."""
        names = {robot.name for robot in self.robots}
        home = self._machinery is self._home
        sensors = [sensor for sensor in self._sensors if home or sensor.fits(names)]  # at home a wrong name is said
        self._sensing = Sensing(sensors, self._machinery, self.time, self._sensor_rng)
        self._readings, self._devices = (), {}

    def _heard(self, commands: FloatArray) -> FloatArray:
        """Return commands that are numbers."""
        commands = np.asarray(commands, dtype=np.float64)
        if commands.shape != self._machinery.drive.velocities.shape:
            raise Error(f"commands: must have shape ({len(self.robots)}, 3), not {commands.shape}")
        commands, dropped = without_nonsense(commands)
        self._dropped += dropped
        return commands

    def _index(self, model: str | int | Model) -> int:
        return self._machinery.population.index(model)

    def _have(self, machinery: Machinery) -> None:
        """Go on with machinery that is new, or the old one changed."""
        old, self._machinery = self._machinery, machinery
        if machinery is not old:
            fresh = np.isin(machinery.robot_keys, old.robot_keys, invert=True)
            machinery.localization.draw_errors(self._odometry_rng, fresh)
            machinery.rangers.start(self.time, machinery.frames, self._ranger_rng)
            machinery.rangers.take_over(old.rangers.scans, same_fans(machinery, old))
            machinery.effects.restore(old.effects.state())
            self._power_up()
