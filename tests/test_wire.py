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

from kurumaisu._core import OdometryFields
from kurumaisu.ros import wire

NS = 1_000_000_000
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


def odometry(frame, child, seq, stamp, pose, twist):
    """Return a message; pose: x, y, heading, twist: three speeds and a turn about z."""
    message = head(Odometry(), frame, seq, stamp)
    message.child_frame_id = child
    place, turn = message.pose.pose.position, message.pose.pose.orientation
    place.x, place.y, turn.z, turn.w = *pose[:2], math.sin(pose[2] / 2), math.cos(pose[2] / 2)
    linear = message.twist.twist.linear
    linear.x, linear.y, linear.z, message.twist.twist.angular.z = twist
    for axis in range(6):
        message.pose.covariance[7 * axis], message.twist.covariance[7 * axis] = axis, 6 + axis
    return message


rows = st.lists(st.tuples(frames, frames, *[numbers] * 8), max_size=4)


@given(rows, stamps)
def test_odometry(robots, stamp):
    wires = [wire.OdometryWire(frame, child, range(6), range(6, 12)) for frame, child, *_ in robots]
    fields = wire.odometry_fields(wires)
    values = np.array([each[2:] for each in robots]).reshape(-1, 8)
    fields.fill(5, values[:, 5:], values[:, 5:])  # what was there before must be gone
    fields.fill(stamp[0] * NS + stamp[1], values[:, :3], values[:, 3:6])
    for made, (frame, child, x, y, heading, v, sideways, w, *_) in zip(wires, robots, strict=True):
        wanted = odometry(frame, child, 1, stamp, (x, y, heading), (v, sideways, 0, w))
        assert made.data == by_genpy(wanted)


@given(rows, stamps, st.floats(0.01, 1.0))
def test_odometry_of_a_change(robots, stamp, span):
    wires = [wire.OdometryWire(frame, child, range(6), range(6, 12)) for frame, child, *_ in robots]
    values = np.array([each[2:] for each in robots]).reshape(-1, 8)
    now, before, count = values[:, :4], values[:, 4:], len(robots)
    times = np.full(count, stamp[0] * NS + stamp[1])
    wire.odometry_fields(wires).fill_change(times, now, before, np.full(count, span))
    for made, (frame, child, *_), new, old in zip(wires, robots, now, before, strict=True):
        x, y, z, turn = (new - old).tolist()
        twist = x / span, y / span, z / span, math.remainder(turn, math.tau) / span
        assert made.data == by_genpy(odometry(frame, child, 0, stamp, (new[0], new[1], new[3]), twist))


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


@given(st.lists(st.tuples(frames, frames, numbers, numbers, numbers), max_size=5), stamps)
def test_transforms_in_the_plane(transforms, stamp):
    made = wire.TransformsWire([(frame, child) for frame, child, *_ in transforms])
    poses = np.array([pose for _, _, *pose in transforms]).reshape(-1, 3)
    made.fields(range(1, len(transforms))).fill(stamp[0] * NS + stamp[1], poses[1:])
    message = TFMessage()
    for i, (frame, child, x, y, heading) in enumerate(transforms):
        each = head(TransformStamped(), frame, 0, stamp)
        each.child_frame_id = child
        place, turn = each.transform.translation, each.transform.rotation
        turn.w = 1.0
        if i:  # the first one stands still
            place.x, place.y, turn.z, turn.w = x, y, math.sin(heading / 2), math.cos(heading / 2)
        message.transforms.append(each)
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


def test_fields_fit_their_messages():
    made = wire.OdometryWire("odom", "", [0] * 6, [0] * 6)
    with pytest.raises(ValueError, match="no room in the message at 1000"):
        OdometryFields([made.data], [1000], [made.twist])
    with pytest.raises(ValueError, match="each message"):
        OdometryFields([made.data], [], [made.twist])
    fields = wire.odometry_fields([made])
    with pytest.raises(ValueError, match=r"velocities must have shape \(1, 3\)"):
        fields.fill(0, np.zeros((1, 3)), np.zeros((2, 3)))
    with pytest.raises(ValueError, match="spans"):
        fields.fill_change(np.zeros(1, np.int64), np.zeros((1, 4)), np.zeros((1, 4)), np.zeros(2))


def test_seq_wraps():
    made = wire.OdometryWire("odom", "", [0] * 6, [0] * 6)
    made.stamp(2**32 + 3, (0, 0))
    assert struct.unpack_from("<I", made.data, 4) == (3,)
    made.stamp(-1, (0, 0))
    wire.odometry_fields([made]).fill(0, np.zeros((1, 3)), np.zeros((1, 3)))
    assert struct.unpack_from("<I", made.data, 4) == (0,)
