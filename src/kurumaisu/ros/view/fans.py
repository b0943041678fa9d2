# SPDX-License-Identifier: BSD-3-Clause
"""What the fans of a simulation saw last, for who draws it; worked out only when somebody asks."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from kurumaisu.geometry import PLANAR, attached
from kurumaisu.params import Laser
from kurumaisu.sim.rangers.fans import spread
from kurumaisu.sim.rangers.scans import Scans
from kurumaisu.sim.robots.machinery import Machinery
from kurumaisu.sim.robots.simulator import Simulator
from kurumaisu.types import FloatArray, IntArray

if TYPE_CHECKING:  # it loads pymunk, which worlds of Stage need not pay for
    from kurumaisu.sim.chair.scanner import Scan
    from kurumaisu.sim.chair.simulator import Observation as ChairObservation

_NS = 1_000_000_000


@dataclass(frozen=True)
class Looks:
    """The newest scans of all fans: stamps (f,) [ns], poses (f, 3) of the sensors; rows of all beams, as in View."""

    stamps: IntArray
    poses: FloatArray
    ranges: FloatArray
    truths: FloatArray | None
    intensities: FloatArray


class Fans(Protocol):
    """The fans of a simulation."""

    def places(self, machinery: Machinery) -> list[dict[str, Any]]:
        """Return for each fan its body's row, bearings and gate."""

    @property
    def fresh(self) -> bool:
        """Whether there may be no newer ones in the next step."""

    def looks(self) -> Looks | None:
        """Return the newest scans, None before the first."""


class ChairFan:
    """The chair's laser."""

    def __init__(self, laser: Laser, chair: Callable[[], int]) -> None:
        """chair: tells its row among the bodies."""
        self._laser, self._chair = laser, chair
        mount = laser.mount
        self._mount = np.array([mount.x, mount.y, mount.z, mount.yaw])
        self._newest: tuple[Scan, int] | None = None

    def note(self, observation: ChairObservation, epoch: int) -> None:
        """Hear of a step; epoch [ns]: what the clock said at the simulation's time 0."""
        if observation.scan is not None:
            self._newest = observation.scan, epoch

    def places(self, _machinery: Machinery) -> list[dict[str, Any]]:
        """Return the one."""
        laser = self._laser
        return [
            {
                "row": self._chair(),
                "beams": laser.beams,
                "angle_min": laser.angle_min,
                "angle_increment": laser.angle_increment,
                "range_min": laser.range_min,
                "range_max": laser.range_max,
            }
        ]

    @property
    def fresh(self) -> bool:
        """A scan keeps the place where it was made."""
        return True

    def looks(self) -> Looks | None:
        """Return its newest scan."""
        if self._newest is None:
            return None
        scan, epoch = self._newest
        x, y, heading = scan.pose.tolist()
        place = attached(np.array([x, y, 0.0, heading]), self._mount)[None, PLANAR]
        stamps = np.array([epoch + round(scan.time * _NS)])
        return Looks(stamps, place, scan.ranges, scan.truths, scan.returns)


class FleetFans:
    """All fans of the robots of a world file."""

    def __init__(self, simulator: Simulator) -> None:
        self._simulator = simulator
        self.fresh = False
        self._newest: tuple[int, Scans, FloatArray] | None = None  # [ns], and the bodies' frames then
        self._rows = np.empty(0, np.int64)  # of the fans' bodies
        self._mounts = np.empty((0, 4))

    def note(self, now: int) -> None:
        """Hear of a step at the end of which a view is due; now [ns]. Only now is it known where the fans measured."""
        scans, time = self._simulator.scans, self._simulator.time
        self.fresh = not len(scans) or any(sweep.time == time for sweep in scans.sweeps)
        if self.fresh and len(scans):
            self._newest = now, scans, self._simulator.machinery.frames.copy()

    def places(self, machinery: Machinery) -> list[dict[str, Any]]:
        """Return those of the models that there are now."""
        self._newest = None
        self._rows = np.array([fan.body for fan in machinery.fans], np.int64)
        self._mounts = np.array([fan.mount for fan in machinery.fans]).reshape(-1, 4)
        return [
            {
                "row": fan.body,
                "beams": fan.fan.samples,
                "angle_min": spread(fan.fan)[0],
                "angle_increment": spread(fan.fan)[1],
                "range_min": fan.fan.range_min,
                "range_max": fan.fan.range_max,
            }
            for fan in machinery.fans
        ]

    def looks(self) -> Looks | None:
        """Return their newest scans."""
        if self._newest is None:
            return None
        self.fresh = False
        stamp, scans, frames = self._newest
        poses = attached(frames[self._rows], self._mounts)[:, PLANAR]
        stamps = np.full(len(self._rows), stamp, np.int64)
        return Looks(stamps, poses, scans.ranges, self._simulator.machinery.rangers.truths, scans.returns)
