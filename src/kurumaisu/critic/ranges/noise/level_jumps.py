# SPDX-License-Identifier: BSD-3-Clause
"""Where all readings jump at once while the chair stands: a supply that is switched, a filter that begins.

A curve over the time with a knot for each stop draws none of that, and what it leaves looks like an error of whole
scans that lasts, about which no curve is sure.
"""

from __future__ import annotations

import numpy as np

from kurumaisu.robust import SIGMA_PER_MAD
from kurumaisu.types import FloatArray, IntArray

_FEWEST = 6  # scans of a stand that may be split
_SURE = 6.0  # sds that the two parts of a stand are apart, at least
_ODD = 3.0  # times as far apart as those of other stands: what wanders has all of them look as if they jumped
_MOST = 3  # stands that are split: of more, it is noise


def level_jumps(off: FloatArray, stand: IntArray) -> IntArray:
    """Return the scans (n,) after which the others of the same stand are read otherwise.

    off (k, b) [m]: by how much readings are off, nan where there is none; stand (k,): of each scan, else -1.
    """
    rows = [np.flatnonzero(stand == one) for one in np.unique(stand[stand >= 0])]
    levels = {int(own[0]): (own, _levels(off[own])) for own in rows if len(own) >= _FEWEST}
    steps = np.concatenate([np.empty(0), *(np.abs(np.diff(level)) for _, level in levels.values())])
    steps = steps[np.isfinite(steps)]
    if not len(steps):
        return np.empty(0, dtype=np.int64)
    noise = max(SIGMA_PER_MAD * float(np.median(steps)) / np.sqrt(2), 1e-6)
    found = [(z / noise, int(own[at])) for own, level in levels.values() for z, at in [_split(level)]]
    least = max(_SURE, _ODD * float(np.median([z for z, _ in found])))
    return np.array(sorted(row for z, row in sorted(found, reverse=True)[:_MOST] if z > least), dtype=np.int64)


def knots_parted(knots: FloatArray, at: FloatArray, stand: IntArray, jumped: IntArray) -> tuple[FloatArray, FloatArray]:
    """Return the knots of a curve over what scans have (k,) with those of some stands parted, and their places.

    jumped: scans after which a stand is parted. By its places a curve is as free from one part to the other as from
    knot to knot elsewhere.
    """
    apart = float(np.median(np.diff(knots)))
    jumped = jumped[at[jumped + 1] > at[jumped]]
    for row in jumped.tolist():
        own = at[stand == stand[row]]
        knots = np.union1d(knots[(knots < own.min()) | (knots > own.max())], at[[row, row + 1]])
    gaps = np.diff(knots)
    ends = np.isin(knots[:-1], at[jumped]) & np.isin(knots[1:], at[jumped + 1])
    return knots, knots[0] + np.concatenate([[0.0], np.cumsum(np.where(ends, apart, gaps))])


def _levels(off: FloatArray) -> FloatArray:
    """Return by how much all readings of each scan (n,) of a stand are off its mean; nan where none is known."""
    seen = np.isfinite(off)
    mean = np.where(seen, off, 0.0).sum(axis=0) / np.maximum(seen.sum(axis=0), 1)
    return np.array(
        [np.median(row[known]) if known.any() else np.nan for row, known in zip(off - mean, seen, strict=True)]
    )


def _split(level: FloatArray) -> tuple[float, int]:
    """Return how far apart the two parts of a stand are at most, in units of the noise, and the last scan of one."""
    ahead = np.arange(1, len(level))
    parts = np.cumsum(level)[:-1] / ahead, np.cumsum(level[::-1])[:-1][::-1] / ahead[::-1]
    z = np.nan_to_num(np.abs(parts[1] - parts[0]) / np.sqrt(1 / ahead + 1 / ahead[::-1]))
    return float(z.max()), int(z.argmax())
