# SPDX-License-Identifier: BSD-3-Clause
"""Where the scans put the chair: the reference's tracks, moved by the errors that the scans see in them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from kurumaisu.critic.laser.noise import Layout
from kurumaisu.critic.laser.shots import Shots, Track
from kurumaisu.critic.laser.standing import kinks, smoothed
from kurumaisu.critic.laser.trust import Hats
from kurumaisu.types import BoolArray, FloatArray, IntArray

_UNSEEN = 0.2  # weight of a pose that no scan has moved, among others


def moved(
    shots: Shots, reference: Sequence[Track], hats: Sequence[Hats], layout: Layout, errors: Sequence[FloatArray]
) -> tuple[Shots, list[BoolArray]]:
    """Return the shots on moved tracks, and for each track which of its poses lie beside a smooth path.

    reference: the tracks as measured, which the shots may have left already; errors (q, 3): of the poses under each
    scan, as of the reference's own.
    """
    tracks = [replace(track, poses=track.poses.copy()) for track in shots.tracks]
    sums = [np.zeros((*track.poses.shape[:1], 4)) for track in tracks]
    for k, some in enumerate(errors):
        rows = _alike(reference[shots.run[k]], hats[k], stood=bool(layout.stand[k] >= 0))
        sums[shots.run[k]][rows, :3] += some
        sums[shots.run[k]][rows, 3] += 1
    mean, kinked = [], []
    for track, first, total in zip(tracks, reference, sums, strict=True):
        seen = total[:, 3] > 0
        found = first.poses + total[:, :3] / np.maximum(total[:, 3:], 1)
        track.poses[:] = smoothed(track.times, found, np.where(seen, 1.0, _UNSEEN))
        mean.append(track.poses - first.poses)
        kinked.append(kinks(found, track.poses, seen))
    shift = [hat.weights @ mean[shots.run[k]][hat.rows] for k, hat in enumerate(hats)]
    return replace(shots, tracks=tuple(tracks), shift=np.array(shift)), kinked


def _alike(track: Track, hat: Hats, *, stood: bool) -> IntArray:
    """Return the rows of the track that share the errors of a scan: its own, or all of its stand."""
    rows = np.arange(len(track.times))[hat.rows]
    return np.flatnonzero((track.poses == track.poses[rows[0]]).all(axis=1)) if stood else rows


def stands(shots: Shots) -> IntArray:
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
