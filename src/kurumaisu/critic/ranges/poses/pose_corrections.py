# SPDX-License-Identifier: BSD-3-Clause
"""Where the scans put the chair: the reference's tracks, moved by the errors that the scans see in them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from kurumaisu.critic.ranges.noise.shared_errors import Layout
from kurumaisu.critic.ranges.poses.likeliest_path import DOUBT, PoseEvidence, likeliest_path
from kurumaisu.critic.ranges.scans.beams import Shots, Track
from kurumaisu.critic.ranges.scans.valid_readings import PoseWeights
from kurumaisu.types import BoolArray, FloatArray, IntArray


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
