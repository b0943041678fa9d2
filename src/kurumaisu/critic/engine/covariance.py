# SPDX-License-Identifier: BSD-3-Clause
"""Noise that is white but for a few directions along which it is larger: I + U U' for columns U."""

from __future__ import annotations

import numpy as np

from kurumaisu.types import FloatArray

_SEEN = 1e-4  # variance along a direction below which white noise hides it


class Covariance:
    """I + U U' for whitened columns U (rows, k), each of which may be off by a normal share, sd 1."""

    def __init__(self, columns: FloatArray) -> None:
        values, vectors = np.linalg.eigh(columns.T @ columns)
        use = values > _SEEN
        self.variances: FloatArray = values[use]
        self.directions: FloatArray = columns @ (vectors[:, use] / np.sqrt(values[use]))

    def scaled(self, share: float) -> Covariance:
        """Return I + (share U)(share U)'."""
        other = object.__new__(Covariance)
        other.variances, other.directions = share**2 * self.variances, self.directions
        return other

    @property
    def log_determinant(self) -> float:
        """Return the log of its determinant."""
        return float(np.log1p(self.variances).sum())

    @property
    def lost(self) -> FloatArray:
        """Return the share of the square along each direction that speaks for nothing, (k,)."""
        return np.asarray(self.variances / (1 + self.variances))

    @property
    def columns(self) -> FloatArray:
        """Return U but for a rotation, (rows, k)."""
        return np.asarray(self.directions * np.sqrt(self.variances))

    def gain(self, left: FloatArray) -> float:
        """Return how much likelier a residual (rows,) is than by white noise alone [nat]."""
        return 0.5 * float(left @ left - self.square(left) - self.log_determinant)

    def square(self, left: FloatArray) -> float:
        """Return r' C^-1 r of a residual (rows,)."""
        along = self.directions.T @ left
        return float(left @ left - self.lost @ along**2)

    def whiten(self, columns: FloatArray) -> FloatArray:
        """Return C^-1/2 X of columns (rows, n) or of a residual (rows,)."""
        less = 1 - 1 / np.sqrt(1 + self.variances)
        along = self.directions.T @ columns
        return np.asarray(columns - self.directions @ (along.T * less).T)


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
