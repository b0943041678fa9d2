# SPDX-License-Identifier: BSD-3-Clause
"""Straight lines through points: least squares as in the paper, and with errors in both variables.

All sums are weighted, and weights may be many sets at once (..., n): so a bootstrap costs one fit of arrays.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kurumaisu.types import FloatArray, IntArray

_HUBER = 1.345  # 95 % efficient where errors are normal
_ROUNDS = 30
NORMAL_MAD = 0.6744897501960817  # median of |z|, z standard normal


@dataclass(frozen=True)
class Lines:
    """y = slope x + intercept, arrays (...,) or numbers."""

    slope: FloatArray
    intercept: FloatArray

    def at(self, x: FloatArray) -> FloatArray:
        """Return y at x (n,), (..., n)."""
        return np.asarray(self.slope[..., np.newaxis] * x + self.intercept[..., np.newaxis])


@dataclass(frozen=True)
class _Moments:
    """Weighted means and central second moments, (...,) each."""

    x: FloatArray
    y: FloatArray
    xx: FloatArray
    xy: FloatArray
    yy: FloatArray


def _moments(x: FloatArray, y: FloatArray, weights: FloatArray) -> _Moments:
    share = weights / weights.sum(axis=-1, keepdims=True)
    mean_x, mean_y = share @ x, share @ y
    return _Moments(
        mean_x,
        mean_y,
        share @ x**2 - mean_x**2,
        share @ (x * y) - mean_x * mean_y,
        share @ y**2 - mean_y**2,
    )


def least_squares(x: FloatArray, y: FloatArray, weights: FloatArray) -> Lines:
    """Return the lines of least vertical squares: all error is in y."""
    m = _moments(x, y, weights)
    slope = m.xy / m.xx
    return Lines(np.asarray(slope), np.asarray(m.y - slope * m.x))


def deming(x: FloatArray, y: FloatArray, weights: FloatArray, ratio: FloatArray | float) -> Lines:
    """Return the lines of greatest likelihood where both variables have normal errors.

    ratio: variance of y's error over that of x's; 0: y is exact, which is the regression of x on y.
    """
    m = _moments(x, y, weights)
    difference = m.yy - ratio * m.xx
    root = np.hypot(difference, 2 * np.sqrt(ratio) * m.xy)
    slope = (difference + root) / (2 * m.xy)
    # the same without cancellation where the difference is negative
    other = 2 * ratio * m.xy / np.where(difference < 0, root - difference, 1.0)
    slope = np.where(difference < 0, other, slope)
    return Lines(np.asarray(slope), np.asarray(m.y - slope * m.x))


@np.errstate(divide="ignore", invalid="ignore")  # a draw of one place only has no line: nan, which interval() counts
def robust(x: FloatArray, y: FloatArray, counts: FloatArray, sd_y: float) -> Lines:
    """Return lines with errors in both: y's known, x's by what the points scatter; far points count less (Huber).

    counts (..., n): how often each point was drawn; sd_y: of y's error.
    """
    line, ratio = deming(x, y, counts, 0.0), np.zeros(counts.shape[:-1])
    for _ in range(_ROUNDS):
        residual = y - line.at(x)
        spread = _spread(residual, counts)
        distance = np.abs(residual) / np.maximum(spread, 1e-300)[..., np.newaxis]
        weights = counts * np.minimum(1.0, _HUBER / np.maximum(distance, _HUBER))
        variance_x = np.maximum(spread**2 - sd_y**2, 0.01 * spread**2) / line.slope**2
        ratio = sd_y**2 / np.maximum(variance_x, 1e-300)
        before, line = line, deming(x, y, weights, ratio)
        if np.allclose(before.slope, line.slope, rtol=1e-7, atol=0):
            break
    return line


def _spread(residual: FloatArray, counts: FloatArray) -> FloatArray:
    """Return a robust sd of residuals (..., n) drawn so often: the weighted median of their size, scaled."""
    size = np.abs(residual)
    order = np.argsort(size, axis=-1)
    ranked = np.take_along_axis(size, order, axis=-1)
    share = np.cumsum(np.take_along_axis(np.broadcast_to(counts, size.shape), order, axis=-1), axis=-1)
    middle = np.argmax(share >= 0.5 * share[..., -1:], axis=-1)
    return np.asarray(np.take_along_axis(ranked, middle[..., np.newaxis], axis=-1)[..., 0] / NORMAL_MAD)


def block_counts(block: IntArray, resamples: int, rng: np.random.Generator) -> FloatArray:
    """Return how often each point is drawn (resamples, n) when whole blocks are drawn with replacement."""
    names, index = np.unique(block, return_inverse=True)
    drawn = rng.multinomial(len(names), np.full(len(names), 1 / len(names)), size=resamples)
    return np.asarray(drawn[:, index], dtype=np.float64)
