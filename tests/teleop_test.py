#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""teleop_keyboard at a pseudo-terminal, teleop_joy: however they end, the last words are rest and a dead-man let go."""

from __future__ import annotations

import os
import pty
import select
import signal
import subprocess
import sys
import unittest
from collections.abc import Callable

import rosnode
import rospy
import rostest
from geometry_msgs.msg import Twist
from sensor_msgs.msg import Joy
from std_msgs.msg import Bool

from kurumaisu.bench.processes import program
from kurumaisu.ros.testing.nodes import PATIENCE, Repeated, Topic, wait_for

HELD = [0, 0, 0, 0, 1, 0, 0, 0]


class Teleop(unittest.TestCase):
    """Both nodes."""

    def setUp(self) -> None:
        self.dead_man = Topic("/dead_man", Bool)
        self.addCleanup(self.dead_man.close)

    def is_held(self) -> bool:
        return self.dead_man.last is not None and self.dead_man.last.data

    def type(self, keys: str) -> None:
        os.write(self.master, keys.encode())

    def type_until(self, key: str, condition: Callable[[], object]) -> None:
        def typed() -> object:
            self.type(key)
            return condition()

        wait_for(typed, "a command")

    def start_keyboard(self) -> None:
        self.master, slave = pty.openpty()
        command = [sys.executable, program("teleop_keyboard")]
        self.process = subprocess.Popen(
            command, stdin=slave, stdout=slave, stderr=subprocess.STDOUT, start_new_session=True
        )
        os.close(slave)
        self.addCleanup(self.process.kill)
        said = b""
        while b"Ctrl-C ends" not in said:  # by pieces
            assert select.select([self.master], [], [], PATIENCE)[0], f"its help: {said!r}"
            said += os.read(self.master, 10000)

    def ends_at_rest(self, end: Callable[[], None]) -> None:
        commands = Topic("/key_vel", Twist)
        self.addCleanup(commands.close)
        self.start_keyboard()
        # Both at once: a key is forgotten after a moment.
        self.type_until("i", lambda: commands.last and commands.last.linear.x == 0.3 and self.is_held())
        end()
        assert self.process.wait(PATIENCE) == 0
        commands.wait_last(lambda m: m.linear.x == 0, "zero")
        self.dead_man.wait_last(lambda m: not m.data, "a dead-man let go")

    def test_ctrl_c(self) -> None:
        self.ends_at_rest(lambda: self.process.send_signal(signal.SIGINT))

    def test_a_terminal_that_is_closed(self) -> None:
        self.ends_at_rest(lambda: os.close(self.master))

    def test_sigterm(self) -> None:
        self.ends_at_rest(lambda: self.process.terminate())

    def test_a_keyboard_node_that_is_killed_by_the_master(self) -> None:
        self.ends_at_rest(lambda: rosnode.kill_nodes(["/teleop_keyboard"]))

    def test_keys_that_fall_silent(self) -> None:
        commands = Topic("/key_vel", Twist)
        self.addCleanup(commands.close)
        self.start_keyboard()
        self.type_until("u", lambda: commands.last and commands.last.linear.x > 0 and self.is_held())
        commands.wait_last(lambda m: m.linear.x == 0 and m.angular.z == 0, "zero")
        self.dead_man.wait_last(lambda m: not m.data, "a dead-man let go")
        count = len(commands.messages)
        self.type("i")
        commands.wait(lambda m: m.linear.x == 0.3, "motion again", since=count)
        self.type("k")
        commands.wait_last(lambda m: m.linear.x == 0, "a stop")
        self.process.terminate()
        self.process.wait(PATIENCE)

    def test_a_joystick_node_that_is_killed(self) -> None:
        commands = Topic("/joy_vel", Twist)
        joy = Repeated("/joy", Joy, 0.02)  # and the stick is held all the while
        joy.say(lambda: Joy(axes=[0.0, 1.0], buttons=HELD))
        wait_for(lambda: commands.last and commands.last.linear.x == 0.4 and self.is_held(), "a command")
        rosnode.kill_nodes(["/teleop_joy"])
        commands.wait_last(lambda m: m.linear.x == 0, "zero")
        self.dead_man.wait_last(lambda m: not m.data, "a dead-man let go")
        joy.close()
        commands.close()


if __name__ == "__main__":
    rospy.init_node("teleop_test", disable_signals=True)
    rostest.rosrun("kurumaisu", "teleop_test", Teleop, sys.argv)
