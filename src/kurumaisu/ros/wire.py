# SPDX-License-Identifier: BSD-3-Clause
"""Messages kept as the bytes that go over the wire; a step patches what has changed.

genpy packs every field of every message anew, which costs more than the ray casting. Here it packs a message once; its
layout is fixed from then on, as frames and numbers of beams are. data starts with the word of TCPROS that says how many
bytes follow.
"""

from __future__ import annotations

import io
import struct
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from geometry_msgs.msg import TransformStamped
from nav_msgs.msg import Odometry
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import CameraInfo, Image, LaserScan, Range
from std_msgs.msg import Bool
from tf2_msgs.msg import TFMessage

from kurumaisu._core import OdometryFields, TransformFields

Stamp = tuple[int, int]  # whole seconds and nanoseconds

_LENGTH = struct.Struct("<I")
_STAMP = struct.Struct("<2I")
_HEAD = struct.Struct("<3I")  # seq and stamp, with which every header starts
_TRANSFORM = struct.Struct("<7d")  # as a pose: x, y, z, quaternion x, y, z, w
_FLOAT = struct.Struct("<f")
_DOUBLE = 8  # bytes
_COVARIANCE = 36 * _DOUBLE


def packed(message: Any) -> bytearray:
    """Return a message as TCPROS sends it."""
    body = io.BytesIO()
    message.serialize(body)
    return bytearray(_LENGTH.pack(body.tell()) + body.getvalue())


class Wire:
    """A message with a header, as bytes."""

    def __init__(self, message: Any) -> None:
        self.data = packed(message)
        self._body = _LENGTH.size + _HEAD.size + _text(message.header.frame_id)  # where what follows the header starts

    def stamp(self, seq: int, stamp: Stamp) -> None:
        """Set the header's number and time."""
        _HEAD.pack_into(self.data, _LENGTH.size, seq & 0xFFFFFFFF, *stamp)


class OdometryWire(Wire):
    """nav_msgs/Odometry."""

    def __init__(self, frame: str, child: str, pose: Sequence[float], twist: Sequence[float]) -> None:
        """pose, twist: (6,) the variances on the diagonals of the two covariances."""
        message = Odometry()
        message.header.frame_id, message.child_frame_id = frame, child
        message.pose.covariance = np.diag(np.asarray(pose, float)).ravel().tolist()
        message.twist.covariance = np.diag(np.asarray(twist, float)).ravel().tolist()
        super().__init__(message)
        self.pose = self._body + _text(child)  # where it begins
        self.twist = self.pose + _TRANSFORM.size + _COVARIANCE
        self.stamp(-1, (0, 0))  # the first that is sent has number 0


def odometry_fields(wires: Sequence[OdometryWire]) -> OdometryFields:
    """Return what fills several messages at once."""
    return OdometryFields([w.data for w in wires], [w.pose for w in wires], [w.twist for w in wires])


class LaserScanWire(Wire):
    """sensor_msgs/LaserScan; the arrays are written in place through ranges and intensities, (beams,) float32."""

    def __init__(self, message: LaserScan, beams: int) -> None:
        """Take everything but the arrays from the message."""
        message.ranges = message.intensities = [0.0] * beams
        super().__init__(message)
        start = self._body + 7 * _FLOAT.size + _LENGTH.size
        self.ranges = np.frombuffer(self.data, "<f4", beams, start)
        self.intensities = np.frombuffer(self.data, "<f4", beams, start + _FLOAT.size * beams + _LENGTH.size)


class RangeWire(Wire):
    """sensor_msgs/Range."""

    def __init__(self, message: Range) -> None:
        super().__init__(message)

    def fill(self, distance: float) -> None:
        """Set the range [m], which is the last field."""
        _FLOAT.pack_into(self.data, len(self.data) - _FLOAT.size, distance)


class ImageWire(Wire):
    """sensor_msgs/Image; pixels (bytes,) uint8 is written in place."""

    def __init__(self, message: Image, size: int) -> None:
        """Take everything but the pixels from the message; size: their bytes."""
        message.data = bytes(size)
        super().__init__(message)
        self.pixels = np.frombuffer(self.data, np.uint8, size, len(self.data) - size)


class CameraInfoWire(Wire):
    """sensor_msgs/CameraInfo, which does not change."""

    def __init__(self, message: CameraInfo) -> None:
        super().__init__(message)


class TransformsWire:
    """tf2_msgs/TFMessage of (frame, child frame) pairs, all of them of the same time."""

    def __init__(self, pairs: Iterable[tuple[str, str]]) -> None:
        message = TFMessage()
        self._starts: list[int] = []
        place = 2 * _LENGTH.size
        for frame, child in pairs:
            transform = TransformStamped()
            transform.header.frame_id, transform.child_frame_id = frame, child
            transform.transform.rotation.w = 1.0
            message.transforms.append(transform)
            self._starts.append(place)
            place += _HEAD.size + _text(frame) + _text(child) + _TRANSFORM.size
        self._ends = [*self._starts[1:], place]
        self.data = packed(message)
        assert place == len(self.data)

    def __len__(self) -> int:
        return len(self._starts)

    def stamp(self, stamp: Stamp) -> None:
        """Set the time of all transforms; their numbers stay 0."""
        data, pack = self.data, _STAMP.pack_into
        for start in self._starts:
            pack(data, start + _LENGTH.size, *stamp)

    def fields(self, planar: Sequence[int]) -> TransformFields:
        """Return what fills all stamps and these transforms, which are poses in the plane."""
        stamps = [start + _LENGTH.size for start in self._starts]
        return TransformFields(self.data, stamps, [self._ends[index] - _TRANSFORM.size for index in planar])

    def fill(self, index: int, transform: Sequence[float]) -> None:
        """Set a transform (7,): x, y, z, quaternion."""
        _TRANSFORM.pack_into(self.data, self._ends[index] - _TRANSFORM.size, *transform)


class ClockWire:
    """rosgraph_msgs/Clock."""

    def __init__(self) -> None:
        self.data = packed(Clock())

    def stamp(self, stamp: Stamp) -> None:
        """Set the time."""
        _STAMP.pack_into(self.data, _LENGTH.size, *stamp)


class BoolWire:
    """std_msgs/Bool."""

    def __init__(self) -> None:
        self.data = packed(Bool())

    def fill(self, value: bool) -> None:
        """Set the value."""
        self.data[-1] = value


def _text(text: str) -> int:
    """Return how many bytes a string takes."""
    return _LENGTH.size + len(text.encode())
