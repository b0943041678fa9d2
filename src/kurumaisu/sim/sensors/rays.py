# SPDX-License-Identifier: BSD-3-Clause
"""What the sensors ask of a ray caster; `kurumaisu._core.Arena` is one."""

from __future__ import annotations

from typing import Protocol

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
