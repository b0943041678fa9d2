# SPDX-License-Identifier: BSD-3-Clause
"""odom_to_tf: the transform that an odometry message holds; for recordings whose tf also holds others' transforms."""

from __future__ import annotations

import tf2_ros
from geometry_msgs.msg import TransformStamped
from nav_msgs.msg import Odometry

from kurumaisu import program
from kurumaisu._core import frame_of
from kurumaisu.ros import life
from kurumaisu.ros.inbox import seconds_of, subscribe
from kurumaisu.ros.rotation import normed, pose_of

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
    send = broadcaster.sendTransform
    heard = subscribe("odom", Odometry, lambda odom: send(_transform(odom)), "ODOM_TO_TF_DROPPED", queue_size=100)
    node.asked.wait()
    del heard
    return 0


def _transform(odom: Odometry) -> TransformStamped:
    """Return it. Raise Error unless it makes sense, for one transform of nonsense may keep all later ones out of tf."""
    seconds_of(odom)
    pose = odom.pose.pose
    pose_of(pose)
    transform = TransformStamped(header=odom.header, child_frame_id=frame_of(odom.child_frame_id))
    transform.header.frame_id = frame_of(odom.header.frame_id)
    place = transform.transform.translation
    place.x, place.y, place.z = pose.position.x, pose.position.y, pose.position.z
    transform.transform.rotation = normed(pose.orientation)
    return transform
