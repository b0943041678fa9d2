#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""base_nodes that the test starts: broken parameters, endings, simulated time."""

from __future__ import annotations

import math
import signal
import subprocess
import sys
import unittest
from collections.abc import Callable
from typing import Any

import numpy as np
import rospy
import rostest
from kurumaisu.msg import Voltages
from nav_msgs.msg import Odometry

from kurumaisu.ros.testing.nodes import PATIENCE, Commander, SimulatedClock, Topic, wait_for

PERIOD = 0.02  # [s] of base_node.yaml
FACTOR = 5.0  # simulated seconds per second


def is_neutral(message: Voltages) -> bool:
    zeros = (message.translation, message.steering, message.v, message.w)
    return zeros == (0.0, 0.0, 0.0, 0.0) and message.reference == 2.5


def set_parameters(name: str, changes: dict[str, Any]) -> None:
    """Load what base.launch loads into a node's namespace, with some keys changed; None removes a key."""
    rospy.set_param(name, rospy.get_param("/template"))
    for key, value in changes.items():
        if value is None:
            rospy.delete_param(f"{name}/{key}")
        else:
            rospy.set_param(f"{name}/{key}", value)


def start(name: str, changes: dict[str, Any]) -> subprocess.Popen[str]:
    """Start a base_node of its own, its topics under /NAME."""
    set_parameters(f"/{name}/base_node", changes)
    command = ["rosrun", "kurumaisu", "base_node", f"__ns:=/{name}"]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)


