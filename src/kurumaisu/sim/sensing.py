# SPDX-License-Identifier: BSD-3-Clause
"""The sensors of a sensors.yaml on a simulator's robots."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from kurumaisu._core import Arena
from kurumaisu.sim.machinery import Machinery
from kurumaisu.sim.partition import build_arena
from kurumaisu.sim.sensors.bumper import BumperSettings
from kurumaisu.sim.sensors.settings import SensorSettings
from kurumaisu.sim.sensors.suite import Moment, Reading, SensorSuite


class Sensing:
    """Reads the sensors that are due, in every step."""

    def __init__(
        self, sensors: Sequence[SensorSettings], machinery: Machinery, time: float, rng: np.random.Generator
    ) -> None:
        """Power up the sensors at a time [s]. Raise Error for a robot that the world has not."""
        self._machinery = machinery
        self._solids, self._numbers = machinery.arena, machinery.numbers
        if any(isinstance(sensor.parameters, BumperSettings) for sensor in sensors):
            start = machinery.population
            threads = machinery.options.threads
            self._solids, self._numbers, _ = build_arena(start.models, start.poses, machinery.bodies, threads, True)
        self._suite = SensorSuite(sensors, machinery.population.models, self._moment(time), rng)

    def read(self, time: float) -> tuple[Reading, ...]:
        """Return the readings that are due."""
        return self._suite.read(self._moment(time))

    def state(self) -> list[dict[str, Any]]:
        """Return what the next readings depend on: not copies."""
        return self._suite.state()

    def restore(self, state: Sequence[dict[str, Any]]) -> None:
        """Go back to a state of the same sensors."""
        self._suite.restore(state)

    def _moment(self, time: float) -> Moment:
        machinery = self._machinery
        return Moment(time, machinery.arena, self._moved_solids(), machinery.model_poses(), machinery.rates())

    def _moved_solids(self) -> Arena:
        machinery = self._machinery
        if self._solids is not machinery.arena:
            self._solids.set_poses(self._numbers, np.ascontiguousarray(machinery.frames[:-1]))
        return self._solids
