# SPDX-License-Identifier: BSD-3-Clause
"""The topics of stageros' cameras, which take a picture only when somebody looks."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from sensor_msgs.msg import CameraInfo, Image

from kurumaisu.ros.outlet import DEPTH, Outlet
from kurumaisu.ros.rotation import optical
from kurumaisu.ros.sensor_messages import intrinsics
from kurumaisu.ros.stageros.plan import CameraPlan, RobotPlan
from kurumaisu.ros.stageros.rates import Pace
from kurumaisu.ros.stageros.settings import StagerosSettings
from kurumaisu.ros.wire import CameraInfoWire, ImageWire, Stamp, TransformsWire
from kurumaisu.sim.sensors.camera import (
    CameraSensor,
    Picture,
    Scenery,
    millimetres,
    mounted_eye,
    stage_eye,
)
from kurumaisu.types import FloatArray
from kurumaisu.world.model import Model

if TYPE_CHECKING:
    from numpy.typing import NDArray


class Cameras:
    """All cameras of a world; transforms go to the outlet of /tf."""

    def __init__(self, settings: StagerosSettings, pace: Pace, tf: Outlet | None) -> None:
        self._settings = settings
        self._pace = pace
        self._tf = tf
        self._topics: list[CameraTopics] = []
        self._models: Sequence[Model] = ()
        self._scenery: Scenery | None = None

    def change(self, models: Sequence[Model], plans: Sequence[RobotPlan]) -> None:
        """Take other models and robots from now on."""
        self._models = models
        self._scenery = None  # made when the first one looks
        there = {(topics.plan.frame, topics.plan.camera): topics for topics in self._topics}
        stay = {(plan.frame, plan.camera) for robot in plans for plan in robot.cameras}
        for likeness in [likeness for likeness in there if likeness not in stay]:
            there.pop(likeness).close()
        self._topics = []
        for robot in plans:
            for plan in robot.cameras:
                topics = there.get((plan.frame, plan.camera))
                if topics is None:
                    topics = CameraTopics(plan, robot.names.frame(self._settings.frames.base_link), self._settings)
                    topics.every = self._pace.sensor("image", plan.names.topic("image", plan.number))
                topics.plan = plan
                self._topics.append(topics)

    @property
    def wanted(self) -> bool:
        """Whether anybody looks."""
        return bool(self._topics) and any(topics.wanted for topics in self._topics)

    def publish(self, poses: Callable[[], FloatArray], number: int, stamp: Stamp) -> None:
        """Take and send what is looked at and due in a step, the number-th; poses: tells those (m, 4) of all models."""
        scenery = self._scenery = self._scenery or Scenery(self._models)
        due = [topics for topics in self._topics if topics.wanted and number % topics.every == 0]
        if due:
            where = poses()
            for topics in due:
                topics.publish(scenery, where, stamp)
                if self._tf is not None:
                    topics.transform.stamp(stamp)
                    self._tf.send(topics.transform.data)


class CameraTopics:
    """image, depth and camera_info of one camera, and where it is."""

    def __init__(self, plan: CameraPlan, base: str, settings: StagerosSettings) -> None:
        """Advertise; base: the frame that the camera stands on."""
        names, number, camera = plan.names, plan.number, plan.camera
        self.plan = plan  # its model's number changes when another one goes
        self.every = 1  # steps from picture to picture
        self._canonical = settings.depth_canonical
        self._as_stage = settings.options.semantics == "stage"
        self._sensor = CameraSensor(camera)
        self._image = Outlet(names.topic("image", number), Image, DEPTH)
        self._depth = Outlet(names.topic("depth", number), Image, DEPTH)
        self._info = Outlet(names.topic("camera_info", number), CameraInfo, DEPTH)
        self._image_wire = _image_wire(plan, "rgba8", 4)
        self._depth_wire = _image_wire(plan, *(("32FC1", 4) if settings.depth_canonical else ("16UC1", 2)))
        self._info_wire = CameraInfoWire(intrinsics(camera, plan.frame))
        self.transform = TransformsWire([(base, plan.frame)])
        # as in 1.8.0, where the lens looks along z
        x, y, z, heading = plan.mount.tolist()
        turn = optical(heading, camera.pan, camera.tilt)
        self.transform.fill(0, (x, y, z, turn.x, turn.y, turn.z, turn.w))

    @property
    def wanted(self) -> bool:
        """Whether anybody looks at the pictures; camera_info alone is not enough, as in 1.8.0."""
        return self._image.wanted or self._depth.wanted

    def publish(self, scenery: Scenery, poses: FloatArray, stamp: Stamp) -> None:
        """Take a picture and send what is looked at."""
        model = self.plan.model
        camera, pose = self.plan.camera, poses[model.index]
        eye = stage_eye(camera, poses[model.parent], pose) if self._as_stage else mounted_eye(camera, pose)
        picture = self._sensor.take(scenery, poses, eye, model.root)
        if self._image.wanted:
            _send(self._image, self._image_wire, picture.rgba, stamp)
        if self._depth.wanted:
            _send(self._depth, self._depth_wire, self._depths(picture), stamp)
        seq = self._info.next_number()
        if self._info.wanted:
            self._info_wire.stamp(seq, stamp)
            self._info.send(self._info_wire.data)

    def close(self) -> None:
        """End the topics."""
        for outlet in (self._image, self._depth, self._info):
            outlet.close()

    def _depths(self, picture: Picture) -> NDArray[Any]:
        return picture.depth if self._canonical else millimetres(picture, self.plan.camera)


def _send(outlet: Outlet, wire: ImageWire, pixels: NDArray[Any], stamp: Stamp) -> None:
    wire.stamp(outlet.next_number(), stamp)
    wire.pixels[:] = np.ascontiguousarray(pixels).view(np.uint8).ravel()
    outlet.send(wire.data)


def _image_wire(plan: CameraPlan, encoding: str, depth: int) -> ImageWire:
    """depth: bytes of a pixel."""
    width, height = plan.camera.width, plan.camera.height
    message = Image(width=width, height=height, encoding=encoding, step=width * depth)
    message.header.frame_id = plan.frame
    return ImageWire(message, width * height * depth)
