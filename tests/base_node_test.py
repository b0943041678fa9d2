#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""base_node as base.launch starts it, on the wall clock."""

from __future__ import annotations

import math
import sys
import unittest

import numpy as np
import rospy
import rostest
import tf2_ros
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import Twist
from kurumaisu.msg import Voltages
from nav_msgs.msg import Odometry

from kurumaisu import _core
from kurumaisu.ros.testing import Commander, Topic, wait_for


def is_neutral(message: Voltages) -> bool:
    zeros = (message.translation, message.steering, message.v, message.w)
    return zeros == (0.0, 0.0, 0.0, 0.0) and message.reference == 2.5


def yaw(odom: Odometry) -> float:
    q = odom.pose.pose.orientation
    return 2 * math.atan2(q.z, q.w)


class BaseNode(unittest.TestCase):
    """The base_node that base.launch has started."""

    def setUp(self) -> None:
        self.voltages = Topic("/voltages", Voltages)
        self.odom = Topic("/odom", Odometry)
        self.diagnostics = Topic("/diagnostics", DiagnosticArray)
        self.commander = Commander("/cmd_vel")
        self.voltages.wait(is_neutral, "neutral before the test")
        wait_for(lambda: self.odom.last, "odometry")
        wait_for(lambda: self.commander.publisher.get_num_connections(), "base_node listens")

    def tearDown(self) -> None:
        self.commander.close()
        for topic in (self.voltages, self.odom, self.diagnostics):
            topic.close()

    def value(self, name: str, key: str) -> str | None:
        """Return a value of the diagnostics from the last array that has it."""
        for array in reversed(self.diagnostics.messages):
            for status in array.status:
                if status.name == f"base_node: {name}":
                    return next((v.value for v in status.values if v.key == key), None)
        return None

    def count(self, key: str) -> int:
        return int(wait_for(lambda: self.value("commands", key), f"diagnostics: {key}"))

    def test_command_becomes_voltages(self) -> None:
        self.commander.say(0.5, 0.3)
        message = self.voltages.wait(lambda m: m.v != 0, "an answer to the command")
        assert abs(message.translation - 0.789916) < 1e-12
        assert abs(message.steering + 0.0455823) < 1e-12
        assert (message.v, message.w, message.reference) == (0.5, 0.3, 2.5)

    def test_silence_is_neutral(self) -> None:
        timeouts = self.count("timeouts")
        self.commander.say(0.2, 0.0)
        self.voltages.wait(lambda m: m.v == 0.2, "motion")
        self.commander.silence()
        self.voltages.wait(is_neutral, "neutral")
        last_motion = max(m.header.stamp.to_sec() for m in self.voltages.messages if m.v)
        first_rest = min(
            m.header.stamp.to_sec() for m in self.voltages.messages if not m.v and m.header.stamp.to_sec() > last_motion
        )
        assert first_rest - last_motion < 0.25
        wait_for(lambda: self.count("timeouts") == timeouts + 1, "the timeout is counted")

    def test_nan_is_refused(self) -> None:
        start, here = len(self.voltages.messages), self.odom.last.pose
        for v, w in ((math.nan, 0.3), (0.3, math.inf)):
            refused = self.count("refused commands")
            self.commander.say(v, w)
            wait_for(lambda n=refused: self.count("refused commands") > n + 10, "refusals are counted")
        assert all(is_neutral(m) for m in self.voltages.messages[start:])
        assert self.odom.last.pose == here

    def test_clamps(self) -> None:
        clamped = self.count("clamped commands")
        self.commander.say(-50.0, 50.0)
        message = self.voltages.wait(lambda m: m.v != 0, "motion")
        assert (message.v, message.w) == (-0.8, 1.5)
        wait_for(lambda: self.count("clamped commands") > clamped, "the clamp is counted")

    def test_sideways_is_not_obeyed(self) -> None:
        ignored = self.count("commands with ignored components")
        twist = Twist()
        twist.linear.x, twist.linear.y = 0.1, 0.5
        self.commander.publisher.publish(twist)
        message = self.voltages.wait(lambda m: m.v != 0, "motion")
        assert (message.v, message.w) == (0.1, 0.0)
        wait_for(lambda: self.count("commands with ignored components") == ignored + 1, "it is counted")

    def test_odometry_and_tf_are_what_was_put_out(self) -> None:
        buffer = tf2_ros.Buffer()
        listener = tf2_ros.TransformListener(buffer)
        for v, w in ((0.4, 0.5), (-0.2, -0.9), (0.0, 0.6)):
            self.commander.say(v, w)
            driven = self.voltages.wait(lambda m, v=v: m.v == v, f"motion at {v}").header.stamp
            self.odom.wait(lambda m, driven=driven: (m.header.stamp - driven).to_sec() > 0.4, "a while of motion")
        self.commander.silence()
        rest = self.voltages.wait(is_neutral, "neutral").header.stamp
        self.odom.wait(lambda m: m.header.stamp > rest, "odometry at rest")

        put_out = {m.header.stamp: m for m in list(self.voltages.messages)}
        odom = [m for m in list(self.odom.messages) if m.header.stamp in put_out]
        assert len(odom) > 60
        v = np.array([put_out[m.header.stamp].v for m in odom])[:-1]
        w = np.array([put_out[m.header.stamp].w for m in odom])[:-1]
        dt = np.diff([m.header.stamp.to_sec() for m in odom])
        first, last = odom[0].pose.pose.position, odom[-1].pose.pose.position
        truth = _core.integrate(v, w, dt, (first.x, first.y, yaw(odom[0])))[-1]
        # Stamps are of the system clock, intervals of the steady clock: they differ by microseconds a tick.
        assert abs(last.x - truth[0]) < 0.005
        assert abs(last.y - truth[1]) < 0.005
        assert abs(math.remainder(yaw(odom[-1]) - truth[2], 2 * math.pi)) < 0.01
        assert np.sum(np.abs(v) * dt) > 0.2
        self.check_tf(buffer, odom[-1])
        self.check_covariance(odom)
        listener.unregister()

    def check_tf(self, buffer: tf2_ros.Buffer, odom: Odometry) -> None:
        stamp = odom.header.stamp
        wait_for(lambda: buffer.can_transform("odom", "base_link", stamp), "tf at the odometry's stamp")
        transform = buffer.lookup_transform("odom", "base_link", stamp).transform
        assert abs(transform.translation.x - odom.pose.pose.position.x) < 1e-9
        assert abs(transform.translation.y - odom.pose.pose.position.y) < 1e-9
        assert abs(transform.rotation.z - odom.pose.pose.orientation.z) < 1e-9
        assert (odom.header.frame_id, odom.child_frame_id) == ("odom", "base_link")

    def check_covariance(self, odom: list[Odometry]) -> None:
        before, after = (np.reshape(m.pose.covariance, (6, 6)) for m in (odom[0], odom[-1]))
        assert after[5, 5] > before[5, 5] + 0.01
        assert np.allclose(after, after.T)
        moving = next(m for m in odom if m.twist.twist.angular.z)
        assert moving.twist.covariance[35] > 0.0

    def test_diagnostics_warn_of_the_published_law(self) -> None:
        assert wait_for(lambda: self.value("voltage law", "voltage law"), "the law") == "published"
        assert self.value("voltage law", "ambiguous V_s [V]") == "(-0.169476, 0.104181)"
        status = next(s for s in self.diagnostics.last.status if s.name == "base_node: voltage law")
        assert status.level == 1
        before = int(self.value("voltage law", "ambiguous samples") or 0)
        self.commander.say(0.0, 0.1)
        wait_for(lambda: int(self.value("voltage law", "ambiguous samples") or 0) > before, "samples counted")


if __name__ == "__main__":
    rospy.init_node("base_node_test", disable_signals=True)
    rostest.rosrun("kurumaisu", "base_node_test", BaseNode, sys.argv)
