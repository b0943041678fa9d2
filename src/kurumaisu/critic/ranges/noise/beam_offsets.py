# SPDX-License-Identifier: BSD-3-Clause
"""Offsets that single beams keep over all scans, integrated out: they do not average out, however many the scans."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import cho_factor, cho_solve, cho_solve_banded, cholesky_banded, solve_triangular

from kurumaisu.critic.ranges.noise.shared_errors import (
    Gram,
    Layout,
    ScanNoise,
    banded,
    gathered,
    own_pose_sds,
    precision,
)
from kurumaisu.types import BoolArray, FloatArray

_FLOOR = 1e-7  # [m] below which no sd of the beams' offsets counts


@dataclass(frozen=True)
class OffsetProducts:
    """What the beams' offsets (b,) have in common with the other columns, whitened within each scan.

    own: for each scan (b, own + shared); common (b, p + 1): summed over the scans; inner (b, b): with one another.
    """

    own: tuple[FloatArray, ...]
    common: FloatArray
    inner: FloatArray


def offset_products(rows: FloatArray, valid: BoolArray, sd: FloatArray, rho: float, inner: FloatArray) -> FloatArray:
    """Return (b, m) products of a scan's offsets with its whitened rows (n, m), and add theirs to inner (b, b)."""
    at = np.flatnonzero(valid)
    out = np.zeros((len(valid), rows.shape[1]))
    if not len(at):
        return out
    shared = rho ** np.diff(at)
    pace = 1 / np.sqrt(1 - shared**2)
    diagonal = np.concatenate([[1.0], pace]) / sd[at]
    below = -shared * pace / sd[at[:-1]]
    out[at] = diagonal[:, np.newaxis] * rows
    out[at[:-1]] += below[:, np.newaxis] * rows[1:]
    inner[at, at] += diagonal**2
    inner[at[:-1], at[:-1]] += below**2
    side = below * diagonal[1:]
    inner[at[:-1], at[1:]] += side
    inner[at[1:], at[:-1]] += side
    return out


def without_beam_offsets(
    grams: Sequence[Gram], cross: OffsetProducts, layout: Layout, noise: ScanNoise, beam_sd: float
) -> FloatArray:
    """Return normal equations as shared_errors.marginal does, offsets of beams of sd beam_sd [m] integrated out too.

    All grams share as many errors with others.
    """
    size, beams = own_pose_sds(noise), len(cross.inner)
    outer = cross.common.copy()
    inner, total = cross.inner + max(beam_sd, _FLOOR) ** -2 * np.eye(beams), np.zeros((outer.shape[1], outer.shape[1]))
    taken: list[tuple[FloatArray, FloatArray]] = []
    within, beside = [], []  # of the errors that scans share, and beside them: beams' offsets, then the common columns
    for k, gram in enumerate(grams):
        own, lead = gram.own, gram.own + gram.shared
        rest, offsets = gram.matrix[own:lead, own:], cross.own[k][:, own:]
        if own:
            part, columns = _of_own(gram, cross.own[k], size)
            rest, offsets = rest - columns[:, : gram.shared].T @ columns, offsets - part.T @ columns[:, : gram.shared]
            taken.append((part, columns[:, gram.shared :]))
        within.append(rest[:, : gram.shared])
        beside.append(np.hstack([offsets.T, rest[:, gram.shared :]]))
        total += gram.matrix[lead:, lead:]
    if taken:  # all at once: one product of large matrices instead of many of small ones
        parts, columns = (np.concatenate(each) for each in zip(*taken, strict=True))
        inner -= parts.T @ parts
        outer -= parts.T @ columns
        total -= columns.T @ columns
    index = layout.index(np.arange(len(grams)), len(within[0]))
    band = precision(layout, noise)[0]
    factor = cholesky_banded(band + banded(index, np.array(within), band.shape), lower=True)
    every = gathered(index, np.array(beside), band.shape[1])
    left = every.T @ cho_solve_banded((factor, True), every)
    inner, outer, total = inner - left[:beams, :beams], outer - left[:beams, beams:], total - left[beams:, beams:]
    return np.asarray(total - outer.T @ cho_solve(cho_factor(inner), outer))


def _of_own(gram: Gram, cross: FloatArray, size: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return what goes when errors of a scan's own poses are integrated out, as roots.

    (own, b) of the beams' offsets and (own, m) of the other columns.
    """
    own = gram.own
    scale = np.tile(size, own // 3)
    inner = gram.matrix[:own, :own] * np.outer(scale, scale) + np.eye(own)
    lower = np.linalg.cholesky(inner)
    columns = solve_triangular(lower, gram.matrix[:own, own:] * scale[:, np.newaxis], lower=True)
    return solve_triangular(lower, (cross[:, :own] * scale).T, lower=True), columns
