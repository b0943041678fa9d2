# SPDX-License-Identifier: BSD-3-Clause
"""A world that runs, with what is published of it and what can be done to it."""

from __future__ import annotations

import math

import numpy as np
import rospy
from geometry_msgs.msg import Twist

from kurumaisu.ros.stageros_plan import plan_world
from kurumaisu.ros.stageros_publish import Publisher
from kurumaisu.ros.stageros_settings import StagerosSettings
from kurumaisu.sim import Simulator
from kurumaisu.types import FloatArray
from kurumaisu.world import World

_NS = 1_000_000_000


class Session:
    """Steps a world and publishes every step; all but hear must be called by one thread."""

    def __init__(self, world: World, settings: StagerosSettings, use_model_names: bool) -> None:
        """Advertise everything; the node must have been initialised."""
        self.paused = False
        self._settings = settings
        self._simulator = Simulator(world, settings.options)
        self._step_ns = round(world.interval * _NS)
        self._number = 0  # of steps since the start; /clock is that many times the interval
        self._last_command = 0  # [ns]
        start = self._simulator.reset(settings.seed)
        self._initial = start.poses.copy()
        self._commands = np.zeros((len(start.poses), 3))
        plans = plan_world(world.models, settings, use_model_names)
        self._publisher = Publisher(plans, settings, world.interval, self.hear)

    @property
    def time(self) -> float:
        """Simulated time [s]."""
        return self._number * self._step_ns / _NS

    def step(self) -> None:
        """Simulate one interval of the world and publish it."""
        observation = self._simulator.step(self._commands)
        self._number += 1
        now = self._number * self._step_ns
        timeout = self._settings.watchdog_timeout
        if timeout > 0 and now - self._last_command >= timeout * _NS:
            self._commands[:] = 0.0  # of all robots: any command for any robot keeps all going, as in 1.8.0
        self._publisher.publish(observation, self._number, divmod(now, _NS))

    def hear(self, row: int, message: Twist) -> None:
        """Take a robot's command, from any thread; the next step heeds it."""
        command = (message.linear.x, message.linear.y, message.angular.z)
        if not all(map(math.isfinite, command)):
            rospy.logwarn_throttle(5.0, f"STAGEROS_COMMAND_NAN for robot {row} dropped: {command}")
            return
        self._commands[row] = command
        self._last_command = self._number * self._step_ns

    def reset(self) -> None:
        """Start again with the same seed; /clock runs on, as time must not jump back."""
        self._simulator.reset(self._settings.seed)
        self._commands[:] = 0.0

    def reset_positions(self) -> None:
        """Put the robots back to where they started; their odometry does not notice, as in 1.8.0."""
        for row, pose in enumerate(self._initial):
            self._simulator.set_pose(row, pose)

    def set_pose(self, row: int, pose: FloatArray) -> None:
        """Put a robot somewhere: pose (4,)."""
        self._simulator.set_pose(row, pose)
