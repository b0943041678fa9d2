# SPDX-License-Identifier: BSD-3-Clause
"""The laser on a moving chair: every beam from where the laser is when it fires."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from kurumaisu._core import Scene
from kurumaisu.errors import Error
from kurumaisu.geometry import compose, interpolate
from kurumaisu.params import Laser
from kurumaisu.types import FloatArray


@dataclass(frozen=True)
class Scan:
    """Readings (beams,) [m]: +inf no return, NaN below range_min.

    time [s] and pose (3,): base_link in the map, both at the first beam.
    """

    time: float
    pose: FloatArray
    ranges: FloatArray


class Scanner:
    """Takes a scan every scan_time from the poses of the chair."""

    def __init__(self, laser: Laser, scene: Scene, rng: np.random.Generator) -> None:
        """Start a scan at time 0. Raise Error for a fan that outlasts scan_time."""
        self._laser = laser
        self._scene = scene
        self._rng = rng
        self._mount = np.array([laser.mount.x, laser.mount.y, laser.mount.yaw])
        self._bearings = laser.bearings
        self._delays = laser.time_increment * np.arange(laser.beams)  # of the beams after the first [s]
        if self._delays[-1] > laser.scan_time:
            raise Error(
                f"laser: the last beam comes {self._delays[-1]:g} s after the first, "
                f"more than scan_time = {laser.scan_time:g} s"
            )
        self._count = 0  # of scans taken
        self._times: list[float] = []
        self._poses: list[FloatArray] = []

    def observe(self, time: float, pose: FloatArray) -> Scan | None:
        """Note where the chair is, times increasing [s]; return the scan that is complete, if any."""
        self._times.append(time)
        self._poses.append(pose)
        start = self._count * self._laser.scan_time
        rounding = 1e-9  # [s] of multiples of the step
        if time < start + self._delays[-1] - rounding:
            return None
        self._count += 1
        times, poses = np.array(self._times), np.array(self._poses)
        scan = self._scan(start, interpolate(times, poses, start + self._delays))
        self._forget(self._count * self._laser.scan_time)
        return scan

    def _scan(self, start: float, poses: FloatArray) -> Scan:
        origins = compose(poses, self._mount)
        ranges = self._scene.cast(origins, self._bearings, math.inf)
        readings = self._laser.error.reading(ranges, self._rng.standard_normal(len(ranges)))
        return Scan(start, poses[0], readings)

    def _forget(self, before: float) -> None:
        """Drop what the next scan does not need: all but the last pose that is not after its start."""
        keep = max(0, int(np.searchsorted(self._times, before, side="right")) - 1)
        del self._times[:keep], self._poses[:keep]
