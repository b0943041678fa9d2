# SPDX-License-Identifier: BSD-3-Clause
"""For tests of mapping and localisation: a room whose scans are computed here, and a chair that drives through it."""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
import rospy
import tf2_ros
from geometry_msgs.msg import TransformStamped
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import LaserScan
from tf2_msgs.msg import TFMessage

from kurumaisu.geometry import between, compose
from kurumaisu.ros.testing.nodes import wait_for
from kurumaisu.types import FloatArray

STEP = 0.1  # [s] between scans
BEAMS, ANGLE_MIN, INCREMENT = 682, -2.086214, 0.006135923
RANGE_MAX = 5.6  # [m]
MOUNT = np.array([0.3, 0.05, 0.1])
SPEED_ERROR = np.array([1.04, 1.04, 0.95])  # odometry drives 4 % too far and turns 5 % too little
# x0, y0, x1, y1 [m]: 10 x 8 m with a box and a screen
WALLS = np.array(
    [
        [-5, -4, 5, -4],
        [5, -4, 5, 4],
        [5, 4, -5, 4],
        [-5, 4, -5, -4],
        [2, 1, 3, 1],
        [3, 1, 3, 2.5],
        [3, 2.5, 2, 2.5],
        [2, 2.5, 2, 1],
        [-5, 1, -3, 1.5],
    ],
    dtype=float,
)


def truth(t: float) -> FloatArray:
    """Return the chair's pose in the room, (3,): an oval in 40 s."""
    a = 2 * np.pi * t / 40
    return np.array([-0.5 + 2 * np.cos(a), -1.5 + 1.2 * np.sin(a), a + 1.6])


def ranges_at(pose: FloatArray, mount: FloatArray = MOUNT, turn: int = 1) -> FloatArray:
    """Return equation (4)'s mean readings, (BEAMS,), as the laser of the default model has them.

    turn: -1 for a laser that hangs upside down, whose beams go the other way round.
    """
    laser = compose(pose, mount)
    angles = laser[2] + turn * (ANGLE_MIN + INCREMENT * np.arange(BEAMS))
    c, s = np.cos(angles)[:, None], np.sin(angles)[:, None]
    edge, d = WALLS[:, 2:] - WALLS[:, :2], WALLS[:, :2] - laser[:2]
    with np.errstate(divide="ignore", invalid="ignore"):
        across = c * edge[:, 1] - s * edge[:, 0]
        along = (d[:, 0] * edge[:, 1] - d[:, 1] * edge[:, 0]) / across
        part = (d[:, 0] * s - d[:, 1] * c) / across
    along[~((along > 0) & (part >= 0) & (part <= 1))] = np.inf
    ranges = along.min(axis=1)
    ranges[ranges > RANGE_MAX] = np.inf
    return np.asarray(1.004587 * ranges + 0.058826)


def transform(parent: str, child: str, pose: FloatArray, stamp: rospy.Time) -> TransformStamped:
    """Return parent_from_child at a time."""
    out = TransformStamped()
    out.header.stamp, out.header.frame_id, out.child_frame_id = stamp, parent, child
    out.transform.translation.x, out.transform.translation.y = pose[0], pose[1]
    out.transform.rotation.z, out.transform.rotation.w = np.sin(pose[2] / 2), np.cos(pose[2] / 2)
    return out


def _heard(publisher: rospy.Publisher, count: int) -> bool:
    return bool(publisher.get_num_connections() >= count)


