#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""stageros over ROS, field by field: one robot, several, switches, services, bad worlds, two masters at once."""

from __future__ import annotations

import math
import os
import re
import signal
import subprocess
import sys
import tempfile
import time
import unittest
import xmlrpc.client
from pathlib import Path

import geometry_msgs.msg
import numpy as np
import PIL.Image
import pytest
import rosgraph
import roslib.packages
import rosmaster.master
import rospy
import rostest
import tf2_ros
from geometry_msgs.msg import Twist
from kurumaisu.msg import Fiducials
from kurumaisu.srv import Delete, Seed, SetPose, Spawn, StateFile
from nav_msgs.msg import OccupancyGrid, Odometry
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import CameraInfo, Image, LaserScan, Range
from std_msgs.msg import Bool, UInt8MultiArray
from std_srvs.srv import Empty, SetBool, Trigger
from tf2_msgs.msg import TFMessage

from kurumaisu.params import shipped
from kurumaisu.ros.rotation import quaternion_of, yaw_of
from kurumaisu.ros.testing import PATIENCE, Topic, wait_for
from kurumaisu.sim import Simulator, load_options
from kurumaisu.world import load_world

STEP = 0.1  # [s]
# A room of 10 x 8 m; the beams' plane is 0.3 + 0.05 + 0.01 m high
MODELS = """
resolution 0.02
interval_sim 100
define laser ranger ( sensor ( range [0.1 20] fov 180 samples 5 ) )
define sonar ranger ( sensor ( range [0 4] fov 20 samples 1 ) sensor ( range [0 4] fov 20 samples 1 pose [0 0 0 90] ) )
define eye camera ( resolution [8 6] range [0.2 8] fov [70 40] )
define base position ( size [0.4 0.4 0.3] drive "diff" laser ( pose [0.1 0 0.05 0] ) )
model ( name "room" size [10 8 1] boundary 1 )
"""
ONE = (
    MODELS
    + """
base ( name "era" pose [1 0.5 0 0] )
model ( name "target" pose [3 0.5 0 0] size [0.5 0.5 1] ranger_return 4000 )
model ( name "black" pose [-3 0 0 0] size [0.5 0.5 1] ranger_return 0 )
"""
)
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


class Stageros:
    """A stageros process with a world of its own."""

    def __init__(self, text: str, *arguments: str, environment: dict[str, str] | None = None) -> None:
        if rospy.has_param("/stageros"):  # of the start before
            rospy.delete_param("/stageros")
        self._folder = tempfile.TemporaryDirectory()
        self.world = Path(self._folder.name) / "a.world"
        self.world.write_text(text)
        pixels = np.full((40, 40), 255, dtype=np.uint8)
        pixels[10:30, 10:30] = 0
        PIL.Image.fromarray(pixels).save(self.world.parent / "square.png")
        (program,) = roslib.packages.find_node("kurumaisu", "stageros")
        self.process = subprocess.Popen(
            [program, *arguments, str(self.world)],
            env={**os.environ, **(environment or {})},
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )

    def wait(self) -> tuple[int, str]:
        """Return exit code and what it said."""
        try:
            said, _ = self.process.communicate(timeout=PATIENCE)
        finally:
            self.process.kill()  # one that hangs must not go on after the test
            self._folder.cleanup()
        return self.process.returncode, said

    def stop(self) -> tuple[int, str]:
        self.process.send_signal(signal.SIGINT)
        return self.wait()


