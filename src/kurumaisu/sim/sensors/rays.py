# SPDX-License-Identifier: BSD-3-Clause
"""What the sensors ask of a ray caster; `kurumaisu._core.Arena` is one."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from kurumaisu.geometry import cos_sin
from kurumaisu.types import FloatArray, IntArray


class Rays(Protocol):
    """Answers rays among the walls and bodies of a world. Bodies of a ray's own tree are invisible to it.

    Both return ranges [m], +inf where nothing is met, and the ranger_return of what was met, 0 for nothing.
    """

    def scan(self, origins: FloatArray, trees: IntArray, fans: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Cast fans (s, 4) of first bearing, increment [rad], samples, range_max [m] from origins (s, 4)."""
        ...

    def cast(self, origins: FloatArray, trees: IntArray, range_max: float) -> tuple[FloatArray, FloatArray]:
        """Cast one ray from each origin (n, 4): x, y, z [m], direction [rad]; trees (n,)."""
        ...


def place(poses: FloatArray, mounts: FloatArray) -> FloatArray:
    """Return map_from_mount (..., 4) of x, y, z, heading for poses (..., 4) and mounts (..., 4) relative to them."""
    c, s = cos_sin(poses[..., 3])
    return np.stack(
        [
            poses[..., 0] + c * mounts[..., 0] - s * mounts[..., 1],
            poses[..., 1] + s * mounts[..., 0] + c * mounts[..., 1],
            poses[..., 2] + mounts[..., 2],
            poses[..., 3] + mounts[..., 3],
        ],
        axis=-1,
    )
