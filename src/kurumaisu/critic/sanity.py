# SPDX-License-Identifier: BSD-3-Clause
"""Data that are wrong rather than surprising: signs and units that one transform would mend. Never fitted, said."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from kurumaisu.critic import replay
from kurumaisu.critic.drive import Drive
from kurumaisu.params import Model

_MENDS = 0.25  # share of the squared residual that a suspected transform must leave at most

_TRANSFORMS: dict[str, Callable[[Drive], Drive]] = {
    "the yaw rate of the input has the wrong sign": lambda d: replace(d, w=-d.w),
    "the forward speed of the input has the wrong sign": lambda d: replace(d, v=-d.v),
    "the yaw rate of the input is in degrees": lambda d: replace(d, w=np.radians(d.w)),
    "the heading of the reference pose is in degrees": lambda d: _pose(d, [0, 1, 2], [1, 1, np.pi / 180]),
    "the reference pose is in millimetres": lambda d: _pose(d, [0, 1, 2], [1e-3, 1e-3, 1]),
    "x and y of the reference pose are swapped": lambda d: _pose(d, [1, 0, 2], [1, 1, 1]),
    "x of the reference pose has the wrong sign": lambda d: _pose(d, [0, 1, 2], [-1, 1, 1]),
    "y of the reference pose has the wrong sign": lambda d: _pose(d, [0, 1, 2], [1, -1, 1]),
}


def suspicions(drives: Sequence[Drive], model: Model) -> list[str]:
    """Return what seems wrong with the data, in words; empty when nothing does."""
    as_given = sum(_misfit(drive, model) for drive in drives)
    found = {}
    for words, transform in _TRANSFORMS.items():
        share = sum(_misfit(transform(drive), model) for drive in drives) / max(as_given, 1e-12)
        if share < _MENDS:
            found[words] = share
    best = sorted(found, key=lambda words: found[words])[:1]
    return [f"{words}: with that undone, {found[words]:.1%} of the squared residual remains" for words in best]


def _pose(drive: Drive, order: list[int], factors: list[float]) -> Drive:
    return replace(drive, poses=drive.poses[:, order] * factors)


def _misfit(drive: Drive, model: Model) -> float:
    """Return the squared residual of dx and dtheta, each in units of what was measured."""
    residual = drive.measured - replay.increments(drive, model, ())
    size = np.sqrt(np.mean(drive.measured**2, axis=0))
    return float(np.sum((residual[:, [0, 2]] / np.maximum(size[[0, 2]], 1e-9)) ** 2))
