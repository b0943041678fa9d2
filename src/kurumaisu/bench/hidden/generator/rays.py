# SPDX-License-Identifier: BSD-3-Clause
"""The generator's own ray caster: every ray against every edge, by Cramer's rule."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kurumaisu.types import FloatArray, IntArray

NOTHING = -1


@dataclass(frozen=True)
class Hits:
    """What rays met: ranges [m], inf for nothing; edge met, NOTHING for none; cosine of the angle of incidence."""

    ranges: FloatArray
    edge: IntArray
    cosine: FloatArray


def cast(origins: FloatArray, angles: FloatArray, edges: FloatArray) -> Hits:
    """Cast rays from origins (n, 2) at angles (n,) on edges (m, 4) of x, y, x, y."""
    dx, dy = np.cos(angles), np.sin(angles)
    best = np.full(len(angles), np.inf)
    index = np.full(len(angles), NOTHING)
    for i, (x0, y0, x1, y1) in enumerate(edges):
        ex, ey = x1 - x0, y1 - y0
        ox, oy = x0 - origins[:, 0], y0 - origins[:, 1]
        across = dx * ey - dy * ex
        with np.errstate(divide="ignore", invalid="ignore"):
            along = (ox * ey - oy * ex) / across
            part = (ox * dy - oy * dx) / across
        better = (along > 0) & (along < best) & (part >= 0) & (part <= 1)
        best[better] = along[better]
        index[better] = i
    span = edges[:, 2:] - edges[:, :2]
    normal = np.stack([-span[:, 1], span[:, 0]], axis=1) / np.linalg.norm(span, axis=1, keepdims=True)
    cosine = np.abs(dx * normal[index, 0] + dy * normal[index, 1])
    return Hits(best, index, np.where(index == NOTHING, 1.0, cosine))
