# SPDX-License-Identifier: BSD-3-Clause
"""All sensors of launch/sensors.yaml on the robots of a world, each at its own rate."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from kurumaisu.errors import Error
from kurumaisu.geometry import attached
from kurumaisu.names import hint
from kurumaisu.sim.memory import recall, remember
from kurumaisu.sim.sensors.battery import Battery, BatterySettings
from kurumaisu.sim.sensors.bumper import BumperSensor, BumperSettings
from kurumaisu.sim.sensors.camera import CameraSensor, Scenery, mounted_eye
from kurumaisu.sim.sensors.fiducial import FiducialFinder
from kurumaisu.sim.sensors.imu import Imu, ImuSettings
from kurumaisu.sim.sensors.rays import Rays
from kurumaisu.sim.sensors.settings import EVERY_ROBOT, SensorSettings
from kurumaisu.sim.sensors.sonar import Sonar, SonarSettings
from kurumaisu.types import FloatArray, IntArray
from kurumaisu.world.model import Camera, Fiducial, Model, Position

_STATELESS = (BumperSensor, CameraSensor, FiducialFinder, Sonar)


@dataclass(frozen=True)
class Moment:
    """What there is to be sensed at a time [s].

    rays: among what rangers see; solids: among what is solid, for bumpers; poses (n, 4) of all models in the map;
    velocities (r, 3) of the robots in file order: forward, leftward [m/s], yaw [rad/s].
    """

    time: float
    rays: Rays
    solids: Rays
    poses: FloatArray
    velocities: FloatArray


@dataclass(frozen=True)
class Reading:
    """What a sensor answered on some robots (k,), numbers in file order: as its class returns it, row by row.

    A camera: a tuple of k pictures; a fiducial finder: sightings whose finder counts the k robots.
    """

    sensor: SensorSettings
    robots: IntArray
    value: Any


@dataclass
class _Running:
    settings: SensorSettings
    robots: IntArray  # (k,), in file order
    models: IntArray  # (k,), of these robots in the world
    roots: IntArray  # (k,)
    sensor: Any
    rng: np.random.Generator
    time: float  # of the last reading [s]


class SensorSuite:
    """Runs the sensors; a deep copy is a saved state."""

    def __init__(
        self, sensors: Sequence[SensorSettings], models: Sequence[Model], start: Moment, rng: np.random.Generator
    ) -> None:
        """Power up all sensors at the start. Raise Error for a robot that the world has not.

        Each sensor has a stream of random numbers of its own, so that the rate of one does not change another's noise.
        """
        robots = [model for model in models if isinstance(model.device, Position)]
        self._scenery = Scenery(models)
        self._running = []
        for settings in sensors:
            carriers = [
                i for i, robot in enumerate(robots) if settings.robot == EVERY_ROBOT or robot.name == settings.robot
            ]
            if not carriers and settings.robot != EVERY_ROBOT:
                near = hint(settings.robot, [robot.name for robot in robots if robot.name])
                raise Error(
                    f"sensor {settings.name}: robot: the world has no position of this name: {settings.robot}; {near}"
                )
            rows: IntArray = np.array(carriers, dtype=np.int64)
            bodies: IntArray = np.array([robots[i].index for i in carriers], dtype=np.int64)
            roots: IntArray = np.array([robots[i].root for i in carriers], dtype=np.int64)
            own = np.random.default_rng(rng.integers(0, 2**63, 4))
            sensor = _power_up(settings, models, start.poses[bodies, 3], start.velocities[rows], own)
            self._running.append(_Running(settings, rows, bodies, roots, sensor, own, start.time))

    def read(self, moment: Moment) -> tuple[Reading, ...]:
        """Return the readings due at a moment, in the order of the settings; call it in every step."""
        return tuple(
            Reading(running.settings, running.robots, self._read(running, moment))
            for running in self._running
            if _due(running, moment.time)
        )

    def state(self) -> list[dict[str, Any]]:
        """Return what the next readings depend on: copies."""
        return [
            {
                "time": running.time,
                "random": running.rng.bit_generator.state,
                "sensor": None if isinstance(running.sensor, _STATELESS) else remember(running.sensor),
            }
            for running in self._running
        ]

    def restore(self, state: Sequence[dict[str, Any]]) -> None:
        """Go back to a state of the same sensors, as new."""
        for running, known in zip(self._running, state, strict=True):
            running.time = known["time"]
            running.rng.bit_generator.state = known["random"]
            if known["sensor"] is not None:
                recall(running.sensor, known["sensor"])

    def _read(self, running: _Running, moment: Moment) -> Any:
        dt, running.time = moment.time - running.time, moment.time
        parameters = running.settings.parameters
        if isinstance(parameters, Camera):
            eyes = attached(moment.poses[running.models], running.settings.mount)
            return tuple(
                running.sensor.take(self._scenery, moment.poses, mounted_eye(parameters, eye), int(root))
                for eye, root in zip(eyes, running.roots, strict=True)
            )
        return _READ[type(parameters)](running, moment, dt)


def _due(running: _Running, time: float) -> bool:
    rounding = 1e-6  # [1] of multiples of the period
    rate = running.settings.rate
    return math.floor(time * rate + rounding) > math.floor(running.time * rate + rounding)


def _power_up(
    settings: SensorSettings,
    models: Sequence[Model],
    headings: FloatArray,
    velocities: FloatArray,
    rng: np.random.Generator,
) -> Any:
    match settings.parameters:
        case ImuSettings() as imu:
            return Imu(imu, velocities, headings, rng)
        case BatterySettings() as battery:
            return Battery(battery, velocities)
        case SonarSettings() as sonar:
            return Sonar(sonar)
        case BumperSettings() as bumper:
            return BumperSensor(bumper)
        case Fiducial() as fiducial:
            return FiducialFinder(fiducial, models)
        case Camera() as camera:
            return CameraSensor(camera)


_READ: dict[type, Callable[[_Running, Moment, float], Any]] = {
    ImuSettings: lambda r, m, dt: r.sensor.read(m.velocities[r.robots], dt, r.rng),
    BatterySettings: lambda r, m, dt: r.sensor.read(m.velocities[r.robots], dt),
    SonarSettings: lambda r, m, dt: r.sensor.read(m.rays, m.poses[r.models], r.roots, r.rng),
    BumperSettings: lambda r, m, dt: r.sensor.read(m.solids, m.poses[r.models], r.roots),
    Fiducial: lambda r, m, dt: r.sensor.find(m.rays, attached(m.poses[r.models], r.settings.mount), r.roots, m.poses),
}