class Case(unittest.TestCase):
    """Tests of one world, which stands still but for step(); no test of these, only of what is made of it."""

    WORLD = ""
    ARGUMENTS: tuple[str, ...] = ("-g", "_headless_rate:=20")
    TOPICS: tuple[tuple[str, type], ...] = ()
    HAS_TF = True
    SLOW: tuple[str, ...] = ()  # topics that are not published in every step

    @classmethod
    def setUpClass(cls):
        cls.node = Stageros(cls.WORLD, *cls.ARGUMENTS)
        cls.clock = Topic("/clock", Clock)
        cls.tf = Topic("/tf", TFMessage)
        cls.topics = {name: Topic(name, kind) for name, kind in cls.TOPICS}
        cls.ask("pause", SetBool, True)
        cls.all_heard()

    @classmethod
    def tearDownClass(cls):
        for topic in (cls.clock, cls.tf, *cls.topics.values()):
            topic.close()
        code, said = cls.node.stop()
        assert code == 0, said
        assert "Traceback" not in said

    @staticmethod
    def ask(name, kind, *request):
        service = f"/stageros/{name}" if name != "reset_positions" else name
        rospy.wait_for_service(service, PATIENCE)
        return rospy.ServiceProxy(service, kind)(*request)

    @classmethod
    def all_heard(cls):
        """Step until every topic is connected."""

        def heard():
            cls.ask("step", Trigger)
            tf = (cls.tf,) if cls.HAS_TF else ()
            return all(topic.messages for topic in (cls.clock, *tf, *cls.topics.values()))

        wait_for(heard, "a message of every topic")

    def step(self, count=1):
        """Go on so many steps and wait for all that is published of them: of several topics, any may come last."""
        for _ in range(count):
            done = self.ask("step", Trigger)
            assert done.success, done.message
            now = float(done.message.split()[1])
            wait_for(lambda now=now: self.now() >= now - 1e-6, f"clock {now}")
        wait_for(lambda: all(self.stamp(t) == self.now() for t in self.stamped()), "every topic's message")
        if self.HAS_TF:
            robot = lambda: any(child.endswith("base_footprint") for _, child in self.transforms())  # noqa: E731
            wait_for(robot, "transforms of now")

    def now(self):
        return self.clock.last.clock.to_sec()

    def stamped(self):
        return [t for name, t in self.topics.items() if hasattr(t.last, "header") and name not in self.SLOW]

    @staticmethod
    def stamp(topic):
        return topic.last.header.stamp.to_sec()

    def drive(self, topic, v, w=0.0):
        """Send one command."""
        message = Twist()
        message.linear.x, message.angular.z = v, w
        self.send(topic, message)

    def send(self, topic, message):
        """Send one message, and wait until it has come."""
        publisher = rospy.Publisher(topic, type(message), queue_size=1)
        wait_for(lambda: publisher.get_num_connections(), f"a listener on {topic}")
        before = self.heard()
        publisher.publish(message)
        wait_for(lambda: self.heard() > before, f"the message on {topic}")
        publisher.unregister()

    def heard(self):
        """Return how many commands and poses the node has heard."""
        return int(re.search(r"(\d+) commands heard", self.ask("pause", SetBool, True).message)[1])

    def transforms(self):
        """Return the simulator's transforms of now, empty before they have come; the mapper is on the topic, too."""
        return {
            (t.header.frame_id, t.child_frame_id): t.transform
            for message in self.tf.messages
            if message._connection_header["callerid"] == "/stageros"
            for t in message.transforms
            if t.header.stamp.to_sec() == self.now()
        }

    def set_pose(self, name, x, y, heading):
        pose = geometry_msgs.msg.Pose()
        pose.position.x, pose.position.y, pose.orientation = x, y, quaternion_of(heading)
        return self.ask("set_pose", SetPose, name, pose)


def place(message):
    pose = message.pose.pose
    return pytest.approx((pose.position.x, pose.position.y, yaw_of(pose.orientation)), abs=1e-9)


def since(messages, time):
    """Return those stamped after a time [s]."""
    return [m for m in messages if m.header.stamp.to_sec() > time + STEP / 2]


