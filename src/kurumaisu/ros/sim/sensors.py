# SPDX-License-Identifier: BSD-3-Clause
"""The topics of the chair's further sensors, and where on it they are."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np
import rospy
from geometry_msgs.msg import TransformStamped, Vector3
from sensor_msgs.msg import BatteryState, CameraInfo, Image, Imu, Range
from tf2_msgs.msg import TFMessage

from kurumaisu.errors import Error
from kurumaisu.ros import sensor_messages as messages
from kurumaisu.ros.rotation import optical, quaternion_of
from kurumaisu.sim.sensors.battery import BatterySettings
from kurumaisu.sim.sensors.bumper import BumperSettings
from kurumaisu.sim.sensors.imu import ImuSettings
from kurumaisu.sim.sensors.settings import SensorSettings
from kurumaisu.sim.sensors.sonar import SonarSettings
from kurumaisu.sim.sensors.suite import Reading
from kurumaisu.types import FloatArray
from kurumaisu.world.model import Camera, Fiducial

_QUEUE = 10
_Publish = Callable[[Any, int, rospy.Time], None]


class SensorTopics:
    """Publishes readings under the names of their sensors, which are their frames', too."""

    def __init__(self, sensors: Sequence[SensorSettings], robot: int, base_frame: str) -> None:
        """Advertise; robot: the chair's number among the robots. Raise Error for two sensors of one name."""
        names = [sensor.name for sensor in sensors]
        if len(set(names)) < len(names):
            raise Error(f"sensors: two have the same name: {', '.join(names)}")
        self._robot = robot
        self._base = base_frame
        self._sensors = tuple(sensors)
        self._publish = {sensor.name: _publisher(sensor) for sensor in sensors}

    def publish(self, readings: Sequence[Reading], stamp: rospy.Time) -> None:
        """Send what was due."""
        for reading in readings:
            (rows,) = np.nonzero(reading.robots == self._robot)
            for row in rows.tolist():
                self._publish[reading.sensor.name](reading.value, row, stamp)

    def transforms(self, stamp: rospy.Time) -> list[TransformStamped]:
        """Return where the sensors are in the chair's frame; a camera's looks along z."""
        return [self._transform(frame, mount, stamp) for sensor in self._sensors for frame, mount in _mounts(sensor)]

    def _transform(self, frame: str, mount: tuple[FloatArray, Camera | None], stamp: rospy.Time) -> TransformStamped:
        place, camera = mount
        message = TransformStamped()
        message.header.stamp, message.header.frame_id, message.child_frame_id = stamp, self._base, frame
        message.transform.translation = Vector3(*place[:3].tolist())
        heading = float(place[3])
        message.transform.rotation = (
            quaternion_of(heading) if camera is None else optical(heading, camera.pan, camera.tilt)
        )
        return message


def _mounts(sensor: SensorSettings) -> Iterator[tuple[str, tuple[FloatArray, Camera | None]]]:
    """Yield the frames of a sensor, their places on the chair (4,), and the camera if it is one."""
    match sensor.parameters:
        case BatterySettings():
            return
        case SonarSettings(mounts=places):
            yield from ((f"{sensor.name}_{i}", (place, None)) for i, place in enumerate(places))
        case BumperSettings(bumper=bumper):
            yield from ((f"{sensor.name}_{i}", (place, None)) for i, place in enumerate(bumper.poses))
        case Camera() as camera:
            yield sensor.name, (sensor.mount, camera)
        case _:
            yield sensor.name, (sensor.mount, None)


def _publisher(sensor: SensorSettings) -> _Publish:
    """Advertise the topic of a sensor, or a camera's three; return what publishes a row of a reading."""
    name = sensor.name
    match sensor.parameters:
        case ImuSettings():
            return _each(name, Imu, lambda value, row, stamp: [messages.imu(value, row, stamp, name)])
        case BatterySettings() as cells:
            return _each(
                name, BatteryState, lambda value, row, stamp: [messages.battery(value, row, stamp, name, cells)]
            )
        case SonarSettings() as ring:
            return _each(name, Range, lambda value, row, stamp: messages.sonars(value, row, stamp, name, ring))
        case BumperSettings() as strips:
            return _each(name, Range, lambda value, row, stamp: messages.bumpers(value, row, stamp, name, strips))
        case Fiducial():
            return _each(name, TFMessage, lambda value, row, stamp: [messages.marks(value, row, stamp, name)])
        case Camera() as camera:
            return _camera(name, camera)


def _each(name: str, kind: type, make: Callable[[Any, int, rospy.Time], Sequence[Any]]) -> _Publish:
    """Advertise; return what publishes each message that is made of a row of a reading."""
    topic = _topic(name, kind)

    def publish(value: Any, row: int, stamp: rospy.Time) -> None:
        for message in make(value, row, stamp):
            topic.publish(message)

    return publish


def _camera(name: str, camera: Camera) -> _Publish:
    image, depth = _topic(f"{name}/image", Image), _topic(f"{name}/depth", Image)
    info, what_it_is = _topic(f"{name}/camera_info", CameraInfo), messages.intrinsics(camera, name)

    def publish(value: Any, row: int, stamp: rospy.Time) -> None:
        picture = value[row]
        what_it_is.header.stamp = stamp
        info.publish(what_it_is)
        if image.get_num_connections():
            image.publish(messages.image(picture.rgba, "rgba8", stamp, name))
        if depth.get_num_connections():
            depth.publish(messages.image(picture.depth, "32FC1", stamp, name))

    return publish


def _topic(name: str, kind: type) -> rospy.Publisher:
    return rospy.Publisher(name, kind, queue_size=_QUEUE)
