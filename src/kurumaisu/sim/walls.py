# SPDX-License-Identifier: BSD-3-Clause
"""What the chair's laser sees: how far its beams go, and how bright what they meet is."""

from __future__ import annotations

import math

import numpy as np

from kurumaisu._core import Arena, Scene
from kurumaisu.types import FloatArray


class Walls:
    """Line segments that answer rays exactly."""

    def __init__(self, segments: FloatArray, returns: FloatArray) -> None:
        """Take segments (m, 4), x and y of both ends [m], and the reflectance of each (m,) [1]."""
        self._scene = Scene(segments)
        self._coloured = None if (returns == 1).all() else _arena(segments, returns)

    def cast(self, poses: FloatArray, bearings: FloatArray) -> FloatArray:
        """Return ranges (n,) [m] of beams from poses (n, 3) along bearings (n,) [rad]; +inf: nothing there."""
        return self._scene.cast(poses, bearings, math.inf)

    def returns(self, poses: FloatArray, bearings: FloatArray) -> FloatArray:
        """Return the reflectance (n,) of what the beams meet; 1 where that is nothing."""
        if self._coloured is None:
            return np.ones(len(bearings))
        level = np.full(len(bearings), 0.5)
        origins = np.column_stack([poses[:, :2], level, poses[:, 2] + bearings])
        nobody = np.full(len(bearings), -1, dtype=np.int64)  # whose own tree would be invisible
        ranges, returns = self._coloured.cast(origins, nobody, math.inf)
        return np.where(np.isfinite(ranges), returns, 1.0)


def _arena(segments: FloatArray, returns: FloatArray) -> Arena:
    heights = np.tile([0.0, 1.0], (len(segments), 1))  # of a world that is flat
    solid, trees = np.zeros(len(segments), dtype=bool), np.zeros(len(segments), dtype=np.int64)
    return Arena(np.hstack([segments, heights]), returns, solid, trees, 1)
