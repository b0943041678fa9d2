# SPDX-License-Identifier: BSD-3-Clause
"""Hidden faults that turn readings into something else: edges, losses, limits, other lasers, a coarser grid."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from kurumaisu.bench.hidden.generator.motion import Sizes
from kurumaisu.bench.hidden.generator.scanning import Scans
from kurumaisu.types import FloatArray


def _draws(c: Scans, s: Sizes, count: int) -> FloatArray:
    return np.random.default_rng(int(s["seed"])).random((count, *c.readings.shape))


def mixed_pixels(c: Scans, s: Sizes) -> Scans:
    """Beside a jump of more than 0.1 m, with probability `size`: anything between the two."""
    return _mixed(c, s, lambda share: share)


def weighted_pixels(c: Scans, s: Sizes) -> Scans:
    """The same with readings that favour both ends, as of a spot that is mostly on one side."""
    return _mixed(c, s, lambda share: 0.5 - 0.5 * np.cos(np.pi * share))


def _mixed(c: Scans, s: Sizes, shape: Callable[[FloatArray], FloatArray]) -> Scans:
    chance, share = _draws(c, s, 2)
    beside = np.concatenate([c.readings[:, 1:], c.readings[:, -1:]], axis=1)
    with np.errstate(invalid="ignore"):
        jump = np.isfinite(c.readings) & np.isfinite(beside) & (np.abs(beside - c.readings) > 0.1)
        between = c.readings + shape(share) * (beside - c.readings)
    return replace(c, readings=np.where(jump & (chance < s["size"]), between, c.readings))


def dropout(c: Scans, s: Sizes) -> Scans:
    """No valid reading with probability `size`, and more by a share of it for far and for oblique."""
    hit = np.isfinite(c.ranges)
    more = s["far"] * np.where(hit, c.ranges, 0.0) / 2 + s["oblique"] * (1 - c.cosine)
    lost = hit & (_draws(c, s, 1)[0] < s["size"] * (1 + more))
    return replace(c, readings=np.where(lost, np.nan, c.readings))


def saturation(c: Scans, s: Sizes) -> Scans:
    """Nothing reads farther than `size` [1/m] inverted."""
    return replace(c, readings=np.minimum(c.readings, 1 / s["size"]))


def crosstalk(c: Scans, s: Sizes) -> Scans:
    """In a sector that wanders round, readings anywhere up to 4 m with probability `size`."""
    chance, spread = _draws(c, s, 2)
    away = np.angle(np.exp(1j * (c.bearings[None, :] - s["drift"] * c.stamps[:, None])))
    hit = (np.abs(away) < s["width"] / 2) & (chance < s["size"])
    return replace(c, readings=np.where(hit, 4.0 * spread, c.readings))


def quantisation(c: Scans, s: Sizes) -> Scans:
    """Readings on a grid of `size` [m]."""
    return replace(c, readings=s["size"] * np.rint(c.readings / s["size"]))


def floored(c: Scans, s: Sizes) -> Scans:
    """Readings cut down to a grid of `size` [m] and lifted by half a step."""
    return replace(c, readings=s["size"] * (np.floor(c.readings / s["size"]) + 0.5))
