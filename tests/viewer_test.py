#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""The viewer on the real simulator, through its WebSocket: look, take control, drive, drag, switch effects, record."""

import sys
import tempfile
import time
import unittest
from pathlib import Path

import aiohttp
import numpy as np
import pytest
import rosgraph
import rospy
from geometry_msgs.msg import TransformStamped, Twist
from nav_msgs.msg import OccupancyGrid
from std_srvs.srv import Trigger
from tf2_msgs.msg import TFMessage

from kurumaisu.bench.speed.viewer.page import Page
from kurumaisu.params import load_model
from kurumaisu.ros.testing.nodes import PATIENCE, Topic, unexplained, wait_for
from kurumaisu.ros.viewer.calls import call

STEP = 0.01  # [s]


def errors_of(scan):
    """Ranges and errors of a binary scan."""
    count = int.from_bytes(scan[2:4], "little")
    values = np.frombuffer(scan, "<f4", offset=8)[7:]
    return values[:count], values[count : 2 * count]


def is_silent(topic):
    """Whether nothing comes for longer than the stick's rate leaves between two words."""
    count = len(topic.messages)
    time.sleep(0.3)
    return len(topic.messages) == count


def listens_to(topic):
    """Whether the viewer does."""
    _, subscribed, _ = rosgraph.Master(rospy.get_name()).getSystemState()
    return "/viewer_node" in dict(subscribed).get(topic, [])


class ViewerTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        rospy.wait_for_service("viewer_node/new_token", PATIENCE)
        cls.address = call("viewer_node/new_token", Trigger).message
        cls.page = Page(cls.address)
        cls.page.let_in(cls.address)
        cls.page.wait(lambda: {"world", "state", "effects"} <= cls.page.newest.keys(), "all that there is to see")

    @classmethod
    def tearDownClass(cls):
        cls.page.close()

    def setUp(self):
        self.do("speed", value=1.0)
        self.do("pause", on=False)
        self.do("reset")

    def do(self, name, **arguments):
        """Command, and be obeyed."""
        reply = self.page.ask(name, **arguments)
        assert reply["ok"], reply
        return reply

    def refused(self, name, **arguments):
        reply = self.page.ask(name, **arguments)
        assert not reply["ok"], reply
        return reply["message"]

    def body(self, name):
        return next(body["id"] for body in self.page.newest["world"]["bodies"] if body["name"] == name)

    def pose(self, name, condition=lambda pose: True):
        id = self.body(name)
        return self.page.state(lambda state: condition(state["poses"][id]), f"{name} there")["poses"][id]

    def test_help_names_all_that_the_node_has(self):
        assert unexplained("/viewer_node", "viewer") == set()

    def test_hello_world_state_and_scan(self):
        hello = self.page.newest["hello"]
        assert (hello["version"], hello["mode"], hello["control"]) == (1, "sim", True)
        assert hello["limits"] == {"v": 0.6, "w": 0.8}
        kinds = {body["name"]: (body["kind"], body["movable"]) for body in self.page.newest["world"]["bodies"]}
        assert kinds == {
            "chair": ("robot", True),
            "box": ("obstacle", True),
            "wall": ("obstacle", True),
            "other robot": ("robot", True),
        }
        state = self.page.state(
            lambda state: state["rtf"] == pytest.approx(1.0, abs=0.3) and state["volts"] and state["odom"],
            "a whole state, at the wall's pace",
        )
        assert state["truth"] == state["poses"][self.body("chair")]
        assert np.hypot(*np.subtract(state["odom"][:2], state["truth"][:2])) < 0.05
        self.page.wait(lambda: self.page.scans, "a scan")
        ranges, error = errors_of(next(iter(self.page.scans.values())))
        assert len(ranges) == 682
        assert 0 < np.nanmax(np.abs(error)) < 0.2

    def test_pause_holds_time_and_step_goes_on_by_one(self):
        self.do("pause", on=True)
        t = self.page.state(lambda state: state["paused"], "a pause")["t"]
        before = self.page.state(lambda state: True, "the next state")["t"]
        assert before == pytest.approx(t, abs=2 * STEP)
        self.do("step")
        after = self.page.state(lambda state: state["t"] > before, "a step")["t"]
        assert after - before == pytest.approx(STEP, abs=1e-6)
        self.do("pause", on=False)
        assert "only while paused" in self.refused("step")

    def test_speed(self):
        self.do("speed", value=0.3)
        self.page.state(lambda state: state["rtf"] < 0.5, "slow motion")
        self.do("speed", value=3.0)
        self.page.state(lambda state: state["rtf"] > 1.3, "faster than the wall's clock, as far as a busy machine can")
        assert "must be a number from 1e-06" in self.refused("speed", value=-1.0)

    def test_set_pose_moves_what_can_be_moved_and_physics_knows(self):
        self.do("set_pose", body=self.body("box"), x=2.0, y=0.2, yaw=0.5)
        assert self.pose("box", lambda pose: pose[0] < 10) == pytest.approx([2.0, 0.2, 0.5], abs=1e-3)
        scan = self.page.counts["scan"]
        self.page.wait(lambda: self.page.counts["scan"] > scan + 2, "new scans")
        ranges, _ = errors_of(next(iter(self.page.scans.values())))
        assert 0.5 < np.nanmin(ranges[300:380]) < 2.0  # the laser sees it
        self.do("set_pose", body=self.body("wall"), x=-4.0, y=1.0, yaw=0.0)  # stands: others are built around it
        assert self.pose("wall", lambda pose: pose[0] < -3.5) == pytest.approx([-4.0, 1.0, 0.0], abs=1e-3)
        refusal = self.refused("set_pose", body=self.body("chair"), x=-4.0, y=1.0, yaw=0.0)
        assert refusal == "chair: does not fit at x -4.000 m, y 1.000 m, 0.0 deg; in the way: wall"  # by names, not ids
        assert "no body" in self.refused("set_pose", body="moon", x=0.0, y=0.0, yaw=0.0)
        assert "position.x: must be" in self.refused("set_pose", body=self.body("box"), x=1e300, y=0.0, yaw=0.0)
        self.page.send(
            f'{{"type":"command","id":77,"name":"set_pose","body":"{self.body("box")}","x":NaN,"y":0,"yaw":0}}'
        )
        self.page.wait(lambda: 77 in self.page.replies or None in self.page.replies, "a refusal")

    def names(self, condition, what):
        """Return the names of all bodies when they are as wanted."""

        def now():
            return {body["name"] for body in self.page.newest["world"]["bodies"]}

        self.page.wait(lambda: condition(now()), what)
        return now()

    def test_add_delete_and_restore(self):
        middle = {"y": 0.0, "yaw": 0.0, "length": 0.5, "width": 0.4}
        id = self.do("add", kind="box", x=1.2, **middle)["result"]
        self.names(lambda names: "box 1" in names, "the box")
        assert self.pose("box 1") == pytest.approx([1.2, 0.0, 0.0], abs=1e-6)
        scan = self.page.counts["scan"]
        self.page.wait(lambda: self.page.counts["scan"] > scan + 2, "new scans")
        ranges, _ = errors_of(next(iter(self.page.scans.values())))
        assert np.nanmin(ranges[330:350]) < 0.8  # the laser sees it
        assert self.refused("add", kind="wall", x=0.0, **middle) == (
            "wall 1: the chair is in the way: it would overlap wall 1"
        )
        assert self.refused("add", kind="moon", x=2.0, **middle) == "add: kind must be one of box, wall, person: 'moon'"
        too_long = self.refused("add", kind="wall", x=2.0, **middle | {"length": 101})
        assert too_long == "add: length must be from 0.02 m to 100 m: 101 m"
        assert self.refused("delete", body=self.body("chair")) == "chair: a robot cannot leave a world that runs"
        self.do("delete", body=id)
        self.names(lambda names: "box 1" not in names, "the end of the box")
        assert "there is none" in self.refused("delete", body=id)
        self.do("restore", body=id)
        self.names(lambda names: "box 1" in names, "the box again")
        assert self.body("box 1") == id
        self.do("add", kind="person", x=-2.0, **middle, to_x=-2.0, to_y=2.0)
        self.names(lambda names: "person 1" in names, "the person")
        self.pose("person 1", lambda pose: pose[1] > 0.2)  # walks
        self.do("reset")
        self.names(lambda names: not names & {"box 1", "person 1"}, "the world of the file")

    def test_drive_with_a_dead_man(self):
        topic = Topic("viewer_vel", Twist)
        start = self.page.state(lambda state: state["driver"] == "", "nobody to drive")["truth"]
        deadline = time.monotonic() + PATIENCE
        while (now := self.page.newest["state"])["driver"] != "viewer" or now["truth"][0] < start[0] + 0.5:
            assert time.monotonic() < deadline, f"it does not drive: {now}"
            self.page.say(type="command", id=0, name="drive", v=99.0, w=0.0)
            time.sleep(0.1)
        assert max(message.linear.x for message in topic.messages) == 0.6  # a full stick
        self.page.state(lambda state: abs(state["v"]) < 1e-3 and state["driver"] == "", "rest")
        assert topic.last.linear.x == 0.0
        wait_for(lambda: is_silent(topic), "silence: others may drive")
        topic.close()

    def test_another_robot_is_driven_by_its_own_topic(self):
        deadline = time.monotonic() + PATIENCE
        start, chair = self.pose("other robot"), self.pose("chair")
        while np.hypot(*np.subtract(self.pose("other robot")[:2], start[:2])) < 0.2:
            assert time.monotonic() < deadline, "it does not drive"
            self.page.say(type="command", id=0, name="drive", v=0.5, w=0.0, body=self.body("other robot"))
        assert np.hypot(*np.subtract(self.pose("chair")[:2], chair[:2])) < 0.01

    def test_estop_holds_until_it_is_released(self):
        self.do("estop", on=True)
        self.page.state(lambda state: state["estop"], "the stop to be shown")
        topic = Topic("viewer_vel", Twist)
        for _ in range(5):
            self.page.say(type="command", id=0, name="drive", v=0.5, w=0.0)
            time.sleep(0.1)
        assert self.page.newest["state"]["volts"] == [0.0, 0.0]
        wait_for(lambda: topic.last and topic.last.linear.x == 0.0, "the stick to be let go")
        topic.close()
        wait_for(lambda: self.page.ask("estop", on=False)["ok"], "a release")
        self.page.state(lambda state: state["estop"] is False, "the release to be shown")

    def group(self, id):
        return next(group for group in self.page.newest["effects"]["groups"] if group["id"] == id)

    def test_effects_switched_and_saved_as_a_model(self):
        assert len(self.page.newest["effects"]["groups"]) > 30
        self.do("effect", effect="laser.offset", enabled=True, values={"offset": 0.15})
        self.page.wait(lambda: self.group("laser.offset")["enabled"], "the effect to be shown")
        assert self.group("laser.offset")["parameters"][0]["value"] == 0.15
        self.do("set_pose", body=self.body("box"), x=2.0, y=0.0, yaw=0.0)
        self.page.wait(lambda: np.nanmean(errors_of(next(iter(self.page.scans.values())))[1]) > 0.1, "longer ranges")
        model = self.do("save_model")["result"]
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder, "mine.yaml")
            path.write_text(model)
            assert [one.id for one in load_model(path).effects] == ["laser.offset"]
        assert "# What the chair IS" in model  # its comments, too
        self.do("effect", effect="laser.offset", enabled=False, values={})
        self.page.wait(lambda: not self.group("laser.offset")["enabled"], "the effect to be gone")
        assert "no effect 'moon'" in self.refused("effect", effect="moon", enabled=True, values={})
        assert "has no" in self.refused("effect", effect="laser.offset", enabled=True, values={"moon": 1.0})
        assert "must be" in self.refused("effect", effect="laser.offset", enabled=True, values={"offset": 1e6})
        self.do("effect", effect="laser.offset", enabled=False, values={})

    def test_reset_and_seed(self):
        self.do("set_pose", body=self.body("chair"), x=0.0, y=2.0, yaw=1.0)
        self.pose("chair", lambda pose: pose[1] > 1)
        self.do("reset")
        assert self.pose("chair", lambda pose: pose[1] < 1) == pytest.approx([0.0, 0.0, 0.0], abs=1e-6)
        self.do("seed", value=9)
        self.page.state(lambda state: state["seed"] == 9, "the seed of the run")
        assert "integer" in self.refused("seed", value=-1)

    def test_record(self):
        self.do("record", on=True)
        name = self.page.state(lambda state: state["recording"], "a recording")["recording"]
        assert name.endswith(".bag")
        assert "already" in self.refused("record", on=True)
        said = self.do("record", on=False)["message"]
        assert Path(said.split(": ")[0]).stat().st_size > 4096
        Path(said.split(": ")[0]).unlink()
        assert "nothing" in self.refused("record", on=False)
        self.page.state(lambda state: state["recording"] is None, "its end")

    def test_without_a_token_a_page_only_looks(self):
        other = Page(self.address)
        other.wait(lambda: "state" in other.newest, "a state")
        assert not other.newest["hello"]["control"]
        assert "needs a token" in other.ask("pause", on=True)["message"]
        other.say(type="token", token=self.address.split("#token=")[1])  # used up
        other.wait(lambda: None in other.replies, "an answer")
        assert "used already" in other.replies[None]["message"]
        other.close()

    def test_transforms_are_heard_only_while_somebody_maps(self):
        assert listens_to("/sim_node/view")
        assert not listens_to("/clock")  # of which a simulator sends thousands a second, flat out
        wait_for(lambda: not listens_to("/tf"), "tf to be left alone")
        mapper = rospy.Publisher("map", OccupancyGrid, queue_size=1)
        wait_for(lambda: listens_to("/tf"), "tf to be heard")
        tf = rospy.Publisher("tf", TFMessage, queue_size=1)
        correction = TransformStamped()
        correction.header.frame_id, correction.child_frame_id = "map", "odom"
        correction.transform.rotation.w = 1.0

        def estimated():
            tf.publish([correction])
            return self.page.newest["state"]["estimate"]

        wait_for(estimated, "an estimate of who maps")
        mapper.unregister()
        wait_for(lambda: not listens_to("/tf"), "tf to be left alone again")
        self.page.state(lambda state: state["estimate"] is None, "the end of the estimate")
        tf.unregister()

    def test_the_viewer_says_who_looks(self):
        other = Page(self.address)
        other.wait(lambda: other.counts["state"] > 3, "some frames")
        lines = call("viewer_node/clients", Trigger).message.splitlines()
        assert len(lines) == 3
        for line in lines[:-1]:
            assert int(line.split(" frames")[0].split()[-1]) > 0
        assert lines[-1] == "disconnected so far because they did not read: 0"
        other.close()
        wait_for(lambda: len(call("viewer_node/clients", Trigger).message.splitlines()) == 2, "it to be gone")

    def test_another_origin_is_refused(self):
        with pytest.raises(aiohttp.WSServerHandshakeError) as refusal:
            Page(self.address, origin="http://evil.example")
        assert refusal.value.status == 403

    def test_a_robot_without_control_refuses_everything(self):
        answer = call("watching/viewer_node/new_token", Trigger)
        assert not answer.success
        watching = Page(answer.message)
        watching.wait(lambda: "hello" in watching.newest, "hello")
        assert watching.newest["hello"]["mode"] == "robot"
        assert watching.newest["hello"]["abilities"] == []
        for name, arguments in (("drive", {"v": 0.1, "w": 0.0}), ("estop", {"on": True}), ("record", {"on": True})):
            assert "is read-only" in watching.ask(name, **arguments)["message"]
        t = watching.state(lambda state: state["t"] > 0, "the time of the simulation")["t"]
        assert t < 1e6  # not this computer's
        watching.say(type="token", token="x")
        watching.wait(lambda: None in watching.replies, "an answer")
        assert "is read-only" in watching.replies[None]["message"]
        watching.close()


if __name__ == "__main__":
    import rostest

    rospy.init_node("viewer_test")
    rostest.rosrun("kurumaisu", "viewer_test", ViewerTest, sys.argv)
