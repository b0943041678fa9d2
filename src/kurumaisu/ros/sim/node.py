# SPDX-License-Identifier: BSD-3-Clause
"""sim_node: the simulator behind the chair's topics, and the clock of everything else."""

from __future__ import annotations

import re
import threading
import time
from collections import deque
from functools import partial

import rospy
from geometry_msgs.msg import Twist

from kurumaisu import program
from kurumaisu.errors import Error
from kurumaisu.msg import Voltages
from kurumaisu.params import EffectSetting
from kurumaisu.ros import life, messages
from kurumaisu.ros.inbox import Rates, nanoseconds_of, rates_of, subscribe
from kurumaisu.ros.services import Services
from kurumaisu.ros.sim.effects import NAMESPACE, LiveEffects
from kurumaisu.ros.sim.laser import LaserOutput, laser_output
from kurumaisu.ros.sim.publish import SimTopics
from kurumaisu.ros.sim.settings import SimSettings, read_settings, start_outside
from kurumaisu.ros.view.fans import ChairFan
from kurumaisu.ros.view.topics import ViewTopics
from kurumaisu.sim.chair.holder import VoltageHolder
from kurumaisu.sim.chair.simulator import ChairSimulator, Observation
from kurumaisu.sim.live.pacing import Pacer
from kurumaisu.sim.live.requests import Requests
from kurumaisu.sim.robots.newcomers import newcomers
from kurumaisu.sim.robots.saved_world import Scene
from kurumaisu.types import FloatArray

_HELP = """
Simulate the chair in a world, and set the time of all other nodes (/clock).
sim.launch starts it with the base controller: roslaunch kurumaisu sim.launch

subscribes to:
  voltages            what the D/A converter puts out
  NAME/cmd_vel        drives another robot of the world
publishes:
  scan                of the laser; with laser:=driver laser_node publishes it
  ground_truth        where the chair is
  collision           whether it touched something since the last message
  /clock, /tf_static
  ~effects            the effects that are on
  ~world, ~view       what a page draws
  and each further sensor's readings, under the sensor's name
services:
  reset, seed         back to the start, with the same or another seed
  pause, step, speed  pause, advance one step, run faster or slower
  set_pose            move a model
  spawn, delete       add a model, or take one away
  restore             bring back what was taken away
  save_world          the world as it is now, as the text of a world file
  save, load          the whole state, to a file and back
parameters:
  launch/sim_node.yaml, and the arguments of launch/sim.launch
  effects, while it runs: dynamic_reconfigure at ~live

More: docs/sim_node.md
"""
_NS = 1_000_000_000
_GLANCE = 0.02  # [s] of wall time in which a service is noticed by who waits for voltages


