# SPDX-License-Identifier: BSD-3-Clause
"""waypoint_node: drives a route by the ground truth and ends; a scripted person for demonstrations and tests."""

from __future__ import annotations

import sys
import threading
from functools import partial

import rospy
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry

from kurumaisu import program, settings
from kurumaisu.driving import Route, RouteFollower, read_route
from kurumaisu.ros import life, parent_launch
from kurumaisu.ros.inbox import seconds_of, subscribe
from kurumaisu.ros.rotation import planar

_HELP = """
Drive a route of waypoints, then end. It steers by the ground truth of a
simulator: for demonstrations and tests.

subscribes to:
  ground_truth  where the chair is
publishes:
  cmd_vel       commands
parameters:
  the route: launch/round.yaml is one, which round.launch loads
"""


class WaypointNode:
    """Publishes cmd_vel for every ground_truth; finished is set when the chair has come to rest at the end."""

    def __init__(self, route: Route) -> None:
        self.finished = threading.Event()
        self.late = False
        self._route = route
        self._driver = RouteFollower(route)
        self._start: float | None = None
        self._heard: float | None = None
        self._end: float | None = None
        self._publisher = rospy.Publisher("cmd_vel", Twist, queue_size=1)
        subscribe("ground_truth", Odometry, self._on_pose, "WAYPOINT_BAD_POSE", queue_size=1)

    def _on_pose(self, message: Odometry) -> None:
        now, pose = seconds_of(message), planar(message.pose.pose)
        self._start = now if self._start is None else self._start
        # The first word that a base hears must be rest, and it may come to listen late.
        if self._heard is None and self._publisher.get_num_connections() > 0:
            self._heard = now
        command = Twist()
        if self._heard is not None and now - self._heard >= self._route.pause:
            command.linear.x, command.angular.z = self._driver.command(pose)
        self._publisher.publish(command)
        if self._driver.done and self._end is None:
            self._end = now
        self.late = now - self._start > self._route.deadline
        if self.late or (self._end is not None and now - self._end >= self._route.pause):
            self.finished.set()


def main() -> int:
    """Drive the route in the private parameters; return 1 when it is not done by its deadline."""
    parser = program.node_parser("waypoint_node", _HELP)
    parent_launch.add_option(parser)
    options = parser.parse_args(program.words())
    return life.run("waypoint_node", partial(_drive, options.ends_launch))


def _drive(ends_launch: bool, own: life.Life) -> int:
    node = WaypointNode(read_route(settings.Section(_own_parameters(), rospy.get_name())))
    while not own.asked.is_set() and not node.finished.wait(0.1):
        pass
    if node.late:
        print(f"{rospy.get_name()}: the route was not done within its deadline", file=sys.stderr)
    elif node.finished.is_set():
        parent_launch.done(f"{rospy.get_name()}: the route is done", ends_launch, own.asked)
    return int(node.late)


def _own_parameters() -> object:
    return rospy.get_param("~", {})
