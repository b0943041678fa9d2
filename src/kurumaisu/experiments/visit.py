# SPDX-License-Identifier: BSD-3-Clause
"""Standing at a place for a while. No ROS."""

from __future__ import annotations

import numpy as np

from kurumaisu import geometry
from kurumaisu.experiments.script import Place
from kurumaisu.experiments.supervisor import Care, Rest
from kurumaisu.types import FloatArray


class Visit:
    """Tells whether the chair stands at a place."""

    def __init__(self, place: Place, origin: FloatArray, care: Care) -> None:
        """Take the place; origin (3,): where the script began, in the map."""
        self.target = geometry.compose(origin, place.pose)
        self.seconds = place.seconds
        self._care = care
        self._rest = Rest(care)
        self._there = False

    def see(self, t: float, pose: FloatArray) -> None:
        """Take a pose (3,) in the map that came at a time [s]."""
        self._rest.see(t, pose)
        error = pose - self.target
        near = np.hypot(*error[:2]) <= self._care.place_distance
        self._there = bool(near and abs(float(geometry.wrap(error[2]))) <= self._care.place_angle)

    def stands(self, now: float, since: float) -> bool:
        """Return whether it is there at a time [s], and at rest for rest_time before another [s]."""
        return self._there and self._rest.since <= since - self._care.rest_time and now >= since
