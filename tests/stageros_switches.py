# SPDX-License-Identifier: BSD-3-Clause
"""Several robots in stageros, and its switches: names, rates, sensors, what the simulator is asked for."""

from __future__ import annotations

import math

import pytest
import rosgraph
from kurumaisu.msg import Fiducials
from nav_msgs.msg import OccupancyGrid, Odometry
from sensor_msgs.msg import CameraInfo, Image, LaserScan, Range
from stageros_rig import MODELS, STEP, Case, place, since
from std_msgs.msg import Bool, UInt8MultiArray
from std_srvs.srv import Empty, Trigger

from kurumaisu.ros.testing.nodes import PATIENCE, Topic, wait_for

TWO = (
    MODELS
    + """
base ( pose [1 0 0 90] )
base ( name "bob" pose [-2 0 0 0] laser ( pose [-0.1 0 0.05 180] ) )
"""
)
ODD = (
    MODELS
    + """
base ( name "ann" pose [0 0 0 0] sonar ( pose [0 0 0 0] ) eye ( pose [0 0 0 0] ) )
model ( pose [0.5 0 0 0] size [0.1 0.1 1] name "post" )
"""
)

# Of `crate` metres and `mass` kilograms, with a mark; a bitmap whose black square is its middle
PUSHED = (
    MODELS
    + """
define finder fiducial ( range_max 3 range_max_id 3 fov 90 )
define strips bumper ( pose [0 0 -0.2 0] bcount 1 bpose[0] [0.21 0 0 0] blength 0.2 )
base ( name "ann" pose [0 0 0 0] mass 20 finder ( pose [0 0 -0.2 0] ) strips ( ) )
base ( name "bob" pose [-3 -3 0 0] mass 20 )
model ( name "crate" pose [1 0 0 0] size [${crate} ${crate} 1] mass ${mass} fiducial_return 7 )
model ( name "image" pose [0 3 0 0] size [4 4 1] bitmap "square.png" )
"""
)
EFFECTS = (
    "[{robot: ann, effects: [{id: laser.offset, parameters: {offset: 0.02}}]}, "
    "{robot: bob, effects: [{id: base.marker_x, parameters: {x: 0.3}}]}]}"
)


class SeveralRobots(Case):
    WORLD = TWO
    TOPICS = (
        ("/robot_0/odom", Odometry),
        ("/robot_0/base_scan", LaserScan),
        ("/robot_0/base_pose_ground_truth", Odometry),
        ("/robot_1/odom", Odometry),
        ("/robot_1/base_scan_0", LaserScan),
        ("/robot_1/base_scan_1", LaserScan),
        ("/robot_1/base_pose_ground_truth", Odometry),
    )

    def setUp(self):
        self.ask("reset", Empty)

    def test_a_mapper_takes_their_frames_as_they_are(self):
        maps = Topic("/robot_0/map", OccupancyGrid)

        def mapped():
            self.step()
            return maps.last

        assert wait_for(mapped, "a map of robot_0's scans", PATIENCE).info.width > 10
        maps.close()

    def test_frames_start_with_a_slash(self):
        self.step()
        frames = {name: topic.last.header.frame_id for name, topic in self.topics.items()}
        assert frames["/robot_0/base_scan"] == "/robot_0/base_laser_link"
        assert frames["/robot_1/base_scan_1"] == "/robot_1/base_laser_link_1"
        assert frames["/robot_1/odom"] == frames["/robot_1/base_pose_ground_truth"] == "/robot_1/odom"
        assert set(self.transforms()) == {
            ("/robot_0/odom", "/robot_0/base_footprint"),
            ("/robot_0/base_footprint", "/robot_0/base_link"),
            ("/robot_0/base_link", "/robot_0/base_laser_link"),
            ("/robot_1/odom", "/robot_1/base_footprint"),
            ("/robot_1/base_footprint", "/robot_1/base_link"),
            ("/robot_1/base_link", "/robot_1/base_laser_link_0"),
            ("/robot_1/base_link", "/robot_1/base_laser_link_1"),
        }

    def test_each_scan_is_of_its_laser(self):
        self.step()
        assert self.topics["/robot_1/base_scan_0"].last.ranges[2] == pytest.approx(5 - 0.01 + 1.9, abs=1e-5)
        assert self.topics["/robot_1/base_scan_1"].last.ranges[2] == pytest.approx(3 - 0.01 - 0.1, abs=1e-5)
        assert self.topics["/robot_0/base_scan"].last.ranges[2] == pytest.approx(4 - 0.01 - 0.1, abs=1e-5)

    def test_any_command_keeps_all_going(self):
        first, second = self.topics["/robot_0/odom"], self.topics["/robot_1/odom"]
        self.step()
        self.drive("/robot_0/cmd_vel", 0.2)
        self.step()
        for _ in range(3):
            self.drive("/robot_1/cmd_vel", 0.1)
            self.step()
        assert (first.last.twist.twist.linear.x, second.last.twist.twist.linear.x) == (0.2, 0.1)
        self.step(2)
        assert (first.last.twist.twist.linear.x, second.last.twist.twist.linear.x) == (0, 0)


