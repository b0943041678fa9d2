# SPDX-License-Identifier: BSD-3-Clause
"""The battery: coulomb counting behind an internal resistance, discharged by electronics and motion."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kurumaisu.sim.sensors.imu import STANDARD_GRAVITY
from kurumaisu.types import BoolArray, FloatArray

_HOUR = 3600.0  # [s]


@dataclass(frozen=True)
class Load:
    """What moves: mass [kg], inertia about the vertical axis [kg m^2], idle power of the electronics [W].

    rolling: resistance [1] as a share of the weight; scrubbing: torque of wheels that turn on the spot [N m];
    efficiency: mechanical per electrical power when driving; recovery: electrical per mechanical power when braking.
    """

    mass: float
    inertia: float
    idle: float
    rolling: float
    scrubbing: float
    efficiency: float
    recovery: float

    def power(self, velocities: FloatArray, accelerations: FloatArray) -> FloatArray:
        """Return the electrical power (k,) [W] for forward, leftward, yaw rates (k, 3) and their derivatives."""
        speed, w = np.hypot(velocities[:, 0], velocities[:, 1]), velocities[:, 2]
        inertial = self.mass * (velocities[:, :2] * accelerations[:, :2]).sum(axis=-1)
        inertial += self.inertia * w * accelerations[:, 2]
        mechanical = inertial + self.rolling * self.mass * STANDARD_GRAVITY * speed + self.scrubbing * np.abs(w)
        driven = np.where(mechanical > 0, mechanical / self.efficiency, mechanical * self.recovery)
        return np.asarray(self.idle + driven)


@dataclass(frozen=True)
class BatterySettings:
    """capacity [A h]; resistance [ohm]; charge: the state at the start, 0 to 1.

    curve: (n, 2) of state of charge, ascending from 0 to 1, and open-circuit voltage [V], ascending.
    """

    capacity: float
    resistance: float
    charge: float
    curve: FloatArray
    load: Load


@dataclass(frozen=True)
class BatteryReading:
    """As sensor_msgs/BatteryState has it, (k,) each.

    voltage: at the terminals [V]; current [A], negative when discharging; charge [A h]; percentage 0 to 1;
    exhausted: empty, or asked for more power than it can give.
    """

    voltage: FloatArray
    current: FloatArray
    charge: FloatArray
    percentage: FloatArray
    exhausted: BoolArray


class Battery:
    """The batteries of k robots."""

    def __init__(self, settings: BatterySettings, velocities: FloatArray) -> None:
        """Start with the settings' charge on robots with velocities (k, 3): forward, leftward [m/s], yaw [rad/s]."""
        self._settings = settings
        self._velocities = velocities.copy()
        self._state = np.full(len(velocities), settings.charge)

    def read(self, velocities: FloatArray, dt: float) -> BatteryReading:
        """Discharge for dt [s], in which the velocities changed evenly to those given (k, 3)."""
        s = self._settings
        mean, slope = (velocities + self._velocities) / 2, (velocities - self._velocities) / dt
        self._velocities = velocities.copy()
        open_circuit = np.interp(self._state, s.curve[:, 0], s.curve[:, 1])
        current, voltage, starved = _terminals(open_circuit, s.resistance, s.load.power(mean, slope))
        used = current * dt / (_HOUR * s.capacity)
        empty = self._state - used <= 0
        self._state = np.clip(self._state - used, 0.0, 1.0)
        return BatteryReading(voltage, -current, self._state * s.capacity, self._state.copy(), empty | starved)


def _terminals(
    open_circuit: FloatArray, resistance: float, power: FloatArray
) -> tuple[FloatArray, FloatArray, BoolArray]:
    """Return current drawn [A], voltage [V] and whether the power is more than there is.

    The smaller root of power = (open_circuit - resistance * current) * current, written to hold for resistance 0, too.
    """
    root = open_circuit**2 - 4 * resistance * power
    current = 2 * power / (open_circuit + np.sqrt(np.maximum(root, 0)))
    if resistance > 0:
        current = np.where(root < 0, open_circuit / (2 * resistance), current)
    return current, open_circuit - resistance * current, np.asarray(root < 0)
