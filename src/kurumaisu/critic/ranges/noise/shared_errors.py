# SPDX-License-Identifier: BSD-3-Clause
"""Errors that the readings of a scan share, and scans with each other, integrated out of their normal equations."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.linalg import cho_factor, cho_solve, cho_solve_banded, cholesky_banded, solve_triangular
from scipy.sparse import coo_array

from kurumaisu.types import BoolArray, FloatArray, IntArray

FLOOR = 1e-6  # [m, rad] below which no sd counts
_FLOOR = 1e-7  # [m] below which no sd of the beams' offsets counts


@dataclass(frozen=True)
class ScanNoise:
    """Errors that the readings of a scan share.

    position_sd [m], heading_sd [rad]: of each reference pose alone; common_sd [m]: of the offset of a scan, whose
    correlation with the next one falls off with a time constant common_tau [s]; lasting: how many times as large as
    the positions' own errors are those whose correlation falls off with lasting_tau [s], as of a reference that
    wanders; lasting_turn: the same of the headings.
    """

    position_sd: float
    heading_sd: float
    common_sd: float
    common_tau: float
    lasting: float = 0.0
    lasting_turn: float = 0.0
    lasting_tau: float = 5.0


@dataclass(frozen=True)
class Layout:
    """How scans hang together: times (k,) [s]; run (k,); stand (k,): scans of one and the same pose row, or -1."""

    times: FloatArray
    run: IntArray
    stand: IntArray

    @cached_property
    def nodes(self) -> tuple[IntArray, IntArray, int]:
        """Return which of the errors that scans share are each scan's (k,): its common mode, its pose; and their count.

        Of a pose the first of three, x, y, yaw: of a stand all its scans' own, else what lasts of the errors until this
        scan. In the order of the scans, so that only near ones have to do with each other.
        """
        common, pose, count = np.empty(len(self.times), dtype=np.int64), np.empty(len(self.times), dtype=np.int64), 0
        known: dict[int, int] = {}
        for k, stand in enumerate(self.stand.tolist()):
            pose[k] = known.get(stand, count) if stand >= 0 else count
            if pose[k] == count:
                known[stand] = count
                count += 3
            common[k], count = count, count + 1
        return common, pose, count

    def index(self, rows: IntArray, shared: int) -> IntArray:
        """Return of which of these errors each of some scans (n,) has its first ones (n, shared)."""
        common, pose, _ = self.nodes
        return np.column_stack([common[rows], pose[rows, np.newaxis] + np.arange(shared - 1)])

    @cached_property
    def moving(self) -> IntArray:
        """Return the scans that were not taken in a stand."""
        return np.flatnonzero(self.stand < 0)

    @cached_property
    def reach(self) -> int:
        """How far apart two errors are at most, in their order, that have to do with each other."""
        common, pose, _ = self.nodes
        steps = [np.diff(common), np.abs(common - pose) + 2, np.diff(pose[self.moving]), np.array([3])]
        return int(max(step.max(initial=0) for step in steps))


@dataclass(frozen=True)
class Gram:
    """Normal equations of one scan, whitened within the scan.

    own: number of leading columns, for the errors of its own reference poses, x, y, yaw in turn; shared: of those that
    follow, one for its common mode and three for the error of its stand's pose or, where asked for, for what lasts of
    its poses' errors; the rest are common to all scans. matrix (m, m), or its rows of own and shared columns alone.
    """

    matrix: FloatArray
    own: int
    shared: int

    @property
    def lead(self) -> int:
        """Return the number of columns that are not common to all scans."""
        return self.own + self.shared


@dataclass(frozen=True)
class Grams:
    """Normal equations of scans: of each the rows that are its own or shared; common (c, c): of all, the rest added up.

    The rest of each would be most of the memory, and nobody asks for it.
    """

    leads: tuple[Gram, ...]
    common: FloatArray

    @classmethod
    def summed(cls, grams: Iterable[Gram]) -> Grams:
        """Return those of some scans, of which one must be known as a whole at a time."""
        leads: list[Gram] = []
        common = np.empty((0, 0))
        for gram in grams:
            rest = gram.matrix[gram.lead :, gram.lead :]
            common = common if leads else np.zeros_like(rest)
            common += rest
            leads.append(replace(gram, matrix=gram.matrix[: gram.lead].copy()))
        return cls(tuple(leads), common)

    def only(self, columns: IntArray) -> Grams:
        """Return them with some of the common columns, and the last, which is the residual."""
        own = np.r_[columns, len(self.common) - 1]
        leads = (
            replace(gram, matrix=gram.matrix[:, np.r_[np.arange(gram.lead), gram.lead + own]]) for gram in self.leads
        )
        return Grams(tuple(leads), self.common[np.ix_(own, own)])


def whitened(columns: FloatArray, valid: BoolArray, sd: FloatArray, rho: float) -> FloatArray:
    """Return L^-1 X, (valid readings of the scan, m), for columns X (b, m), deviations sd (b,) [m] and neighbours' rho.

    Neighbours with gaps between them correlate by rho to the power of their distance.
    """
    at = np.flatnonzero(valid)
    z = columns[at] / sd[at, np.newaxis]
    shared = rho ** np.diff(at)[:, np.newaxis]
    out = z.copy()
    out[1:] = (z[1:] - shared * z[:-1]) / np.sqrt(1 - shared**2)
    return np.asarray(out)


class Stacked:
    """Grams in a few large arrays, for noises to be tried on."""

    def __init__(self, grams: Grams, layout: Layout) -> None:
        self._layout, self._common = layout, grams.common
        groups: dict[tuple[int, int], list[int]] = {}
        for k, gram in enumerate(grams.leads):
            groups.setdefault((gram.own, gram.shared), []).append(k)
        self._parts = [
            _Part(np.array([grams.leads[k].matrix for k in rows]), own, layout.index(np.array(rows), shared))
            for (own, shared), rows in groups.items()
        ]

    def marginal(self, noise: ScanNoise) -> tuple[FloatArray, float]:
        """Return the normal equations of what all scans have, their own errors integrated out, and a log determinant.

        The latter is that of the covariance, relative to independent readings.
        """
        band, prior_log_det = precision(self._layout, noise)
        total, log_det = self._common.copy(), 0.0
        cross = np.zeros((band.shape[1], len(total)))
        for part in self._parts:
            within, beside, less, more = part.without_own(own_pose_sds(noise))
            log_det += more
            total -= less
            band += banded(part.index, within, band.shape)
            cross += gathered(part.index, beside, band.shape[1])
        factor = cholesky_banded(band, lower=True)
        log_det += 2 * float(np.log(factor[0]).sum()) - prior_log_det
        return total - cross.T @ cho_solve_banded((factor, True), cross), log_det


def banded(index: IntArray, parts: FloatArray, shape: tuple[int, ...]) -> FloatArray:
    """Return symmetric parts (n, s, s), whose rows and columns are index (n, s), added up, as a lower band."""
    below = index[:, :, np.newaxis] - index[:, np.newaxis]
    use = below >= 0
    flat = (below * shape[1] + index[:, np.newaxis])[use]
    return np.asarray(np.bincount(flat, parts[use], shape[0] * shape[1]).reshape(shape), dtype=np.float64)


def gathered(index: IntArray, parts: FloatArray, count: int) -> FloatArray:
    """Return parts (n, s, c), whose rows are index (n, s), added up (count, c)."""
    places = coo_array((np.ones(index.size), (index.ravel(), np.arange(index.size))), (count, index.size))
    return np.asarray(places @ parts.reshape(index.size, -1))


class _Part:
    """Rows (n, lead, m) of alike grams; index (n, shared): of which errors that scans share each has its own."""

    def __init__(self, matrices: FloatArray, own: int, index: IntArray) -> None:
        lead = matrices.shape[1]
        self.index = index
        self._own, self._outer = matrices[:, :own, :own], np.ascontiguousarray(matrices[:, :own, own:])
        self._within, self._beside = matrices[:, own:, own:lead], matrices[:, own:, lead:]

    def without_own(self, size: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, float]:
        """Return parts of the grams when errors of sds size (3,) of their own poses are integrated out.

        (n, shared, shared) within what is shared, (n, shared, c) beside the common columns; by how much those of these
        (c, c) are less; and a log determinant.
        """
        own, shared = self._own.shape[1], self.index.shape[1]
        if own == 0:
            return self._within, self._beside, np.zeros(2 * self._beside.shape[2:]), 0.0
        scale = np.tile(size, own // 3)
        inner = self._own * np.outer(scale, scale) + np.eye(own)
        lower = np.linalg.cholesky(inner)
        root = (_inverse(lower) * scale) @ self._outer
        log_det = 2 * float(np.log(np.diagonal(lower, axis1=1, axis2=2)).sum())
        lead, common = root[:, :, :shared].transpose(0, 2, 1), root[:, :, shared:]
        flat = common.reshape(-1, common.shape[2])
        return (
            self._within - lead @ root[:, :, :shared],
            self._beside - lead @ common,
            flat.T @ flat,
            log_det,
        )


def _inverse(lower: FloatArray) -> FloatArray:
    """Return the inverses of many small lower triangles (n, q, q), a row of all at a time."""
    out = np.zeros_like(lower)
    for i in range(lower.shape[1]):
        out[:, i, i] = 1 / lower[:, i, i]
        out[:, i, :i] = -np.einsum("nj,njk->nk", lower[:, i, :i], out[:, :i, :i]) * out[:, i, i, np.newaxis]
    return out


def pose_sds(noise: ScanNoise) -> FloatArray:
    """Return the sds (3,) of a reference pose."""
    return np.hypot(own_pose_sds(noise), lasting_sds(noise))


def lasting_sds(noise: ScanNoise) -> FloatArray:
    """Return the sds (3,) of what of a reference pose's error lasts."""
    return np.array([noise.lasting, noise.lasting, noise.lasting_turn]) * own_pose_sds(noise)


