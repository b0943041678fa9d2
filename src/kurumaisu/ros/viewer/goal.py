# SPDX-License-Identifier: BSD-3-Clause
"""A goal that a page sets: told to whoever navigates, and, in a simulation, driven to by the viewer itself."""

from __future__ import annotations

import math
import threading
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import rospy
from geometry_msgs.msg import PoseStamped

from kurumaisu.driving import Manner, PoseFollower
from kurumaisu.errors import Error
from kurumaisu.ros.rotation import quaternion_of
from kurumaisu.ros.viewer.settings import Driving
from kurumaisu.ros.viewer.stick import Sticks
from kurumaisu.types import FloatArray
from kurumaisu.viewer.protocol import Goal, Pose
from kurumaisu.viewer.source import Outcome

_TOPIC = "move_base_simple/goal"
_TOUCH = 0.5  # [s] of the simulation that something may be in the way: who starts beside a wall grazes it
_STRIDE = 0.05  # [m, rad] between two looks at most: a simulation may be faster than the page's pictures


@dataclass
class _Way:
    """A robot on its way; run: of the scene, when it began; touched: since when it is kept from moving [s]."""

    body: str
    follower: PoseFollower
    run: int
    touched: float = math.inf


class Goals:
    """The newest goal."""

    def __init__(self, frame: str) -> None:
        """frame: of the map."""
        self._frame = frame
        self._publisher = rospy.Publisher(_TOPIC, PoseStamped, queue_size=1)
        self._pose: Pose | None = None

    def publish(self, pose: FloatArray, in_map: FloatArray, t: float) -> Outcome:
        """Tell of a goal (3,) at a time [s]; in_map: the same in the frame of the map that a robot has."""
        message = PoseStamped()
        message.header.stamp, message.header.frame_id = rospy.Time.from_sec(t), self._frame
        message.pose.position.x, message.pose.position.y = in_map[:2].tolist()
        message.pose.orientation = quaternion_of(float(in_map[2]))
        self._publisher.publish(message)
        self.stop("")
        x, y, yaw = pose.tolist()
        self._pose = (x, y, yaw)
        listeners = self._publisher.get_num_connections()
        return Outcome(
            f"published on {rospy.resolve_name(_TOPIC)}, {listeners or 'no'} node{'s'[: listeners != 1]} listening"
        )

    def stop(self, why: str) -> None:
        """End what the viewer drives; here it drives nothing."""

    def forget(self) -> Outcome:
        """Show no goal any more."""
        self.stop("")
        self._pose = None
        return Outcome("no goal")

    def shown(self) -> Goal | None:
        """Return what a page is to show."""
        return None if self._pose is None else Goal(self._pose)


class DrivenGoals(Goals):
    """Goals in a simulation, which knows where its robots are: the viewer can drive there."""

    def __init__(self, frame: str, manner: Manner, driving: Driving, sticks: Sticks) -> None:
        super().__init__(frame)
        self._manner, self._driving, self._sticks = manner, driving, sticks
        self._lock = threading.Lock()
        self._way: _Way | None = None
        self._body: str | None = None
        self._text = ""

    def drive(self, body: str, run: int) -> Outcome:
        """Let a body drive to the goal. Raise Error if there is none, or it cannot be driven."""
        if self._pose is None:
            raise Error("go: there is no goal yet")
        self._sticks.drive(0.0, 0.0, body)
        follower = PoseFollower(np.array(self._pose), self._manner, self._driving.v, self._driving.w)
        with self._lock:
            self._way, self._body, self._text = _Way(body, follower, run), body, "driving there"
        return Outcome("driving there")

    def stop(self, why: str) -> None:
        """End the drive, if there is one, and say why."""
        with self._lock:
            way, self._way = self._way, None
            if way is not None or not why:
                self._text = why
        if way is not None:
            self._sticks.drive(0.0, 0.0, way.body)

    def by_hand(self, body: str | None) -> None:
        """Hear that a page drives a body, None: the chair."""
        way = self._way
        if way is not None and body in (way.body, None):
            self.stop("ended: driven by hand")

    def moment(self, parts: Mapping[str, Any], run: int, stopped: bool) -> None:
        """Drive on at a moment of the simulation, which is new; stopped: by an emergency stop."""
        way = self._way
        if way is None:
            return
        pose, t = parts["poses"].get(way.body), float(parts["t"])
        if pose is None or run != way.run:
            self.stop("ended: the robot was put elsewhere")
            return
        v, w = way.follower.command(np.array(pose), t)
        if why := self._end(way, stopped, way.body in parts["hit"], t):
            self.stop(why)
            return
        share = self._share(v, w, float(parts["rtf"] or 0.0))
        with self._lock:
            if self._way is way:
                self._sticks.drive(share * v, share * w, way.body)

    def shown(self) -> Goal | None:
        """Return what a page is to show."""
        known = super().shown()
        return known and Goal(known.pose, self._body, self._way is not None, self._text)

    def _end(self, way: _Way, stopped: bool, hit: bool, t: float) -> str:
        """Return why a drive is over, or nothing."""
        if stopped:
            return "ended by the emergency stop"
        if way.follower.done:
            return "arrived"
        way.touched = min(way.touched, t) if hit else math.inf
        if hit and t - way.touched > _TOUCH:
            return "stopped: it touches something"
        return f"gave up: no closer for {self._manner.patience:g} s" if way.follower.gave_up(t) else ""

    def _share(self, v: float, w: float, factor: float) -> float:
        """Return how much of a speed is not too much for a simulation so many times as fast as the clock."""
        stride = max(abs(v), abs(w)) * factor / self._driving.rate
        return min(1.0, _STRIDE / stride) if stride > 0 else 1.0
