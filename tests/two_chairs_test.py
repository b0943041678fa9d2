#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Two chairs at one master: neither hears the other's commands, sums up its diagnostics, or hangs in its frames."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

import rosbag
import rospy
import rostest
import tf2_ros
from diagnostic_msgs.msg import DiagnosticArray
from kurumaisu.msg import Voltages
from sensor_msgs.msg import LaserScan

from kurumaisu.ros.testing.nodes import PATIENCE, Commander, Topic, wait_for

CHAIRS = ("left", "right")


class TwoChairs(unittest.TestCase):
    """What robot.launch has started, twice."""

    def test_each_hangs_in_frames_of_its_own(self) -> None:
        buffer = tf2_ros.Buffer()
        listener = tf2_ros.TransformListener(buffer)
        for chair, other in (CHAIRS, CHAIRS[::-1]):
            scans = Topic(f"/{chair}/scan", LaserScan)
            scan = wait_for(lambda scans=scans: scans.last, f"a scan of {chair}")
            frame = scan.header.frame_id
            assert frame == f"{chair}/laser"
            wait_for(
                lambda frame=frame, chair=chair: buffer.can_transform(f"{chair}/odom", frame, rospy.Time(0)),
                f"{chair}/odom -> {frame}",
            )
            assert not buffer.can_transform(f"{other}/odom", frame, rospy.Time(0))
            scans.close()
        assert not buffer.can_transform("odom", "base_link", rospy.Time(0))
        listener.unregister()

    def test_each_sums_up_its_own_diagnostics(self) -> None:
        for chair, other in (CHAIRS, CHAIRS[::-1]):
            summed = Topic(f"/{chair}/diagnostics_agg", DiagnosticArray)
            for part in ("base", "laser"):
                wait_for(
                    lambda summed=summed, part=part: self.message(summed, f"/chair/{part}") in ("OK", "Warning"),
                    f"{part} of {chair} is known, and not stale",
                )
            names = [status.name for status in summed.last.status]
            assert [name for name in names if other in name or "Other" in name] == []
            assert any(chair in name for name in names)
            summed.close()

    @staticmethod
    def message(summed: Topic, name: str) -> str | None:
        return next((s.message for s in summed.last.status if s.name == name), None) if summed.last else None

    def test_a_command_drives_one_of_them(self) -> None:
        driven, other = (Topic(f"/{chair}/voltages", Voltages) for chair in CHAIRS)
        commander = Commander("/left/cmd_vel")
        commander.say(0.0, 0.0)
        driven.wait(lambda m: m.v == 0.0, "neutral")
        commander.say(0.3, 0.0)
        driven.wait(lambda m: m.v == 0.3, "motion", PATIENCE)
        assert {m.v for m in other.messages} == {0.0}
        commander.say(0.0, 0.0)
        driven.wait(lambda m: m.v == 0.0, "rest")
        commander.close()
        driven.close()
        other.close()

    def test_a_recording_has_what_one_of_a_chair_alone_has(self) -> None:
        with tempfile.TemporaryDirectory() as folder:
            bag = Path(folder) / "drive.bag"
            process = subprocess.Popen(
                ["roslaunch", "kurumaisu", "record.launch", f"bag:={bag}", "compression:=none"],
                env={**os.environ, "ROS_NAMESPACE": "/right"},
            )
            active = Path(f"{bag}.active")
            wait_for(lambda: active.exists() and active.stat().st_size > 300_000, "a recording")
            process.send_signal(signal.SIGINT)
            process.wait(PATIENCE)
            with rosbag.Bag(str(bag)) as recorded:
                topics = set(recorded.get_type_and_topic_info().topics)
                frames = {m.header.frame_id for _, m, _ in recorded.read_messages("scan")}
                names = {s.name for _, m, _ in recorded.read_messages("/diagnostics") for s in m.status}
        assert {"/tf", "/tf_static", "/diagnostics", "scan", "odom", "voltages"} <= topics
        assert frames == {"right/laser"}
        assert names
        assert {name.partition("/")[0] for name in names} == {"right"}


if __name__ == "__main__":
    rospy.init_node("two_chairs_test", disable_signals=True)
    rostest.rosrun("kurumaisu", "two_chairs_test", TwoChairs, sys.argv)