class OneRobot(Case):
    WORLD = ONE
    TOPICS = (("odom", Odometry), ("base_scan", LaserScan), ("base_pose_ground_truth", Odometry))

    def setUp(self):
        self.ask("reset", Empty)
        self.odom, self.scan, self.truth = self.topics.values()

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

    def test_cmd_pose_carries_the_robot(self):
        pose = geometry_msgs.msg.Pose(geometry_msgs.msg.Point(-1, 2, 0), quaternion_of(1.0))
        self.send("cmd_pose", pose)
        self.step()
        assert place(self.truth.last) == (-1, 2, 1)
        stamped = geometry_msgs.msg.PoseStamped(pose=pose)
        stamped.pose.position.x = -2
        self.send("cmd_pose_stamped", stamped)
        self.step()
        assert place(self.truth.last) == (-2, 2, 1)

    def test_reset_positions(self):
        self.step()
        self.drive("cmd_vel", 0.5)
        self.step()
        self.ask("reset_positions", Empty)
        self.step(3)
        assert place(self.truth.last) == (1.05, 0.5, 0)  # the command went on for one step more

    def test_reset_goes_back_but_time_does_not(self):
        self.set_pose("era", 0, 0, 1)
        self.step()
        before = self.now()
        assert self.ask("seed", Seed, 7).success
        self.step()
        assert self.now() == pytest.approx(before + STEP)
        assert place(self.truth.last) == (1, 0.5, 0)

    def test_save_and_load(self):
        with tempfile.TemporaryDirectory() as folder:
            file = f"{folder}/state"
            self.set_pose("era", 0, 0, 1)
            assert self.ask("save", StateFile, file).success
            self.ask("reset", Empty)
            assert self.ask("load", StateFile, file).success
            self.step()
            assert place(self.truth.last) == (0, 0, 1)
            missing = self.ask("load", StateFile, f"{folder}/none")
            assert not missing.success
            assert f"{folder}/none: No such file" in missing.message

    def test_services_say_what_is_wrong(self):
        nobody = self.set_pose("nobody", 0, 0, 0)
        assert not nobody.success
        assert "'nobody'" in nobody.message
        bad = geometry_msgs.msg.Pose()  # an orientation of zeros is none
        assert "pose: must be finite" in self.ask("set_pose", SetPose, "era", bad).message
        assert (
            "'target'"
            in self.ask("spawn", Spawn, "era", "target", geometry_msgs.msg.Pose(None, quaternion_of(0))).message
        )

    def test_spawn_and_delete(self):
        pose = geometry_msgs.msg.Pose(geometry_msgs.msg.Point(-1, -2, 0), quaternion_of(0.0))
        done = self.ask("spawn", Spawn, "era", "second", pose)
        assert done.success, done.message
        truth = Topic("/robot_1/base_pose_ground_truth", Odometry)
        wait_for(lambda: self.ask("step", Trigger) and truth.messages, "the second robot")
        assert place(truth.last) == (-1, -2, 0)
        self.step()
        assert ("/robot_1/odom", "/robot_1/base_footprint") in self.transforms()
        with tempfile.TemporaryDirectory() as folder:
            assert self.ask("save", StateFile, f"{folder}/state").success
            assert self.ask("delete", Delete, "second").success
            self.step()
            assert len(self.transforms()) == 3
            loaded = self.ask("load", StateFile, f"{folder}/state")
            assert loaded.success, loaded.message
        self.step()
        assert ("/robot_1/odom", "/robot_1/base_footprint") in self.transforms()
        assert place(self.truth.last) == (1, 0.5, 0)
        assert self.ask("delete", Delete, "target").success
        self.step()
        assert self.scan.last.ranges[2] == pytest.approx(3.89, abs=1e-5)
        assert self.ask("delete", Delete, "second").success
        self.step()
        assert len(self.transforms()) == 3
        truth.close()

    def test_spawn_from_text(self):
        pose = geometry_msgs.msg.Pose(geometry_msgs.msg.Point(2, 2, 0), quaternion_of(0.0))
        done = self.ask("spawn", Spawn, 'base ( name "guest" size [0.3 0.3 0.3] )', "", pose)
        assert done.success, done.message
        self.step()
        assert len(self.transforms()) == 6
        again = self.ask("spawn", Spawn, 'base ( name "guest" )', "", pose)
        assert (again.success, again.message) == (False, "name 'guest': there is a model of this name")
        bad = self.ask("spawn", Spawn, "base (\n size [1, 1] )", "other", pose).message
        assert "text:2:9: ',' is not allowed" in bad
        assert bad.endswith("^")
        assert self.ask("delete", Delete, "guest").success

    def test_step_needs_a_pause(self):
        assert self.ask("pause", SetBool, False).success
        try:
            assert not self.ask("step", Trigger).success
        finally:
            self.ask("pause", SetBool, True)

    def test_a_mapper_makes_a_map(self):
        grid = Topic("map", OccupancyGrid)
        self.ask("pause", SetBool, False)
        try:
            # the latched one may have come already, and a robot at rest makes no other
            wait_for(lambda: any(max(m.data, default=0) > 50 for m in grid.messages), "a map with a wall")
        finally:
            self.ask("pause", SetBool, True)
            grid.close()


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