class Room:
    """The clock, the laser and the odometry of a chair in the room; times are those of one test, which begins anew.

    begin: simulated time of a test's first scan [s]; each test begins earlier than the last one.
    """

    def __init__(self, begin: float) -> None:
        self.begin = begin
        self.odom = np.zeros(3)
        self.clock = rospy.Publisher("clock", Clock, queue_size=100)
        self.scan = rospy.Publisher("scan", LaserScan, queue_size=100)
        self.tf = rospy.Publisher("tf", TFMessage, queue_size=100)
        self._places: list[TransformStamped] = []
        self._static = tf2_ros.StaticTransformBroadcaster()
        self.place_laser("laser", MOUNT)

    def place_laser(self, frame: str, mount: FloatArray, *, upside_down: bool = False) -> None:
        """Say on tf where a laser is."""
        place = transform("base_link", frame, mount, rospy.Time(0))
        if upside_down:  # rolled by half a turn before it is yawed
            q = place.transform.rotation
            q.x, q.y, q.z, q.w = q.w, q.z, 0.0, 0.0
        self._places.append(place)
        self._static.sendTransform(self._places)  # all of them: who comes later hears the last message only

    def wait_for_subscribers(self, count: int = 1) -> None:
        """Return when so many nodes hear all of it."""
        for publisher in (self.clock, self.scan, self.tf, self._static.pub_tf):
            wait_for(partial(_heard, publisher, count), f"subscriber of {publisher.name}", 40.0)

    def connections(self) -> list[set[Any]]:
        """Return who hears the clock, scans, transforms and those that stay."""
        return [set(p.impl.connections) for p in (self.clock, self.scan, self.tf, self._static.pub_tf)]

    def wait_for_another(self, before: list[set[Any]]) -> None:
        """Return when one more node hears all of it; to count would not do, as one that has gone is noticed late."""
        wait_for(lambda: all(now - then for now, then in zip(self.connections(), before, strict=True)), "one more node")

    def begin_anew(self) -> None:
        """Set the clock back, and the odometry to where it starts."""
        self.begin -= 1000
        self.odom = np.array([1.0, 2.0, 0.5])
        self.at(-1.0)

    def at(self, t: float) -> rospy.Time:
        """Set the clock to a time of the test [s]."""
        stamp = rospy.Time.from_sec(self.begin + t)
        self.clock.publish(stamp)
        return stamp

    def time_of(self, message: Any) -> float:
        """Return a message's time in this test [s]."""
        return float(message.header.stamp.to_sec() - self.begin)

    def of_this_test(self, messages: list[Any]) -> list[Any]:
        """Return those that are not of an earlier test."""
        return [m for m in messages if abs(self.time_of(m)) < 500]

    def step(
        self, t: float, *, with_tf: bool = True, ranges: FloatArray | list[float] | None = None, frame: str = "laser"
    ) -> None:
        """Publish odometry and a scan, of the room or what is given."""
        stamp = self.at(t)
        if with_tf:
            self.tf.publish([transform("odom", "base_link", self.odom, stamp)])
        self.scan.publish(self.sweep(t, stamp, ranges=ranges, frame=frame))
        self.odom = compose(self.odom, between(truth(t), truth(t + STEP)) * SPEED_ERROR)

    @staticmethod
    def sweep(
        t: float, stamp: rospy.Time, *, ranges: FloatArray | list[float] | None = None, frame: str = "laser"
    ) -> LaserScan:
        """Return a scan of the room at a time of the test, or what is given, with a stamp."""
        message = LaserScan(
            angle_min=ANGLE_MIN,
            angle_increment=INCREMENT,
            angle_max=ANGLE_MIN + INCREMENT * (BEAMS - 1),
            range_min=0.06,
            range_max=RANGE_MAX,
            ranges=ranges_at(truth(t)) if ranges is None else ranges,
        )
        message.header.stamp, message.header.frame_id = stamp, frame
        return message

    def of_another_time(self, t: float) -> None:
        """Publish at a time of the test what has stamps of others: transforms, and three scans, one of them old."""
        last, year = rospy.Time(4294967295), rospy.Duration(31536000)
        now = rospy.Time.from_sec(self.begin + t)
        for stamp in (last, now + year, now + rospy.Duration(3600)):
            self.tf.publish([transform("odom", "base_link", np.array([7.0, 7.0, 1.0]), stamp)])
        for stamp in (last, now + year, now - rospy.Duration(1.5)):
            self.scan.publish(self.sweep(t, stamp))

    def drive(self, seconds: float, first: float = 0.0, **options: Any) -> float:
        """Drive; return the time of the last scan. Paced by the wall clock, so that nothing is skipped."""
        times = first + np.arange(0, seconds, STEP)
        for t in times:
            self.step(float(t), **options)
            time.sleep(0.02)
        return float(times[-1])

    def step_until(self, condition: Callable[[], Any], what: str, patience: float, **options: Any) -> None:
        """Step at the wall's pace until a condition holds. Raise AssertionError after so many seconds."""
        begin, pause = time.monotonic(), 0.05

        def stepped() -> Any:
            self.step(time.monotonic() - begin, **options)
            time.sleep(pause)
            return condition()

        wait_for(stepped, what, patience)
