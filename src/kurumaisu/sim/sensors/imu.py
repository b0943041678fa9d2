# SPDX-License-Identifier: BSD-3-Clause
"""The inertial measurement unit: yaw rate and specific force of a robot that moves in the plane."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kurumaisu.geometry import wrap
from kurumaisu.sim.sensors.inertial_error import InertialError, InertialErrorSettings
from kurumaisu.types import FloatArray

STANDARD_GRAVITY = 9.80665  # [m/s^2], standard: what instruments are calibrated by


@dataclass(frozen=True)
class ImuSettings:
    """mount: x, y [m], yaw [rad] on the robot, z up; heading: none, or integrated from the measured yaw rate."""

    mount: tuple[float, float, float]
    gyroscope: InertialErrorSettings
    accelerometer: InertialErrorSettings
    heading: str


@dataclass(frozen=True)
class ImuReading:
    """In the frame of the unit: angular_velocity (k, 3) [rad/s], acceleration (k, 3) [m/s^2].

    The acceleration is the specific force: (0, 0, +g) at rest. heading (k,) [rad] of the unit in the map, or None.
    """

    angular_velocity: FloatArray
    acceleration: FloatArray
    heading: FloatArray | None


class Imu:
    """The units of k robots."""

    def __init__(
        self, settings: ImuSettings, velocities: FloatArray, headings: FloatArray, rng: np.random.Generator
    ) -> None:
        """Power up on robots with velocities (k, 3): forward, leftward [m/s], yaw [rad/s], and headings (k,) [rad]."""
        self._settings = settings
        self._velocities = velocities.copy()
        self._gyroscope = InertialError(settings.gyroscope, (len(velocities), 3), rng)
        self._accelerometer = InertialError(settings.accelerometer, (len(velocities), 3), rng)
        self._heading = headings + settings.mount[2]

    def read(self, velocities: FloatArray, dt: float, rng: np.random.Generator) -> ImuReading:
        """Return the readings over the last dt [s], in which the velocities changed evenly to those given (k, 3)."""
        force, rates = self._truth(velocities, dt)
        self._velocities = velocities.copy()
        angular_velocity = self._gyroscope.apply(rates, dt, rng)
        acceleration = self._accelerometer.apply(force, dt, rng)
        self._heading = wrap(self._heading + angular_velocity[:, 2] * dt)
        heading = self._heading.copy() if self._settings.heading == "integrated" else None
        return ImuReading(angular_velocity, acceleration, heading)

    def _truth(self, velocities: FloatArray, dt: float) -> tuple[FloatArray, FloatArray]:
        """Return specific force and rates (k, 3) at the unit; velocities turn with the robot, hence the w x v."""
        x, y, yaw = self._settings.mount
        forward, leftward, w = ((velocities + self._velocities) / 2).T
        d_forward, d_leftward, d_w = ((velocities - self._velocities) / dt).T
        ahead = d_forward - w * leftward - d_w * y - w**2 * x
        left = d_leftward + w * forward + d_w * x - w**2 * y
        c, s = np.cos(yaw), np.sin(yaw)
        zero = np.zeros(len(w))
        force = np.stack([c * ahead + s * left, c * left - s * ahead, zero + STANDARD_GRAVITY], axis=-1)
        return force, np.stack([zero, zero, w], axis=-1)
