# SPDX-License-Identifier: BSD-3-Clause
"""Noise that is slower than a block: by how much it widens what blocks that are taken for independent say.

Residuals of an axis about its lines are normal, with the correlation of a rate that wanders (exponential in time) and
a share that is white. Time constant and share are not chosen but averaged over what the residuals make likely.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kurumaisu.types import FloatArray, IntArray

_TAUS = 0.5 * 2.0 ** np.arange(8)  # [s] up to a minute: slower noise is a drift
_WHITE = np.array([0.0, 0.1, 0.3, 0.5, 0.7, 0.9, 1.0])  # share of the variance
_CHUNK = 150  # residuals that are looked at together: their covariance is inverted
_JITTER = 1e-3  # of the variance is white always: two samples are never one


@dataclass(frozen=True)
class Residuals:
    """Of an axis, in the order of time: t [s]; run, block (n,); rate about the line, design (n, k) of the lines."""

    t: FloatArray
    run: IntArray
    block: IntArray
    rate: FloatArray
    design: FloatArray


def widening(found: Residuals, influence: FloatArray) -> FloatArray:
    """Return by how much the variances of estimates are larger than independent blocks would have them, (m,).

    influence (m, n): of each residual on each estimate. At least 1: that blocks help each other is not believed.
    """
    chunks = _chunks(found)
    laws = [(tau, white) for tau in _TAUS for white in _WHITE if white < 1 or tau == _TAUS[0]]
    likely = np.array([sum(_log_likelihood(found, chunk, law) for chunk in chunks) for law in laws])
    weight = np.exp(likely - likely.max())
    ratio = np.array([_ratio(found, chunks, influence, law) for law in laws])
    # in logarithms: a tail of slow laws that cannot be excluded would else rule
    return np.asarray(np.maximum(np.exp(weight @ np.log(ratio) / weight.sum()), 1.0))


def _chunks(found: Residuals) -> list[IntArray]:
    """Return rows that are looked at together, of one run each."""
    return [
        rows
        for run in np.unique(found.run)
        for rows in np.array_split(np.flatnonzero(found.run == run), 1 + int((found.run == run).sum()) // _CHUNK)
    ]


def _correlation(found: Residuals, rows: IntArray, law: tuple[float, float]) -> FloatArray:
    tau, white = law
    apart = np.abs(found.t[rows, np.newaxis] - found.t[rows])
    own = np.eye(len(rows))
    return np.asarray((1 - _JITTER) * ((1 - white) * np.exp(-apart / tau) + white * own) + _JITTER * own)


def _log_likelihood(found: Residuals, rows: IntArray, law: tuple[float, float]) -> float:
    """Return that of residuals, of what the lines leave free; their variance and the lines are integrated out."""
    root = np.linalg.cholesky(_correlation(found, rows, law))
    r = np.linalg.solve(root, found.rate[rows])
    used = found.design[rows][:, np.abs(found.design[rows]).max(axis=0) > 0]
    basis, upper = np.linalg.qr(np.linalg.solve(root, used))
    left = r @ r - np.sum((basis.T @ r) ** 2)
    freedom = len(rows) - used.shape[1]
    if freedom < 1 or left <= 0:
        return 0.0
    volume = np.log(np.abs(np.diag(root))).sum() + np.log(np.abs(np.diag(upper))).sum()
    return float(-volume - 0.5 * freedom * np.log(left))


def _ratio(found: Residuals, chunks: list[IntArray], influence: FloatArray, law: tuple[float, float]) -> FloatArray:
    """Return the variance of estimates over that which blocks alone would have, (m,)."""
    whole, apart = np.zeros(len(influence)), np.zeros(len(influence))
    for rows in chunks:
        correlation = _correlation(found, rows, law)
        same = found.block[rows, np.newaxis] == found.block[rows]
        some = influence[:, rows]
        whole += np.einsum("mi,ij,mj->m", some, correlation, some)
        apart += np.einsum("mi,ij,mj->m", some, np.where(same, correlation, 0.0), some)
    return np.asarray(np.where(apart > 0, whole, 1.0) / np.where(apart > 0, apart, 1.0))  # 1: no such line
