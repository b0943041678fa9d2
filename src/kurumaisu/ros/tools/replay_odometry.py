# SPDX-License-Identifier: BSD-3-Clause
"""replay_odometry: base_node's odometry again, from the recorded voltages; and, of a bag, whether it is the same."""

from __future__ import annotations

import math
import threading
from pathlib import Path

import numpy as np
import rosbag
import rospy
from nav_msgs.msg import Odometry

from kurumaisu import program
from kurumaisu.bounded_files import MOST_RECORDING, check_file
from kurumaisu.critic.bags.parts import parts_of
from kurumaisu.errors import Error
from kurumaisu.msg import Voltages
from kurumaisu.paper.chair import dead_reckoning
from kurumaisu.paper.chair.dead_reckoning import Odom, Put, Reckoner
from kurumaisu.plausible import require
from kurumaisu.ros import life
from kurumaisu.ros.inbox import nanoseconds_of, subscribe
from kurumaisu.ros.rotation import planar

_HELP = """
Compute base_node's odometry again, from the voltages of a bag that is played.
For a check without ROS: paper odometry FILE.bag

subscribes to:
  voltages       what the D/A converter put out
  recorded/odom  the odometry of the bag: start, stamps, frames, covariances
publishes:
  odom           the same messages, with the pose that the voltages make
"""
_QUEUE = 10000  # messages: none may be lost


class _Again:
    """Hears voltages and the recorded odometry; publishes odometry for every stamp that both have.

    Pose: reckoned. Frames, covariance and rates are those that were recorded: they are no function of the voltages.
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._put: list[Voltages] = []
        self._recorded: dict[int, Odometry] = {}
        self._reckoner: Reckoner | None = None
        self._publisher = rospy.Publisher("odom", Odometry, queue_size=_QUEUE)
        subscribe("voltages", Voltages, self._hear_voltages, "REPLAY_DROPPED", queue_size=_QUEUE)
        subscribe("recorded/odom", Odometry, self._hear_odom, "REPLAY_DROPPED", queue_size=_QUEUE)

    def _hear_voltages(self, message: Voltages) -> None:
        nanoseconds_of(message)
        require("speed", "v", message.v)
        require("yaw rate", "w", message.w)
        with self._lock:
            self._put.append(message)
            self._go_on()

    def _hear_odom(self, message: Odometry) -> None:
        stamp = nanoseconds_of(message)
        planar(message.pose.pose)
        with self._lock:
            self._recorded[stamp] = message
            self._go_on()

    def _go_on(self) -> None:
        """Reckon as far as both have come: a stamp's voltages are complete when a later one's are there."""
        while len(self._put) > 1 or (self._put and self._known(self._put[0])):
            message = self._put[0]
            newest = max(self._recorded, default=0)
            if not self._known(message) and newest < message.header.stamp.to_nsec():
                return  # its odometry may still come
            self._put.pop(0)
            self._one(message)

    def _known(self, message: Voltages) -> bool:
        return message.header.stamp.to_nsec() in self._recorded

    def _one(self, message: Voltages) -> None:
        stamp = message.header.stamp.to_nsec()
        then = self._recorded.pop(stamp, None)
        for old in [key for key in self._recorded if key < stamp]:
            del self._recorded[old]
        if self._reckoner is None:
            if then is None:
                return
            self._reckoner = Reckoner(stamp, np.array((*_row(then)[1:3], dead_reckoning.heading(*_row(then)[3:]))))
        x, y, theta = self._reckoner.go(stamp, message.v, message.w)
        if then is not None:
            pose = then.pose.pose
            pose.position.x, pose.position.y = x, y
            pose.orientation.z, pose.orientation.w = math.sin(0.5 * theta), math.cos(0.5 * theta)
            self._publisher.publish(then)


def main() -> int:
    """Publish odom, until shut down."""
    program.no_arguments("replay_odometry", _HELP)
    return life.run("replay_odometry", _serve)


def _serve(node: life.Life) -> int:
    again = _Again()
    node.asked.wait()
    del again
    return 0


def _row(message: Odometry) -> Odom:
    pose = message.pose.pose
    return (
        message.header.stamp.to_nsec(),
        pose.position.x,
        pose.position.y,
        pose.orientation.z,
        pose.orientation.w,
    )


def check(path: Path) -> int:
    """Say how odometry of a bag, or of a split one, compares with what its voltages make; return 0 when bits are equal.

    Raise Error when it cannot be read, or has not both.
    """
    put: list[Put] = []
    odom: list[Odom] = []
    for part in parts_of(path):
        check_file(part, MOST_RECORDING)
        try:
            with rosbag.Bag(str(part)) as bag:
                for topic, message, _ in bag.read_messages(["voltages", "/voltages", "odom", "/odom"]):
                    if topic.endswith("odom"):
                        odom.append(_row(message))
                    else:
                        put.append((message.header.stamp.to_nsec(), message.v, message.w))
        except (OSError, rosbag.ROSBagException) as error:
            raise Error(f"{part}: {error}") from error
    found = dead_reckoning.compare(put, odom)
    if found is None:
        raise Error(f"{path}: has no voltages and odom with equal stamps")
    print(
        f"{path.name}: {found.equal} of {found.stamps} poses are the same to the last bit; the others differ by "
        f"{found.worst:.2e} m, {found.worst_turn:.2e} rad at most; {found.gaps} gaps"
    )
    return int(found.equal < found.stamps)
