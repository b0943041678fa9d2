# SPDX-License-Identifier: BSD-3-Clause
"""How much causes show: lengths of their effects, whitened by the noise that was put in."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from scipy.linalg import cho_factor, cho_solve, solve_triangular
from scipy.optimize import minimize

from kurumaisu.bench.strangers.marl.causes import SPREAD, Cause, Causes, size_of
from kurumaisu.bench.strangers.marl.covariance import POSE, apart, covariances, increments
from kurumaisu.bench.strangers.marl.driving import Drive
from kurumaisu.bench.strangers.marl.evidence import EVIDENCE, Fan
from kurumaisu.bench.strangers.marl.laser import View, mean, sd
from kurumaisu.bench.strangers.marl.motions import at, unobserve
from kurumaisu.bench.strangers.marl.rooms import Room
from kurumaisu.bench.strangers.marl.scans import tailed
from kurumaisu.bench.strangers.marl.things import Reference
from kurumaisu.types import BoolArray, FloatArray

Shown = tuple[float, float]  # how sure it is, and how sure beside what else might be
GROWTH = "base.process_noise"


class Motions(NamedTuple):
    """A drive's motions of a second: stamps, covariances by source, a factor of their sum, means without causes."""

    d: Drive
    s0: FloatArray
    s1: FloatArray
    parts: list[FloatArray]
    factor: Any
    mean: FloatArray


class Effect(NamedTuple):
    """A cause's effect by drives: on motions, on mean readings, and factors of variances where they count."""

    motions: list[FloatArray]
    means: list[FloatArray]
    variances: list[tuple[FloatArray, BoolArray]]


class Score:
    """Inner products of effects over the drives of training."""

    def __init__(self, drives: Sequence[Drive], room: Room, ref: Reference, causes: Causes) -> None:
        self.room, self.ref, self.causes = room, ref, causes
        self.motions = [self._motions(d) for d in drives]
        self.fans = [self._fan(d) for d in drives if d.laser]

    def _motions(self, d: Drive) -> Motions:
        s0, s1 = (d.tp[w] for w in d.windows)
        parts = covariances(d, self.ref, s0, s1, [c for c in self.causes if c.id == GROWTH])
        factor = cho_factor(sum(parts), lower=True)
        return Motions(d, s0, s1, parts, factor, increments(d, s0, s1, ()))

    def _variance(self, q: View) -> FloatArray:
        s, step = sd(q, self.causes), size_of(self.causes, "laser.quantisation")
        var = s * s + step * step / 12
        for c in self.causes:
            if c.id == "laser.heavy_tails":
                var = var * tailed(c)
        return var

    def _fan(self, d: Drive) -> Fan:
        ref, poses, n = self.ref, at(d.path, d.ts), len(d.ts)
        q = View(d, self.room, d.ts, poses)
        m, edge, jac = mean(q, ()), q.edge(), q.jacobian()
        ok = ~edge & (m < q.laser.far * 0.98) & (m > q.laser.near * 1.1) & (q.cos > 0.1)
        far = np.exp(-apart(d.ts) / ref.tau)
        prior = [ref.white[i] ** 2 * np.eye(n) + ref.wander[i] ** 2 * far for i in POSE]
        pose_var = np.array([p[0, 0] for p in prior])
        pose = jac**2 @ pose_var
        if common := size_of(self.causes, "laser.common_mode"):
            jac = np.c_[jac, np.ones(len(m))]
            prior.append(common**2 * np.eye(n))
        k = len(prior)
        weight, jac = (ok / self._variance(q)).reshape(n, -1), jac.reshape(n, -1, k)
        big, i = np.zeros((k, n, k, n)), np.arange(n)
        big[:, i, :, i] = np.einsum("sbi,sb,sbj->sij", jac, weight, jac)
        for j in range(k):
            big[j, :, j] += np.linalg.inv(prior[j])
        factor = cho_factor(big.reshape(k * n, k * n), lower=True)
        return Fan(q, poses, m, ok, edge, weight, jac, factor, sd(q, ()), pose, pose_var)

    def _effect(self, c: Cause) -> Effect:
        out, one, base = Effect([], [], []), [c], c.id.startswith("base.")
        if base and c.id != GROWTH:
            out.motions.extend((increments(q.d, q.s0, q.s1, one) - q.mean).T.ravel() for q in self.motions)
        if base and not c.id.startswith("base.marker") and c.channel != "base.pose":
            return out
        for f in self.fans:
            d = f.view.d
            q = View(d, self.room, d.ts, unobserve(f.poses, one), one, hit=f.view.hit)
            out.means.append(np.asarray(np.clip(mean(q, one) - f.mean, -1, 1) * f.ok))
            if c.id in SPREAD or c.channel == "laser.spread":
                out.variances.append(((sd(q, one) ** 2 + f.pose) / (f.sd**2 + f.pose), f.ok))
        return out

    def _gram(self, effects: list[Effect]) -> FloatArray:
        """Return inner products of effects on motions and mean readings."""
        n = len(effects)
        gram = np.zeros((n, n))
        for k, q in enumerate(self.motions):
            m = np.stack([e.motions[k] if e.motions else np.zeros(q.mean.size) for e in effects], 1)
            white = solve_triangular(q.factor[0], m, lower=True)
            gram += white.T @ white
        for k, f in enumerate(self.fans):
            m = np.stack([e.means[k] if e.means else np.zeros(len(f.mean)) for e in effects], 1)
            m = m.reshape(len(f.view.t), -1, n)
            weighted = m * f.weight[..., None]
            b = np.einsum("sbi,sbm->ism", f.jacobian, weighted).reshape(-1, n)
            gram += np.tensordot(m, weighted, ((0, 1), (0, 1))) - b.T @ cho_solve(f.factor, b)
        return gram

    def judge(self, rivals: Causes) -> list[Shown]:
        """Return how sure each cause is, and beside the others and any rival."""
        ids = [c.id for c in self.causes]
        others = [r for r in rivals if r.id not in ids or (r.id == "laser.range_noise" and r.other)]
        effects = [self._effect(c) for c in [*self.causes, *others]]
        gram = self._gram(effects)
        return [self._shown(i, c, effects, gram) for i, c in enumerate(self.causes)]

    def _shown(self, i: int, c: Cause, effects: list[Effect], gram: FloatArray) -> Shown:
        n = len(self.causes)
        if effects[i].variances:
            z, beside = _spread(i, effects, n)
        elif c.id in EVIDENCE:
            z, share = EVIDENCE[c.id](self.fans, c)
            beside = z * share
        elif c.id == GROWTH:
            z = beside = self._process()
        else:
            some = [j for j in range(n, len(gram)) if gram[j, j] > 0.01]
            z, beside = _rest(gram, i, []), _beside(gram, i, [j for j in range(n) if j != i], some)
        return float(z), float(beside)

    def _process(self) -> float:
        """Return how sure growth of the process noise is, against noise of other sizes that does not grow."""
        plain = [covariances(q.d, self.ref, q.s0, q.s1) for q in self.motions]

        def divergence(x: FloatArray) -> float:
            total = 0.0
            for p, q in zip(plain, self.motions, strict=True):
                factor = cho_factor(p[0] * np.exp(x[0]) + p[1] * np.exp(x[1]) + p[2], lower=True)
                total += np.trace(cho_solve(factor, sum(q.parts))) - len(p[0]) + _log_det(factor) - _log_det(q.factor)
            return total / 2

        least = minimize(divergence, [0.3, 0.3], method="Nelder-Mead", options={"maxfev": 22}).fun
        return float(np.sqrt(2 * max(least, 0)))


