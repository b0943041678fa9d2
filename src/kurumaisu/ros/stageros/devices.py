# SPDX-License-Identifier: BSD-3-Clause
"""The topics of bumpers and fiducial finders, which stage_ros does not have."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
import rospy
from geometry_msgs.msg import Point, Pose
from std_msgs.msg import UInt8MultiArray

from kurumaisu.geometry import PLANAR, compose
from kurumaisu.msg import Fiducials
from kurumaisu.ros.outlet import OutletTopic
from kurumaisu.ros.rotation import quaternion_of
from kurumaisu.ros.stageros.plan import DevicePlan
from kurumaisu.ros.wire import Stamp, packed
from kurumaisu.sim.sensors.fiducial import Sightings

if TYPE_CHECKING:
    from kurumaisu.sim.robots.devices import Value


class DeviceTopic(OutletTopic):
    """A bumper as std_msgs/UInt8MultiArray, or a finder as kurumaisu/Fiducials in base_link."""

    def __init__(self, plan: DevicePlan, frame: str, every: int) -> None:
        """Advertise; every: steps from message to message."""
        self.plan = plan  # its model's number changes when another one goes
        self.every = every
        self._frame = frame
        self._newest: Value | None = None
        super().__init__(plan.topic, UInt8MultiArray if plan.kind == "bumper" else Fiducials)

    def take(self, readings: Mapping[int, Value]) -> None:
        """Note the reading of this step, if there is one."""
        self._newest = readings.get(self.plan.model, self._newest)

    def publish(self, stamp: Stamp) -> None:
        """Send the newest reading, once there has been one."""
        if self._newest is None:
            return
        seq = self._outlet.next_number()
        if self._outlet.wanted:
            self._outlet.send(packed(self._message(self._newest, seq, stamp)))

    def _message(self, value: Value, seq: int, stamp: Stamp) -> Any:
        if not isinstance(value, Sightings):
            return UInt8MultiArray(data=np.asarray(value, dtype=np.uint8).tobytes())
        message = Fiducials(id=value.id.tolist(), pose=self._poses(value))
        message.header.seq, message.header.stamp = seq, rospy.Time(*stamp)
        message.header.frame_id = self._frame
        return message

    def _poses(self, seen: Sightings) -> list[Pose]:
        mount = self.plan.mount
        ahead, aside = seen.range * np.cos(seen.bearing), seen.range * np.sin(seen.bearing)
        places = compose(mount[PLANAR], np.stack([ahead, aside, seen.heading], axis=-1))
        return [Pose(Point(x, y, float(mount[2])), quaternion_of(heading)) for x, y, heading in places.tolist()]
