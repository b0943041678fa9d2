# SPDX-License-Identifier: BSD-3-Clause
"""Topics of which only the newest message counts, read when it is wanted and not when it comes."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable
from typing import Any

import numpy as np
import rospy
from geometry_msgs.msg import Point, Pose
from rosgraph_msgs.msg import Clock
from tf2_msgs.msg import TFMessage

from kurumaisu._core import frame_of
from kurumaisu.errors import Error
from kurumaisu.geometry import between, compose
from kurumaisu.ros.inbox import Refusals
from kurumaisu.ros.rotation import planar
from kurumaisu.types import FloatArray


class Newest:
    """The newest message of a topic; what nobody asks for is never unpacked."""

    def __init__(self, name: str, kind: type, check: Callable[[Any], object] | None = None) -> None:
        """Hear nothing before open; check: raises Error for a message that makes no sense, which is refused."""
        self._name, self._kind, self._check = name, kind, check
        self._refusals = Refusals("VIEWER_BAD_MESSAGE", name)
        self._raw: Any = None
        self._subscriber: Any = None
        self.last: Any = None  # as of the last take

    def open(self) -> None:
        """Listen."""
        self._subscriber = rospy.Subscriber(self._name, rospy.AnyMsg, self._hear, queue_size=1, tcp_nodelay=True)

    def close(self) -> None:
        """Listen no longer; what was heard is forgotten."""
        if self._subscriber is not None:
            self._subscriber.unregister()
        self._subscriber = self._raw = self.last = None

    @property
    def listens(self) -> bool:
        """Whether it is open."""
        return self._subscriber is not None

    @property
    def there(self) -> bool:
        """Whether it is listened to, and somebody publishes it."""
        return self._subscriber is not None and self._subscriber.get_num_connections() > 0

    def take_raw(self) -> bytes | None:
        """Return the bytes of the newest message, None if there is none since the last take."""
        raw, self._raw = self._raw, None
        return None if raw is None else raw._buff

    def take(self) -> Any:
        """Return the newest message, its arrays as numpy has them; None if there is none since the last take."""
        raw = self.take_raw()
        if raw is None:
            return None
        message = self._kind()
        message.deserialize_numpy(raw, np)
        try:
            if self._check is not None:
                self._check(message)
        except Error as error:
            self._refusals.add(error)
            return None
        self.last = message
        return message

    def _hear(self, message: rospy.AnyMsg) -> None:
        self._raw = message


class Now:
    """The time [s] by /clock where that is what counts, heard only while it is asked for, and else of this computer."""

    def __init__(self) -> None:
        self._clock = Newest("/clock", Clock)

    def open(self) -> None:
        """Listen, if need be."""
        if rospy.get_param("/use_sim_time", False):
            self._clock.open()

    def close(self) -> None:
        """Listen no longer."""
        self._clock.close()

    def time(self) -> float:
        """Return it; 0 before the first of /clock."""
        if not self._clock.listens:
            return time.time()
        self._clock.take()
        return 0.0 if self._clock.last is None else float(self._clock.last.clock.to_sec())


class PlanarTransforms:
    """What /tf says in the plane, from the newest message of each publisher; enough for a picture."""

    def __init__(self) -> None:
        self._raw: dict[str, bytes] = {}
        self._parents: dict[str, tuple[str, FloatArray]] = {}
        self._subscriber: Any = None

    def listen(self, on: bool) -> None:
        """Listen, or not."""
        if on != (self._subscriber is not None):
            self.open() if on else self.close()

    def open(self) -> None:
        """Listen."""
        self._subscriber = rospy.Subscriber("/tf", rospy.AnyMsg, self._hear, queue_size=10, tcp_nodelay=True)

    def close(self) -> None:
        """Listen no longer."""
        if self._subscriber is not None:
            self._subscriber.unregister()
        self._subscriber = None
        self._raw, self._parents = {}, {}

    def lookup(self, target: str, source: str) -> FloatArray | None:
        """Return target_from_source (3,) of x, y [m], yaw [rad]; None where tf does not say so."""
        self._read()
        here, frame, seen = np.zeros(3), source, {source}
        while frame != target:
            if frame not in self._parents:
                return None
            frame, step = self._parents[frame]
            if frame in seen:
                return None
            seen.add(frame)
            here = compose(step, here)
        return here

    def _read(self) -> None:
        while self._raw:
            _, raw = self._raw.popitem()
            message = TFMessage()
            message.deserialize(raw)
            for one in message.transforms:
                with contextlib.suppress(Error):  # nothing in the plane: a camera's frame, or nonsense
                    place = one.transform.translation
                    pose = planar(Pose(Point(place.x, place.y, place.z), one.transform.rotation))
                    self._parents[frame_of(one.child_frame_id)] = frame_of(one.header.frame_id), pose

    def _hear(self, message: Any) -> None:
        self._raw[message._connection_header["callerid"]] = message._buff


class Alignment:
    """Lays one account of where the robot is on another: both agree where it begins."""

    def __init__(self) -> None:
        self._offset: FloatArray | None = None

    def begin(self) -> None:
        """Agree anew at the next pose."""
        self._offset = None

    def laid(self, pose: FloatArray, on: FloatArray | None) -> FloatArray | None:
        """Return a pose (3,) of one account in the frame of the other, which has the robot `on` now."""
        if self._offset is None:
            if on is None:
                return None
            self._offset = compose(on, between(pose, np.zeros(3)))
        return compose(self._offset, pose)
