# SPDX-License-Identifier: BSD-3-Clause
"""The chair's laser as a device: a virtual URG that is fed with the simulator's scans."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from kurumaisu.errors import Error
from kurumaisu.params import Laser
from kurumaisu.sim.chair.scanner import Scan
from kurumaisu.virtual_urg import Pty, Sensor, Tcp, VirtualUrg

_MS = 1_000_000  # [ns]
_NS = 1_000_000_000
_TCP = "tcp:"  # begins a port that is no pty
_AMID = 0.5e-3  # [s] into a millisecond, so that no rounding makes the sensor's clock read another one


class VirtualLaser:
    """A virtual URG under simulated time: its clock and its scans are the simulator's."""

    def __init__(self, sensor: Sensor, laser: Laser, port: str, faults: Sequence[str], intensity: float) -> None:
        """Plug it in at a port: the name of a link to a pty, or tcp:NUMBER.

        sensor: one that passes check_fan, changed here; faults: as `corrupt@5`; intensity: what it says of a surface
        of reflectance 1, if it says such things. Raise Error for a port that cannot be had, and for unknown faults.
        """
        _gate(sensor, laser)
        self._sensor = sensor
        self._intensity = None if "ME" in sensor.model.refused else intensity
        self._last = 0  # [ns] start of the newest turn
        self._urg = VirtualUrg(sensor, _place(port), faults=faults, fed=True)

    @property
    def address(self) -> str:
        """Where clients find it."""
        return self._urg.address

    @property
    def counters(self) -> dict[str, int]:
        """What happened so far, see VirtualUrg."""
        return self._urg.counters

    def advance(self, now: int, scan: Scan | None, epoch: int) -> bool:
        """Tell the time [ns], and the scan that has just ended, if one has; return whether it was sent to a client.

        epoch [ns]: the time at the simulation's time 0. No mirror turns back: a turn that does not begin after the one
        before it, as may happen after a state has been loaded, is left out.
        """
        start = 0 if scan is None else turn_start(self._sensor, epoch + round(scan.time * _NS))
        if scan is None or start <= self._last:
            self._urg.advance(now / _NS)
            return False
        self._last = start
        before = self._urg.counters["scans"]
        strengths = None if self._intensity is None else scan.returns * self._intensity
        kept = self._urg.measure(now / _NS, start / _NS + _AMID, scan.ranges, strengths)
        return kept and self._urg.connected and self._urg.counters["scans"] > before

    def close(self) -> None:
        """Unplug it."""
        self._urg.close()


def turn_start(sensor: Sensor, stamp: int) -> int:
    """Return when the mirror was at step 0 for a first beam at a stamp [ns], on the clock's grid of milliseconds."""
    return round((stamp - sensor.first * sensor.step_time * _NS) / _MS) * _MS


def remainder(sensor: Sensor, stamp: int) -> float:
    """Return by how much a stamp worked out of the sensor's clock is later than the true one [s]."""
    return (turn_start(sensor, stamp) - stamp) / _NS + sensor.first * sensor.step_time


def check_fan(laser: Laser, sensor: Sensor, model: Path) -> None:
    """Raise Error naming both files unless the sensor's steps are the model's beams, as fast, and reach as far."""
    pairs = {  # of the model, of the sensor, rounding in the model's file
        "beams": (laser.beams, sensor.steps, 0.0),
        "angle_min": (laser.angle_min, float(sensor.bearings[0]), 1e-5),
        "angle_increment": (laser.angle_increment, sensor.increment, 1e-5 / sensor.steps),
        "scan_time": (laser.scan_time, sensor.scan_time, 1e-9),
        "time_increment": (laser.time_increment, sensor.step_time, 1e-9),
    }
    for name, (ours, theirs, rounding) in pairs.items():
        if abs(ours - theirs) > rounding:
            steps = f"steps {sensor.first} to {sensor.last} of {sensor.path}"
            raise Error(f"{model}: laser.{name}: is {ours:.9g}, but {steps} make it {theirs:.9g}")
    if laser.range_max > sensor.range_max:
        raise Error(
            f"{model}: laser.error.range_max: is {laser.range_max:g} m, but DMAX of {sensor.path} is "
            f"{sensor.range_max:g} m"
        )


def _gate(sensor: Sensor, laser: Laser) -> None:
    """Let a sensor say the model's gate of itself: else who trusts DMAX takes no return for far too much free space."""
    said = {"DMIN": str(round(1000 * laser.range_min)), "DMAX": str(round(1000 * laser.range_max))}
    sensor.model.parameters = [(key, said.get(key, value)) for key, value in sensor.model.parameters]


def _place(port: str) -> Pty | Tcp:
    if not port.startswith(_TCP):
        return Pty(Path(port))
    number = port.removeprefix(_TCP)
    if not number.isdigit():
        raise Error(f"laser_port: must be the name of a link, or tcp:NUMBER: {port!r}")
    return Tcp(int(number))