class Alone(unittest.TestCase):
    """base_nodes with other parameters, endings and clocks."""

    def refusal(self, changes: dict[str, Any]) -> str:
        """Return what a base_node says that must not start."""
        process = start("refused", changes)
        try:
            output, _ = process.communicate(timeout=PATIENCE)
        finally:
            process.kill()
            process.wait()
        assert process.returncode == 1, output
        assert "FATAL" in output
        return output

    def test_broken_parameters_stop_it(self) -> None:
        root = "/refused/base_node"
        laws = "model/voltage_laws/published/steering/positive"
        cases: list[tuple[dict[str, Any], str]] = [
            ({"longest_stepp": 0.3}, f"{root}/longest_stepp: is not a known key"),
            ({"limits": [1, 2]}, f"{root}/limits: must be a mapping"),
            ({"inputs/navigation/limits": "fast"}, f"{root}/inputs/navigation/limits: must be one of ride, script"),
            ({"model/voltages/steering/min": 0.1}, f"{root}/model/voltages/steering: neutral, 0 V, must lie inside"),
            ({"model/reference_voltage": 7.0}, f"{root}/model/voltages/reference: reference_voltage 7"),
            ({"model/voltage_law": "publshed"}, f"{root}/model/voltage_law: must be one of"),
            ({f"{laws}/slope": 0.0}, f"{root}/{laws}/slope: must not be 0"),
            ({f"{laws}/intercept": "1e-3"}, f"{root}/{laws}/intercept: must be a number, not 1e-3"),
            ({"rate": None}, f"{root}/rate: is missing"),
            ({"rate": math.nan}, f"{root}/rate: must be finite"),
        ]
        for changes, message in cases:
            assert message in self.refusal(changes)

    def end_while_driving(self, name: str, end: Callable[[subprocess.Popen[str]], Any]) -> None:
        voltages = Topic(f"/{name}/voltages", Voltages)
        commander = Commander(f"/{name}/cmd_vel")
        # A commander that connects late, or gets no turn for so long, would count as one that has let go.
        process = start(name, {"odometry/publish_tf": False, "inputs/navigation/timeout": PATIENCE})
        try:
            commander.say(0.5, 0.3)
            wait_for(lambda: len(voltages.messages) > 50, "voltages")
            assert all(is_neutral(m) for m in voltages.messages)  # commanded from the start: not released
            commander.say(0.0, 0.0)
            voltages.wait(is_neutral, "a zero heard")
            wait_for(lambda: commander.publisher.get_num_connections(), "it listens")
            count = len(voltages.messages)
            wait_for(lambda: len(voltages.messages) > count + 10, "a zero heard")
            commander.say(0.5, 0.3)
            voltages.wait(lambda m: m.v == 0.5, "motion")
            end(process)
            output, _ = process.communicate(timeout=PATIENCE)
            assert process.returncode == 0, output
            assert "voltage law: published" in output
            assert "V_s in (-0.169476, 0.104181) V stands for two rates" in output
            assert "BASE_NOT_RELEASED: navigation" in output
            # What was sent before the process ended has arrived or is lost: nothing comes after neutral.
            wait_for(lambda: is_neutral(voltages.last), "neutral as the last word")
        finally:
            process.kill()
            process.wait()
            commander.close()
            voltages.close()

    def test_neutral_is_the_last_word(self) -> None:
        self.end_while_driving("interrupted", lambda process: process.send_signal(signal.SIGINT))
        self.end_while_driving("terminated", lambda process: process.send_signal(signal.SIGTERM))
        self.end_while_driving("killed", lambda _: subprocess.run(["rosnode", "kill", "/killed/base_node"], check=True))

    def test_simulated_time(self) -> None:
        rospy.set_param("/use_sim_time", True)  # this test's own clock was chosen at its start
        clock = SimulatedClock(start=50.0, factor=FACTOR)
        voltages, odom = Topic("/simulated/voltages", Voltages), Topic("/simulated/odom", Odometry)
        commander = Commander("/simulated/cmd_vel")
        process = start("simulated", {"inputs/navigation/timeout": FACTOR * PATIENCE, "odometry/publish_tf": False})
        try:
            commander.say(0.0, 0.0)
            voltages.wait(is_neutral, "the node")
            wait_for(lambda: odom.last, "its odometry")
            wait_for(lambda: commander.publisher.get_num_connections(), "it listens")
            count = len(voltages.messages)
            wait_for(lambda: len(voltages.messages) > count + 50, "a zero heard")
            commander.say(0.5, 0.0)
            first = voltages.wait(lambda m: m.v == 0.5, "motion").header.stamp
            later = odom.wait(lambda m: (m.header.stamp - first).to_sec() > 20.0, "20 s of motion")
            begun = next(m for m in odom.messages if m.header.stamp == first)
            driven = later.pose.pose.position.x - begun.pose.pose.position.x
            assert abs(driven - 0.5 * (later.header.stamp - first).to_sec()) < 1e-6
            self.check_pace(odom, clock)
            self.check_reset(clock, commander, voltages, odom)
        finally:
            rospy.set_param("/use_sim_time", False)
            process.kill()
            process.wait()
            commander.close()
            clock.close()

    def check_pace(self, odom: Topic, clock: SimulatedClock) -> None:
        """The node is not behind the clock, though it runs fast."""
        target = clock.now + 1.0
        odom.wait(lambda m: m.header.stamp.to_sec() >= target, "the node keeps up")
        stamps = np.array([m.header.stamp.to_sec() for m in odom.messages])
        assert np.median(np.diff(stamps)) < 3 * PERIOD
        assert np.all(np.diff(stamps) > 0)

    def check_reset(self, clock: SimulatedClock, commander: Commander, voltages: Topic, odom: Topic) -> None:
        """Time runs backwards: neutral, and the odometry starts afresh."""
        commander.silence()
        clock.jump(1.0)
        fresh = odom.wait(lambda m: m.header.stamp.to_sec() < 10.0, "odometry after the reset")
        assert fresh.pose.pose.position.x == 0.0
        assert is_neutral(voltages.wait(lambda m: m.header.stamp.to_sec() < 20.0, "voltages"))


if __name__ == "__main__":
    rospy.init_node("base_node_alone_test", disable_signals=True)
    rostest.rosrun("kurumaisu", "base_node_alone_test", Alone, sys.argv)
