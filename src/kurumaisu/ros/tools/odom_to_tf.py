# SPDX-License-Identifier: BSD-3-Clause
"""odom_to_tf: the transform that an odometry message holds; for recordings whose tf also holds others' transforms."""

from __future__ import annotations

import rospy
import tf2_ros
from geometry_msgs.msg import TransformStamped
from nav_msgs.msg import Odometry

from kurumaisu import program
from kurumaisu.ros import life

_HELP = """
Publish the transform that each odometry message holds: for recordings whose tf
also has transforms that are not wanted.

subscribes to:
  odom  nav_msgs/Odometry
publishes:
  /tf   from the message's frame_id to its child_frame_id
"""


def main() -> int:
    """Publish a transform for every message on odom, until shut down."""
    program.no_arguments("odom_to_tf", _HELP)
    return life.run("odom_to_tf", _serve)


def _serve(node: life.Life) -> int:
    broadcaster = tf2_ros.TransformBroadcaster()
    rospy.Subscriber("odom", Odometry, lambda odom: broadcaster.sendTransform(_transform(odom)), queue_size=100)
    node.asked.wait()
    return 0


def _transform(odom: Odometry) -> TransformStamped:
    transform = TransformStamped(header=odom.header, child_frame_id=odom.child_frame_id)
    pose = odom.pose.pose
    place = transform.transform.translation
    place.x, place.y, place.z = pose.position.x, pose.position.y, pose.position.z
    transform.transform.rotation = pose.orientation
    return transform
