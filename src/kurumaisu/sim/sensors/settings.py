# SPDX-License-Identifier: BSD-3-Clause
"""Sensors that a world file cannot describe, or of which it says too little: launch/sensors.yaml."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from kurumaisu import settings
from kurumaisu.sim.sensors.parameters import MOUNTED, READERS, Parameters, read_place
from kurumaisu.types import FloatArray

EVERY_ROBOT = "every"


@dataclass(frozen=True)
class SensorSettings:
    """One sensor. robot: name of a position model, or EVERY_ROBOT; name: of its topic and frame; rate [Hz].

    mount: (4,) of x, y, z [m], heading [rad] on the robot, zeros for a battery; the sonars of a ring and the strips of
    a bumper have it in their own places already.
    """

    name: str
    robot: str
    rate: float
    mount: FloatArray
    parameters: Parameters

    def fits(self, names: Collection[str | None]) -> bool:
        """Return whether one of the robots of these names has it."""
        return self.robot == EVERY_ROBOT or self.robot in names


def load_sensors(path: Path) -> tuple[SensorSettings, ...]:
    """Read a sensors.yaml. Raise Error naming file and key."""
    return read_sensors(settings.load(path))


def read_sensors(section: settings.Section) -> tuple[SensorSettings, ...]:
    """Return the sensors of a section, in their order. Raise Error naming file and key."""
    sensors = tuple(_sensor(item) for item in section.items("sensors"))
    section.end()
    for i, sensor in enumerate(sensors):
        for other in sensors[:i]:
            same_robot = sensor.robot == other.robot or EVERY_ROBOT in (sensor.robot, other.robot)
            if sensor.name == other.name and same_robot:
                raise section.error(f"sensors[{i}].name", f"is taken by another sensor: {sensor.name}")
    return sensors


def _sensor(section: settings.Section) -> SensorSettings:
    kind = section.text("type", tuple(READERS))
    name, robot, rate = section.text("name"), section.text("robot"), section.number("rate", above=0)
    mount = read_place(section.section("mount")) if kind in MOUNTED else np.zeros(4)
    parameters = section.section("parameters")
    found = READERS[kind](parameters, mount)
    parameters.end()
    section.end()
    return SensorSettings(name, robot, rate, mount, found)