class RealTime(unittest.TestCase):
    def test_ten_hertz_without_g(self):
        """As stage_ros' hztest: 10 +- 2 Hz by the wall's clock."""
        node = Stageros(ONE)
        scan = Topic("base_scan", LaserScan)
        wait_for(lambda: scan.messages, "a scan")

        def rate():
            before, start = len(scan.messages), time.monotonic()
            wait_for(lambda: len(scan.messages) >= before + 20, "20 scans")
            return 20 / (time.monotonic() - start)

        wait_for(lambda: rate() == pytest.approx(10, abs=2), "10 scans a second, when the machine lets it")
        scan.close()
        code, said = node.stop()
        assert code == 0, said
        assert said.count("STAGEROS_NO_WINDOW") == 1

    def test_quit_time_ends_the_node(self):
        code, said = Stageros(ONE + "quit_time 3\n", "-g").wait()
        assert code == 0, said
        assert "quit_time 3 s" in said


class BadStarts(unittest.TestCase):
    def refused(self, message, text, *arguments):
        node = Stageros(text, "-g", *arguments)
        code, said = node.wait()
        assert code == 1, said
        assert message.format(node.world) in said
        assert "Traceback" not in said

    def test_bad_world(self):
        self.refused("{}:2:9: ", "model (\n size [1, 1] )\n")

    def test_unknown_value(self):
        self.refused("robot_prefix: must be one of stage, always, never: 'both'", ONE, "_robot_prefix:=both")

    def test_rate_that_does_not_divide(self):
        self.refused("rates: odom: must divide the world's 10 Hz: 3", ONE, "_rates:={odom: 3.0}")

    def test_rate_of_no_sensor(self):
        self.refused(
            "there is no sensor of this name; there are: base_scan", ONE, "_rates:={sensors: {base_scam: 5.0}}"
        )

    def test_no_world(self):
        (program,) = roslib.packages.find_node("kurumaisu", "stageros")
        done = subprocess.run([program], capture_output=True, text=True, timeout=PATIENCE, check=False)
        assert (done.returncode, done.stdout) == (255, "usage: stageros [-g] [-u] FILE.world\n")
        missing = subprocess.run([program, "none.world"], capture_output=True, text=True, timeout=PATIENCE, check=False)
        assert missing.returncode == 1
        assert "none.world" in missing.stderr


class TwoMasters(unittest.TestCase):
    def test_each_has_its_own(self):
        masters = [rosmaster.master.Master(port=0) for _ in range(2)]
        nodes = []
        for master in masters:
            master.start()
            nodes.append(Stageros(ONE, "-g", environment={"ROS_MASTER_URI": master.uri}))
        try:
            for master in masters:
                proxy = xmlrpc.client.ServerProxy(master.uri)
                wait_for(lambda proxy=proxy: ["/clock", "rosgraph_msgs/Clock"] in proxy.getTopicTypes("/t")[2], "clock")
        finally:
            outcomes = [node.stop() for node in nodes]
            for master in masters:
                master.stop()
        assert [code for code, _ in outcomes] == [0, 0], outcomes


if __name__ == "__main__":
    rospy.init_node("stageros_test", disable_rostime=True)
    name = sys.argv[1]
    rostest.rosrun("kurumaisu", name, globals()[name], sys.argv)
