# SPDX-License-Identifier: BSD-3-Clause
"""Beams in whose way something is that moves with the chair: they read the same wherever the chair stands."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from kurumaisu.critic.ranges.scans.valid_readings import without_cut_off
from kurumaisu.critic.values.criticism import UNKNOWN_CHANNEL
from kurumaisu.critic.values.verdict import Unknown
from kurumaisu.types import BoolArray, FloatArray

_MANY = 10  # readings of a beam, at least
_MOST = (0.1, 0.9)  # quantiles between which most readings lie
_STAYS = 0.05  # [m] within which most readings of what moves with the chair stay
_MOVES = 0.3  # [m] by which walls must come and go meanwhile
_ELSEWHERE = 0.1  # [m] from the walls
_TOLD = 3  # groups of neighbours in a sentence


def blocked_beams(measured: FloatArray, expected: FloatArray) -> BoolArray:
    """Return which beams (b,) read the same wherever the chair stands; measured, expected (k, b) [m].

    What is the same to the last digit is no distance: readings have been cut off there.
    """
    seen = np.isfinite(expected) & np.isfinite(without_cut_off(measured))
    out = np.zeros(measured.shape[1], dtype=bool)
    for beam in np.flatnonzero(seen.sum(axis=0) >= _MANY):
        here, walls = measured[seen[:, beam], beam], expected[seen[:, beam], beam]
        stays, moves = (float(np.ptp(np.quantile(values, _MOST))) for values in (here, walls))
        elsewhere = float(np.median(np.abs(here - walls))) > _ELSEWHERE
        out[beam] = 0 < stays < _STAYS and moves > _MOVES and elsewhere
    return out


def described(beams: BoolArray, measured: FloatArray, bearings: FloatArray) -> Iterator[Unknown]:
    """Yield what is outside the catalogue where beams (b,) are blocked; bearings (b,) [rad]."""
    edges = np.flatnonzero(np.diff(np.r_[False, beams, False]))
    groups = sorted(zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True), key=lambda ends: ends[0] - ends[1])
    words = [
        f"beams from {bearings[first]:.3g} to {bearings[stop - 1]:.3g} rad read "
        f"{np.nanmedian(measured[:, first:stop]):.3g} m"
        for first, stop in groups[:_TOLD]
    ]
    if words:
        shape = f"{'; '.join(words)}, wherever the chair stands: something on the chair blocks them"
        yield Unknown(UNKNOWN_CHANNEL, "bearing", shape, 1.0)
