# SPDX-License-Identifier: BSD-3-Clause
"""Where the scans put the chair: the reference's tracks, moved by the errors that the scans see in them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import solveh_banded

from kurumaisu.critic.ranges.noise.shared_errors import Gram, Layout
from kurumaisu.critic.ranges.scans.beams import Shots, Track
from kurumaisu.critic.ranges.scans.valid_readings import PoseWeights
from kurumaisu.robust import SIGMA_PER_MAD
from kurumaisu.types import BoolArray, FloatArray, IntArray

DOUBT = np.array([0.02, 0.02, 0.01])  # [m, m, rad] sd of the reference, before any is known
_WANDER = np.array([0.1, 0.1, 0.3])  # [m/s, m/s, rad/s] by which rates change in a second, by chance
_JUMPY = 2.0  # degrees of freedom of these changes: commands make rates jump
_ROUNDS = 5
_PAUSE = 1.0  # [s] without a pose, over which rates say nothing
_BRIEF = 2e-3  # [s] between poses that say how the chair was carried, not how it moved
_HELD = 1e-5  # [m, rad] by which a pose may move that is known
_OFTEN = 4.0  # usual jumps from which a jump is none of the usual ones
_SEEN = np.array([5e-4, 5e-4, 2.5e-4])  # [m, m, rad] by which a path in straight lines may be off, unnoticed by scans


@dataclass(frozen=True)
class PoseEvidence:
    """What a scan says of the errors of the reference's poses in rows (q,): inner (3 q, 3 q), outer (3 q,).

    Normal equations of the errors x, y [m], yaw [rad] of each pose in turn, whatever else the scan has integrated out.
    """

    rows: slice
    inner: FloatArray
    outer: FloatArray


def pose_evidence(gram: Gram, rows: slice, width: float, common_sd: float) -> PoseEvidence:
    """Return what a scan says of its poses, its common mode of sd common_sd [m] integrated out.

    rows: of the track, that it rests on; width: of what it leaves, in deviations.
    """
    common, poses = gram.own, np.arange(gram.own) if gram.own else np.arange(1, 4)
    matrix = gram.matrix / width**2
    beside = matrix[poses, common] / (matrix[common, common] + common_sd**-2)
    inner = matrix[np.ix_(poses, poses)] - np.outer(beside, matrix[common, poses])
    return PoseEvidence(rows, inner, matrix[poses, -1] - beside * matrix[common, -1])


def likeliest_path(
    times: FloatArray, reference: FloatArray, sights: Sequence[PoseEvidence], held: BoolArray, errors: FloatArray
) -> tuple[FloatArray, BoolArray]:
    """Return poses (n, 3), and which of them rates jump at as they seldom do; times (n,) [s], reference (n, 3).

    held (n,): poses that are known, with their errors (n, 3) [m, m, rad].
    """
    count = len(times)
    if count < 3:
        return reference + np.where(held[:, np.newaxis], errors, 0.0), np.zeros(count, dtype=bool)
    widest = max((sight.rows.stop - sight.rows.start for sight in sights), default=1)
    reach = max(3 * widest - 1, 6)
    band = np.zeros((reach + 1, 3 * count))  # upper form, as of solveh_banded
    target = np.zeros(3 * count)
    known = np.where(held[:, np.newaxis], _HELD, DOUBT) ** -2
    band[-1] = known.ravel()
    target += (known * np.where(held[:, np.newaxis], errors, 0.0)).ravel()
    for sight in sights:
        start, size = 3 * sight.rows.start, len(sight.outer)
        for i in range(size):
            band[reach - i, start + i : start + size] += np.diagonal(sight.inner, i)
        target[start : start + size] += sight.outer
    terms = _Changes(times, reference)
    weights = np.ones((len(terms.rows), 3))
    out = reference
    for _ in range(_ROUNDS):
        whole, aim = band.copy(), target.copy()
        terms.put(whole, aim, weights)
        out = reference + solveh_banded(whole, aim, check_finite=False).reshape(count, 3)
        weights = _weights(terms.of(out) / terms.sd)
    return out, terms.seldom(out, held)


@dataclass(frozen=True)
class MotionEvidence:
    """What the motion says of the errors of the poses under a scan: rows (m, 3 q), and what is left of them (m,).

    In units in which each has a variance of 1.
    """

    rows: FloatArray
    left: FloatArray


def motion_evidence(
    times: FloatArray, reference: FloatArray, path: FloatArray, scans: Sequence[slice]
) -> list[MotionEvidence]:
    """Return how far errors of the poses under each scan can differ from one to the next, the chair moving as it does.

    path (n, 3): the likeliest one; scans: the rows of the poses that each rests on. Where rates jump, they say less;
    where they always change by more than they usually do anywhere, too.
    """
    parts = [_Changes(times[rows], reference[rows]) for rows in scans]
    units = [terms.of(path[rows]) / terms.sd for terms, rows in zip(parts, scans, strict=True)]
    every = np.concatenate([np.empty((0, 3)), *units])
    usual = np.maximum(SIGMA_PER_MAD * np.median(np.abs(every), axis=0), 1.0) if len(every) else np.ones(3)
    return [
        _steady(terms, usual, unit / usual, reference[rows])
        for terms, unit, rows in zip(parts, units, scans, strict=True)
    ]


def _steady(terms: _Changes, usual: FloatArray, unit: FloatArray, reference: FloatArray) -> MotionEvidence:
    precision = np.sqrt(_weights(unit)) / (usual * terms.sd)
    out = np.zeros((len(terms.rows), 3, len(reference), 3))
    for axis in range(3):
        for i, part in zip((-1, 0, 1), terms.parts, strict=True):
            out[range(len(part)), axis, terms.rows + i, axis] = precision[:, axis] * part
    return MotionEvidence(out.reshape(-1, reference.size), -(precision * terms.of(reference)).ravel())


def _weights(unit: FloatArray) -> FloatArray:
    """Return how much changes of the rates (m, 3), in sds, count; those of a position's axes jump together."""
    moves = np.mean(unit[:, :2] ** 2, axis=1)[:, np.newaxis]
    return np.asarray((_JUMPY + 1) / (_JUMPY + np.hstack([moves, moves, unit[:, 2:] ** 2])))


