#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""stageros over ROS, field by field: runs one class of tests, by its name."""

import importlib
import sys
from pathlib import Path

import rospy
import rostest

MODULES = {
    "OneRobot": "stageros_one_robot",
    "SeveralRobots": "stageros_switches",
    "Switches": "stageros_switches",
    "OtherWays": "stageros_switches",
    "RealTime": "stageros_starts",
    "BadStarts": "stageros_starts",
    "TwoMasters": "stageros_starts",
}

if __name__ == "__main__":
    rospy.init_node("stageros_test", disable_rostime=True)
    sys.path.insert(0, str(Path(__file__).parent))  # catkin runs it from another folder
    name = sys.argv[1]
    rostest.rosrun("kurumaisu", name, getattr(importlib.import_module(MODULES[name]), name), sys.argv)