def own_pose_sds(noise: ScanNoise) -> FloatArray:
    """Return the sds (3,) of what of a reference pose's error is its own."""
    return np.maximum([noise.position_sd, noise.position_sd, noise.heading_sd], FLOOR)


def precision(layout: Layout, noise: ScanNoise) -> tuple[FloatArray, float]:
    """Return the precision of the errors that scans share, as a lower band (reach + 1, n), and its log determinant.

    Common modes and what lasts of the poses' errors follow the last ones of a run; stands have errors of their own.
    """
    common, pose, count = layout.nodes
    band = np.zeros((layout.reach + 1, count))
    every = np.arange(len(common))
    log_det = _chain(band, layout, every, common, max(noise.common_sd, FLOOR), noise.common_tau)
    lasting = np.maximum(lasting_sds(noise), FLOOR)
    stands = np.unique(pose[layout.stand >= 0])
    for axis, (slow, whole) in enumerate(zip(lasting.tolist(), pose_sds(noise).tolist(), strict=True)):
        log_det += _chain(band, layout, layout.moving, pose[layout.moving] + axis, slow, noise.lasting_tau)
        band[0, stands + axis] += whole**-2
        log_det -= 2 * len(stands) * float(np.log(whole))
    return band, log_det


def correlations(times: FloatArray, run: IntArray, tau: float) -> FloatArray:
    """Return how errors at times (k,) [s] that fall off with tau [s] correlate with the next ones, 0 over runs (k,)."""
    return np.where(np.diff(run) == 0, np.exp(-np.abs(np.diff(times)) / tau), 0.0)


