# SPDX-License-Identifier: BSD-3-Clause
"""The chair's picture: a URDF written from the model file."""

from __future__ import annotations

import argparse
import math
import sys
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree

from kurumaisu import frames, program
from kurumaisu.errors import Error, failed
from kurumaisu.params import Model, load_model

# A picture, with which nothing computes: height of the seat, radius and width of a drive wheel [m].
_SEAT, _WHEEL, _TYRE = 0.5, 0.2, 0.05
_SENSOR = (0.05, 0.05, 0.07)  # housing of a URG-04LX [m]


@dataclass(frozen=True)
class Pose:
    """child in parent: metres, and roll, pitch, yaw in radians."""

    xyz: tuple[float, float, float]
    rpy: tuple[float, float, float]


def robot_description(model: Model, base_frame: str, imu: tuple[str, Pose] | None = None, prefix: str = "") -> str:
    """Return URDF: the chair, its laser, and fixed joints. imu: frame and mounting of an inertial sensor.

    prefix: before the frames of the chair and of the laser; that of the sensor is what its messages say.

    What collides is the box of the model, as in the simulator: its footprint, up to the head of the occupant.
    """
    robot = ElementTree.Element("robot", name=model.name)
    chassis, laser = model.chassis, model.laser
    centre = chassis.axle_to_front - chassis.length / 2
    base_frame, laser_frame = prefix + base_frame, prefix + laser.frame
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
    link = _attach(robot, base_frame, laser_frame, Pose((mount.x, mount.y, mount.z), (0.0, 0.0, mount.yaw)))
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
    """Print the URDF of a model file, for roslaunch; exit with 1 where there is none."""
    parser = _parser()
    options = parser.parse_args()
    if (options.imu_frame is None) != (options.imu_pose is None):
        parser.error("IMU_FRAME goes with a pose: 'X Y Z ROLL PITCH YAW'")
    imu = None if options.imu_frame is None else (options.imu_frame, options.imu_pose)
    try:
        base_frame = frames.base_frame(options.base_frame)
        print(robot_description(load_model(options.model), base_frame, imu, options.prefix))
    except Error as error:
        sys.exit(failed("urdf", error))


def _parser() -> argparse.ArgumentParser:
    parser = program.Parser(
        prog="urdf",
        usage="urdf [--prefix P] MODEL.yaml BASE_FRAME [IMU_FRAME POSE]",
        description="Print the URDF of the chair, for the parameter robot_description.",
    )
    parser.add_argument("model", type=Path, metavar="MODEL.yaml", help="what the chair is, as launch/md100.yaml")
    parser.add_argument("--prefix", default="", help="what is put before the frames of chair and laser")
    parser.add_argument("base_frame", metavar="BASE_FRAME", help="of the chair: its name, or base_node's settings")
    parser.add_argument("imu_frame", nargs="?", metavar="IMU_FRAME", help="frame of an inertial sensor")
    parser.add_argument(
        "imu_pose",
        nargs="?",
        type=_pose,
        metavar="POSE",
        help="where it is on the chair: 'X Y Z ROLL PITCH YAW' [m, rad]",
    )
    return parser


def _pose(text: str) -> Pose:
    try:
        x, y, z, roll, pitch, yaw = map(float, text.split())
    except ValueError as error:
        raise argparse.ArgumentTypeError(f"a pose is 'X Y Z ROLL PITCH YAW' [m, rad], not {text!r}") from error
    return Pose((x, y, z), (roll, pitch, yaw))
