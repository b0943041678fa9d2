# SPDX-License-Identifier: BSD-3-Clause
"""The parameters of each type of sensor, as launch/sensors.yaml has them."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from kurumaisu import settings
from kurumaisu.geometry import attached
from kurumaisu.sim.sensors.battery import BatterySettings, Load
from kurumaisu.sim.sensors.bumper import BumperSettings
from kurumaisu.sim.sensors.camera import build
from kurumaisu.sim.sensors.imu import ImuSettings
from kurumaisu.sim.sensors.inertial_error import InertialErrorSettings
from kurumaisu.sim.sensors.sonar import SonarSettings
from kurumaisu.types import FloatArray
from kurumaisu.world.model import Bumper, Camera, Fiducial

_TURN = 2 * math.pi
_MOST_RAYS = 10_000  # of a sonar's cone

Parameters = ImuSettings | BatterySettings | SonarSettings | BumperSettings | Camera | Fiducial


def read_place(section: settings.Section) -> FloatArray:
    """Return x, y, z [m], heading [rad] (4,) of a section of those keys. Raise Error naming file and key."""
    found = np.array([section.number(key) for key in ("x", "y", "z", "yaw")])
    section.end()
    return found


def _imu(section: settings.Section, mount: FloatArray) -> ImuSettings:
    return ImuSettings(
        mount=(float(mount[0]), float(mount[1]), float(mount[3])),
        gyroscope=_inertial_error(section.section("gyroscope")),
        accelerometer=_inertial_error(section.section("accelerometer")),
        heading=section.text("heading", ("none", "integrated")),
    )


def _inertial_error(section: settings.Section) -> InertialErrorSettings:
    error = InertialErrorSettings(
        noise_density=section.number("noise_density", at_least=0),
        bias=section.number("bias", at_least=0),
        instability=section.number("instability", at_least=0),
        correlation_time=section.number("correlation_time", above=0),
        random_walk=section.number("random_walk", at_least=0),
        scale=section.number("scale", above=-1),
        limit=section.number("limit", above=0),
    )
    section.end()
    return error


def _battery(section: settings.Section, _mount: FloatArray) -> BatterySettings:
    load = section.section("load")
    battery = BatterySettings(
        capacity=section.number("capacity", above=0),
        resistance=section.number("resistance", at_least=0),
        charge=_share(section, "charge"),
        curve=_curve(section),
        load=Load(
            mass=load.number("mass", above=0),
            inertia=load.number("inertia", at_least=0),
            idle=load.number("idle", at_least=0),
            rolling=load.number("rolling", at_least=0),
            scrubbing=load.number("scrubbing", at_least=0),
            efficiency=_share(load, "efficiency", above=0),
            recovery=_share(load, "recovery"),
        ),
    )
    load.end()
    return battery


def _share(section: settings.Section, key: str, above: float = -math.inf) -> float:
    value = section.number(key, at_least=0, above=above)
    if value > 1:
        raise section.error(key, f"must not exceed 1: {value:g}")
    return value


def _curve(section: settings.Section) -> FloatArray:
    points = section.items("curve")
    curve = np.array([(_share(point, "charge"), point.number("voltage", above=0)) for point in points])
    for point in points:
        point.end()
    if len(curve) < 2 or curve[0, 0] != 0 or curve[-1, 0] != 1 or (np.diff(curve, axis=0) <= 0).any():
        raise section.error("curve", "must rise from charge 0 to charge 1, in two points or more")
    return curve


def _sonar(section: settings.Section, mount: FloatArray) -> SonarSettings:
    mounts = [read_place(item) for item in section.items("mounts")]
    if not mounts:
        raise section.error("mounts", "must name one sonar at least")
    sonar = SonarSettings(
        mounts=attached(mount, np.array(mounts)),
        field_of_view=_angle(section, "field_of_view", _TURN),
        rays=section.integer("rays", at_least=1, at_most=_MOST_RAYS),
        range_min=section.number("range_min", at_least=0),
        range_max=section.number("range_max", above=0),
        deviation=section.number("deviation", at_least=0),
    )
    if sonar.range_min >= sonar.range_max:
        raise section.error("range_min", f"must be less than range_max: {sonar.range_min:g}")
    return sonar


def _angle(section: settings.Section, key: str, most: float) -> float:
    angle = section.number(key, above=0)
    if angle > most:
        raise section.error(key, f"must not exceed {most:.4f} rad: {angle:g}")
    return angle


def _camera(section: settings.Section, _mount: FloatArray) -> Camera:
    camera = Camera(
        width=section.integer("width", at_least=1),
        height=section.integer("height", at_least=1),
        fov_h=_angle(section, "fov_h", 0.99 * math.pi),
        fov_v=_angle(section, "fov_v", 0.99 * math.pi),
        near=section.number("near", above=0),
        far=section.number("far", above=0),
        pan=section.number("pan"),
        tilt=section.number("tilt"),
    )
    try:
        build(camera)
    except ValueError as error:
        raise section.error("", str(error)) from error
    return camera


def _bumper(section: settings.Section, mount: FloatArray) -> BumperSettings:
    items = section.items("strips")
    lengths = np.array([item.number("length", above=0) for item in items])
    poses = np.array([read_place(item) for item in items]).reshape(-1, 4)
    return BumperSettings(Bumper(attached(mount, poses), lengths), section.number("travel", at_least=0))


def _fiducial(section: settings.Section, _mount: FloatArray) -> Fiducial:
    return Fiducial(
        range_min=0.0,  # has no effect in Stage, nor here
        range_max=section.number("range_max", above=0),
        range_max_id=section.number("range_max_id", at_least=0),
        fov=_angle(section, "fov", _TURN),
        ignore_zloc=section.text("ignore_height", ("on", "off")) == "on",
        key=section.integer("key", at_least=0),
    )


READERS: dict[str, Callable[[settings.Section, FloatArray], Parameters]] = {
    "imu": _imu,
    "battery": _battery,
    "sonar": _sonar,
    "camera": _camera,
    "bumper": _bumper,
    "fiducial": _fiducial,
}
MOUNTED = frozenset(READERS) - {"battery"}
