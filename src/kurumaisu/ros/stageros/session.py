# SPDX-License-Identifier: BSD-3-Clause
"""A world that runs, with what is published of it and what can be done to it."""

from __future__ import annotations

from collections import deque
from dataclasses import replace
from functools import partial

import numpy as np
import rospy
from geometry_msgs.msg import Pose, Twist

from kurumaisu.errors import Error, told
from kurumaisu.names import hint
from kurumaisu.ros.inbox import Rates, rates_of
from kurumaisu.ros.rotation import pose_of
from kurumaisu.ros.stageros.names import Names, names_of, names_of_another
from kurumaisu.ros.stageros.plan import plan_world
from kurumaisu.ros.stageros.publish import Publisher
from kurumaisu.ros.stageros.robot import CommandListener
from kurumaisu.ros.stageros.saved_names import with_names, without_names
from kurumaisu.ros.stageros.settings import StagerosSettings
from kurumaisu.ros.view.fans import FleetFans
from kurumaisu.ros.view.topics import ViewTopics
from kurumaisu.sim.motion.partition import is_robot
from kurumaisu.sim.robots.newcomers import newcomers
from kurumaisu.sim.robots.saved_world import Scene
from kurumaisu.sim.robots.simulator import Simulator
from kurumaisu.types import FloatArray
from kurumaisu.world import World
from kurumaisu.world.layout import family
from kurumaisu.world.model import Model

_NS = 1_000_000_000


