# SPDX-License-Identifier: BSD-3-Clause
"""Poses (3, n) and motions between them, true and as the reference measures them."""

from __future__ import annotations

import numpy as np

from kurumaisu.bench.strangers.marl.causes import Cause, Causes, size_of
from kurumaisu.types import FloatArray

DT = 0.02


def compose(p: FloatArray, r: FloatArray) -> FloatArray:
    """Return poses p moved by r."""
    c, s = np.cos(p[2]), np.sin(p[2])
    return np.array([p[0] + c * r[0] - s * r[1], p[1] + s * r[0] + c * r[1], p[2] + r[2]])


def between(a: FloatArray, b: FloatArray) -> FloatArray:
    """Return motions from a to b."""
    c, s = np.cos(a[2]), np.sin(a[2])
    x, y = b[0] - a[0], b[1] - a[1]
    return np.array([c * x + s * y, -s * x + c * y, b[2] - a[2]])


def integrate(rates: tuple[FloatArray, FloatArray, FloatArray], start: FloatArray | None = None) -> FloatArray:
    """Return poses at the edges of cells (3, n + 1)."""
    v, w, u = rates
    x0, y0, th0 = np.zeros(3) if start is None else start
    th = th0 + np.r_[0.0, np.cumsum(w)] * DT
    m = th[:-1] + w * DT / 2
    x = x0 + np.r_[0.0, np.cumsum(v * np.cos(m) - u * np.sin(m))] * DT
    y = y0 + np.r_[0.0, np.cumsum(v * np.sin(m) + u * np.cos(m))] * DT
    return np.array([x, y, th])


def at(path: FloatArray, t: FloatArray) -> FloatArray:
    """Return poses at times."""
    e = np.arange(path.shape[1]) * DT
    return np.array([np.interp(t, e, q) for q in path])


def _strayed(p: FloatArray, c: Cause) -> FloatArray:
    """Return what something unknown adds to poses."""
    q = {"x": np.sin(1.7 * p[0]), "y": np.sin(2.1 * p[1]), "heading": np.sin(2 * p[2])}[c.of] * c.size
    return np.array([q * (c.part == k) for k in range(3)])


def observe(p: FloatArray, causes: Causes) -> FloatArray:
    """Return true poses as they are measured."""
    mx, my, m = (size_of(causes, "base.marker_" + k) for k in ("x", "y", "yaw"))
    x, y, a = p
    out = np.array([x + np.cos(a) * mx - np.sin(a) * my, y + np.sin(a) * mx + np.cos(a) * my, a + m])
    for c in causes:
        if c.channel == "base.pose":
            out = out + _strayed(p, c)
    return out


def unobserve(m: FloatArray, causes: Causes) -> FloatArray:
    """Return the true poses of measured ones."""
    p = m.copy()
    for _ in range(4):
        p = p + m - observe(p, causes)
    return p


def clock(t: FloatArray, causes: Causes) -> FloatArray:
    """Return the true times of the reference's stamps."""
    return t / (1 + size_of(causes, "base.clock_scale"))
