#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""sim_node in a world that moves: services, collisions, others in the scan, further sensors."""

import math
import sys
import tempfile
import unittest
import uuid
from pathlib import Path

import numpy as np
import pytest
import rospy
import tf2_ros
from geometry_msgs.msg import Pose, Twist
from kurumaisu.msg import Voltages
from kurumaisu.srv import Seed, SetPose, StateFile
from nav_msgs.msg import Odometry
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import BatteryState, CameraInfo, Image, Imu, LaserScan, Range
from std_msgs.msg import Bool
from std_srvs.srv import Empty, SetBool, Trigger
from tf2_msgs.msg import TFMessage

from kurumaisu.params import load_model
from kurumaisu.ros.rotation import quaternion_of
from kurumaisu.ros.testing.nodes import PATIENCE, Topic, pose_of, wait_for

SERVICES = {
    "reset": Empty,
    "pause": SetBool,
    "step": Trigger,
    "set_pose": SetPose,
    "seed": Seed,
    "save": StateFile,
    "load": StateFile,
}
SENSORS = {
    "imu": Imu,
    "battery": BatteryState,
    "sonar": Range,
    "bumper": Range,
    "fiducial": TFMessage,
    "camera/image": Image,
    "camera/depth": Image,
    "camera/camera_info": CameraInfo,
}


def pose(x, y, yaw):
    message = Pose(orientation=quaternion_of(yaw))
    message.position.x, message.position.y = x, y
    return message


class SimWorldTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.model = load_model(Path(rospy.get_param("~model")))
        for name in SERVICES:
            rospy.wait_for_service(name, PATIENCE)
        cls.call = {name: rospy.ServiceProxy(name, kind) for name, kind in SERVICES.items()}
        cls.clock, cls.truth = Topic("/clock", Clock), Topic("ground_truth", Odometry)
        cls.scan, cls.collision = Topic("scan", LaserScan), Topic("collision", Bool)
        cls.voltages = rospy.Publisher("voltages", Voltages, queue_size=10)
        cls.other = rospy.Publisher("other_robot/cmd_vel", Twist, queue_size=10)
        wait_for(lambda: cls.clock.last and cls.truth.last and cls.scan.last, "clock, ground_truth and scan")
        wait_for(lambda: cls.voltages.get_num_connections() and cls.other.get_num_connections(), "sim_node listens")

    def setUp(self):
        self.call["reset"]()
        self.begin = self.time_of(self.done("pause", False))

    def tearDown(self):
        self.call["pause"](False)
        stamps = [m.clock.to_nsec() for m in self.clock.messages]
        assert sorted(stamps) == stamps, "the clock has jumped back"

    def drive(self, v):
        message = Voltages(
            translation=float(self.model.translation.volts(v)), reference=self.model.reference_voltage, v=v
        )
        message.header.stamp = self.clock.last.clock
        self.voltages.publish(message)

    def done(self, name, *values):
        answer = self.call[name](*values)
        assert answer.success, answer.message
        return answer.message

    @staticmethod
    def time_of(said):
        """Return the time of a service's answer, at 1.230 s, which it gives to a millisecond."""
        return rospy.Time.from_sec(float(said.split()[1]) + 0.001)

    def truth_after(self, time):
        """Return the first truth after a time: what is heard next may be of before."""
        return self.truth.wait(lambda m: m.header.stamp > time, "the truth", since=0)

    def test_it_starts_where_the_launch_file_says(self):
        np.testing.assert_allclose(pose_of(self.truth_after(self.begin)), [0.5, 0.0, 0.0], atol=1e-9)

    def test_a_pause_holds_the_clock_and_steps_are_single(self):
        answer = self.call["step"]()
        assert not answer.success
        assert "only while paused" in answer.message
        at = [float(self.done("pause", True).split()[1])]
        for _ in range(3):
            at.append(float(self.done("step").split()[1]))
        np.testing.assert_allclose(np.diff(at), [0.01] * 3, atol=1e-9)
        wait_for(lambda: self.clock.last.clock.to_sec() >= at[-1] - 1e-6, "the last step's time")
        assert self.clock.last.clock.to_sec() == pytest.approx(at[-1], abs=1e-6)
        count = len(self.clock.messages)
        self.done("pause", False)
        wait_for(lambda: len(self.clock.messages) > count + 10, "the clock to run on")

    def test_services_are_served_during_a_pause(self):
        self.done("pause", True)
        self.done("set_pose", "chair", pose(0.0, 1.0, 0.5))
        self.done("step")
        self.call["reset"]()
        time = self.time_of(self.done("pause", False))
        np.testing.assert_allclose(pose_of(self.truth_after(time)), [0.5, 0.0, 0.0], atol=1e-9)

    def test_a_step_does_not_wait_long_for_voltages_that_do_not_come(self):
        self.drive(0.2)
        self.done("pause", True)
        for _ in range(30):  # three times voltage_lead
            self.done("step")
        self.done("pause", False)
        self.truth.wait(lambda m: m.twist.twist.linear.x > 0.1, "the voltages are held")

    def test_set_pose(self):
        time = self.time_of(self.done("set_pose", "chair", pose(1.0, 2.0, 1.0)))
        np.testing.assert_allclose(pose_of(self.truth_after(time)), [1.0, 2.0, 1.0], atol=1e-9)
        for name, where, why in (("nobody", pose(0, 0, 0), "nobody"), ("chair", pose(-3, 0, 0), "does not fit")):
            answer = self.call["set_pose"](name, where)
            assert not answer.success
            assert why in answer.message

    def test_save_and_load(self):
        self.drive(0.4)
        self.truth.wait(lambda m: pose_of(m)[0] > 0.7, "the chair to move")
        name = f"test-{uuid.uuid4().hex}"
        self.done("pause", True)
        told = self.done("save", name)
        file = Path(told.split(": ", 1)[1])
        self.addCleanup(file.unlink)
        saved = self.simulated_pose(told)
        self.done("pause", False)
        moved = self.truth.wait(lambda m: pose_of(m)[0] > saved[0] + 0.3, "the chair to move on")
        self.done("pause", True)
        loaded = self.done("load", name)
        assert self.time_of(loaded) > moved.header.stamp
        again = self.simulated_pose(loaded)
        self.done("pause", False)
        # the truth is told within five steps after each of the two, one of them perhaps of before the pause
        np.testing.assert_allclose(again, saved, atol=0.0201)  # five steps of 0.4 m/s
        assert file.name == name
        file.write_bytes(file.read_bytes()[:-9])
        assert "is damaged or cut" in self.call["load"](name).message
        assert "No such file" in self.call["load"](name + "-none").message

    def test_states_are_in_one_folder(self):
        with tempfile.TemporaryDirectory() as folder:
            victim = Path(folder, "notes.txt")
            victim.write_text("not a state")
            for service in ("save", "load"):
                for name in (str(victim), "../../etc/passwd", "", "."):
                    answer = self.call[service](name)
                    assert not answer.success
                    assert "the folder of saved states" in answer.message
            assert victim.read_text() == "not a state"

    def simulated_pose(self, said):
        """Step on from a pause, in which a service was asked, until the truth is told; return it."""
        for _ in range(5):  # ground_truth_rate
            self.done("step")
        return pose_of(self.truth_after(self.time_of(said)))

    def test_seed(self):
        scans = []
        for seed in (3, 3, 4):
            self.done("pause", True)
            time = rospy.Time.from_sec(self.time_of(self.done("seed", seed)).to_sec() - 0.002)
            for _ in range(10):
                self.done("step")
            scan = self.scan.wait(lambda m, time=time: m.header.stamp > time, "a scan of the seed", since=0)
            scans.append(np.array(scan.ranges))
            self.done("pause", False)
        np.testing.assert_array_equal(scans[0], scans[1])
        assert not np.array_equal(scans[0], scans[2])

    def test_pushing_is_a_collision(self):
        self.collision.wait_last(lambda m: not m.data, "no collision")
        begin = len(self.collision.messages)
        self.done("set_pose", "box", pose(1.6, 0.0, 0.0))
        self.drive(0.5)
        self.truth.wait(lambda m: pose_of(m)[0] > 1.0, "the chair to push")
        self.collision.wait(lambda m: m.data, "a collision", since=begin)
        self.done("set_pose", "wall", pose(3.0, 0.0, 0.0))
        self.collision.wait(lambda m: m.data, "the box to be stopped by the wall")
        self.truth.wait(lambda m: abs(m.twist.twist.linear.x) < 0.01, "the chair to be stopped")

    def test_somebody_who_passes_is_seen_passing(self):
        twist = Twist()
        twist.linear.x = 0.5
        self.other.publish(twist)
        bearings, time = [], self.begin
        for _ in range(200):  # 20 s; the way takes 6
            scan = self.scan.wait(lambda m, time=time: m.header.stamp > time, "a scan", since=0)
            time, ranges = scan.header.stamp, np.array(scan.ranges)
            ahead = self.model.laser.bearings[np.isfinite(ranges) & (np.abs(self.model.laser.bearings) < 1.2)]
            bearings.append(float(ahead.mean()))
            if bearings[-1] > 0.5:
                break
        assert bearings[0] < -0.5
        assert bearings[-1] > 0.5
        assert np.median(np.diff(bearings)) > 0
        assert np.sum(np.diff(bearings) < -0.02) == 0

    def test_further_sensors(self):
        topics = {name: Topic(name, kind) for name, kind in SENSORS.items()}
        self.done("set_pose", "chair", pose(0.0, 0.0, math.pi))
        wait_for(lambda: all(topic.last for topic in topics.values()), "all sensors")
        assert topics["imu"].last.linear_acceleration.z == pytest.approx(9.8, abs=0.5)
        assert topics["imu"].last.orientation_covariance[0] == -1
        assert topics["battery"].last.percentage == pytest.approx(1.0, abs=0.01)
        assert topics["bumper"].last.range == math.inf
        mark = topics["fiducial"].wait(lambda m: m.transforms, "the mark on the wall").transforms[0]
        assert (mark.header.frame_id, mark.child_frame_id) == ("fiducial", "mark_7")
        assert mark.transform.translation.x == pytest.approx(3.0 - 0.3, abs=1e-6)
        picture, info = topics["camera/image"].last, topics["camera/camera_info"].last
        assert (picture.width, picture.height, picture.encoding) == (info.width, info.height, "rgba8")
        assert len(topics["camera/depth"].last.data) == 4 * info.width * info.height
        buffer = tf2_ros.Buffer()
        tf2_ros.TransformListener(buffer)
        for frame in ("imu", "sonar_0", "sonar_1", "bumper_1", "fiducial", "laser"):
            buffer.lookup_transform("base_link", frame, rospy.Time(0), rospy.Duration(100))
        optical = buffer.lookup_transform("base_link", "camera", rospy.Time(0), rospy.Duration(100)).transform.rotation
        x, y, z, w = optical.x, optical.y, optical.z, optical.w
        ahead = np.array([2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)])  # where its z looks
        np.testing.assert_allclose(ahead, [math.cos(0.2), 0.0, -math.sin(0.2)], atol=1e-9)
        for topic in topics.values():
            topic.close()


if __name__ == "__main__":
    import rostest

    rospy.init_node("sim_world_test")
    rostest.rosrun("kurumaisu", "sim_world_test", SimWorldTest, sys.argv)
