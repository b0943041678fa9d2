# SPDX-License-Identifier: BSD-3-Clause
"""What stops a body of Stage's semantics: outlines that cross, or that share cells."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from kurumaisu._core import Arena, Cells
from kurumaisu.types import BoolArray, FloatArray, IntArray


class Collisions(Protocol):
    """Lets bodies, by their rows, go or not, and has the arena follow them."""

    def place(self, poses: FloatArray) -> None:
        """Put all bodies at poses (b, 4)."""

    def begin_step(self) -> None:
        """Say that the moves to come are of the next step."""

    def move(self, rows: slice | IntArray, poses: FloatArray, groups: IntArray | None = None) -> BoolArray:
        """Let bodies go in this order to poses (k, 4), each, or each group (k,), as a whole.

        Return which stall (k,).
        """

    def end_step(self, poses: FloatArray) -> None:
        """Say where all bodies are after a step's moves (b, 4)."""

    def drawn(self) -> FloatArray | None:
        """Return where bodies are met if not where they are (b, 4)."""

    def touching(self) -> BoolArray:
        """Return which bodies (b,) touch something where they are."""

    def state(self) -> dict[str, FloatArray]:
        """Return what the next moves depend on besides the poses, arrays (b, ...)."""

    def restore(self, state: dict[str, FloatArray | BoolArray]) -> None:
        """Go back to a state; the poses have been placed."""


class Crossing:
    """Outlines collide where they cross."""

    def __init__(self, arena: Arena, numbers: IntArray) -> None:
        """Watch the bodies that the arena knows by numbers (b,)."""
        self._arena = arena
        self._numbers = numbers

    def place(self, poses: FloatArray) -> None:
        """Put all bodies at poses (b, 4)."""
        self._arena.set_poses(self._numbers, poses)

    def begin_step(self) -> None:
        """Nothing depends on steps."""

    def move(self, rows: slice | IntArray, poses: FloatArray, groups: IntArray | None = None) -> BoolArray:
        """Let bodies go; see Collisions."""
        return self._arena.move(self._numbers[rows], poses, groups)

    def end_step(self, poses: FloatArray) -> None:
        """The arena knows."""

    def drawn(self) -> FloatArray | None:
        """Return None: bodies are met where they are."""
        return None

    def touching(self) -> BoolArray:
        """Return which bodies (b,) touch something."""
        return self._arena.touches(self._numbers)

    def state(self) -> dict[str, FloatArray]:
        """Return nothing."""
        return {}

    def restore(self, state: dict[str, FloatArray | BoolArray]) -> None:
        """Nothing to do."""


class SharedCells:
    """Outlines collide where they share cells, as in Stage."""

    def __init__(self, arena: Arena, numbers: IntArray, cells: Cells, known_as: IntArray, layers: int) -> None:
        """Watch the bodies that the arena knows by numbers (b,), the cells, of 1 or 2 layers, by others (b,)."""
        self._arena = arena
        self._numbers = numbers
        self._cells = cells
        self._known_as = known_as
        self._layers = range(layers) if layers > 1 else range(0)  # that differ from the poses

    def place(self, poses: FloatArray) -> None:
        """Put all bodies at poses (b, 4)."""
        self._cells.set_poses(self._known_as, poses)
        self._arena.set_poses(self._numbers, poses)

    def begin_step(self) -> None:
        """Draw to the other layer."""
        self._cells.turn()

    def move(self, rows: slice | IntArray, poses: FloatArray, groups: IntArray | None = None) -> BoolArray:
        """Let bodies go; see Collisions."""
        return self._cells.move(self._known_as[rows], poses, groups)

    def end_step(self, poses: FloatArray) -> None:
        """Tell the arena."""
        self._arena.set_poses(self._numbers, poses)

    def drawn(self) -> FloatArray | None:
        """Return where bodies are in the layer of this step (b, 4), if there are several."""
        return self._cells.drawn(self._known_as, 0) if self._layers else None

    def touching(self) -> BoolArray:
        """Return which bodies (b,) share cells with something."""
        return self._cells.touches(self._known_as)

    def state(self) -> dict[str, FloatArray]:
        """Return where bodies are drawn, (b, 4) for each layer."""
        return {f"layer {layer}": self._cells.drawn(self._known_as, layer) for layer in self._layers}

    def restore(self, state: dict[str, FloatArray | BoolArray]) -> None:
        """Draw them there."""
        for layer in self._layers:
            self._cells.draw(self._known_as, layer, np.asarray(state[f"layer {layer}"], dtype=np.float64))