def _log_det(factor: Any) -> float:
    return float(2 * np.log(np.diag(factor[0])).sum())


def _spread(i: int, effects: list[Effect], n: int) -> Shown:
    """Return an exact likelihood ratio for a cause of the scatter, and the share of it that rivals leave."""
    z = np.sqrt(sum((r - 1 - np.log(r))[ok].sum() for r, ok in effects[i].variances))
    use = [j for j, e in enumerate(effects) if e.variances]
    logs = [np.concatenate([np.log(r) * ok for r, ok in effects[j].variances]) for j in use]
    gram, k = np.array([[a @ b for b in logs] for a in logs]), use.index(i)
    own = [row for row, j in enumerate(use) if j < n and j != i]
    worst = _beside(gram, k, own, [row for row, j in enumerate(use) if j >= n])
    return z, z * worst / np.sqrt(gram[k, k])


def _beside(gram: FloatArray, i: int, own: list[int], others: list[int]) -> float:
    """Return the length of column i that neither columns own nor any one of others explain."""
    return min(_rest(gram, i, own), *(_rest(gram, i, [*own, j]) for j in others), np.inf)


def _rest(gram: FloatArray, i: int, some: list[int]) -> float:
    """Return the length of column i that some columns do not explain."""
    if not some:
        return float(np.sqrt(max(gram[i, i], 0)))
    s = np.sqrt(np.maximum(np.diag(gram)[some], 1e-12))
    a = gram[np.ix_(some, some)] / np.outer(s, s) + 1e-9 * np.eye(len(some))
    b = gram[some, i] / s
    return float(np.sqrt(max(gram[i, i] - b @ np.linalg.solve(a, b), 0)))
