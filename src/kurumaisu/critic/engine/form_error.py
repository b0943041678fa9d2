# SPDX-License-Identifier: BSD-3-Clause
"""What the equations of causes may miss, as a part of the noise."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from kurumaisu.critic.values.settings import Settings
from kurumaisu.types import FloatArray


@dataclass(frozen=True)
class FormError:
    """Marks by which a run may be off, each by a normal share of its own, but for what a fit does itself.

    here: effects as they act; moved: effects as they would with another size or shape, whether that counts only where
    it holds the chair back, and the sd of the share of what that changes; near: effects as they would with a little
    more of each size or shape.
    """

    here: Settings
    moved: tuple[tuple[Settings, bool, float], ...]
    near: tuple[Settings, ...]

    def marks(
        self, simulated: Callable[[Settings], FloatArray], whiten: Callable[[FloatArray], FloatArray]
    ) -> FloatArray:
        """Return what a share of 1 sd of each mark changes of a run, whitened, (3 m, k); simulated: its increments."""
        here = simulated(self.here)
        own = [change(here, simulated(settings)) for settings in self.near]
        marks = [sd * change(here, simulated(settings), held_back=only) for settings, only, sd in self.moved]
        white = whiten(np.column_stack([*own, *marks]))
        return outside_span(white[:, : len(own)], white[:, len(own) :])


def change(here: FloatArray, there: FloatArray, *, held_back: bool = False) -> FloatArray:
    """Return what increments (m, 3) have more there than here, (3 m,); held_back: only where that is less way."""
    more = there - here
    return np.asarray(np.where(more * here < 0, more, 0.0) if held_back else more).ravel()


def outside_span(own: FloatArray, marks: FloatArray) -> FloatArray:
    """Return what of marks (rows, k) columns (rows, n) cannot do."""
    basis = np.linalg.qr(own)[0]
    return np.asarray(marks - basis @ (basis.T @ marks))


class FormErrorWhitener:
    """Whitens on, what is white but for columns that may be off by a normal share, sd 1."""

    def __init__(self, columns: FloatArray) -> None:
        """Take whitened columns (rows, k)."""
        directions, lengths, _ = np.linalg.svd(columns, full_matrices=False)
        self._directions = directions
        self._less = 1 - 1 / np.hypot(1.0, lengths)

    def whiten(self, columns: FloatArray) -> FloatArray:
        """Return columns (rows, n) with less of what may be off."""
        along = self._directions.T @ columns
        return np.asarray(columns - self._directions @ (self._less[:, np.newaxis] * along))
