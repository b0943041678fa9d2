# SPDX-License-Identifier: BSD-3-Clause
"""One robot in stageros: its topics field by field, commands and transforms."""

from __future__ import annotations

import math

import numpy as np
import pytest
import rosgraph
import rospy
import tf2_ros
from nav_msgs.msg import OccupancyGrid
from stageros_rig import STEP, place
from stageros_services import Services
from std_srvs.srv import SetBool, Trigger

from kurumaisu.params import shipped
from kurumaisu.ros.testing.nodes import Topic, unexplained, wait_for
from kurumaisu.sim import Simulator, load_options
from kurumaisu.world import load_world


class OneRobot(Services):
    """With the services: one start of stageros for both."""

    def test_help_names_all_that_the_node_has(self):
        assert unexplained("/stageros", "stageros") == set()

    def test_names_types_and_services(self):
        publishers, subscribers, services = rosgraph.Master("/test").getSystemState()
        types = dict(rosgraph.Master("/test").getTopicTypes())
        mine = {topic: types[topic] for topic, nodes in publishers if "/stageros" in nodes}
        assert mine == {
            "/odom": "nav_msgs/Odometry",
            "/base_pose_ground_truth": "nav_msgs/Odometry",
            "/base_scan": "sensor_msgs/LaserScan",
            "/clock": "rosgraph_msgs/Clock",
            "/tf": "tf2_msgs/TFMessage",
            "/rosout": "rosgraph_msgs/Log",
            # not stage_ros', and below its own name: silent until a page looks
            "/stageros/view": "kurumaisu/View",
            "/stageros/world": "std_msgs/String",
        }
        assert sorted(topic for topic, nodes in subscribers if "/stageros" in nodes) == [
            *("/cmd_pose", "/cmd_pose_stamped", "/cmd_vel")
        ]
        assert ["/reset_positions", ["/stageros"]] in services
        assert rospy.get_param("/use_sim_time") is True

    def test_scan(self):
        self.step()
        scan = self.scan.last
        assert scan.header.frame_id == "base_laser_link"
        assert (scan.angle_min, scan.angle_max) == pytest.approx((-math.pi / 2, math.pi / 2))
        assert scan.angle_increment == pytest.approx(math.pi / 4)
        assert (scan.time_increment, scan.scan_time) == (0, 0)
        assert (scan.range_min, scan.range_max) == pytest.approx((0.1, 20))
        diagonal = math.sqrt(2)
        # boundary: 1 cm thick inside the room's size; the laser at 1.1, 0.5
        walls = [4.49, 3.89 * diagonal, 1.65, 3.49 * diagonal, 3.49]
        assert scan.ranges == pytest.approx(walls, abs=1e-5)
        assert scan.intensities == pytest.approx([1, 1, 4000, 1, 1])  # above 256, as stage_ros' own test wants

    def test_a_miss_is_range_max_and_dark_is_visible(self):
        assert self.set_pose("era", 100, 100, 0).success
        self.step()
        assert self.scan.last.ranges == pytest.approx([20] * 5)
        assert self.scan.last.intensities == pytest.approx([0] * 5)
        assert self.set_pose("era", -1, 0, math.pi).success
        self.step()
        assert self.scan.last.ranges[2] == pytest.approx(3 - 0.25 - 1.1, abs=1e-5)
        assert self.scan.last.intensities[2] == 0

    def test_odometry_and_truth_at_rest(self):
        self.step(2)
        for message in (self.odom.last, self.truth.last):
            assert message.header.frame_id == "odom"
            assert message.child_frame_id == ""
            assert place(message) == (1, 0.5, 0)
            assert not any((*message.pose.covariance, *message.twist.covariance))
            twist = message.twist.twist
            assert (twist.linear.x, twist.linear.y, twist.linear.z, twist.angular.z) == (0, 0, 0, 0)

    def test_every_message_of_a_step_has_its_time(self):
        self.step()  # the clock that was last heard may be of an earlier step
        before = self.now()
        self.step(3)
        assert self.now() == pytest.approx(before + 3 * STEP)
        assert self.clock.last.clock.nsecs % 100_000_000 == 0
        assert self.clock.messages[0].clock.to_sec() > 0
        assert {self.stamp(topic) for topic in self.stamped()} == {self.now()}
        assert len(self.transforms()) == 3

    def test_transforms(self):
        self.step()
        transforms = self.transforms()
        assert set(transforms) == {
            *[("odom", "base_footprint"), ("base_footprint", "base_link"), ("base_link", "base_laser_link")]
        }
        laser = transforms["base_link", "base_laser_link"].translation
        assert (laser.x, laser.y, laser.z) == pytest.approx((0.1, 0, 0.35))  # the robot's height and the laser's pose
        foot = transforms["odom", "base_footprint"]
        assert (foot.translation.x, foot.translation.y, foot.translation.z) == (1, 0.5, 0)
        assert transforms["base_footprint", "base_link"].rotation.w == 1

    def test_tf2_finds_the_laser(self):
        buffer = tf2_ros.Buffer()
        listener = tf2_ros.TransformListener(buffer)

        def found():
            self.ask("step", Trigger)
            return buffer.can_transform("odom", "base_laser_link", rospy.Time(0))

        wait_for(found, "odom -> base_laser_link")
        where = buffer.lookup_transform("odom", "base_laser_link", rospy.Time(0)).transform.translation
        assert (where.x, where.y, where.z) == pytest.approx((1.1, 0.5, 0.35))
        listener.unregister()

    def test_drives_and_stops_after_the_watchdog_s_time(self):
        self.step()
        self.drive("cmd_vel", 0.5)
        self.step()
        # gps odometry is of before the move, the truth of after it; the truth's twist is the change in the world
        assert place(self.odom.last) == (1, 0.5, 0)
        assert place(self.truth.last) == (1.05, 0.5, 0)
        assert self.odom.last.twist.twist.linear.x == 0.5
        assert self.truth.last.twist.twist.linear.x == pytest.approx(0.5)
        self.step()  # 0.2 s after the command's step: the next one stops
        assert self.odom.last.twist.twist.linear.x == 0.5
        self.step()
        assert self.odom.last.twist.twist.linear.x == 0
        assert place(self.truth.last) == (1.1, 0.5, 0)

    def test_the_same_as_without_ros(self):
        """Not a bit differs: x and y are doubles in both, ranges are rounded to the message's floats."""
        simulator = Simulator(load_world(self.node.world), load_options(shipped("launch/simulator.yaml")))
        self.drive("cmd_vel", 0.7, 0.9)
        for _ in range(2):  # as long as the watchdog lets one command act
            self.step()
            seen = simulator.step(np.array([[0.7, 0.0, 0.9]]))
            position = self.truth.last.pose.pose.position
            assert [position.x, position.y] == seen.poses[0, :2].tolist()
            found = np.where(np.isinf(seen.scans[0].ranges), 20.0, seen.scans[0].ranges)
            np.testing.assert_array_equal(np.float32(self.scan.last.ranges), np.float32(found))

    def test_truth_turns_about_the_world_s_z(self):
        self.set_pose("era", -1, 2, math.pi / 2)
        self.step(2)
        self.drive("cmd_vel", 0.5, 1.0)
        self.step()
        twist = self.truth.last.twist.twist
        assert (twist.linear.x, twist.linear.y, twist.angular.z) == pytest.approx((0, 0.5, 1.0), abs=1e-9)

    def test_too_fast_is_clamped_and_nonsense_dropped(self):
        self.drive("cmd_vel", 5.0, 9.0)
        self.step()
        twist = self.odom.last.twist.twist
        assert (twist.linear.x, twist.angular.z) == pytest.approx((1.0, math.pi / 2))
        self.drive("cmd_vel", math.nan)
        self.step()
        assert self.odom.last.twist.twist.linear.x == 1.0

    def test_a_mapper_makes_a_map(self):
        grid = Topic("map", OccupancyGrid)
        self.ask("pause", SetBool, False)
        try:
            # the latched one may have come already, and a robot at rest makes no other
            wait_for(lambda: any(max(m.data, default=0) > 50 for m in grid.messages), "a map with a wall")
        finally:
            self.ask("pause", SetBool, True)
            grid.close()
