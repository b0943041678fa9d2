# SPDX-License-Identifier: BSD-3-Clause
"""Contact strips."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kurumaisu.geometry import attached
from kurumaisu.sim.sensors.rays import Rays
from kurumaisu.types import BoolArray, FloatArray, IntArray
from kurumaisu.world.model import Bumper


@dataclass(frozen=True)
class BumperSettings:
    """Strips, and how far ahead of themselves they feel [m]; 0: on their line only, as in Stage."""

    bumper: Bumper
    travel: float


class BumperSensor:
    """Feels what crosses its strips: a strip lies across the heading of its pose, which is its middle."""

    def __init__(self, settings: BumperSettings) -> None:
        """Prepare n strips."""
        bumper, travel = settings.bumper, settings.travel
        half = bumper.lengths / 2
        zero, turned = np.zeros(len(half)), np.full(len(half), np.pi / 2)
        lines = [(zero, -half, turned, bumper.lengths)]
        if travel > 0:
            ahead, straight = np.full(len(half), travel), zero
            lines += [(ahead, -half, turned, bumper.lengths)]
            lines += [(zero, side, straight, ahead) for side in (-half, zero, half)]
        starts = np.array([[x, y, zero, heading] for x, y, heading, _ in lines]).transpose(2, 0, 1)
        self._origins = attached(bumper.poses[:, None, :], starts)  # (n, lines, 4) in the model's frame
        self._lengths = np.array([length for *_, length in lines]).T

    def read(self, rays: Rays, poses: FloatArray, trees: IntArray) -> BoolArray:
        """Return which strips (k, n) touch, for bumpers at global poses (k, 4), on robots of trees (k,).

        rays: among what is solid; its returns are not looked at. Stage feels at any height, these rays at the strip's.
        """
        k, (n, lines) = len(poses), self._lengths.shape
        if not n:
            return np.zeros((k, 0), dtype=bool)
        origins = attached(poses[:, None, None, :], self._origins[None]).reshape(-1, 4)
        ranges, _ = rays.cast(origins, np.repeat(trees, n * lines), float(self._lengths.max()))
        return np.asarray((ranges.reshape(k, n, lines) <= self._lengths).any(axis=-1))
