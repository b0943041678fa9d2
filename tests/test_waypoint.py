# SPDX-License-Identifier: BSD-3-Clause
"""waypoint_node without a master: what it says to a base that comes to listen late."""

from types import SimpleNamespace

import numpy as np
import rospy
from nav_msgs.msg import Odometry

from kurumaisu.driving import Route
from kurumaisu.ros.tools.waypoint_node import WaypointNode


def test_whoever_comes_to_listen_hears_rest_first(monkeypatch):
    said, listeners = [], [0]
    publisher = SimpleNamespace(publish=said.append, get_num_connections=lambda: listeners[0])
    monkeypatch.setattr(rospy, "Publisher", lambda *_, **__: publisher)
    monkeypatch.setattr(rospy, "Subscriber", lambda *_, **__: None)
    node = WaypointNode(
        Route(waypoints=np.array([[2.0, 0.0]]), speed=0.5, turn=0.8, gain=1.5, reach=0.2, pause=0.5, deadline=60.0)
    )
    for step in range(40):
        listeners[0] = int(step >= 20)
        message = Odometry()
        message.header.stamp = rospy.Time.from_sec(1.0 + 0.1 * step)
        message.pose.pose.orientation.w = 1.0
        node._on_pose(message)
    speeds = np.array([command.linear.x for command in said])
    assert (speeds[:25] == 0).all()
    assert (speeds[26:] > 0).all()
