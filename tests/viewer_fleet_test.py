#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""The viewer on stageros with several robots: each is driven, all rangers and contacts are seen."""

import sys
import time
import unittest

import numpy as np
import rospy
from geometry_msgs.msg import Twist
from std_srvs.srv import Trigger

from kurumaisu.bench.speed.viewer.page import Page
from kurumaisu.ros.testing.nodes import PATIENCE, Topic
from kurumaisu.ros.viewer.calls import call


class ViewerFleetTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        rospy.wait_for_service("viewer_node/new_token")
        cls.address = call("viewer_node/new_token", Trigger).message
        cls.page = Page(cls.address)
        cls.page.let_in(cls.address)
        cls.page.wait(lambda: {"world", "state"} <= cls.page.newest.keys(), "all that there is to see")
        cls.bodies = {body["name"]: body for body in cls.page.newest["world"]["bodies"]}

    @classmethod
    def tearDownClass(cls):
        cls.page.close()

    def setUp(self):
        assert self.page.ask("reset")["ok"]

    def drive(self, name, v, until):
        """Drive a robot until a condition of the state holds; return the state."""
        deadline = time.monotonic() + PATIENCE
        while not until(state := self.page.newest["state"]):
            assert time.monotonic() < deadline, f"it does not come to that: {state}"
            self.page.say(type="command", id=0, name="drive", v=v, w=0.0, body=self.bodies[name]["id"])
            time.sleep(0.05)
        return state

    def test_each_robot_is_driven_by_its_own_topic(self):
        assert [name for name, body in self.bodies.items() if body["drivable"]] == ["scout", "porter"]
        scout, porter = self.bodies["scout"]["id"], self.bodies["porter"]["id"]
        heard = Topic("robot_0/cmd_vel", Twist)
        state = self.drive("porter", -0.4, lambda state: state["poses"][porter][0] < 2.8)
        assert abs(state["poses"][scout][0]) < 1e-9
        assert heard.messages == []
        start = state["poses"][porter][0]
        self.drive("scout", 0.4, lambda state: state["poses"][scout][0] > 0.2)
        assert max(message.linear.x for message in heard.messages) == 0.4
        self.page.wait(lambda: heard.last.linear.x == 0.0, "the dead-man")
        assert abs(self.page.newest["state"]["poses"][porter][0] - start) < 0.4  # it was let go, too
        heard.close()

    def test_a_body_that_nobody_drives_is_refused(self):
        wall = next(body["id"] for body in self.bodies.values() if body["kind"] == "wall")
        for body in (wall, "moon"):
            reply = self.page.ask("drive", v=0.1, w=0.0, body=body)
            assert not reply["ok"]
            assert "cannot be driven" in reply["message"]

    def test_all_rangers_are_seen(self):
        self.page.scans.clear()  # bodies that came and went had other places
        self.page.wait(lambda: len(self.page.scans) == 2, "both rangers")
        place = self.page.newest["world"]["bodies"].index(self.bodies["scout"])
        front, rear = (self.page.scans[place | number << 16] for number in (0, 1))
        counts = [int.from_bytes(scan[2:4], "little") for scan in (front, rear)]
        assert counts == [91, 31]
        headings = [np.frombuffer(scan, "<f4", offset=8, count=3)[2] for scan in (front, rear)]
        assert abs(abs(headings[1] - headings[0]) - np.pi) < 1e-3
        assert abs(np.frombuffer(front, "<f4", offset=8)[7 + 45] - 3.8) < 0.01  # the wall before it

    def test_odometry_is_beside_the_truth(self):
        scout = self.bodies["scout"]["id"]
        state = self.drive("scout", 0.5, lambda state: state["poses"][scout][0] > 1.0)
        truth = state["truth"][0]
        assert abs(state["odom"][0] / truth - 1.1) < 0.01, state  # the world file has it a tenth too far
        assert abs(state["odom"][1]) < 1e-6

    def test_walls_are_where_the_world_has_them(self):
        for name, box in (("east", [[3.9, -4.0], [4.1, 4.0]]), ("north", [[-4.0, 4.9], [4.0, 5.1]])):
            wall = self.bodies[name]
            assert wall["kind"] == "wall"
            corners = np.array(wall["polygons"]).reshape(-1, 2)
            np.testing.assert_allclose([corners.min(axis=0), corners.max(axis=0)], box, atol=1e-3)
            assert wall["id"] not in self.page.newest["state"]["poses"]  # it is drawn as it is

    def test_a_contact_is_counted_and_not_missed(self):
        porter = self.bodies["porter"]["id"]
        before = self.page.newest["state"]["contacts"].get(porter, 0)
        state = self.drive("porter", 0.6, lambda state: state["contacts"].get(porter, 0) > before)
        assert state["poses"][porter][0] > 3.5  # at the wall

    def test_a_robot_is_driven_to_a_goal(self):
        porter = self.bodies["porter"]["id"]
        assert "there is no goal" in self.page.ask("go", body=porter)["message"]
        assert self.page.ask("goal", x=2.0, y=-1.0, yaw=1.0)["ok"]
        assert "cannot be driven" in self.page.ask("go", body="moon")["message"]
        assert self.page.ask("go", body=porter)["ok"]
        state = self.page.state(lambda state: state["goal"]["text"] == "arrived", "the arrival")
        np.testing.assert_allclose(state["poses"][porter], [2.0, -1.0, 1.0], atol=0.12)
        assert (state["goal"]["body"], state["goal"]["driving"]) == (porter, False)
        assert self.page.ask("goal", x=2.0, y=9.0, yaw=1.0)["ok"]  # behind a wall
        assert self.page.ask("go", body=porter)["ok"]
        self.page.state(lambda state: state["goal"]["driving"], "that it drives")
        self.page.say(type="command", id=0, name="drive", v=0.0, w=0.0, body=porter)
        self.page.state(lambda state: state["goal"]["text"] == "ended: driven by hand", "a hand on the stick")
        assert self.page.ask("forget_goal")["ok"]
        self.page.state(lambda state: state["goal"] is None, "no goal")

    def test_a_robot_leaves_and_comes_back_and_the_world_is_saved(self):
        added = self.page.ask("add", kind="wall", x=0.0, y=-2.0, yaw=0.0, length=4.0, width=0.1)["result"]
        porter = self.bodies["porter"]["id"]
        assert self.page.ask("delete", body=porter)["ok"]

        def ids():
            return {body["id"]: body for body in self.page.newest["world"]["bodies"]}

        self.page.wait(lambda: added in ids() and porter not in ids(), "another world")
        assert ids()[added]["movable"]  # though longer than what is taken for a thing
        saved = self.page.ask("save_world")["result"]
        assert 'name "wall 1"' in saved
        assert 'name "porter"' not in saved
        assert self.page.ask("restore", body=porter)["ok"]
        self.page.wait(lambda: porter in ids(), "the robot again")
        self.drive("porter", -0.4, lambda state: porter in state["poses"] and state["poses"][porter][0] < 2.8)

    def test_a_refused_pose_names_the_body_and_not_its_number(self):
        reply = self.page.ask("set_pose", body=self.bodies["porter"]["id"], x=1e300, y=0.0, yaw=0.0)
        assert not reply["ok"]
        assert self.bodies["porter"]["id"] not in reply["message"]

    def test_the_speed_of_the_launch_file_is_told(self):
        assert self.page.state(lambda state: state["speed"] == 1.0, "the speed")


if __name__ == "__main__":
    import rostest

    rospy.init_node("viewer_fleet_test")
    rostest.rosrun("kurumaisu", "viewer_fleet_test", ViewerFleetTest, sys.argv)
