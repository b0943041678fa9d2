# SPDX-License-Identifier: BSD-3-Clause
"""Noise that is white but for a few directions along which it is larger: I + U U' for columns U."""

from __future__ import annotations

from copy import copy

import numpy as np
from numpy.typing import NDArray

from kurumaisu.types import FloatArray

_SEEN = 1e-4  # variance along a direction below which white noise hides it


class Covariance:
    """I + U U' for whitened columns U (rows, k), each of which may be off by a normal share, sd 1.

    variances (n,): along orthonormal directions, which stay combinations of the columns: they are never written out.
    """

    def __init__(self, columns: FloatArray, gram: FloatArray | None = None) -> None:
        """Take columns; gram: their products U'U, where they are known."""
        values, vectors = np.linalg.eigh(columns.T @ columns if gram is None else gram)
        use = values > _SEEN
        self._whole = columns
        self.variances: FloatArray = values[use]
        self._turn: FloatArray = vectors[:, use] / np.sqrt(values[use])  # from the columns to the directions

    def scaled(self, share: float) -> Covariance:
        """Return I + (share U)(share U)'."""
        other = copy(self)
        other.variances = share**2 * self.variances
        return other

    def beside(self, columns: FloatArray) -> Covariance:
        """Return what has more columns (rows, k)."""
        known = self._turn * np.sqrt(self.variances)  # from the columns to those of a rotated U
        across = known.T @ (self._whole.T @ columns)
        gram = np.block([[np.diag(self.variances), across], [across.T, columns.T @ columns]])
        return Covariance(np.column_stack([self._whole @ known, columns]), gram)

    @property
    def log_determinant(self) -> float:
        """Return the log of its determinant."""
        return float(np.log1p(self.variances).sum())

    @property
    def lost(self) -> FloatArray:
        """Return the share of the square along each direction that speaks for nothing, (n,)."""
        return np.asarray(self.variances / (1 + self.variances))

    def along(self, columns: FloatArray | NDArray[np.float32]) -> FloatArray:
        """Return what columns (rows, k), or a residual (rows,), are along the directions, (n, k) or (n,).

        Of many columns single precision is enough, and takes half as long.
        """
        whole = self._whole.astype(np.float32) if columns.dtype == np.float32 else self._whole
        return np.asarray(self._turn.T @ (whole.T @ columns).astype(np.float64))

    def gain(self, left: FloatArray) -> float:
        """Return how much likelier a residual (rows,) is than by white noise alone [nat]."""
        return 0.5 * float(self.lost @ self.along(left) ** 2 - self.log_determinant)

    def whiten(self, columns: FloatArray) -> FloatArray:
        """Return C^-1/2 X of columns (rows, n) or of a residual (rows,)."""
        less = 1 - 1 / np.sqrt(1 + self.variances)
        return np.asarray(columns - self._spread((self.along(columns).T * less).T))

    def inverse(self, columns: FloatArray) -> FloatArray:
        """Return C^-1 X of columns (rows, n) or of a residual (rows,)."""
        return np.asarray(columns - self._spread((self.along(columns).T * self.lost).T))

    def _spread(self, along: FloatArray) -> FloatArray:
        """Return in rows what is given along the directions."""
        return np.asarray(self._whole @ (self._turn @ along))


def orthonormal(columns: FloatArray) -> FloatArray:
    """Return an orthonormal basis (rows, n) of what columns (rows, k) span."""
    if not columns.shape[1]:
        return columns
    norms = np.linalg.norm(columns, axis=0)
    values, vectors = np.linalg.eigh((columns / np.maximum(norms, 1e-12)).T @ (columns / np.maximum(norms, 1e-12)))
    use = values > 1e-9 * max(float(values[-1]), 1e-12)
    return np.asarray((columns / np.maximum(norms, 1e-12)) @ (vectors[:, use] / np.sqrt(values[use])))


def without(basis: FloatArray, columns: FloatArray) -> FloatArray:
    """Return columns (rows, n) less what an orthonormal basis (rows, k) spans of them."""
    return np.asarray(columns - basis @ (basis.T @ columns))
