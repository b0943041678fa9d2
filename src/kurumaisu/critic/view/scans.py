# SPDX-License-Identifier: BSD-3-Clause
"""A run's scans for the viewer: where the laser was, and by how much its readings differ from the map."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kurumaisu import geometry
from kurumaisu.critic.ranges.scans.walls import Rays
from kurumaisu.critic.values.recording import Series
from kurumaisu.critic.view.spool import Spool
from kurumaisu.params import Laser
from kurumaisu.types import FloatArray
from kurumaisu.viewer.protocol import Fan
from kurumaisu.viewer.tape import Track

_NOWHERE = Fan((0.0, 0.0, 0.0), 0.0, 0.0, 0.0, 0.0, ())  # nobody knows where that scan was taken


@dataclass(frozen=True)
class Scans:
    """Scans of a run. series: numbers in the spool; path: where the chair was, None: nobody knows, it stands at 0.

    rays: of the map, None where there is none, or the path is not in its frame.
    """

    series: Series
    spool: Spool
    laser: Laser
    path: Track | None
    rays: Rays | None

    def fan(self, number: int) -> Fan:
        """Return a scan, with the error of each reading where the map is known."""
        laser, t = self.laser, float(self.series.t[number])
        mount = np.array([laser.mount.x, laser.mount.y, laser.mount.yaw])
        base = (0.0, 0.0, 0.0) if self.path is None else self.path.at(t)
        if base is None:
            return _NOWHERE
        read, intensities = self.spool.get(int(self.series.values[number, 0]))
        ranges = np.asarray(read, dtype=np.float64)
        x, y, yaw = geometry.compose(np.array(base), mount).tolist()
        error = None if self.rays is None or self.path is None else ranges - self._true(t, mount, self.path, self.rays)
        return Fan(
            pose=(x, y, yaw),
            angle_min=laser.angle_min,
            angle_increment=laser.angle_increment,
            range_min=laser.range_min,
            range_max=laser.range_max,
            ranges=ranges,
            error=None if error is None else np.where(np.isfinite(error), error, np.nan),
            intensities=intensities,
        )

    def _true(self, t: float, mount: FloatArray, path: Track, rays: Rays) -> FloatArray:
        """Return the ranges (b,) in the map, each beam cast from where the laser was when it was fired."""
        laser = self.laser
        times = t + laser.time_increment * np.arange(laser.beams)
        poses = geometry.compose(geometry.interpolate(path.times, path.poses, times), mount)
        return rays.ranges(poses, laser.bearings)
