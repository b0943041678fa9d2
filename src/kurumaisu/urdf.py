# SPDX-License-Identifier: BSD-3-Clause
"""The chair's picture: a URDF written from the model file."""

from __future__ import annotations

import math
import sys
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree

from kurumaisu.errors import Error, one_line
from kurumaisu.params import Model, load_model

# A picture, with which nothing computes: height of the seat, radius and width of a drive wheel [m].
_SEAT, _WHEEL, _TYRE = 0.5, 0.2, 0.05
_SENSOR = (0.05, 0.05, 0.07)  # housing of a URG-04LX [m]


@dataclass(frozen=True)
class Pose:
    """child in parent: metres, and roll, pitch, yaw in radians."""

    xyz: tuple[float, float, float]
    rpy: tuple[float, float, float]


def robot_description(model: Model, base_frame: str, imu: tuple[str, Pose] | None = None) -> str:
    """Return URDF: the chair, its laser, and fixed joints. imu: frame and mounting of an inertial sensor.

    What collides is the box of the model, as in the simulator: its footprint, up to the head of the occupant.
    """
    robot = ElementTree.Element("robot", name=model.name)
    chassis, laser = model.chassis, model.laser
    centre = chassis.axle_to_front - chassis.length / 2
    base = ElementTree.SubElement(robot, "link", name=base_frame)
    seat = ElementTree.Element("box", size=_text((chassis.length, chassis.width, _SEAT)))
    _shape(base, "visual", seat, Pose((centre, 0.0, _SEAT / 2), (0.0, 0.0, 0.0)), "0.2 0.3 0.6 0.6")
    for side in (1, -1):
        wheel = ElementTree.Element("cylinder", radius=f"{_WHEEL:g}", length=f"{_TYRE:g}")
        place = Pose((0.0, side * chassis.track / 2, _WHEEL), (math.pi / 2, 0.0, 0.0))
        _shape(base, "visual", wheel, place, "0.1 0.1 0.1 1")
    box = ElementTree.Element("box", size=_text((chassis.length, chassis.width, chassis.height)))
    _shape(base, "collision", box, Pose((centre, 0.0, chassis.height / 2), (0.0, 0.0, 0.0)))
    mount = laser.mount
    housing = ElementTree.Element("box", size=_text(_SENSOR))
    link = _attach(robot, base_frame, laser.frame, Pose((mount.x, mount.y, mount.z), (0.0, 0.0, mount.yaw)))
    _shape(link, "visual", housing, Pose((0.0, 0.0, 0.0), (0.0, 0.0, 0.0)), "0.1 0.1 0.1 1")
    if imu is not None:
        _attach(robot, base_frame, *imu)
    ElementTree.indent(robot)
    return ElementTree.tostring(robot, encoding="unicode")


def _attach(robot: ElementTree.Element, parent: str, name: str, pose: Pose) -> ElementTree.Element:
    link = ElementTree.SubElement(robot, "link", name=name)
    joint = ElementTree.SubElement(robot, "joint", name=f"{parent}_to_{name}", type="fixed")
    ElementTree.SubElement(joint, "parent", link=parent)
    ElementTree.SubElement(joint, "child", link=name)
    ElementTree.SubElement(joint, "origin", xyz=_text(pose.xyz), rpy=_text(pose.rpy))
    return link


def _shape(link: ElementTree.Element, part: str, geometry: ElementTree.Element, pose: Pose, rgba: str = "") -> None:
    shape = ElementTree.SubElement(link, part)
    ElementTree.SubElement(shape, "origin", xyz=_text(pose.xyz), rpy=_text(pose.rpy))
    ElementTree.SubElement(shape, "geometry").append(geometry)
    if rgba:
        name = f"{link.get('name')}_{geometry.tag}_colour"
        material = ElementTree.SubElement(shape, "material", name=name)
        ElementTree.SubElement(material, "color", rgba=rgba)


def _text(values: tuple[float, float, float]) -> str:
    return " ".join(f"{value:g}" for value in values)


def main() -> None:
    """Print the URDF of a model file, for roslaunch: urdf MODEL BASE_FRAME [IMU_FRAME 'X Y Z ROLL PITCH YAW']."""
    try:
        if len(sys.argv) not in (3, 5):
            raise Error("usage: urdf MODEL BASE_FRAME [IMU_FRAME 'X Y Z ROLL PITCH YAW']")
        imu = (sys.argv[3], _pose(sys.argv[4])) if len(sys.argv) == 5 else None
        print(robot_description(load_model(Path(sys.argv[1])), sys.argv[2], imu))
    except Error as error:
        print(f"urdf: {one_line(error)}", file=sys.stderr)
        sys.exit(1)


def _pose(text: str) -> Pose:
    try:
        x, y, z, roll, pitch, yaw = map(float, text.split())
    except ValueError as error:
        raise Error(f"a pose is 'X Y Z ROLL PITCH YAW' [m, rad], not {text!r}") from error
    return Pose((x, y, z), (roll, pitch, yaw))
