# SPDX-License-Identifier: BSD-3-Clause
"""Patched bytes are what genpy makes of the same message."""

import io
import math
import struct

import numpy as np
import pytest
import rospy
from geometry_msgs.msg import TransformStamped
from hypothesis import given
from hypothesis import strategies as st
from nav_msgs.msg import Odometry
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import CameraInfo, Image, LaserScan, Range
from std_msgs.msg import Bool
from tf2_msgs.msg import TFMessage

from kurumaisu.ros import wire

numbers = st.floats(-1e6, 1e6)
frames = st.text(st.characters(blacklist_categories=["Cs"]), max_size=20)
seqs = st.integers(0, 2**32 - 1)
stamps = st.tuples(st.integers(0, 2**32 - 1), st.integers(0, 10**9 - 1))


def by_genpy(message):
    body = io.BytesIO()
    message.serialize(body)
    return struct.pack("<I", body.tell()) + body.getvalue()


def head(message, frame, seq, stamp):
    message.header.frame_id, message.header.seq = frame, seq
    message.header.stamp = rospy.Time(*stamp)
    return message


@given(frames, frames, seqs, stamps, st.lists(numbers, min_size=13, max_size=13))
def test_odometry(frame, child, seq, stamp, values):
    made = wire.OdometryWire(frame, child, range(6), range(6, 12))
    made.fill([1.0] * 7, [2.0] * 6)  # what was there before must be gone
    made.stamp(seq, stamp)
    made.fill(values[:7], values[7:])
    message = head(Odometry(), frame, seq, stamp)
    message.child_frame_id = child
    pose, twist = message.pose.pose, message.twist.twist
    pose.position.x, pose.position.y, pose.position.z = values[:3]
    pose.orientation.x, pose.orientation.y, pose.orientation.z, pose.orientation.w = values[3:7]
    twist.linear.x, twist.linear.y, twist.linear.z = values[7:10]
    twist.angular.x, twist.angular.y, twist.angular.z = values[10:]
    for axis in range(6):
        message.pose.covariance[7 * axis], message.twist.covariance[7 * axis] = axis, 6 + axis
    assert made.data == by_genpy(message)


@given(frames, seqs, stamps, st.lists(st.tuples(numbers, numbers), max_size=50))
def test_scan(frame, seq, stamp, readings):
    ranges, intensities = [r for r, _ in readings], [i for _, i in readings]
    fixed = {"angle_min": -2.0, "angle_max": 2.0, "angle_increment": 0.01, "time_increment": 0.25, "scan_time": 0.5}
    made = wire.LaserScanWire(head(LaserScan(range_min=0.1, range_max=5.0, **fixed), frame, 0, (0, 0)), len(readings))
    made.stamp(seq, stamp)
    made.ranges[:], made.intensities[:] = ranges, intensities
    message = head(LaserScan(range_min=0.1, range_max=5.0, **fixed), frame, seq, stamp)
    message.ranges, message.intensities = ranges, intensities
    assert made.data == by_genpy(message)


@given(st.lists(st.tuples(frames, frames, st.lists(numbers, min_size=7, max_size=7)), max_size=5), stamps)
def test_transforms(transforms, stamp):
    made = wire.TransformsWire([(frame, child) for frame, child, _ in transforms])
    made.stamp(stamp)
    message = TFMessage()
    for index, (frame, child, values) in enumerate(transforms):
        made.fill(index, values)
        each = head(TransformStamped(), frame, 0, stamp)
        each.child_frame_id = child
        place, turn = each.transform.translation, each.transform.rotation
        place.x, place.y, place.z, turn.x, turn.y, turn.z, turn.w = values
        message.transforms.append(each)
    assert made.data == by_genpy(message)


def test_a_transform_that_is_not_filled_is_the_identity():
    made = wire.TransformsWire([("a", "b")])
    message = TFMessage()
    message.deserialize(bytes(made.data[4:]))
    turn = message.transforms[0].transform.rotation
    assert (turn.x, turn.y, turn.z, turn.w) == (0, 0, 0, 1)


@given(frames, seqs, stamps, st.floats(0, 100))
def test_range(frame, seq, stamp, distance):
    made = wire.RangeWire(head(Range(field_of_view=0.3, min_range=0.1, max_range=5.0), frame, 0, (0, 0)))
    made.stamp(seq, stamp)
    made.fill(distance)
    wanted = Range(field_of_view=0.3, min_range=0.1, max_range=5.0, range=distance)
    assert made.data == by_genpy(head(wanted, frame, seq, stamp))


@given(frames, seqs, stamps, st.binary(min_size=24, max_size=24))
def test_image(frame, seq, stamp, pixels):
    layout = {"height": 2, "width": 3, "encoding": "rgba8", "step": 12}
    made = wire.ImageWire(head(Image(**layout), frame, 0, (0, 0)), 24)
    made.stamp(seq, stamp)
    made.pixels[:] = np.frombuffer(pixels, np.uint8)
    assert made.data == by_genpy(head(Image(data=pixels, **layout), frame, seq, stamp))


def test_camera_info():
    made = wire.CameraInfoWire(head(CameraInfo(height=3, D=[0.0] * 4), "camera", 0, (0, 0)))
    made.stamp(7, (1, 2))
    assert made.data == by_genpy(head(CameraInfo(height=3, D=[0.0] * 4), "camera", 7, (1, 2)))


@given(stamps)
def test_clock(stamp):
    made = wire.ClockWire()
    made.stamp(stamp)
    assert made.data == by_genpy(Clock(rospy.Time(*stamp)))


@pytest.mark.parametrize("value", [True, False])
def test_bool(value):
    made = wire.BoolWire()
    made.fill(not value)
    made.fill(value)
    assert made.data == by_genpy(Bool(value))


def test_planar_poses_turn_about_z():
    (first, second) = wire.planar([[1.0, 2.0, 0.0], [3.0, 4.0, math.pi / 2]])
    assert first == (1, 2, 0, 0, 0, 0, 1)
    assert second == pytest.approx((3, 4, 0, 0, 0, math.sqrt(0.5), math.sqrt(0.5)))


def test_seq_wraps():
    made = wire.OdometryWire("odom", "", [0] * 6, [0] * 6)
    made.stamp(2**32 + 3, (0, 0))
    assert struct.unpack_from("<I", made.data, 4) == (3,)
