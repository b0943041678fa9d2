# SPDX-License-Identifier: BSD-3-Clause
"""All that a simulator's robots sense beside their rangers: sensors of a sensors.yaml, devices of the world file."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from kurumaisu.sim.robots.machinery import Machinery
from kurumaisu.sim.robots.solids import Solids

if TYPE_CHECKING:  # loaded below by those that have any
    from kurumaisu.sim.robots.devices import Value, WorldDevices
    from kurumaisu.sim.sensors.settings import SensorSettings
    from kurumaisu.sim.sensors.suite import Moment, Reading, SensorSuite


class Sensing:
    """Reads what is due, in every step."""

    def __init__(
        self, sensors: Sequence[SensorSettings], machinery: Machinery, time: float, rng: np.random.Generator
    ) -> None:
        """Power up the sensors at a time [s]. Raise Error for a robot that the world has not."""
        self._machinery = machinery
        self._solids: Solids | None = None
        self._suite: SensorSuite | None = None
        if sensors:
            from kurumaisu.sim.sensors.bumper import BumperSettings
            from kurumaisu.sim.sensors.suite import SensorSuite

            if any(isinstance(sensor.parameters, BumperSettings) for sensor in sensors):
                self._solids = Solids(machinery)
            self._suite = SensorSuite(sensors, machinery.population.models, self._moment(time), rng)
        self._devices: WorldDevices | None = None
        if machinery.options.devices:
            from kurumaisu.sim.robots.devices import WorldDevices

            self._devices = WorldDevices(machinery, machinery.options.devices)

    def read(self, time: float) -> tuple[Reading, ...]:
        """Return the readings of sensors that are due at a time [s]."""
        return self._suite.read(self._moment(time)) if self._suite is not None else ()

    def devices(self, step: int) -> dict[int, Value]:
        """Return the readings of devices that are due in a step, counted from 1, by their models' numbers."""
        return self._devices.read(step) if self._devices is not None else {}

    def state(self) -> list[dict[str, Any]]:
        """Return what the next readings depend on: copies."""
        return self._suite.state() if self._suite is not None else []

    def restore(self, state: Sequence[dict[str, Any]]) -> None:
        """Go back to a state of the same sensors."""
        if self._suite is not None:
            self._suite.restore(state)

    def _moment(self, time: float) -> Moment:
        from kurumaisu.sim.sensors.suite import Moment

        machinery = self._machinery
        solids = machinery.arena if self._solids is None else self._solids.now()
        return Moment(time, machinery.arena, solids, machinery.model_poses(), machinery.rates())
