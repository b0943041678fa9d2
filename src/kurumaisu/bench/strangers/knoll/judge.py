# SPDX-License-Identifier: BSD-3-Clause
"""How strongly causes show in the training drives (z), and beside their rivals."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.linalg import solve_triangular

from kurumaisu.bench.strangers.knoll.catalogue import BASE, VOLTAGE, draw_cause
from kurumaisu.bench.strangers.knoll.motions import MotionErrors, motions
from kurumaisu.bench.strangers.knoll.readings import Readings, without
from kurumaisu.bench.strangers.knoll.spread import scattered, seconds
from kurumaisu.bench.strangers.knoll.things import Cause, Drive, Scene
from kurumaisu.types import FloatArray


def _in_motions(sc: Scene, causes: Sequence[Cause], asked: Sequence[Cause], x: Drive, n: int) -> FloatArray:
    """Return the changes of motions by causes, hidden ones and others, in sds (motions, n)."""
    ia, ib = seconds(x)
    start = x.clean[:, ia]
    moved = motions(sc, causes, x, x.rt[ia], x.rt[ib], start)
    d = np.zeros((n, moved.means.size))
    for k, c in enumerate(asked):
        if c.base:
            hidden = any(c is other for other in causes)
            changed = without(causes, c) if hidden else [*causes, c]
            by = (moved.means - motions(sc, changed, x, x.rt[ia], x.rt[ib], start).means).ravel()
            d[k] = by if hidden else -by
    factor = np.linalg.cholesky(MotionErrors(sc, causes, x, ia, ib, moved).together())
    return np.asarray(solve_triangular(factor, d.T, lower=True))


def _in_readings(mean: Sequence[Cause], labels: list[str], las: Readings, hidden: set[str]) -> FloatArray:
    """Return the changes of readings by labels, the first of which are the hidden causes."""
    out = np.zeros((len(labels), las.mu.size))
    change = {k: las.change(c) for k, c in enumerate(mean) if c.ranges}
    las.weigh(np.all([las.ok, *(same for _, same in change.values())], axis=0))
    for k, (d, _) in change.items():
        out[k] = las.as_poses(mean[k], d)
    for name, d in las.rivals(hidden).items():
        if name in labels:
            out[labels.index(name)] = d
    return out


def _beside(total: FloatArray, j: int, hidden: int) -> float:
    """Return what is left of cause j beside the other hidden ones and any one rival."""
    others, best = [k for k in range(hidden) if k != j], np.inf
    for k in [None, *range(hidden, len(total))]:
        q = others + ([k] if k is not None and total[k, k] > 1e-9 else [])
        rest = total[j, j]
        if q:
            d = np.sqrt(np.maximum(total[q, q], 1e-12))
            b = total[q, j] / d
            rest = rest - b @ np.linalg.pinv(total[np.ix_(q, q)] / np.outer(d, d), rcond=1e-9) @ b
        best = min(best, rest)
    return best


def judge(sc: Scene, causes: Sequence[Cause], drives: Sequence[Drive]) -> list[tuple[float, float]]:
    """Return (z, beside) of each cause."""
    if not causes:
        return []
    hidden, mean = {c.id for c in causes}, [c for c in causes if not c.scatter]
    left = [n for n in BASE if "base." + n not in hidden and n not in ("process_noise", "steering_law")]
    left = [n for n in left if sc.voltage or n not in VOLTAGE]
    asked = mean + [draw_cause(n, np.random.default_rng(4), sc, 1.0) for n in left]
    lasers = [Readings(sc, causes, x) for x in drives] if sc.fan else []
    total = np.zeros((0, 0))
    if mean:
        labels = [c.id for c in asked]
        labels += [n for n in (lasers[0].rivals(hidden) if lasers else ()) if n not in labels]
        total = np.zeros((len(labels),) * 2)
        for i, x in enumerate(drives):
            d = _in_motions(sc, causes, asked, x, len(labels))
            total += d.T @ d
            if lasers:
                total += lasers[i].gram(_in_readings(mean, labels, lasers[i], hidden))
    out = []
    for c in causes:
        if c.scatter:
            out.append(scattered(sc, causes, c, drives, lasers))
            continue
        j = mean.index(c)
        out.append((float(np.sqrt(max(total[j, j], 0))), float(np.sqrt(max(_beside(total, j, len(mean)), 0)))))
    return out