class Session:
    """Steps a world and publishes every step; all but hear and carry must be called by one thread."""

    def __init__(self, world: World, settings: StagerosSettings, use_model_names: bool) -> None:
        """Advertise everything; the node must have been initialised."""
        self.paused = False
        settings = replace(settings, options=settings.options.of_world(world.semantics))
        self._settings = settings
        self._vocabulary, self._setting = world.vocabulary, world.setting
        self._use_model_names = use_model_names
        self._seed = settings.seed
        self._simulator = Simulator(world, settings.options)
        self._simulator.reset(self._seed)
        self._step_ns = round(world.interval * _NS)
        self._number = 0  # of steps since the start; /clock is that many times the interval
        self._last_command = 0  # [ns]
        self._heard: deque[tuple[Names, Rates]] = deque()
        self._carried: deque[tuple[Names, FloatArray]] = deque()
        self._home = names_of(world.models, settings, use_model_names)
        self._numbered = len(self._home)  # robots that there have ever been
        self._left: dict[int, Names] = {}  # names of deleted robots, by their keys
        self._publisher = Publisher(settings, world.interval, self._ears)
        self._take(self._home)
        self._publisher.check_rates()
        self._fans = FleetFans(self._simulator)
        self._view = ViewTopics(
            settings.view_rate,
            settings.frames.ground_truth,
            lambda: self._simulator.machinery,
            self._fans,
            self._drives,
            lambda: self._seed,
        )
        self.heard = 0  # commands and poses, of any robot, since the start, dropped ones included

    @property
    def time(self) -> float:
        """Simulated time [s]."""
        return self._number * self._step_ns / _NS

    @property
    def warnings(self) -> tuple[str, ...]:
        """What the world says and is not heeded, and what is odd about it, in words."""
        return self._simulator.warnings

    def step(self) -> None:
        """Simulate one interval of the world and publish it."""
        self._obey()
        observation = self._simulator.step(self._commands)
        self._number += 1
        now = self._number * self._step_ns
        timeout = self._settings.watchdog_timeout
        if timeout > 0 and now - self._last_command >= timeout * _NS:
            self._commands[:] = 0.0  # of all robots: any command for any robot keeps all going, as in 1.8.0
        self._publisher.publish(observation, self._model_poses, self._number, divmod(now, _NS))
        if self._view.due:
            self._fans.note(now)

    def show(self, speed: float) -> None:
        """Publish what a page draws, if one looks; speed: at which it runs."""
        self._view.show(self._number * self._step_ns, self.paused, speed)

    def _drives(self) -> dict[int, str]:
        rows = self._simulator.machinery.robot_rows.tolist()
        return {rows[row]: rospy.resolve_name(names.topic("cmd_vel")) for names, row in self._rows.items()}

    def _ears(self, names: Names) -> CommandListener:
        return CommandListener(partial(self.hear, names), partial(self.carry, names))

    def _obey(self) -> None:
        """Heed what has been heard since the last step."""
        while self._heard:
            names, command = self._heard.popleft()
            if names in self._rows:
                self._commands[self._rows[names]] = command
            self._last_command = self._number * self._step_ns
        while self._carried:
            names, pose = self._carried.popleft()
            if names in self._rows:
                self._simulator.set_pose(self._simulator.robots[self._rows[names]], pose)

    def carry(self, names: Names, pose: Pose) -> None:
        """Put a robot to a pose, from any thread, before the next step. Raise Error for one that makes no sense."""
        self.heard += 1
        self._carried.append((names, pose_of(pose)))

    def hear(self, names: Names, message: Twist) -> None:
        """Take a robot's command, from any thread; the next step heeds it. Raise Error for one that makes no sense."""
        self.heard += 1
        self._heard.append((names, rates_of(message)))

    def reset(self, seed: int | None = None) -> None:
        """Start again as the file says, with the same or another seed; /clock runs on, as time must not jump back."""
        self._seed = self._seed if seed is None else seed
        self._simulator.reset(self._seed)
        self._view.carried()
        self._left = {}
        self._take(self._home)

    def reset_positions(self) -> None:
        """Put the robots back to where they started; their odometry does not notice, as in 1.8.0."""
        self._simulator.reset_positions()
        self._view.carried()

    def set_pose(self, name: str | Names, pose: FloatArray) -> None:
        """Put a model or a robot to x, y, z [m], heading [rad]. Raise Error for an unknown one."""
        model = self._model(name)
        self._simulator.set_pose(model, pose)
        if is_robot(model):
            self._view.carried()

    def spawn(self, like: str, name: str, pose: FloatArray) -> str:
        """Add a copy of a model with all that stands on it, or what a text in the world's words describes.

        Return `#` and its key. Raise Error for an unknown model, a text that makes no sense, or a name that is taken.
        """
        new = newcomers(like, name, self._simulator.models, lambda one: self._model(one).index, self._vocabulary)
        for warning in new.warnings:
            rospy.logwarn(f"STAGEROS_WORLD {warning}")
        key = self._simulator.spawn(new.models, pose)
        self._take_more()
        return key

    def delete(self, name: str) -> None:
        """Take a model with all that stands on it away. Raise Error for an unknown one."""
        model, keys = self._model(name), self._simulator.machinery.robot_keys.tolist()
        gone = set(family(self._simulator.models, model.index))
        going = {names for names, row in self._rows.items() if self._simulator.robots[row].index in gone}
        self._left |= {keys[self._rows[names]]: names for names in going}
        stay = [names for names in self._rows if names not in going]
        self._simulator.delete(model)
        self._take(stay)

    def restore(self, name: str) -> None:
        """Bring back what was deleted, robots under their old names. Raise Error if it cannot be."""
        self._simulator.restore(name)
        self._take_more()

    def _take_more(self) -> None:
        """Publish the robots that have come as well; they are the last."""
        names = sorted(self._rows, key=self._rows.__getitem__)
        more = slice(len(names), None)
        keys = self._simulator.machinery.robot_keys.tolist()[more]
        self._take([*names, *self._names_of_more(self._simulator.robots[more], keys)])

    def scene(self) -> Scene:
        """Return what there is now."""
        return Scene(self._setting, self._simulator.models, self._simulator.model_poses)

    def save(self) -> bytes:
        """Return the whole state, with the names that the robots have here."""
        names = sorted(self._rows, key=self._rows.__getitem__)
        return with_names(self._simulator.save(), names, self._numbered)

    def load(self, saved: bytes) -> None:
        """Go back to a state that was saved of this world; /clock runs on."""
        prefixes, numbered, state = without_names(saved)
        now = self._simulator.save()
        self._simulator.load(state)
        self._view.carried()
        if len(set(prefixes)) != len(self._simulator.robots):
            self._simulator.load(now)
            raise Error(f"state: does not name each of its robots once: {told(prefixes)}")
        self._seed = self._simulator.seed
        switches = self._settings.strip_leading_slash, self._settings.relative_topics
        self._numbered = max(self._numbered, numbered)
        self._left = {}
        self._take([Names(prefix, *switches) for prefix in prefixes])

    def _model_poses(self) -> FloatArray:
        return self._simulator.model_poses

    def _take(self, names: list[Names]) -> None:
        """Publish the robots that there are now, under these names."""
        self._rows = {each: row for row, each in enumerate(names)}
        self._commands = np.zeros((len(names), 3))
        models = self._simulator.models
        self._publisher.change(models, plan_world(models, names, self._settings))

    def _names_of_more(self, robots: tuple[Model, ...], keys: list[int]) -> list[Names]:
        """Return the names of robots that have come: those that they had before, or new ones."""
        every: list[Names] = []
        for robot, key in zip(robots, keys, strict=True):
            names = self._left.pop(key, None)
            if names is None:
                names = names_of_another(self._numbered, robot, self._settings, self._use_model_names)
                self._numbered += 1
            every.append(names)
        return every

    def _model(self, name: str | Names) -> Model:
        """Return the model of a name in the world file, of # and its key, or a robot's by its topics', as robot_1."""
        for names, row in self._rows.items():
            if name in (names, names.prefix or ""):
                return self._simulator.robots[row]
        found = [model for model in self._simulator.models if model.name == name]
        if isinstance(name, str) and name.startswith("#") and not found:
            return self._simulator.models[self._simulator.machinery.population.index(name)]
        if len(found) != 1:
            known = sorted({model.name for model in self._simulator.models if model.name})
            why = "several models have it" if found else f"no model has it; {hint(str(name), known)}"
            raise Error(f"name {name!r}: {why}")
        return found[0]