class _Changes:
    """Changes of the rates from one interval between poses to the next one."""

    def __init__(self, times: FloatArray, reference: FloatArray) -> None:
        steps = np.diff(times)
        before, after = steps[:-1], steps[1:]
        moves = (np.minimum(before, after) > _BRIEF) & (np.maximum(before, after) < _PAUSE)
        self.rows = np.flatnonzero(moves) + 1  # of the pose between
        before, after = before[moves], after[moves]
        self.parts = np.stack([1 / before, -1 / before - 1 / after, 1 / after])  # of three poses
        self.sd = _WANDER * np.sqrt(0.5 * (before + after))[:, np.newaxis]
        self._reference = self.of(reference)
        self._lasts = 0.25 * np.maximum(before, after)

    def of(self, poses: FloatArray) -> FloatArray:
        """Return the changes (m, 3) [m/s, m/s, rad/s] along a path (n, 3)."""
        before, at, after = self.parts[:, :, np.newaxis]
        return np.asarray(before * poses[self.rows - 1] + at * poses[self.rows] + after * poses[self.rows + 1])

    def put(self, band: FloatArray, target: FloatArray, weights: FloatArray) -> None:
        """Add what the changes say of the errors to normal equations."""
        precision = weights / self.sd**2
        last = len(band) - 1
        for axis in range(3):
            columns = 3 * (self.rows - 1) + axis  # each but once, of the first of the three poses
            for i in range(3):
                target[columns + 3 * i] -= precision[:, axis] * self.parts[i] * self._reference[:, axis]
                for j in range(i, 3):
                    part = precision[:, axis] * self.parts[i] * self.parts[j]
                    band[last - 3 * (j - i), columns + 3 * j] += part

    def seldom(self, poses: FloatArray, held: BoolArray) -> BoolArray:
        """Return which poses (n,) the rates jump at so that nobody knows just where the chair was."""
        out = np.zeros(len(poses), dtype=bool)
        jumps = np.abs(self.of(poses))
        some = ~held[self.rows]
        if some.any():
            usual = SIGMA_PER_MAD * np.median(jumps[some], axis=0)
            far = (jumps > _OFTEN * usual) & (jumps * self._lasts[:, np.newaxis] > _SEEN)
            out[self.rows] = some & far.any(axis=1)
        return out


def pose_corrected(
    shots: Shots,
    reference: Sequence[Track],
    hats: Sequence[PoseWeights],
    layout: Layout,
    sights: Sequence[PoseEvidence],
) -> tuple[Shots, list[BoolArray]]:
    """Return the shots on moved tracks, and for each track at which of its poses the chair's rates jump.

    reference: the tracks as measured, which the shots may have left already; sights: what each scan says of the errors
    of its poses, as of the reference's own.
    """
    tracks, kinked = [], []
    for i, (track, first) in enumerate(zip(shots.tracks, reference, strict=True)):
        own = [k for k in range(len(hats)) if shots.run[k] == i]
        rested = np.r_[False, (first.poses[1:] == first.poses[:-1]).all(axis=1), False]
        held, errors = rested[1:] | rested[:-1], np.zeros_like(first.poses)
        for stand in np.unique(layout.stand[own]).tolist() if own else ():
            if stand >= 0:
                those = [sights[k] for k in own if layout.stand[k] == stand]
                rows = _alike(first, those[0])
                held[rows], errors[rows] = True, _together(those)
        free = [sights[k] for k in own if layout.stand[k] < 0]
        poses, jumps = likeliest_path(track.times, first.poses, free, held, errors)
        tracks.append(replace(track, poses=poses))
        kinked.append(jumps)
    mean = [track.poses - first.poses for track, first in zip(tracks, reference, strict=True)]
    shift = [hat.weights @ mean[shots.run[k]][hat.rows] for k, hat in enumerate(hats)]
    return replace(shots, tracks=tuple(tracks), shift=np.array(shift)), kinked


def _alike(track: Track, sight: PoseEvidence) -> IntArray:
    """Return the rows of the track that share the one error of a stand."""
    return np.flatnonzero((track.poses == track.poses[sight.rows.start]).all(axis=1))


def _together(sights: Sequence[PoseEvidence]) -> FloatArray:
    """Return the error (3,) of the one pose that all of some scans rest on."""
    inner = np.sum([sight.inner for sight in sights], axis=0) + np.diag(DOUBT**-2)
    return np.asarray(np.linalg.solve(inner, np.sum([sight.outer for sight in sights], axis=0)))


def stands_of(shots: Shots) -> IntArray:
    """Return which scans were taken from one and the same row of reference poses, numbered, else -1."""
    out = np.full(len(shots.stamps), -1)
    known: dict[tuple[int, bytes], int] = {}
    for k in range(len(out)):
        track = shots.tracks[shots.run[k]]
        times = shots.stamps[k] + shots.said[[0, -1]]
        low = max(int(np.searchsorted(track.times, times[0], side="right")) - 1, 0)
        high = min(int(np.searchsorted(track.times, times[1])), len(track.times) - 1)
        rows = track.poses[low : high + 1]
        if (rows == rows[0]).all():
            out[k] = known.setdefault((int(shots.run[k]), rows[0].tobytes()), len(known))
    return out
