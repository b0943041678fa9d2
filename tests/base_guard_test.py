#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""base_node, guard and a virtual board: nothing moves but who let go first, nor anything after a kill."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

import rospy
import rostest
from diagnostic_msgs.msg import DiagnosticArray
from kurumaisu.msg import Voltages
from nav_msgs.msg import Odometry

from kurumaisu.bench.guard_rig import Rig
from kurumaisu.bench.processes import program
from kurumaisu.ros.testing.nodes import PATIENCE, Commander, Topic, wait_for

NEUTRAL = 0.002  # [V] more than half a code of the board


def is_neutral(message: Voltages) -> bool:
    at_rest = abs(message.translation) < NEUTRAL and abs(message.steering) < NEUTRAL
    return at_rest and message.v == 0.0 and message.w == 0.0


class Guarded(unittest.TestCase):
    """The whole chain, with kills."""

    def setUp(self) -> None:
        folder = self.enterContext(tempfile.TemporaryDirectory())
        self.rig = Rig(Path(folder))
        self.enterContext(self.rig.board())
        self.rig.start()
        rospy.set_param("/guarded/base_node", rospy.get_param("/template"))
        rospy.set_param("/guarded/base_node/dac/kind", "guard")
        rospy.set_param("/guarded/base_node/guard/socket", str(self.rig.socket))
        self.voltages = Topic("/guarded/voltages", Voltages)
        self.odom = Topic("/guarded/odom", Odometry)
        self.diagnostics = Topic("/diagnostics", DiagnosticArray)
        self.commander = Commander("/guarded/cmd_vel")
        self.node: subprocess.Popen[bytes] | None = None
        self.addCleanup(self.clean)

    def clean(self) -> None:
        if self.node:
            self.node.kill()
            self.node.wait()
        self.commander.close()

    def start_node(self) -> None:
        self.node = subprocess.Popen([program("base_node"), "__ns:=/guarded"])

    def wait_said(self, words: str) -> None:
        """Wait until diagnostics say so of the guard."""
        said = lambda array: any(s.name.endswith("guard") and words in s.message for s in array.status)  # noqa: E731
        self.diagnostics.wait(said, words)

    def drive(self) -> Voltages:
        self.commander.say(0.0, 0.0)
        self.wait_said("armed")
        self.commander.say(0.5, 0.3)
        return self.voltages.wait(lambda m: m.v > 0.45 and m.w > 0.25, "motion")

    def stays_neutral(self, count: int) -> None:
        begin = len(self.voltages.messages)
        wait_for(lambda: len(self.voltages.messages) >= begin + count, "samples")
        assert all(is_neutral(m) for m in self.voltages.messages[begin:])

    def test_the_chain(self) -> None:
        self.commander.say(0.5, 0.3)  # somebody holds the stick while it starts
        self.start_node()
        self.voltages.wait(lambda _: True, "voltages")
        self.stays_neutral(60)
        moving = self.drive()
        assert not self.rig.changes()[-1].neutral
        assert abs(moving.translation - (1.32402 * moving.v + 0.127906)) < 1e-6
        self.kill_the_guard()
        self.drive()
        assert self.node
        self.node.send_signal(signal.SIGKILL)
        assert self.rig.neutral(PATIENCE) is not None
        self.node.wait()
        self.commander.say(0.0, 0.0)
        self.start_node()
        self.drive()
        self.node.send_signal(signal.SIGTERM)
        assert self.node.wait(PATIENCE) == 0
        assert self.rig.neutral(PATIENCE) is not None

    def kill_the_guard(self) -> None:
        """The stick is held throughout: nothing moves until it is let go, and odometry knows."""
        os.kill(self.rig.guard(), signal.SIGKILL)
        assert self.rig.neutral(PATIENCE) is not None
        self.voltages.wait(is_neutral, "voltages that say so")
        self.stays_neutral(60)
        self.wait_said("tripped")
        here = self.odom.last.pose.pose.position.x
        self.stays_neutral(10)
        assert self.odom.last.pose.pose.position.x == here


if __name__ == "__main__":
    rospy.init_node("base_guard_test", disable_signals=True)
    rostest.rosrun("kurumaisu", "base_guard_test", Guarded, sys.argv)
