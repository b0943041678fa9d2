# SPDX-License-Identifier: BSD-3-Clause
"""When the viewer drives to a goal, and when it stops. No master: moments are handed over."""

import numpy as np
import pytest

from kurumaisu._core import integrate
from kurumaisu.driving import Manner
from kurumaisu.errors import Error
from kurumaisu.ros.viewer import goal
from kurumaisu.ros.viewer.goal import DrivenGoals, Goals
from kurumaisu.ros.viewer.settings import Driving

STEP = 1 / 30


class Topic:
    """Takes what would be published."""

    def __init__(self, *_arguments, **_options):
        self.messages = []

    def publish(self, message):
        self.messages.append(message)

    def get_num_connections(self):
        return len(self.messages)


class Room:
    """A robot that does what it is told, and the viewer that drives it."""

    def __init__(self):
        self.told = []
        self.pose, self.t, self.run = np.zeros(3), 100.0, 0
        self.goals = DrivenGoals("map", Manner(1.0, 0.05, 0.035, 8.0), Driving("x", 20.0, 0.3, 0.6, 0.8), self)

    def drive(self, v, w, _body):
        self.told.append((v, w))

    def go(self, seconds, stopped=False, free=True, rtf=1.0, **more):
        """Let time pass; return what is shown then."""
        for _ in range(round(seconds / STEP)):
            parts = {"t": self.t, "poses": {"#1": tuple(self.pose)}, "hit": () if free else ("#1",), "rtf": rtf, **more}
            self.goals.moment(parts, self.run, stopped)
            v, w = self.told[-1] if free else (0.0, 0.0)
            self.pose = integrate(np.array([v]), np.array([w]), np.array([STEP]), list(self.pose))[-1]
            self.t += STEP
        return self.goals.shown()


@pytest.fixture
def room(monkeypatch):
    monkeypatch.setattr(goal.rospy, "Publisher", Topic)
    monkeypatch.setattr(goal.rospy, "resolve_name", lambda name: f"/{name}")
    one = Room()
    one.goals.publish(np.array([2.0, 1.0, 0.5]), np.array([2.0, 1.0, 0.5]), 1.0)
    one.goals.drive("#1", 0)
    return one


def test_it_arrives_and_rests(room):
    assert room.go(1.0).driving
    shown = room.go(15.0)
    assert (shown.text, shown.driving, shown.body) == ("arrived", False, "#1")
    assert room.pose == pytest.approx([2.0, 1.0, 0.5], abs=0.1)
    assert room.told[-1] == (0.0, 0.0)
    count = len(room.told)
    room.go(1.0)
    assert len(room.told) == count  # silence: others may drive


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"stopped": True}, "ended by the emergency stop"),
        ({"free": False}, "stopped: it touches something"),
        ({"poses": {}}, "ended: the robot was put elsewhere"),
    ],
)
def test_what_ends_it(room, change, text):
    room.go(1.0)
    shown = room.go(1.0, **change)
    assert (shown.text, shown.driving) == (text, False)
    assert room.told[-1] == (0.0, 0.0)


def test_a_hand_a_reset_and_a_new_goal_end_it(room):
    room.goals.by_hand("#2")
    assert room.go(0.5).driving  # another robot's hand
    room.goals.by_hand("#1")
    assert room.go(0.5).text == "ended: driven by hand"
    room.goals.drive("#1", 0)
    room.run = 1
    assert room.go(0.5).text == "ended: the robot was put elsewhere"
    room.goals.drive("#1", 1)
    room.goals.publish(np.array([0.0, 1.0, 0.0]), np.array([0.0, 1.0, 0.0]), 1.0)
    shown = room.go(0.5)
    assert (shown.pose, shown.driving, shown.text) == ((0.0, 1.0, 0.0), False, "")
    room.goals.forget()
    assert room.goals.shown() is None
    with pytest.raises(Error, match="there is no goal"):
        room.goals.drive("#1", 1)


def test_who_gets_nowhere_gives_up(room):
    room.drive = lambda *_: None
    room.told = [(0.0, 0.0)]
    assert room.go(9.0).text == "gave up: no closer for 8 s"


def test_a_fast_simulation_is_driven_slowly(room):
    room.go(STEP, rtf=20.0)
    assert 0 < max(np.abs(room.told[-1])) * 20.0 / 20.0 <= 0.05 + 1e-12


def test_a_robot_is_told_and_not_driven(monkeypatch):
    monkeypatch.setattr(goal.rospy, "Publisher", Topic)
    monkeypatch.setattr(goal.rospy, "resolve_name", lambda name: f"/{name}")
    goals = Goals("map")
    said = goals.publish(np.array([1.0, 2.0, 0.0]), np.array([0.5, 2.0, np.pi / 2]), 7.5)
    assert said.message == "published on /move_base_simple/goal, 1 node listening"
    (message,) = goals._publisher.messages
    assert (message.header.frame_id, message.header.stamp.to_sec()) == ("map", 7.5)
    assert (message.pose.position.x, message.pose.position.y) == (0.5, 2.0)
    assert message.pose.orientation.z == pytest.approx(np.sqrt(0.5))
    assert goals.shown().pose == (1.0, 2.0, 0.0)
    assert not hasattr(goals, "drive")
