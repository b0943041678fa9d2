# SPDX-License-Identifier: BSD-3-Clause
"""What stageros publishes of a world: one plan for each robot, without ROS."""

from __future__ import annotations

from collections.abc import Hashable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from kurumaisu.ros.stageros.names import Names, devices_of, robots_of
from kurumaisu.ros.stageros.settings import StagerosSettings
from kurumaisu.types import FloatArray
from kurumaisu.world.layout import beam_place
from kurumaisu.world.model import Bumper, Camera, Device, Fan, Fiducial, Model, Ranger

_DEVICES: dict[str, tuple[type[Device], str]] = {"bumper": (Bumper, "bumper"), "fiducial": (Fiducial, "fiducials")}


@dataclass(frozen=True)
class ScanPlan:
    """A sensor of a ranger; fan None: the ranger has no sensor, so it has a frame only.

    mount (4,): x, y, z [m], heading [rad] in base_link; index: of the reading in Observation.scans.
    """

    topic: str
    frame: str
    mount: FloatArray
    fan: Fan | None
    index: int
    is_range: bool


@dataclass(frozen=True)
class CameraPlan:
    """A camera; mount (4,): x, y, z [m], heading [rad] in base_link; number: among several, else None."""

    model: Model
    camera: Camera
    names: Names
    number: int | None
    frame: str
    mount: FloatArray


@dataclass(frozen=True)
class DevicePlan:
    """A bumper or a fiducial finder: its type, the number of its model; mount (4,): x, y, z, heading in base_link."""

    kind: str
    model: int
    topic: str
    mount: FloatArray


@dataclass(frozen=True)
class RobotPlan:
    """A robot; row: of the observation's arrays."""

    row: int
    model: Model
    names: Names
    scans: tuple[ScanPlan, ...]
    cameras: tuple[CameraPlan, ...]
    devices: tuple[DevicePlan, ...]

    @property
    def likeness(self) -> Hashable:
        """What is equal for robots whose messages differ in numbers only."""
        fans = tuple(
            (scan.topic, scan.fan and (scan.fan.samples, scan.fan.fov, scan.fan.range_min, scan.fan.range_max))
            for scan in self.scans
        )
        return self.names, fans, tuple(device.topic for device in self.devices)


def plan_world(models: Sequence[Model], names: Sequence[Names], settings: StagerosSettings) -> tuple[RobotPlan, ...]:
    """Return the plans of all robots, in file order, each with its names."""
    return tuple(
        RobotPlan(
            row,
            robot,
            names[row],
            _scans(models, robot, names[row], settings),
            _cameras(models, robot, names[row], settings.frames.camera),
            tuple(_devices(models, robot, names[row], settings.publish_devices)),
        )
        for row, robot in enumerate(robots_of(models))
    )


@dataclass(frozen=True)
class _Sensor:
    """A sensor before it has a name."""

    mount: FloatArray
    fan: Fan | None
    index: int


def _scans(models: Sequence[Model], robot: Model, names: Names, settings: StagerosSettings) -> tuple[ScanPlan, ...]:
    sensors = [
        sensor
        for ranger in devices_of(models, robot, Ranger)
        for sensor in _sensors(models, robot, ranger, settings.all_sensors)
    ]
    sonars = [sensor for sensor in sensors if settings.sonar_as_range and _is_sonar(sensor)]
    lasers = [sensor for sensor in sensors if not (settings.sonar_as_range and _is_sonar(sensor))]
    frames = settings.frames
    return (
        *_numbered(lasers, names, "base_scan", frames.base_laser_link, False),
        *_numbered(sonars, names, "base_sonar", frames.base_sonar_link, True),
    )


def _is_sonar(sensor: _Sensor) -> bool:
    return sensor.fan is not None and sensor.fan.samples == 1


def _sensors(models: Sequence[Model], robot: Model, ranger: Model, every: bool) -> list[_Sensor]:
    """Return the first sensor of a ranger where stage_ros puts it, or every one where it really is."""
    assert isinstance(ranger.device, Ranger)
    fans = ranger.device.fans
    first = _readings_before(models, ranger)
    top = np.array([0.0, 0.0, robot.size[2], 0.0])
    if not every or not fans:  # stage_ros' frame leaves out the ranger's origin and the sensor's pose
        return [_Sensor(ranger.pose + top, fans[0] if fans else None, first)]
    return [_Sensor(beam_place(ranger, ranger.pose, fan) + top, fan, first + number) for number, fan in enumerate(fans)]


def _readings_before(models: Sequence[Model], device: Model) -> int:
    """Return how many scans an observation has before those of a ranger."""
    return sum(len(model.device.fans) for model in models[: device.index] if isinstance(model.device, Ranger))


def _numbered(sensors: Sequence[_Sensor], names: Names, topic: str, frame: str, is_range: bool) -> list[ScanPlan]:
    """Name sensors of one kind; only several have numbers."""
    return [
        ScanPlan(
            names.topic(topic, number), names.frame(frame, number), sensor.mount, sensor.fan, sensor.index, is_range
        )
        for number, sensor in ((i if len(sensors) > 1 else None, sensor) for i, sensor in enumerate(sensors))
    ]


def _cameras(models: Sequence[Model], robot: Model, names: Names, frame: str) -> tuple[CameraPlan, ...]:
    cameras = devices_of(models, robot, Camera)
    top = np.array([0.0, 0.0, robot.size[2], 0.0])
    plans = []
    for i, model in enumerate(cameras):
        assert isinstance(model.device, Camera)
        number = i if len(cameras) > 1 else None
        plans.append(CameraPlan(model, model.device, names, number, names.frame(frame, number), model.pose + top))
    return tuple(plans)


def _devices(models: Sequence[Model], robot: Model, names: Names, kinds: Sequence[str]) -> Iterator[DevicePlan]:
    top = np.array([0.0, 0.0, robot.size[2], 0.0])
    for kind in kinds:
        found = devices_of(models, robot, _DEVICES[kind][0])
        for number, model in enumerate(found):
            topic = names.topic(_DEVICES[kind][1], number if len(found) > 1 else None)
            yield DevicePlan(kind, model.index, topic, model.pose + top)
