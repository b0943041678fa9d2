# SPDX-License-Identifier: BSD-3-Clause
"""How strongly causes show in the scatter of motions and readings."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from scipy.stats import t as student

from kurumaisu.bench.strangers.knoll.catalogue import draw_cause
from kurumaisu.bench.strangers.knoll.driving import open_rates
from kurumaisu.bench.strangers.knoll.motions import MotionErrors, motions
from kurumaisu.bench.strangers.knoll.readings import Readings, without
from kurumaisu.bench.strangers.knoll.scans import beam_times, shoot
from kurumaisu.bench.strangers.knoll.signals import normal
from kurumaisu.bench.strangers.knoll.things import Cause, Drive, Hits, Scene
from kurumaisu.types import FloatArray, IntArray

Seen = tuple[FloatArray, FloatArray, FloatArray, FloatArray, Hits]  # readings, means, sds, variances by poses, hits


def seconds(x: Drive) -> tuple[IntArray, IntArray]:
    """Return rows of the reference about 1 s apart, as neighbours."""
    good = np.flatnonzero(~x.bad)
    goal = np.arange(x.rt[good[0]], x.rt[good[-1]], 1.0)
    k = np.unique(good[np.clip(np.searchsorted(x.rt[good], goal), 0, good.size - 1)])
    apart = np.diff(x.rt[k])
    ok = (apart < 1.6) & (apart > 0.4)
    return k[:-1][ok], k[1:][ok]


def _of_motions(sc: Scene, causes: Sequence[Cause], c: Cause, drives: Sequence[Drive]) -> float:
    assert c.growth
    out = 0.0
    for x in drives:
        ia, ib = seconds(x)
        moved = motions(sc, causes, x, x.rt[ia], x.rt[ib], x.ref[:, ia])
        v, w, _ = open_rates(sc, causes, x)
        on = (np.abs(v) > 1e-3) | (np.abs(w) > 1e-3)
        fv, fw = (float(np.sqrt(np.mean(q[on] ** 2))) for q in c.growth(v, w))
        flat = replace(sc, sd_v=sc.sd_v * fv, sd_w=sc.sd_w * fw)
        a = np.linalg.solve(
            MotionErrors(flat, without(causes, c), x, ia, ib, moved).together(),
            MotionErrors(sc, causes, x, ia, ib, moved).together(),
        )
        out += np.trace(a) - len(a) - np.linalg.slogdet(a)[1]
    return out


def _lost(c: Cause, las: Readings) -> tuple[float, float]:
    """Return the gain by readings that are lost, alone and beside a flat share."""
    assert c.lost
    r, o = las.x.scans.ravel(), las.open
    p = np.clip(c.lost(las.mu, las.g), 1e-4, 1 - 1e-4)
    q = np.where(np.isnan(r), np.log(p / 0.002), np.log((1 - p) / 0.998))
    miss = max(float(np.mean(np.isnan(r[o]))), 1e-4)
    flat = np.where(np.isnan(r), np.log(miss / 0.002), np.log((1 - miss) / 0.998))
    own = 2 * q[o].sum()
    return own, own if c.id == "laser.dropout" else 2 * (q - flat)[o].sum()


def _common(c: Cause, las: Readings) -> float:
    assert c.common
    q, b = np.einsum("nb->n", las.weights), np.einsum("nbi,nb->ni", las.jac, las.weights)
    known = np.diag(1 / (las.sc.ref.white + las.sc.ref.slow))
    q = c.common[0] ** 2 * (q - np.einsum("ni,nij,nj->n", b, np.linalg.inv(las.info + known), b))
    return float((q - np.log1p(q)).sum())


def _correlated(c: Cause, las: Readings) -> float:
    assert c.noise
    e = c.noise(np.random.default_rng(2).normal(size=las.mu.size)).reshape(las.n, -1)
    rho = np.corrcoef(e[:, 1:].ravel(), e[:, :-1].ravel())[0, 1]
    pair = (las.weights[:, 1:] > 0) & (las.weights[:, :-1] > 0)
    share = (las.sd**2 / (las.sd**2 + 0.3 * las.pose_var)).reshape(las.n, -1)[:, 1:]
    return float(-(np.log1p(-(rho**2)) * share**2)[pair].sum())


def _rivals(own: str, las: Readings, one: Seen) -> Iterator[FloatArray]:
    """Yield the densities of readings by other causes of the scatter."""
    r, m, s, p, g = one
    wide = np.sqrt(s**2 + p)
    if own != "laser.range_noise":
        yield from (normal(r, m, np.sqrt((k * s) ** 2 + p)) for k in (0.7, 1.15, 1.3, 1.6, 2, 3))
    if own != "laser.incidence_noise":
        yield from (normal(r, m, np.sqrt((s * (1 + k * g.tan(5))) ** 2 + p)) for k in (0.2, 0.5, 1.0, 2))
    if own != "laser.heavy_tails":
        yield from (student.pdf((r - m) / wide, 1 / k) / wide for k in (0.1, 0.25, 0.4))
        for k in (0.01, 0.03, 0.1):
            yield from ((1 - k) * normal(r, m, wide) + k * normal(r, m, np.hypot(s, far)) for far in (0.05, 0.3, 1.0))
    if own != "laser.crosstalk":
        yield from ((1 - k) * normal(r, m, wide) + k / min(las.sc.laser.far, 5) for k in (0.01, 0.03, 0.1))
    if own != "laser.mixed_pixels":
        mixed = draw_cause("mixed_pixels", np.random.default_rng(1), las.sc, 1.0)
        assert mixed.dens
        yield mixed.dens(r, m, wide, g)


def _densities(c: Cause, las: Readings) -> tuple[float, FloatArray]:
    """Return the gains in log likelihood by the cause and by each of its rivals."""
    sc, r, sd = las.sc, las.x.scans.ravel(), las.sd
    o = las.ok & (np.abs(r - las.mu) < 20)
    if c.sd:
        sd = shoot(sc, without(las.causes, c), las.x, las.poses, beam_times(sc, las.causes, las.x.st))[1]
        sd = np.sqrt(sd**2 + sc.laser.resolution**2 / 12)
    g, r, mu, s0, s1, p = las.g.only(o), r[o], las.mu[o], sd[o], las.sd[o], 0.6 * las.pose_var[o]
    floor = 0.002 / sc.laser.far
    wide = np.sqrt(s1**2 + p)
    own = c.dens(r, mu, wide, g) if c.dens else normal(r, mu, wide)
    null = np.log(normal(r, mu, np.sqrt(s0**2 + p)) + floor)
    rivals = [(np.log(f + floor) - null).sum() for f in _rivals(c.id, las, (r, mu, s0, p, g))]
    return float((np.log(own + floor) - null).sum()), np.array(rivals)


def _of_readings(c: Cause, lasers: Sequence[Readings]) -> tuple[float, float]:
    if c.lost:
        gains = [_lost(c, las) for las in lasers]
        return sum(z for z, _ in gains), sum(b for _, b in gains)
    if c.step:
        z2 = sum(2 * las.ok.sum() * np.log(c.step / las.sc.laser.resolution) for las in lasers)
    elif c.common or c.noise:
        z2 = sum((_common if c.common else _correlated)(c, las) for las in lasers)
    else:
        each = [_densities(c, las) for las in lasers]
        own, rivals = sum(z for z, _ in each), np.sum([r for _, r in each], axis=0)
        return 2 * own, 2 * (own - max(0.0, rivals.max()))
    return z2, z2


def scattered(
    sc: Scene, causes: Sequence[Cause], c: Cause, drives: Sequence[Drive], lasers: Sequence[Readings]
) -> tuple[float, float]:
    """Return how strongly a cause shows in the scatter (z), and beside its rivals."""
    if c.growth:
        z2 = b2 = _of_motions(sc, causes, c, drives)
    else:
        z2, b2 = _of_readings(c, lasers)
    return float(np.sqrt(max(z2, 0))), float(np.sqrt(max(b2, 0)))
