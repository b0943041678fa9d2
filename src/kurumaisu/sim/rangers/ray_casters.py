# SPDX-License-Identifier: BSD-3-Clause
"""What rangers see by: exact geometry, or Stage's cells."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Protocol

import numpy as np

from kurumaisu._core import Arena, CellRays
from kurumaisu.errors import Error
from kurumaisu.sim.rangers.fans import RangerFan
from kurumaisu.types import FloatArray, IntArray


class RayCaster(Protocol):
    """Casts rays; scan and cast as in Arena."""

    def follow(self, frames: FloatArray) -> None:
        """Have bodies and map where they are now, (b + 1, 4)."""

    def scan(self, origins: FloatArray, trees: IntArray, fans: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return ranges and ranger returns of fans."""

    def cast(self, origins: FloatArray, trees: IntArray, range_max: float) -> tuple[FloatArray, FloatArray]:
        """Return ranges and ranger returns of single rays."""


class ExactRayCaster:
    """Sees by the arena, which the motion keeps up to date."""

    def __init__(self, arena: Arena) -> None:
        """Look into an arena."""
        self.scan, self.cast = arena.scan, arena.cast

    def follow(self, frames: FloatArray) -> None:
        """Nothing to do."""


class CellRayCaster:
    """Sees by cells, which have their own bodies."""

    def __init__(
        self, rays: CellRays, known_as: IntArray, drawn: Callable[[], FloatArray | None], fans: Sequence[RangerFan]
    ) -> None:
        """Look at cells that know the bodies by numbers (b,); drawn: where they are met if not where they are (b, 4).

        Raise Error for a fan that reaches beyond what cells can be counted.
        """
        self._rays, self._known_as, self._drawn = rays, known_as, drawn
        self.scan, self.cast = rays.scan, rays.cast
        nowhere = np.zeros((1, 4))
        for fan in fans:
            try:
                rays.scan(nowhere, np.zeros(1, dtype=np.int64), np.array([[0.0, 0.0, 0.0, fan.fan.range_max]]))
            except ValueError as error:
                raise Error(f"{fan.model.place}: ray_casting: cells: {error}") from error

    def follow(self, frames: FloatArray) -> None:
        """Redraw the bodies that are elsewhere."""
        drawn = self._drawn()
        self._rays.set_poses(self._known_as, frames[:-1] if drawn is None else drawn)
