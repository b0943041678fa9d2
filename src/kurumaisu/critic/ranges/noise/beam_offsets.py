# SPDX-License-Identifier: BSD-3-Clause
"""Offsets that single beams keep over all scans, integrated out: they do not average out, however many the scans."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import cho_factor, cho_solve, solve_triangular

from kurumaisu.critic.ranges.noise.scan_noise import Gram, Layout, ScanNoise, own_pose_sds, precision
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
    """Return normal equations as scan_noise.marginal does, offsets of beams of sd beam_sd [m] integrated out too."""
    size, beams = own_pose_sds(noise), len(cross.inner)
    prior = precision(layout, noise)[0]
    scans, shared = len(grams), len(prior)
    common = cross.common.shape[1]
    inner = np.zeros((shared + beams, shared + beams))
    outer = np.zeros((shared + beams, common))
    total = np.zeros((common, common))
    inner[shared:, shared:] = cross.inner
    outer[shared:] = cross.common
    taken: list[tuple[FloatArray, FloatArray]] = []
    for k, gram in enumerate(grams):
        own, lead = gram.own, gram.shared
        index = [k, *(scans + 3 * layout.places[k] + i for i in range(lead - 1))]
        rest, beside = gram.matrix[own : own + lead, own:], cross.own[k][:, own:]
        if own:
            part, columns = _of_own(gram, cross.own[k], size)
            rest, beside = rest - columns[:, :lead].T @ columns, beside - part.T @ columns[:, :lead]
            taken.append((part, columns[:, lead:]))
        inner[np.ix_(index, index)] += rest[:, :lead]
        inner[shared:, index] += beside
        outer[index] += rest[:, lead:]
        total += gram.matrix[own + lead :, own + lead :]
    if taken:  # all at once: one product of large matrices instead of many of small ones
        parts, columns = (np.concatenate(each) for each in zip(*taken, strict=True))
        inner[shared:, shared:] -= parts.T @ parts
        outer[shared:] -= parts.T @ columns
        total -= columns.T @ columns
    inner[:shared, shared:] = inner[shared:, :shared].T
    inner[:shared, :shared] += prior
    inner[range(shared, len(inner)), range(shared, len(inner))] += max(beam_sd, _FLOOR) ** -2
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