class SimNode:
    """Steps the simulator and publishes what it observes; the services act between steps."""

    def __init__(self, settings: SimSettings) -> None:
        """Advertise everything; the node must have been initialised."""
        self.paused = False
        self._settings = settings
        self._seed = settings.seed
        self._simulator = ChairSimulator(settings.model, settings.world, settings.dynamics, settings.sensors)
        self._epoch = round(settings.start_time * _NS)  # /clock at the simulator's time 0; reset moves it on
        self._now = self._epoch
        self._lock = threading.Condition()  # over the holder
        self._holder = VoltageHolder()
        self._given_up: int | None = None  # stamp of the voltages after which no more came in time
        self._laser: LaserOutput = laser_output(settings)
        self._topics = SimTopics(settings, self._laser, self._simulator.robot, self._now)
        self._voltages = subscribe("voltages", Voltages, self._hear, "SIM_VOLTAGES_DROPPED", queue_size=100)
        self._commands: deque[tuple[str, Rates]] = deque()  # heard since the last step, for other robots
        self._others = {
            name: subscribe(
                f"{re.sub(r'[^A-Za-z0-9_]', '_', name)}/cmd_vel",
                Twist,
                partial(self._command, name),
                "SIM_COMMAND_DROPPED",
                queue_size=100,
            )
            for name in self._simulator.others
        }
        self._requests = Requests()
        self._pacer = Pacer(settings.speed)
        self._services = Services(self, self._requests, self._pacer, settings.states, "")
        self._fan = ChairFan(settings.model.laser, lambda: self._simulator.row)
        self._view = ViewTopics(
            settings.view_rate,
            settings.map_frame,
            lambda: self._simulator.machinery,
            self._fan,
            self._drives,
            lambda: self._seed,
        )
        self._effects = LiveEffects(settings.model.effects, self._switch)

    @property
    def time(self) -> float:
        """What /clock says [s]."""
        return self._now / _NS

    def run(self, asked: threading.Event) -> None:
        """Simulate until asked to end."""
        try:
            self._loop(asked)
        finally:
            self._requests.close()
            self._laser.close()

    def _loop(self, asked: threading.Event) -> None:
        self.reset()
        while not asked.is_set():
            if self._requests:
                self._requests.serve()
            self._view.show(self._now, self.paused, self._pacer.speed)
            if self.paused:
                self._requests.wait(0.1)
                continue
            if not self._pacer.wait(self._requests):
                continue
            self._wait_for_voltages()
            self._laser.wait(self._has_requests)
            if self._requests:
                continue
            self._advance()
            self._pacer.step(self._simulator.step_time)

    def step(self) -> None:
        """Go on by one step, as soon as the voltages have come that are due, and the scan that a driver makes."""
        self._wait_for_voltages()
        self._laser.wait(self._has_requests)
        self._advance()

    def reset(self, seed: int | None = None) -> None:
        """Put all back to the start, with the same or another seed; /clock runs on, as time must not jump back."""
        self._seed = self._seed if seed is None else seed
        self._start(self._simulator.reset(self._seed))

    def set_pose(self, name: str, pose: FloatArray) -> None:
        """Put a model to x, y, z [m], heading [rad]. Raise Error for an unknown one."""
        before = self._simulator.chair_pose
        self._simulator.set_pose(name, pose)
        if (self._simulator.chair_pose != before).any():
            self._view.carried()

    def spawn(self, like: str, name: str, pose: FloatArray) -> str:
        """Add a copy of a model, or what a text describes, at a pose (4,); return `#` and its key.

        Raise Error for an unknown model, a text that makes no sense, a robot, and if the chair is in the way.
        """
        there = self._simulator.machinery.population
        new = newcomers(like, name, there.models, there.index, self._settings.world.vocabulary)
        for warning in new.warnings:
            rospy.logwarn(f"SIM_WORLD_IGNORED {warning}")
        return self._simulator.spawn(new.models, pose)

    def delete(self, name: str) -> None:
        """Take a model with all that stands on it away. Raise Error for an unknown one, and for a robot."""
        self._simulator.delete(name)

    def restore(self, name: str) -> None:
        """Bring back what was deleted. Raise Error if it cannot be."""
        self._simulator.restore(name)

    def scene(self) -> Scene:
        """Return what there is now."""
        return Scene(self._settings.world.setting, self._simulator.models, self._simulator.model_poses)

    def save(self) -> bytes:
        """Return the state of all but the voltages that are yet to come."""
        return self._simulator.save()

    def load(self, saved: bytes) -> None:
        """Go back to a state of this world; /clock runs on, and the voltages are neutral until new ones come."""
        self._start(self._simulator.load(saved))
        self._seed = self._simulator.seed

    def _start(self, observation: Observation) -> None:
        """Go on from an observation, at what the clock says now."""
        with self._lock:
            self._holder.clear()
            self._given_up = None
        self._epoch = self._now - round(observation.time * _NS)
        self._view.carried()
        self._publish(observation)

    def _switch(self, settings: tuple[EffectSetting, ...]) -> None:
        """Let other effects act from the next step on, asked by another thread."""
        self._requests.ask(partial(self._simulator.switch, settings))

    def _drives(self) -> dict[int, str]:
        """Return the topics that other robots are driven by; the chair has a controller of its own."""
        machinery = self._simulator.machinery
        rows = zip(machinery.robot_rows.tolist(), machinery.robots, strict=True)
        return {row: self._others[robot.name].resolved_name for row, robot in rows if robot.name in self._others}

    def _has_requests(self) -> bool:
        return bool(self._requests)

    def _command(self, robot: str, twist: Twist) -> None:
        self._commands.append((robot, rates_of(twist)))

    def _advance(self) -> None:
        while self._commands:
            self._simulator.command(*self._commands.popleft())
        with self._lock:
            command = self._holder.at(self._now)
        self._publish(self._simulator.step(command))
        self._warn()

    def _publish(self, observation: Observation) -> None:
        self._now = self._epoch + round(observation.time * _NS)
        self._topics.publish(observation, self._epoch, round(observation.time / self._simulator.step_time))
        self._fan.note(observation, self._epoch)

    def _hear(self, message: Voltages) -> None:
        stamp, command = nanoseconds_of(message), messages.command_of(message)
        with self._lock:
            horizon = self._now + self._settings.voltage_horizon * _NS
            if stamp > horizon:
                raise Error(f"stamp: must be at most {horizon / _NS:.3f} s by /clock: {stamp / _NS:.3f} s")
            self._holder.put(stamp, command)
            self._lock.notify_all()

    def _wait_for_voltages(self) -> None:
        """Let a controller keep up: wait for voltages that are due, within patience."""
        lead = round(self._settings.voltage_lead * _NS)
        if self._voltages.get_num_connections() == 0:
            return
        with self._lock:
            deadline = time.monotonic() + self._settings.voltage_patience
            while self._behind(lead) and not self._requests:
                remaining = deadline - time.monotonic()
                if remaining <= 0:
                    self._given_up = self._holder.newest
                    return
                self._lock.wait(min(remaining, _GLANCE))

    def _behind(self, lead: int) -> bool:
        return self._holder.newest != self._given_up and self._holder.is_due(self._now, lead)

    def _warn(self) -> None:
        newest = self._holder.newest
        if newest is not None and self._now - newest > self._settings.voltage_timeout * _NS:
            silent = (self._now - newest) / _NS
            rospy.logwarn_throttle(
                10.0, f"SIM_VOLTAGES_SILENT for {silent:.2f} s: the D/A converter holds its last voltages"
            )


def main() -> int:
    """Run the node; return 1 after one line for bad configuration."""
    program.no_arguments("sim_node", _HELP)
    return life.run("sim_node", _simulate)


def _simulate(own: life.Life) -> int:
    values = {key: value for key, value in rospy.get_param("~", {}).items() if key != NAMESPACE}
    settings = read_settings(values, rospy.get_name())
    node = SimNode(settings)
    for warning in settings.world.warnings:
        rospy.logwarn(f"SIM_WORLD_IGNORED {warning}")
    if words := start_outside(settings.world):
        rospy.logwarn(f"SIM_START_OUTSIDE {words}")
    node.run(own.asked)
    return 0
