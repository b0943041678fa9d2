# SPDX-License-Identifier: BSD-3-Clause
"""The chair's laser as a device: a virtual URG that is fed with the simulator's scans."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from kurumaisu.errors import Error
from kurumaisu.params import Laser
from kurumaisu.sim.scanner import Scan
from kurumaisu.virtual_urg import Sensor, VirtualUrg, load_sensor

_MM = 1e-3  # [m]
_MS = 1_000_000  # [ns]
_NS = 1_000_000_000
_TCP = "tcp:"  # what a port begins with that is none of a pty
_AMID = 0.5e-3  # [s] so that no rounding takes a reading of the sensor's clock to the millisecond before


@dataclass(frozen=True)
class Turn:
    """What a sensor's steps are: the first and the last that are measured, the front's, those of a turn; turns/min."""

    first: int
    last: int
    front: int
    steps: int
    rpm: float

    @property
    def before(self) -> float:
        """Time from step 0 to the first beam [s]."""
        return self.first * 60 / (self.rpm * self.steps)

    def start(self, stamp: int) -> int:
        """Return when the mirror was at step 0 [ns], on the sensor's grid of milliseconds; stamp [ns]: first beam's."""
        return round((stamp - self.before * _NS) / _MS) * _MS

    def remainder(self, stamp: int) -> float:
        """Return by how much the stamp that follows from the sensor's clock is later than the true one [s]."""
        return (self.start(stamp) - stamp) / _NS + self.before


class VirtualLaser:
    """A virtual URG under simulated time: its clock, and its scans, are the simulator's."""

    def __init__(self, laser: Laser, model: Path, sensor: Path, *, port: str, faults: Sequence[str]) -> None:
        """Plug it in at a port: the name of a link to a pty, or tcp:NUMBER.

        model, sensor: the files of the chair and of what the sensor is. Raise Error naming both where the sensor's fan
        is not the model's, and for a port or a fault that cannot be.
        """
        self._sensor = load_sensor(sensor)
        self.turn = _turn(self._sensor)
        check_fan(laser, self.turn, model, sensor)
        self._has_intensities = "ME" not in self._sensor.refused
        self._urg = _plug(_gated(self._sensor, laser), port, faults)
        self._last = 0  # [ns] the newest turn's start

    @property
    def address(self) -> str:
        """Where it is."""
        return self._urg.address

    @property
    def counters(self) -> dict[str, int]:
        """What has happened so far."""
        return self._urg.counters

    def advance(self, now: int, scan: Scan | None, epoch: int) -> bool:
        """Tell the time [ns], and the scan that has just ended, if one has; return whether it was sent to anybody.

        epoch [ns]: the time at the simulation's time 0. A turn that begins before the last one did, after a state was
        loaded, is left out: no mirror turns back.
        """
        if scan is None:
            self._urg.advance(now / _NS)
            return False
        start = self.turn.start(epoch + round(scan.time * _NS))
        if start <= self._last:
            return False
        self._last = start
        before = self._urg.counters["scans"]
        self._urg.measure(now / _NS, start / _NS + _AMID, scan.ranges)
        return self._urg.counters["scans"] > before

    def close(self) -> None:
        """Unplug it."""
        self._urg.close()


def check_fan(laser: Laser, turn: Turn, model: Path, sensor: Path) -> None:
    """Raise Error unless a sensor's steps are the model's beams, and as fast. model, sensor: the files of them."""
    increment, scan_time = math.tau / turn.steps, 60 / turn.rpm
    beams = turn.last - turn.first + 1
    pairs = {  # of the model, of the sensor, rounding of what the model's file has
        "beams": (laser.beams, beams, 0.0),
        "angle_min": (laser.angle_min, (turn.first - turn.front) * increment, 1e-5),
        "angle_increment": (laser.angle_increment, increment, 1e-5 / beams),
        "scan_time": (laser.scan_time, scan_time, 1e-9),
        "time_increment": (laser.time_increment, scan_time / turn.steps, 1e-9),
    }
    for name, (ours, theirs, rounding) in pairs.items():
        if abs(ours - theirs) > rounding:
            raise Error(
                f"{model}: laser.{name} is {ours:.9g}, but steps {turn.first} to {turn.last} of {sensor} make it "
                f"{theirs:.9g}"
            )
