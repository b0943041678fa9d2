# SPDX-License-Identifier: BSD-3-Clause
"""The bytes of a View are those that genpy makes of the same content."""

import io
import struct

import numpy as np
import pytest
import rospy
from kurumaisu.msg import View

from kurumaisu.ros.view.fans import Looks
from kurumaisu.ros.view.wire import Lengths, ViewWire

NS = 1_000_000_000


def packed(view):
    body = io.BytesIO()
    view.serialize(body)
    return struct.pack("<I", body.tell()) + body.getvalue()


@pytest.mark.parametrize("frame", ["map", "", "Grundriß"])
@pytest.mark.parametrize(
    "shape",
    [
        Lengths(3, 2, 2, 9, 9, 9),
        Lengths(3, 1, 2, 9, 0, 9),
        Lengths(3, 3, 0, 0, 0, 0),
        Lengths(0, 0, 1, 4, 4, 4),
        Lengths(0, 0, 0, 0, 0, 0),
    ],
)
def test_as_genpy_has_it(frame, shape):
    rng = np.random.default_rng(1)
    poses = rng.normal(size=(shape.bodies, 3))
    odometry = rng.normal(size=(shape.robots, 3))
    looks = Looks(
        stamps=np.arange(shape.fans) * NS + 4_000_000_005,
        poses=rng.normal(size=(shape.fans, 3)),
        ranges=np.where(rng.random(shape.beams) < 0.3, np.inf, rng.random(shape.beams)),
        truths=rng.random(shape.truths) if shape.truths else None,
        intensities=rng.random(shape.intensities),
    )
    wire = ViewWire(frame, shape)
    for seq in (7, 2**32 + 8):  # the second time over what the first has left
        wire.head(seq, (12, 34), 5, 6)
        wire.pace(True, 2.5, 1.25)
        wire.poses[:] = poses
        wire.hit[:] = 1
        wire.contacts[:] = np.arange(shape.bodies) + 1000
        wire.odometry[:] = odometry
        wire.fill(looks)

    view = View(world=5, run=6, paused=True, speed=2.5, real_time_factor=1.25)
    view.header.seq, view.header.stamp, view.header.frame_id = 8, rospy.Time(12, 34), frame
    view.poses, view.hit = poses.ravel().tolist(), bytes([1] * shape.bodies)
    view.contacts = [1000 + i for i in range(shape.bodies)]
    view.odometry = odometry.ravel().tolist()
    view.stamps = [rospy.Time(i + 4, 5) for i in range(shape.fans)]
    view.sensors = looks.poses.ravel().tolist()
    view.ranges, view.intensities = looks.ranges.tolist(), looks.intensities.tolist()
    view.truths = [] if looks.truths is None else looks.truths.tolist()
    assert bytes(wire.data) == packed(view)
