# SPDX-License-Identifier: BSD-3-Clause
"""How much causes show that no column of a linear problem describes: how sure, and the share that rivals leave."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from kurumaisu.bench.strangers.marl.causes import Cause
from kurumaisu.bench.strangers.marl.laser import View
from kurumaisu.bench.strangers.marl.scans import crosstalk
from kurumaisu.bench.strangers.marl.things import RESOLUTION
from kurumaisu.types import BoolArray, FloatArray


class Fan(NamedTuple):
    """A drive's scans without causes: mean readings, which count, weights, and a factor of what poses leave open."""

    view: View
    poses: FloatArray
    mean: FloatArray
    ok: BoolArray
    edge: BoolArray
    weight: FloatArray
    jacobian: FloatArray
    factor: Any
    sd: FloatArray
    pose: FloatArray  # variance of readings by poses
    prior: FloatArray  # variance of poses


Fans = list[Fan]


def _number(fans: Fans) -> int:
    return sum(int(f.ok.sum()) for f in fans)


def _divergence(p: float, q: float) -> float:
    """Return the divergence of two coins."""
    p, q = np.clip(p, 1e-9, 1 - 1e-9), np.clip(q, 1e-9, 1 - 1e-9)
    return float(p * np.log(p / q) + (1 - p) * np.log((1 - p) / (1 - q)))


def _common(fans: Fans, c: Cause) -> tuple[float, float]:
    z2 = 0.0
    for f in fans:
        w = (f.ok / f.sd**2).reshape(len(f.view.t), -1)
        jac = f.jacobian[..., :3]
        a = np.einsum("sbi,sb,sbj->sij", jac, w, jac) + np.diag(1 / f.prior)
        b = np.einsum("sbi,sb->si", jac, w)
        left = w.sum(1) - np.einsum("si,si->s", b, np.linalg.solve(a, b[..., None])[..., 0])
        ratio = 1 + c.size**2 * left
        z2 += (ratio - 1 - np.log(ratio)).sum()
    return np.sqrt(z2), 0.9


def _correlation(fans: Fans, c: Cause) -> tuple[float, float]:
    rho = c.size / (1 + c.size**2) if c.other else c.size
    return np.sqrt(-_number(fans) * np.log(1 - rho**2)), 0.95


def _normal(x: FloatArray, s: float) -> FloatArray:
    return np.asarray(np.exp(-x * x / 2 / s / s) / s / np.sqrt(2 * np.pi))


def _tails(fans: Fans, c: Cause) -> tuple[float, float]:
    x = np.linspace(-40, 40, 40001)
    h = x[1] - x[0]
    if c.other:
        f = _normal(x, 1) * (1 - 0.25 * c.size) + _normal(x, 4) * 0.25 * c.size
    else:
        nu = 1 / c.size
        f = (1 + x * x / nu) ** (-(nu + 1) / 2)
        f /= f.sum() * h
    best = _normal(x, np.sqrt((f * x * x).sum() * h))
    divergence = (f * np.log(f / np.maximum(best, 1e-300))).sum() * h
    return np.sqrt(2 * _number(fans) * max(divergence, 0)), 0.8


def _mixed(fans: Fans, c: Cause) -> tuple[float, float]:
    """Judge against no outliers but the usual few, and against outliers anywhere."""
    n, edges = _number(fans), sum(int(f.edge.sum()) for f in fans)
    mixed = 0.7 * edges * c.size
    e = mixed / (n + edges)
    z = np.sqrt(2 * mixed * np.log(c.size / 2e-3))
    return z, np.sqrt(2 * (edges * _divergence(0.7 * c.size, e) + n * e)) / max(z, 1e-9)


def _dropout(fans: Fans, c: Cause) -> tuple[float, float]:
    return np.sqrt(2 * _number(fans) * _divergence(c.size, 1e-3)), 0.9


def _crosstalk(fans: Fans, c: Cause) -> tuple[float, float]:
    hit = [crosstalk(np.random.default_rng(0), f.view.laser, f.view.d, c) for f in fans]
    n = sum(g.sum() for g in hit)
    e = max(n / sum(map(len, hit)), 1e-6)
    z = np.sqrt(2 * n * np.log(0.7 / 2e-3))
    return z, np.sqrt(2 * n * np.log(0.7 / e)) / max(z, 1e-9)


def _quantisation(fans: Fans, c: Cause) -> tuple[float, float]:
    return np.sqrt(2 * _number(fans) * np.log(max(c.size / RESOLUTION, 1.0))), 1.0


EVIDENCE: dict[str, Callable[[Fans, Cause], tuple[float, float]]] = {
    "laser.common_mode": _common,
    "laser.beam_correlation": _correlation,
    "laser.heavy_tails": _tails,
    "laser.mixed_pixels": _mixed,
    "laser.dropout": _dropout,
    "laser.crosstalk": _crosstalk,
    "laser.quantisation": _quantisation,
}