class Switches(Case):
    WORLD = ODD
    ARGUMENTS = (
        *("-u", "-g", "_headless_rate:=20", "_strip_leading_slash:=true", "_set_child_frame_id:=true"),
        *("_fill_covariance:=true", "_pose_variances:=[1.0, 2.0, 3.0, 4.0, 5.0, 6.0]", "_publish_collision:=true"),
        *("_sensors:=all", "_sonar_as_range:=true", "_frame_odom:=wheels", "_frame_ground_truth:=world"),
        *("_rates:={odom: 5.0, sensors: {base_sonar_1: 2.5}}", "_scan_timing:=true"),
    )
    TOPICS = (
        ("/ann/base_scan", LaserScan),
        ("/ann/base_sonar_0", Range),
        ("/ann/base_sonar_1", Range),
        ("/ann/base_pose_ground_truth", Odometry),
        ("/ann/collision", Bool),
        ("/ann/image", Image),
        ("/ann/depth", Image),
        ("/ann/camera_info", CameraInfo),
    )
    SLOW = ("/ann/base_sonar_1",)

    def setUp(self):
        self.ask("reset", Empty)

    def test_frames(self):
        self.step()
        assert ("ann/wheels", "ann/base_footprint") in self.transforms()
        assert self.topics["/ann/base_pose_ground_truth"].last.header.frame_id == "ann/world"
        assert self.topics["/ann/base_pose_ground_truth"].last.child_frame_id == "ann/base_footprint"
        assert self.topics["/ann/base_sonar_1"].last.header.frame_id == "ann/base_sonar_link_1"

    def test_odometry_has_its_covariance_and_its_rate(self):
        odom = Topic("/ann/odom", Odometry)
        wait_for(lambda: self.ask("step", Trigger) and len(odom.messages) > 2, "odometry")
        times = [message.header.stamp.to_sec() for message in odom.messages]
        assert times[-1] - times[-2] == pytest.approx(0.2)
        assert odom.last.pose.covariance[::7] == (1, 2, 3, 4, 5, 6)
        odom.close()

    def test_a_sensor_has_a_rate_of_its_own(self):
        one, two = (self.topics[f"/ann/base_sonar_{i}"].messages for i in range(2))
        self.step(4)  # the clock that was last heard may be of an earlier step
        start = self.now()
        self.step(8)
        wait_for(lambda: len(since(one, start)) == 8, "eight readings of the first")
        wait_for(lambda: len(since(two, start)) >= 2, "two of the second")
        self.step()  # what is published of the ninth comes after all of the eighth
        of_the_eight = [m for m in since(two, start) if m.header.stamp.to_sec() < start + 8.5 * STEP]
        assert len(of_the_eight) == 2

    def test_sonars(self):
        self.step(4)  # the second one is published in every fourth
        ahead, left = (self.topics[f"/ann/base_sonar_{i}"].last for i in range(2))
        assert (ahead.range, left.range) == pytest.approx((0.45, 3.99), abs=1e-5)
        assert (ahead.radiation_type, ahead.min_range, ahead.max_range) == (Range.ULTRASOUND, 0, 4)
        assert ahead.field_of_view == pytest.approx(math.radians(20))

    def test_collision(self):
        self.step()
        assert self.topics["/ann/collision"].last.data is False
        for _ in range(4):
            self.drive("/ann/cmd_vel", 1.0)
            self.step()
        assert self.topics["/ann/collision"].last.data is True

    def test_scan_timing(self):
        self.step()
        assert self.topics["/ann/base_scan"].last.scan_time == pytest.approx(STEP)

    def test_camera(self):
        self.step()
        image, depth, info = (self.topics[f"/ann/{name}"].last for name in ("image", "depth", "camera_info"))
        assert (image.width, image.height, image.encoding, image.step, len(image.data)) == (8, 6, "rgba8", 32, 192)
        assert (depth.encoding, depth.step, len(depth.data)) == ("32FC1", 32, 192)
        assert image.header.frame_id == info.header.frame_id == "ann/camera"
        assert (info.D, info.distortion_model) == ((0, 0, 0, 0), "")
        assert info.K[0] == pytest.approx(8 / (2 * math.tan(math.radians(35))))
        camera = ("ann/base_link", "ann/camera")
        self.tf.wait(
            lambda m: any((t.header.frame_id, t.child_frame_id) == camera for t in m.transforms), "tf", since=0
        )


