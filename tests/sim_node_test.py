#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""sim_node over ROS: clock, arc, scan, static transform, reset, and bad configurations."""

import math
import subprocess
import sys
import time
import unittest
from pathlib import Path

import numpy as np
import pytest
import rospy
import tf2_ros
from kurumaisu.msg import Voltages
from kurumaisu.srv import Speed
from nav_msgs.msg import Odometry
from rosgraph_msgs.msg import Clock, Log
from sensor_msgs.msg import LaserScan
from std_msgs.msg import Header
from std_srvs.srv import Empty, SetBool

from kurumaisu.params import load_model
from kurumaisu.ros.testing.nodes import PATIENCE, Topic, pose_of, unexplained, wait_for

STEP = rospy.Duration(0, 10_000_000)


class BadConfiguration:
    """Tests that run another node, with bad parameters."""

    def start(self, **changes):
        """Run a second node with the first one's parameters, changed; return its exit code and what it said."""
        values = rospy.get_param("/sim_node")
        for key, value in changes.items():
            values[key] = value
            if value is None:
                del values[key]
        name = f"bad_{self.id().rsplit('.', 1)[-1]}"
        rospy.set_param(f"/{name}", values)
        # Not rosrun: in a workspace it finds scripts several times and asks which.
        node = [sys.executable, "-c", "import sys; from kurumaisu.ros.sim.node import main; sys.exit(main())"]
        command = [*node, f"__name:={name}", "/clock:=/bad_clock", "scan:=bad_scan"]
        done = subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE, check=False)
        return done.returncode, done.stdout + done.stderr

    def refused(self, message, **changes):
        code, said = self.start(**changes)
        assert code == 1, said
        assert message in said
        assert "Traceback" not in said

    def test_bad_world_file(self):
        path = Path(self.id() + ".world").absolute()
        path.write_text("model\n(\n  size [1, 1]\n)\n")
        try:
            self.refused(f"{path}:3:10: ',' is not allowed", world=str(path))
        finally:
            path.unlink()

    def test_bad_effects_file(self):
        path = Path(self.id() + ".yaml").absolute()
        path.write_text("effects: [{id: laser.offset, parameters: {offset: 9.0}}]")
        try:
            self.refused("laser.offset: offset must be -0.5 to 0.5 m: 9", effects=str(path))
        finally:
            path.unlink()

    def test_unknown_key(self):
        self.refused("spede: is not a known key", spede=1.0)

    def test_missing_key(self):
        self.refused("seed: is missing", seed=None)

    def test_rate_that_does_not_divide(self):
        self.refused("clock_rate: must divide 1 / physics.step = 100 Hz: 30", clock_rate=30.0)


