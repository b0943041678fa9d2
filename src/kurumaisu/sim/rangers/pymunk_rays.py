# SPDX-License-Identifier: BSD-3-Clause
"""Rays through pymunk: a second opinion on the ray caster, not a part of the simulator."""

from __future__ import annotations

import math

import numpy as np
import pymunk

from kurumaisu.types import FloatArray


class PymunkRays:
    """Asks pymunk what each ray meets first."""

    def __init__(self, segments: FloatArray) -> None:
        """Build a space of segments (m, 4) [m] without thickness."""
        self._space = pymunk.Space()
        for ax, ay, bx, by in segments.tolist():
            self._space.add(pymunk.Segment(self._space.static_body, (ax, ay), (bx, by), 0.0))

    def cast(self, pose: FloatArray, bearings: FloatArray, max_range: float) -> FloatArray:
        """Return ranges (n,) [m] from a pose (3,) along bearings (n,) [rad]; inf beyond a finite max_range."""
        x, y, theta = pose.tolist()
        ranges = np.full(len(bearings), np.inf)
        everything = pymunk.ShapeFilter()
        for i, angle in enumerate((theta + bearings).tolist()):
            end = x + max_range * math.cos(angle), y + max_range * math.sin(angle)
            hit = self._space.segment_query_first((x, y), end, 0.0, everything)
            if hit is not None:
                ranges[i] = hit.alpha * max_range
        return ranges
