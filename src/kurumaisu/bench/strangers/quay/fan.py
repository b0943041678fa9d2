# SPDX-License-Identifier: BSD-3-Clause
"""What causes do to the scans of a drive, in units of their noise."""

from __future__ import annotations

import numpy as np

from kurumaisu.bench.strangers.quay.base import DT, Drive, Effects
from kurumaisu.bench.strangers.quay.reference import elsewhere, refer
from kurumaisu.bench.strangers.quay.scans import MOVES, edges, look, means
from kurumaisu.bench.strangers.quay.things import Array, Scene


class Fan:
    """Scans of one drive at known poses: effects of causes on the mean, whitened by noise and errors of poses."""

    def __init__(self, dr: Drive, scene: Scene) -> None:
        self.dr, self.scene, self.t = dr, scene, dr.scan_t
        self.view = look(dr, scene, {}, self.t)
        self.base = means({}, self.view)
        r, laser = self.view.r, self.view.laser
        sd = np.sqrt(laser.sd(r) ** 2 + laser.res**2 / 12)
        jac = []
        for k, h in enumerate((0.005, 0.005, 0.002)):
            p = dr.path.copy()
            p[:, k] += h
            jac.append((look(dr, scene, {}, self.t, p).r - r) / h)
        self.jac = np.stack(jac, -1)
        bad = (abs(self.jac) > 40).any(-1) | ~np.isfinite(self.base) | (self.base > laser.rmax - 3 * sd)
        bad |= edges(self.view) | (self.base < laser.rmin)
        self.w = np.where(bad, 0, 1 / sd**2)
        self.jac[bad] = 0
        self.base[~np.isfinite(self.base)] = 0
        ref = scene.ref
        self.white = np.diag([1 / ref.sp**2, 1 / ref.sp**2, 1 / ref.sh**2])
        self.slow = np.diag([1 / ref.wp**2, 1 / ref.wp**2, 1 / ref.wh**2])

    def effect(self, eff: Effects) -> Array:
        """Return the mean reading with the causes less that of the base model at the poses that are measured."""
        dr, scene, moves = self.dr, self.scene, bool(MOVES & set(eff))
        m = means(eff, look(dr, scene, eff, self.t) if moves else self.view)
        base = self.base
        if elsewhere(eff):
            path = refer(dr, scene.robot, eff, dr.path, np.arange(len(dr.path)) * DT)
            base = self.view.laser.scale * look(dr, scene, {}, self.t, path).r
        d = np.where(np.isfinite(m) & np.isfinite(base), m - base, 0)
        return np.where(abs(d) > 0.4, 0, d) if moves or elsewhere(eff) else d

    def common(self, sd: float) -> float:
        """Return twice the log likelihood ratio of an error of sd that all readings of a scan share."""
        shares = []
        for w, j in zip(self.w, self.jac, strict=True):
            c = w @ j
            shares.append(sd**2 * (w.sum() - c @ np.linalg.inv((j.T * w) @ j + self.white) @ c))
        x = np.array(shares)
        return float((x - np.log1p(x)).sum())

    def gram(self, vectors: list[Array]) -> Array:
        """Return inner products of effects."""
        e = np.stack(vectors)
        g = np.zeros((len(e), len(e)))
        block = (self.t / self.scene.ref.wtau).astype(int)
        for b in np.unique(block):
            c_all, m_all = np.zeros((len(e), 3)), np.zeros((3, 3))
            for s in np.flatnonzero(block == b):
                w, j = self.w[s], self.jac[s]
                ew = e[:, s] * w
                m = (j.T * w) @ j
                k = np.linalg.inv(m + self.white)
                c = ew @ j
                g += ew @ e[:, s].T - c @ k @ c.T
                c_all += c - c @ k @ m
                m_all += m - m @ k @ m
            g -= c_all @ np.linalg.inv(m_all + self.slow) @ c_all.T
        return g