class SimNodeTest(BadConfiguration, unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.model = load_model(Path(rospy.get_param("~model")))
        cls.clock = Topic("/clock", Clock)
        cls.truth = Topic("ground_truth", Odometry)
        cls.scan = Topic("scan", LaserScan)
        cls.voltages = rospy.Publisher("voltages", Voltages, queue_size=10)
        wait_for(lambda: cls.voltages.get_num_connections(), "sim_node listens to voltages")

    def send(self, stamp, v, w):
        message = Voltages(
            translation=float(self.model.translation.volts(v)),
            steering=float(self.model.steering.volts(w)),
            reference=self.model.reference_voltage,
            v=v,
            w=w,
        )
        message.header.stamp = stamp
        self.voltages.publish(message)

    def reset(self):
        """Return a stamp after a reset, by the node's own word: what is heard may be of before."""
        for name in ("reset", "pause"):
            rospy.wait_for_service(name, PATIENCE)
        rospy.ServiceProxy("reset", Empty)()
        said = rospy.ServiceProxy("pause", SetBool)(False).message  # at 12.340 s
        return rospy.Time.from_sec(float(said.split()[1]))

    def test_help_names_all_that_the_node_has(self):
        assert unexplained("/sim_node", "sim_node") == set()

    def test_clock_advances_step_by_step(self):
        first = self.clock.wait(lambda _: True, "the clock")
        self.clock.wait(lambda m: m.clock >= first.clock + rospy.Duration(2), "2 s later")
        stamps = np.array([m.clock.to_nsec() for m in self.clock.messages])
        np.testing.assert_array_less(0, np.diff(stamps) + 1)
        assert int(np.median(np.diff(stamps))) == STEP.to_nsec()
        assert rospy.get_param("/use_sim_time")

    def test_voltages_drive_the_arc_of_equation_3(self):
        start = self.reset() + rospy.Duration(4)  # a second of the wall's, for the voltages to come in time
        v, w, seconds = 0.4, -0.6, 2
        self.send(start, v, w)
        self.send(start + rospy.Duration(seconds), 0.0, 0.0)
        moving = self.truth.wait(lambda m: m.header.stamp > start + rospy.Duration(1), "the truth on the arc")
        assert moving.twist.twist.linear.x == pytest.approx(v, abs=1e-9)
        assert moving.twist.twist.angular.z == pytest.approx(w, abs=1e-9)
        assert (moving.header.frame_id, moving.child_frame_id) == ("map", "base_link")
        rest = self.truth.wait(lambda m: m.header.stamp > start + rospy.Duration(seconds + 1), "the truth at rest")
        turned = w * seconds
        expected = [1.5 + v / w * math.sin(turned), 2.0 + v / w * (1 - math.cos(turned)), turned]
        np.testing.assert_allclose(pose_of(rest), expected, atol=1e-9)

    def test_voltages_that_make_no_sense_are_refused_and_the_next_good_ones_used(self):
        said = Topic("/rosout", Log)
        wait_for(lambda: said.is_published, "rosout")
        start = self.reset() + rospy.Duration(4)
        for volts in (1e308, -1e30, math.nan):
            self.voltages.publish(Voltages(Header(stamp=start), volts, 0.0, 2.5, 0.0, 0.0))
        self.voltages.publish(Voltages(Header(stamp=rospy.Time(4294967295)), 0.0, 0.0, 2.5, 0.0, 0.0))
        self.send(start, 0.2, 0.0)
        moving = self.truth.wait(lambda m: m.header.stamp > start + rospy.Duration(1), "the truth after them")
        assert moving.twist.twist.linear.x == pytest.approx(0.2, abs=1e-9)
        said.wait(lambda m: "SIM_VOLTAGES_DROPPED /voltages: refused, 1 so far: translation: " in m.msg, "why", since=0)
        said.close()

    def test_a_slow_speed_can_be_undone(self):
        speed = rospy.ServiceProxy("speed", Speed)
        rospy.wait_for_service("speed", PATIENCE)
        assert not speed(1e-300).success
        assert "speed (0: as fast as possible): must be" in speed(math.nan).message
        assert speed(1e-6).success
        begin = time.monotonic()
        assert speed(4.0).success
        assert time.monotonic() - begin < 5
        last = self.clock.wait(lambda _: True, "the clock").clock
        self.clock.wait(lambda m: m.clock > last + rospy.Duration(1), "time to go on")

    def test_silence_holds_the_last_voltages(self):
        start = self.reset() + rospy.Duration(0, 500_000_000)
        self.send(start, 0.1, 0.0)
        later = self.truth.wait(lambda m: m.header.stamp > start + rospy.Duration(3), "the truth 3 s later")
        assert later.twist.twist.linear.x == pytest.approx(0.1, abs=1e-9)

    def test_reset_brings_back_the_start_while_the_clock_runs_on(self):
        start = self.reset()
        self.send(start, 0.3, 0.0)
        moved = self.truth.wait(lambda m: m.header.stamp > start and pose_of(m)[0] > 1.7, "the chair has moved")
        after = self.reset()
        assert after > moved.header.stamp
        again = self.truth.wait(lambda m: m.header.stamp > after, "the truth after the reset")
        np.testing.assert_allclose(pose_of(again), [1.5, 2.0, 0.0], atol=1e-9)

    def test_scan_at_the_start(self):
        after = self.reset()
        scan = self.scan.wait(lambda m: m.header.stamp > after, "a scan after the reset")
        laser = self.model.laser
        assert len(scan.ranges) == 682
        assert scan.header.frame_id == "laser"
        assert scan.time_increment == pytest.approx(0.1 / 1024, abs=1e-9)
        assert scan.scan_time == pytest.approx(0.1, abs=1e-6)
        assert scan.angle_min == pytest.approx(laser.angle_min, abs=1e-6)
        assert scan.angle_max == pytest.approx(laser.bearings[-1], abs=1e-5)
        assert (round(scan.range_min, 6), scan.range_max) == (0.06, 4.0)
        self.scan.wait(lambda m: m.header.stamp > after + rospy.Duration(1), "ten scans")
        bearings, ranges = laser.bearings, np.array([m.ranges for m in self.scan.messages if m.header.stamp > after])
        # The laser stands at (1.8, 2.0), looking east: the east wall is out of reach, these two are not.
        assert np.isinf(ranges[:, np.abs(bearings) < 0.1]).all()
        for side, distance in ((1, 3.0), (-1, 2.0)):
            beams = np.abs(bearings - side * math.pi / 2) < 0.12  # beyond it the bed is in the way
            truth = distance / np.abs(np.sin(bearings[beams]))
            mean = 1.004587 * truth + 0.058826
            sigma = 0.000199 * truth**2 - 0.000488 * truth + 0.002334
            assert (np.abs(ranges[:, beams] - mean) < 5 * sigma + 0.001).all()
            assert np.std((ranges[:, beams] - mean) / sigma) == pytest.approx(1.0, abs=0.15)

    def test_scans_and_truth_share_stamps(self):
        scan = self.scan.wait(lambda m: m.header.stamp > rospy.Time(2), "a scan")
        # Not wait: the truth at the first beam comes before the scan, which ends with the last.
        wait_for(lambda: any(m.header.stamp == scan.header.stamp for m in self.truth.messages), "the scan's truth")

    def test_the_laser_is_where_the_model_says(self):
        buffer = tf2_ros.Buffer()
        tf2_ros.TransformListener(buffer)
        found = buffer.lookup_transform("base_link", "laser", rospy.Time(0), rospy.Duration(100)).transform
        assert (found.translation.x, found.translation.y, found.translation.z) == (0.3, 0.0, 0.4)

    def test_robot_description_names_the_laser(self):
        assert '<child link="laser"' in rospy.get_param("robot_description")


if __name__ == "__main__":
    import rostest

    rospy.init_node("sim_node_test")
    rostest.rosrun("kurumaisu", "sim_node_test", SimNodeTest, sys.argv)