class OtherWays(Case):
    """What the node hands on to the simulator, all at once."""

    WORLD = PUSHED
    ARGUMENTS = (
        *(
            "-u",
            "-g",
            "_headless_rate:=20",
            "_simulator:={semantics: physical, timing: consistent, effects: " + EFFECTS,
        ),
        *("_image_extents:=true", "_parameters:={crate: 0.5, mass: 2}", "_publish_tf:=false"),
        *("_publish_bumpers:=true", "_publish_fiducials:=true"),
    )
    TOPICS = (
        ("/ann/odom", Odometry),
        ("/ann/base_scan", LaserScan),
        ("/ann/base_pose_ground_truth", Odometry),
        ("/bob/base_pose_ground_truth", Odometry),
        ("/ann/bumper", UInt8MultiArray),
        ("/ann/fiducials", Fiducials),
    )
    HAS_TF = False

    def setUp(self):
        self.ask("reset", Empty)
        self.odom, self.scan, self.truth, self.bob, self.bumper, self.fiducials = self.topics.values()

    def test_no_tf(self):
        self.step()
        publishers, _, _ = rosgraph.Master("/test").getSystemState()
        assert "/tf" not in [topic for topic, nodes in publishers if "/stageros" in nodes]
        assert "/clock" in [topic for topic, nodes in publishers if "/stageros" in nodes]

    def test_a_crate_is_pushed_and_seen_where_it_is_and_all_is_of_one_moment(self):
        self.step()
        far = self.scan.last.ranges[2]
        assert far == pytest.approx(1 - 0.25 - 0.1 + 0.02, abs=1e-4)  # read 2 cm too long
        for _ in range(15):
            self.drive("/ann/cmd_vel", 0.5)
            self.step()
        at = self.truth.last.pose.pose.position.x
        assert at == pytest.approx(0.75, abs=0.02)
        assert self.odom.last.pose.pose.position.x == at
        assert self.scan.last.ranges[2] == pytest.approx(0.2 - 0.1 + 0.02, abs=0.02)  # the crate goes before it

    def test_the_image_has_its_own_extents(self):
        """The black square fills a quarter of a 4 x 4 m image about (0, 3): with Stage's rule all of it."""
        self.set_pose("ann", -3, 3, 0)
        self.step()
        assert self.scan.last.ranges[2] == pytest.approx(3 - 1 - 0.1 + 0.02, abs=0.01)

    def test_the_truth_of_bob_is_of_his_marker(self):
        self.step()
        assert place(self.bob.last) == (-3 + 0.3, -3, 0)
        assert self.stamp(self.bob) == self.now()

    def test_bumper_and_fiducials(self):
        self.step()
        assert list(self.bumper.last.data) == [0]
        seen = self.fiducials.last
        assert seen.header.frame_id == "/ann/base_link"
        assert list(seen.id) == [7]
        assert (seen.pose[0].position.x, seen.pose[0].position.y) == pytest.approx((1, 0))
        self.set_pose("ann", 1 - 0.25 - 0.22, 0, 0)
        self.step()
        assert list(self.bumper.last.data) == [1]