def _chain(band: FloatArray, layout: Layout, rows: IntArray, at: IntArray, sd: float, tau: float) -> float:
    """Add the precision of errors of an sd that fall off with tau [s] within a run, and return its log determinant.

    rows: of scans; at: where each has its error.
    """
    times, run = layout.times[rows], layout.run[rows]
    rho = correlations(times, run, tau)
    innovation = sd**2 * np.maximum(np.concatenate([np.ones(min(len(rows), 1)), 1 - rho**2]), 1e-9)  # variances
    band[0, at] += 1 / innovation
    band[0, at[:-1]] += rho**2 / innovation[1:]
    band[np.diff(at), at[:-1]] -= rho / innovation[1:]
    return -float(np.log(innovation).sum())


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
    grams: Grams, cross: OffsetProducts, layout: Layout, noise: ScanNoise, beam_sd: float
) -> FloatArray:
    """Return normal equations as Stacked.marginal does, offsets of beams of sd beam_sd [m] integrated out too.

    All grams share as many errors with others.
    """
    size, beams = own_pose_sds(noise), len(cross.inner)
    outer = cross.common.copy()
    inner, total = cross.inner + max(beam_sd, _FLOOR) ** -2 * np.eye(beams), grams.common.copy()
    taken: list[tuple[FloatArray, FloatArray]] = []
    within, beside = [], []  # of the errors that scans share, and beside them: beams' offsets, then the common columns
    for k, gram in enumerate(grams.leads):
        own = gram.own
        rest, offsets = gram.matrix[own:, own:], cross.own[k][:, own:]
        if own:
            part, columns = _of_own(gram, cross.own[k], size)
            rest, offsets = rest - columns[:, : gram.shared].T @ columns, offsets - part.T @ columns[:, : gram.shared]
            taken.append((part, columns[:, gram.shared :]))
        within.append(rest[:, : gram.shared])
        beside.append(np.hstack([offsets.T, rest[:, gram.shared :]]))
    if taken:  # all at once: one product of large matrices instead of many of small ones
        parts, columns = (np.concatenate(each) for each in zip(*taken, strict=True))
        inner -= parts.T @ parts
        outer -= parts.T @ columns
        total -= columns.T @ columns
    index = layout.index(np.arange(len(within)), len(within[0]))
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
