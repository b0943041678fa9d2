# SPDX-License-Identifier: BSD-3-Clause
"""A drive of the simulated chair, and the log that mapping and localisation get of it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from kurumaisu import slam
from kurumaisu._core import integrate
from kurumaisu.params import Laser, load_model, shipped
from kurumaisu.sim.chair.scanner import Scan
from kurumaisu.sim.chair.simulator import ChairSimulator, Command
from kurumaisu.sim.settings import load_dynamics, with_effects
from kurumaisu.types import FloatArray
from kurumaisu.world import World

_COMMAND_EVERY = 10  # simulator steps


class SimulatedDrive:
    """The chair on an uneven floor, obeying rates; observation: the latest."""

    def __init__(self, world: World, seed: int) -> None:
        self._model = with_effects(load_model(shipped("launch/md100.yaml")), shipped("launch/uneven_floor.yaml"))
        self._simulator = ChairSimulator(self._model, world, load_dynamics(shipped("launch/physical.yaml")))
        self._commands: list[tuple[float, float]] = []
        self._scans: list[Scan] = []
        self.observation = self._simulator.reset(seed)

    @property
    def due(self) -> bool:
        """Return whether the next step begins with a new command."""
        return len(self._commands) % _COMMAND_EVERY == 0

    def step(self, v: float, w: float) -> None:
        """Obey v [m/s], w [rad/s] for a step of the simulator."""
        self._commands.append((v, w))
        volts = float(self._model.translation.volts(v)), float(self._model.steering.volts(w))
        self.observation = self._simulator.step(Command(*volts, float(np.sign(v)), float(np.sign(w))))
        if self.observation.scan is not None:
            self._scans.append(self.observation.scan)

    def log(self) -> tuple[slam.ScanLog, FloatArray]:
        """Return the scans with odometry of the commands, and the true poses (n, 3) at them."""
        log = _log_of(self._model.laser, np.array(self._commands), self._simulator.step_time, self._scans)
        return log, np.array([scan.pose for scan in self._scans])[: len(log.times)]


def _log_of(laser: Laser, commands: FloatArray, step: float, scans: Sequence[Scan]) -> slam.ScanLog:
    """Return scans with the odometry that integrates the commands (n, 2), each held for a step [s]."""
    odom = integrate(commands[:, 0], commands[:, 1], np.full(len(commands), step))
    fan = slam.Fan(
        angle_min=laser.angle_min,
        angle_increment=laser.angle_increment,
        time_increment=laser.time_increment,
        range_max=laser.range_max,
        base_from_laser=(laser.mount.x, laser.mount.y, laser.mount.yaw),
    )
    times = np.array([scan.time for scan in scans])
    ranges = np.array([scan.ranges for scan in scans], dtype=np.float32)
    return slam.scan_log("drive", times, ranges, fan, step * np.arange(len(odom)), odom)
