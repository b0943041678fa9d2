# SPDX-License-Identifier: BSD-3-Clause
"""The chair's picture: a URDF written from the model file."""

from __future__ import annotations

import sys
from pathlib import Path
from xml.etree import ElementTree

from kurumaisu.errors import Error, one_line
from kurumaisu.params import Model, load_model

_SEAT = 0.5  # height of the drawn body [m]; a picture, nothing computes with it
_SENSOR = (0.05, 0.05, 0.07)  # housing of a URG-04LX [m]


def robot_description(model: Model, base_frame: str) -> str:
    """Return URDF: a box for the chair, a box for the laser, and the fixed joint between them."""
    robot = ElementTree.Element("robot", name=model.name)
    chassis, laser = model.chassis, model.laser
    centre = chassis.axle_to_front - chassis.length / 2
    _link(robot, base_frame, (chassis.length, chassis.width, _SEAT), (centre, 0.0, _SEAT / 2), "0.2 0.3 0.6 0.6")
    _link(robot, laser.frame, _SENSOR, (0.0, 0.0, 0.0), "0.1 0.1 0.1 1")
    joint = ElementTree.SubElement(robot, "joint", name=f"{base_frame}_to_{laser.frame}", type="fixed")
    ElementTree.SubElement(joint, "parent", link=base_frame)
    ElementTree.SubElement(joint, "child", link=laser.frame)
    mount = laser.mount
    ElementTree.SubElement(joint, "origin", xyz=_text((mount.x, mount.y, mount.z)), rpy=_text((0.0, 0.0, mount.yaw)))
    ElementTree.indent(robot)
    return ElementTree.tostring(robot, encoding="unicode")


def _link(
    robot: ElementTree.Element,
    name: str,
    size: tuple[float, float, float],
    centre: tuple[float, float, float],
    rgba: str,
) -> None:
    link = ElementTree.SubElement(robot, "link", name=name)
    for part in ("visual", "collision"):
        shape = ElementTree.SubElement(link, part)
        ElementTree.SubElement(shape, "origin", xyz=_text(centre), rpy="0 0 0")
        ElementTree.SubElement(ElementTree.SubElement(shape, "geometry"), "box", size=_text(size))
        if part == "visual":
            material = ElementTree.SubElement(shape, "material", name=f"{name}_colour")
            ElementTree.SubElement(material, "color", rgba=rgba)


def _text(values: tuple[float, float, float]) -> str:
    return " ".join(f"{value:g}" for value in values)


def main() -> None:
    """Print the URDF of a model file, for roslaunch: urdf MODEL BASE_FRAME."""
    try:
        if len(sys.argv) != 3:
            raise Error("usage: urdf MODEL BASE_FRAME")
        print(robot_description(load_model(Path(sys.argv[1])), sys.argv[2]))
    except Error as error:
        print(f"urdf: {one_line(error)}", file=sys.stderr)
        sys.exit(1)
