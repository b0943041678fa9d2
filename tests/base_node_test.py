#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""base_node as base.launch starts it, on the wall clock."""

from __future__ import annotations

import math
import signal
import subprocess
import sys
import unittest
from typing import Any

import numpy as np
import rospy
import rostest
import tf2_ros
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from dynamic_reconfigure.client import Client
from geometry_msgs.msg import Twist, TwistStamped
from kurumaisu.msg import Voltages
from nav_msgs.msg import Odometry
from std_msgs.msg import Bool, Float64, String
from std_srvs.srv import Trigger

from kurumaisu import _core
from kurumaisu.ros.rotation import yaw_of
from kurumaisu.ros.testing.nodes import Commander, Topic, unexplained, wait_for


def is_neutral(message: Voltages) -> bool:
    zeros = (message.translation, message.steering, message.v, message.w)
    return zeros == (0.0, 0.0, 0.0, 0.0) and message.reference == 2.5


class BaseNode(unittest.TestCase):
    """The base_node that base.launch has started."""

    def setUp(self) -> None:
        self.voltages = Topic("/voltages", Voltages)
        self.odom = Topic("/odom", Odometry)
        self.diagnostics = Topic("/diagnostics", DiagnosticArray)
        self.commander = Commander("/cmd_vel")
        neutral = self.voltages.wait(is_neutral, "neutral before the test")
        # Odometry follows by a tick, and comes on another topic.
        after = neutral.header.stamp + rospy.Duration.from_sec(0.1)
        self.odom.wait(lambda m: m.header.stamp > after, "odometry at rest")
        wait_for(lambda: self.commander.publisher.get_num_connections(), "base_node listens")

    def tearDown(self) -> None:
        self.commander.close()
        for topic in (self.voltages, self.odom, self.diagnostics):
            topic.close()

    def status(self, name: str) -> DiagnosticStatus:
        """Return what diagnostics say from now on: what is under way may be of before."""
        begin, full = rospy.Time.now(), f"base_node: {name}"

        def found(array: DiagnosticArray) -> bool:
            return array.header.stamp >= begin and any(s.name == full for s in array.status)

        array = self.diagnostics.wait(found, f"diagnostics: {name}")
        return next(s for s in array.status if s.name == full)

    def value(self, name: str, key: str) -> str:
        """Return a value of the diagnostics from now on."""
        return next(v.value for v in self.status(name).values if v.key == key)

    def count(self, key: str) -> int:
        return int(self.value("commands", key))

    def test_help_names_all_that_the_node_has(self) -> None:
        assert unexplained("/base_node", "base_node") == set()

    def test_command_becomes_voltages(self) -> None:
        self.commander.say(0.5, 0.3)
        message = self.voltages.wait(lambda m: (m.v, m.w) == (0.5, 0.3), "the command put out")
        assert abs(message.translation - 0.789916) < 1e-12
        assert abs(message.steering + 0.0455823) < 1e-12
        assert (message.v, message.w, message.reference) == (0.5, 0.3, 2.5)

    def test_silence_is_neutral(self) -> None:
        timeouts = self.count("timeouts")
        self.commander.say(0.6, 0.0)
        self.voltages.wait(lambda m: m.v == 0.6, "motion")
        self.commander.silence()
        silent = rospy.get_time()
        rest = self.voltages.wait(is_neutral, "neutral").header.stamp.to_sec()
        after = [m for m in self.voltages.messages if silent <= m.header.stamp.to_sec() <= rest]
        gaps = np.diff([silent, *(m.header.stamp.to_sec() for m in after)])
        late = np.maximum(gaps - 0.02, 0.0).sum()  # by the node's own stamps: turns that a busy machine gave it late
        assert rest - silent - late < 0.25 + 0.6 / 1.2 + 0.1  # timeout, v / deceleration, and two ticks late
        assert max(-np.diff([m.v for m in after])) < 1.2 * 0.1 + 1e-9  # a ramp, a tick of 0.1 s at most
        counted = self.count("timeouts")
        assert counted > timeouts
        assert self.count("timeouts") == counted  # once, not in every tick

    def test_nan_is_refused(self) -> None:
        start, here = len(self.voltages.messages), self.odom.last.pose
        for v, w in ((math.nan, 0.3), (0.3, math.inf), (-50.0, 0.1)):
            refused = self.count("refused commands")
            self.commander.say(v, w)
            wait_for(lambda n=refused: self.count("refused commands") > n + 10, "refusals are counted")
        self.commander.silence()
        assert all(is_neutral(m) for m in self.voltages.messages[start:])
        assert self.odom.last.pose == here

    def test_clamps(self) -> None:
        clamped = self.count("clamped commands")
        self.commander.say(-5.0, 1.0)
        self.voltages.wait(lambda m: (m.v, m.w) == (-0.8, 1.0), "what the limits let pass")
        self.commander.say(0.0, 5.0)
        self.voltages.wait(lambda m: (m.v, m.w) == (0.0, 1.5), "what the limits let pass")
        assert all(abs(m.v * m.w) <= 1.0 + 1e-9 for m in self.voltages.messages)
        wait_for(lambda: self.count("clamped commands") > clamped, "the clamp is counted")

    def test_sideways_is_not_obeyed(self) -> None:
        ignored = self.count("commands with ignored components")
        twist = Twist()
        twist.linear.x, twist.linear.y = 0.1, 0.5
        self.commander.repeat(twist)
        message = self.voltages.wait(lambda m: m.v == 0.1, "motion")
        assert message.w == 0.0
        wait_for(lambda: self.count("commands with ignored components") > ignored, "it is counted")

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
        assert len(odom) > 30
        v = np.array([put_out[m.header.stamp].v for m in odom])[:-1]
        w = np.array([put_out[m.header.stamp].w for m in odom])[:-1]
        dt = np.diff([m.header.stamp.to_sec() for m in odom])
        first, last = odom[0].pose.pose.position, odom[-1].pose.pose.position
        truth = _core.integrate(v, w, dt, (first.x, first.y, yaw_of(odom[0].pose.pose.orientation)))[-1]
        # Stamps are of the system clock, intervals of the steady clock: they differ by microseconds a tick.
        assert abs(last.x - truth[0]) < 0.005
        assert abs(last.y - truth[1]) < 0.005
        assert abs(math.remainder(yaw_of(odom[-1].pose.pose.orientation) - truth[2], 2 * math.pi)) < 0.01
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
        status = self.status("voltage law")
        values = {item.key: item.value for item in status.values}
        assert values["voltage law"] == "published"
        assert values["ambiguous V_s [V]"] == "(-0.169476, 0.104181)"
        assert status.level == 1
        self.commander.say(0.0, 0.1)
        before = int(values["ambiguous samples"])
        wait_for(lambda: int(self.value("voltage law", "ambiguous samples")) > before, "samples counted")

    def heard(self, topic: Topic, data: Any) -> None:
        topic.wait_last(lambda m: m.data == data, f"{data!r} on its topic")  # told when it changes, and once

    def test_who_has_the_higher_priority_drives(self) -> None:
        active, survived = Topic("/active_input", String), Topic("/cmd_vel_out", TwistStamped)
        self.commander.say(0.2, 0.0)
        self.heard(active, "navigation")
        survived.wait(lambda m: m.twist.linear.x == 0.2, "what survived")
        hand = Commander("/joy_vel")
        hand.say(-0.1, 0.0)
        self.heard(active, "joystick")
        survived.wait(lambda m: m.twist.linear.x == -0.1, "what survived")
        hand.close()
        self.heard(active, "navigation")
        survived.wait(lambda m: m.twist.linear.x == 0.2, "what survived")
        assert survived.last.header.frame_id == "base_link"
        self.commander.silence()
        self.heard(active, "")

    def test_a_second_publisher_brakes(self) -> None:
        self.commander.say(0.3, 0.0)
        self.voltages.wait(lambda m: m.v == 0.3, "motion")
        conflicts = self.count("conflicts")
        command = ["rostopic", "pub", "-r", "20", "/cmd_vel", "geometry_msgs/Twist", "{linear: {x: 0.3}}"]
        with subprocess.Popen(command, stdout=subprocess.DEVNULL) as other:
            try:
                self.voltages.wait(is_neutral, "rest")
                wait_for(lambda: self.count("conflicts") > conflicts, "it is counted")
                told = lambda: self.value("commands", "state").startswith("several publishers: navigation")  # noqa: E731
                wait_for(told, "it is told")
            finally:
                other.send_signal(signal.SIGINT)
        self.voltages.wait(lambda m: m.v == 0.3, "motion, when it is alone again")

    def test_locks_and_caps(self) -> None:
        hold = rospy.Publisher("/hold", Bool, queue_size=1, latch=True)
        self.commander.say(0.4, 0.0)
        self.voltages.wait(lambda m: m.v == 0.4, "motion")
        hold.publish(True)
        self.voltages.wait(is_neutral, "rest")
        hold.publish(False)
        self.voltages.wait(lambda m: m.v == 0.4, "motion")
        cap = rospy.Publisher("/speed_cap", Float64, queue_size=1)

        def capped() -> bool:
            cap.publish(0.15)
            return self.voltages.last.v == 0.15

        wait_for(capped, "a slower chair")
        self.voltages.wait(lambda m: m.v == 0.4, "the cap forgotten")
        hold.unregister()

    def test_an_emergency_stop_needs_a_reset(self) -> None:
        stop = rospy.Publisher("/e_stop", Bool, queue_size=1)
        wait_for(stop.get_num_connections, "it listens")
        reset = rospy.ServiceProxy("/base_node/reset", Trigger)
        self.commander.say(0.5, 0.3)
        self.voltages.wait(lambda m: m.v == 0.5, "motion")
        stop.publish(True)
        self.voltages.wait(is_neutral, "rest")
        before = next(m for m in reversed(self.voltages.messages) if not is_neutral(m))
        assert before.v == 0.5  # at once, without a ramp
        assert "still pressed" in reset().message
        stop.publish(False)
        wait_for(lambda: "release the input first" in reset().message, "the cause is gone, the command is not")
        assert is_neutral(self.voltages.last)
        self.commander.say(0.0, 0.0)
        wait_for(lambda: reset().success, "a reset")
        wait_for(lambda: self.value("commands", "state") == "driving: navigation", "released by its zeros")
        self.commander.say(0.5, 0.3)
        self.voltages.wait(lambda m: m.v == 0.5, "motion")
        assert rospy.ServiceProxy("/base_node/e_stop", Trigger)().success
        self.voltages.wait(is_neutral, "rest")
        self.commander.silence()
        wait_for(lambda: reset().success, "a reset")

    def test_limits_change_while_it_drives(self) -> None:
        client = Client("/base_node/limits/ride", timeout=20)
        shipped = client.get_configuration()
        self.commander.say(0.6, 0.0)
        self.voltages.wait(lambda m: m.v == 0.6, "motion")
        start = len(self.voltages.messages)
        assert client.update_configuration({"v_forward": 0.25, "v_deceleration": 0.5})["v_forward"] == 0.25
        self.voltages.wait(lambda m: m.v == 0.25, "the new limit")
        v = [m.v for m in self.voltages.messages[start:]]
        assert max(-np.diff(v)) < 0.5 * 0.1 + 1e-9
        assert client.update_configuration({"v_jerk": math.nan})["v_jerk"] == shipped["v_jerk"]
        assert client.update_configuration({"v_jerk": -1.0})["v_jerk"] > 0
        assert client.update_configuration({"v_deceleration": 0.0})["v_deceleration"] == 0.2  # it must brake
        client.update_configuration(shipped)
        self.voltages.wait(lambda m: m.v == 0.6, "the old limit")
        client.close()


if __name__ == "__main__":
    rospy.init_node("base_node_test", disable_signals=True)
    rostest.rosrun("kurumaisu", "base_node_test", BaseNode, sys.argv)
