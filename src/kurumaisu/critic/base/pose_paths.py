# SPDX-License-Identifier: BSD-3-Clause
"""The way from one reference pose to the next: an error of a rate acts along it, not along the chord."""

from __future__ import annotations

import numpy as np

from kurumaisu import geometry
from kurumaisu.types import FloatArray

_POINTS = 16  # of each increment: commands change once in it, seldom twice


def pose_paths(times: FloatArray, poses: FloatArray, edges: FloatArray, path: FloatArray) -> FloatArray:
    """Return how a chair went from each reference pose to the next, (m, 8).

    Means of the heading's cosine and sine and of the way x, y [m] that lies ahead, in the frame of the first pose; and
    by how much each of them grows from its beginning to its end, by least squares.

    times (m + 1,) and poses (m + 1, 3) of the reference; path (n, 3): poses that were asked for at edges (n,) of time.
    The way is half way between what was asked for and what was measured.
    """
    share = (np.arange(_POINTS) + 0.5) / _POINTS
    at = times[:-1, None] + np.diff(times)[:, None] * np.append(share, 1.0)
    begin = np.stack([np.interp(times[:-1], edges, column) for column in path.T], axis=-1)
    asked = np.stack([np.interp(at, edges, column) for column in path.T], axis=-1)
    gone = geometry.between(begin[:, None], asked)
    off = geometry.between(poses[:-1], poses[1:]) - gone[:, -1]
    off[:, 2] = geometry.wrap(off[:, 2])
    # Of what differs, the squares cancel about the middle: a derivative about either end sees a speed and a turn that
    # are both off as a slip.
    off *= 0.5
    gone[:, :-1] += off[:, None] * share[:, None]
    gone[:, -1] += off
    ahead = gone[:, -1:, :2] - gone[:, :-1, :2]
    heading = gone[:, :-1, 2, None]
    along = np.concatenate([np.cos(heading), np.sin(heading), ahead], axis=-1)
    late = share - 0.5
    slope = np.einsum("mpk,p->mk", along, late / (late @ late))
    return np.concatenate([along.mean(axis=1), slope], axis=1)
