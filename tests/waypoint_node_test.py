#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""waypoint_node drives the simulated chair along its route, rests and ends; a bad route stops it."""

import subprocess
import sys
import unittest

import numpy as np
import rosnode
import rospy
from nav_msgs.msg import Odometry

from kurumaisu.ros.testing.nodes import PATIENCE, Topic, wait_for

END = np.array([1.0, 1.5])


class WaypointNode(unittest.TestCase):
    def test_the_chair_comes_to_rest_at_the_end_of_the_route(self):
        truth = Topic("ground_truth", Odometry)

        def distance(message):
            position = message.pose.pose.position
            return np.hypot(*(END - [position.x, position.y]))

        truth.wait(lambda m: distance(m) < 0.2, "the last waypoint", patience=2 * PATIENCE)
        wait_for(lambda: "/driver" not in rosnode.get_node_names(), "the driver to end")
        rest = truth.wait(lambda m: m.twist.twist.linear.x == 0 and m.twist.twist.angular.z == 0, "rest")
        assert distance(rest) < 0.35

    def test_a_bad_route_stops_it(self):
        good = rospy.get_param("/driver")
        for key, value, message in (
            ("sped", 1.0, "/bad_driver: sped: is not a known key"),
            ("speed", "fast", "/bad_driver: speed: must be a number"),
            ("waypoints", [], "/bad_driver: waypoints: must name at least one point"),
        ):
            rospy.set_param("/bad_driver", {**good, key: value})
            node = [
                sys.executable,
                "-c",
                "import sys; from kurumaisu.ros.tools.waypoint_node import main; sys.exit(main())",
            ]
            done = subprocess.run(
                [*node, "__name:=bad_driver"], capture_output=True, text=True, timeout=PATIENCE, check=False
            )
            said = done.stdout + done.stderr
            assert done.returncode == 1, said
            assert message in said
            assert "Traceback" not in said


if __name__ == "__main__":
    import rostest

    rospy.init_node("waypoint_node_test")
    rostest.rosrun("kurumaisu", "waypoint_node_test", WaypointNode, sys.argv)
