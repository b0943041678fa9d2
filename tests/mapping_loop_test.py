#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""base_node, simulator and mapping_node together: a drive along a corridor whose walls hardly tell how far."""

import sys
import unittest

import numpy as np
import rospy
import tf2_ros
from nav_msgs.msg import Odometry
from nav_msgs.srv import GetMap

from kurumaisu import geometry, slam_score
from kurumaisu.maps import Grid
from kurumaisu.params import shipped
from kurumaisu.ros.rotation import yaw_of
from kurumaisu.ros.testing.nodes import PATIENCE, Commander, Topic, pose_of, wait_for
from kurumaisu.world import load_world

WAY = 5.0  # [m]


class MappingLoop(unittest.TestCase):
    def test_the_map_says_where_the_chair_is(self):
        buffer = tf2_ros.Buffer()
        tf2_ros.TransformListener(buffer)
        truth = Topic("ground_truth", Odometry)
        start = pose_of(wait_for(lambda: truth.last, "ground_truth"))
        commander = Commander("cmd_vel")
        commander.release()
        commander.say(0.5, 0.0)
        truth.wait(
            lambda m: pose_of(m)[0] - start[0] > WAY, "the chair to drive down the corridor", patience=2 * PATIENCE
        )
        commander.silence()
        rest = truth.wait(lambda m: m.twist.twist.linear.x == 0, "the chair at rest").header.stamp
        # asked for: on its topic comes only a map that has changed, which it may not have since before the chair stood
        ask = rospy.ServiceProxy("dynamic_map", GetMap)
        served = wait_for(lambda: (now := ask().map).header.stamp > rest and now, "a map with a scan taken at rest")

        found = wait_for(
            lambda: (
                buffer.can_transform("map", "base_link", rest)
                and buffer.lookup_transform("map", "base_link", rest).transform
            ),
            "map -> base_link at rest",
        )
        seen = np.array([found.translation.x, found.translation.y, yaw_of(found.rotation)])
        true = geometry.between(start, pose_of(truth.last))  # the map begins where the chair did
        assert np.hypot(*(seen - true)[:2]) < 0.2, (seen, true)
        assert abs(seen[2] - true[2]) < 0.02

        info = served.info
        cells = np.array(served.data, dtype=np.int8).reshape(info.height, info.width)
        grid = Grid(cells, info.resolution, info.origin.position.x, info.origin.position.y)
        error = slam_score.map_error(grid, start, load_world(shipped("worlds/building.world")).segments)
        assert len(error) > 100
        assert np.median(error) < info.resolution


if __name__ == "__main__":
    import rostest

    rospy.init_node("mapping_loop_test")
    rostest.rosrun("kurumaisu", "mapping_loop_test", MappingLoop, sys.argv)
