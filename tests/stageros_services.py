# SPDX-License-Identifier: BSD-3-Clause
"""What may be asked of stageros while one robot is in its world: poses, state files, robots more and fewer."""

from __future__ import annotations

import geometry_msgs.msg
import pytest
from kurumaisu.srv import Delete, Seed, SetPose, Spawn, StateFile
from nav_msgs.msg import Odometry
from sensor_msgs.msg import LaserScan
from stageros_rig import ONE, STEP, Case, place
from std_srvs.srv import Empty, SetBool, Trigger

from kurumaisu.ros.rotation import quaternion_of
from kurumaisu.ros.testing.nodes import Topic, wait_for


class Services(Case):
    WORLD = ONE
    TOPICS = (("odom", Odometry), ("base_scan", LaserScan), ("base_pose_ground_truth", Odometry))

    def setUp(self):
        self.ask("reset", Empty)
        self.odom, self.scan, self.truth = self.topics.values()

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
        folder = self.node.world.parent
        self.set_pose("era", 0, 0, 1)
        assert str(folder / "turned") in self.ask("save", StateFile, "turned").message
        self.ask("reset", Empty)
        assert self.ask("load", StateFile, "turned").success
        self.step()
        assert place(self.truth.last) == (0, 0, 1)
        missing = self.ask("load", StateFile, "none")
        assert not missing.success
        assert f"{folder}/none: No such file" in missing.message
        over = self.ask("save", StateFile, self.node.world.name)
        assert not over.success
        assert "is no saved state" in over.message
        assert self.node.world.read_text() == self.WORLD

    def test_services_say_what_is_wrong(self):
        nobody = self.set_pose("nobody", 0, 0, 0)
        assert not nobody.success
        assert "'nobody'" in nobody.message
        bad = geometry_msgs.msg.Pose()  # an orientation of zeros is none
        assert "orientation: must be" in self.ask("set_pose", SetPose, "era", bad).message
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
        assert self.ask("save", StateFile, "two").success
        assert self.ask("delete", Delete, "second").success
        self.step()
        assert len(self.transforms()) == 3
        loaded = self.ask("load", StateFile, "two")
        assert loaded.success, loaded.message
        self.step()
        assert ("/robot_1/odom", "/robot_1/base_footprint") in self.transforms()
        assert place(self.truth.last) == (1, 0.5, 0)
        assert self.ask("delete", Delete, "second").success
        self.step()
        assert len(self.transforms()) == 3
        assert self.ask("restore", Delete, "second").success
        self.step()
        assert ("/robot_1/odom", "/robot_1/base_footprint") in self.transforms()  # under its old name
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
