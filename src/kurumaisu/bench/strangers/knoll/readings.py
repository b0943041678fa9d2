# SPDX-License-Identifier: BSD-3-Clause
"""How the readings of a drive change by causes, poses of scans being known as well as the reference tells them."""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from kurumaisu.bench.strangers.knoll.catalogue import LASER, draw_cause
from kurumaisu.bench.strangers.knoll.motions import tracked, untracked
from kurumaisu.bench.strangers.knoll.scans import beam_times, shoot
from kurumaisu.bench.strangers.knoll.things import Cause, Drive, Pose, Scene
from kurumaisu.types import BoolArray, FloatArray

_WHITE = 0.7  # share of the white variance that poses of scans have


def without(causes: Sequence[Cause], c: Cause) -> list[Cause]:
    """Return the other causes."""
    return [d for d in causes if d is not c]


def _scan_poses(causes: Sequence[Cause], subset: Sequence[Cause], x: Drive, ta: FloatArray) -> Pose:
    """Return true poses at beam times as a subset of the causes makes them of the reference."""
    true = x.at(ta)
    return untracked(subset, ta, tracked(causes, ta, true)) if any(c.poses for c in causes) else true


class Readings:
    """Means, scatter and weights of one drive's scans."""

    def __init__(self, sc: Scene, causes: Sequence[Cause], x: Drive) -> None:
        fan, ta = sc.laser, beam_times(sc, causes, x.st)
        self.sc, self.x, self.n, self.causes = sc, x, x.st.size, causes
        self.poses = _scan_poses(causes, causes, x, ta)
        self.mu, sd, self.g = shoot(sc, causes, x, self.poses, ta)
        self.open: BoolArray = (self.g.r < 99) & (self.mu < fan.far - 4 * sd) & (self.mu > fan.near)
        self.ok: BoolArray = np.isfinite(x.scans.ravel()) & self.open & (self.g.cosi > 0.12)
        self.sd: FloatArray = np.sqrt(sd**2 + fan.resolution**2 / 12)
        self.jac = self.g.jac.reshape(self.n, -1, 3)
        self.weigh(self.ok)

    def weigh(self, mask: BoolArray) -> None:
        """Leave only these readings."""
        sc, n, jac = self.sc, self.n, self.jac
        self.ok = self.ok & mask
        self.weights: FloatArray = np.where(self.ok, 1 / self.sd**2, 0).reshape(n, -1)
        known = np.linalg.inv(sc.ref.cov(self.x.st, _WHITE))
        self.info: FloatArray = np.einsum("nbi,nb,nbj->nij", jac, self.weights, jac)
        for i in range(n):
            known[3 * i : 3 * i + 3, 3 * i : 3 * i + 3] += self.info[i]
        self._factor = cho_factor(known)
        self.pose_var: FloatArray = np.einsum(
            "nbi,ij,nbj->nb", jac, np.diag(_WHITE * sc.ref.white + sc.ref.slow), jac
        ).ravel()

    def gram(self, changes: FloatArray) -> FloatArray:
        """Return the inner products of changes (k, readings), errors of the poses in the covariance."""
        d = changes.reshape(len(changes), self.n, -1)
        wd = d * self.weights
        b = np.einsum("nbi,knb->kni", self.jac, wd).reshape(len(d), -1)
        return np.asarray(np.einsum("knb,lnb->kl", wd, d, optimize=True) - b @ cho_solve(self._factor, b.T))

    def change(self, c: Cause) -> tuple[FloatArray, BoolArray]:
        """Return the change of the means by a hidden cause, and where it is one of the same edge."""
        rest = without(self.causes, c)
        ta = beam_times(self.sc, rest, self.x.st)
        mu, _, g = shoot(self.sc, rest, self.x, _scan_poses(self.causes, rest, self.x, ta), ta)
        d = self.mu - mu
        return d, (g.edge == self.g.edge) & (np.abs(d) < 0.4 + 0.1 * self.g.r)

    def as_poses(self, c: Cause, d: FloatArray) -> FloatArray:
        """Return the change d, linear where a pose of each scan explains it."""
        d = np.where(self.ok, d, 0)
        if c.mean or not (c.mount is not None or c.poses or c.scan_time):
            return d
        b = np.einsum("nbi,nb->ni", self.jac, self.weights * d.reshape(self.n, -1))
        p = np.linalg.solve(self.info + 1e-3 * np.eye(3), b[..., None])[..., 0]
        return np.where(self.ok, np.einsum("nbi,ni->nb", self.jac, p).ravel(), 0)

    def _linear(self) -> dict[str, FloatArray]:
        """Return the changes by what moves the laser, at a usual size."""
        g, jac, x = self.g, self.g.jac, self.x
        c, s = np.cos(g.th), np.sin(g.th)
        k = np.clip((g.t * 100).astype(int), 0, x.n - 1)
        v, w, u = x.v[k], x.w[k], x.u[k]
        late = jac[:, 0] * (v * c - u * s) + jac[:, 1] * (v * s + u * c) + jac[:, 2] * w
        fx, fy = jac[:, 0] * c + jac[:, 1] * s, -jac[:, 0] * s + jac[:, 1] * c
        m, walls = self.sc.laser.mount, np.random.default_rng(5).normal(0, 0.008, (60, 2))[g.thing]
        return {
            "laser.mount_x": 0.02 * fx,
            "laser.mount_y": 0.02 * fy,
            "laser.mount_yaw": 0.02 * (jac[:, 2] + m[1] * fx - m[0] * fy),
            "laser.sweep": 0.25 * late * g.late,
            "laser.latency": 0.03 * late,
            "laser.clock_skew": 4e-4 * late * g.t,
            "world.map_error": -(jac[:, 0] * walls[:, 0] + jac[:, 1] * walls[:, 1]),
            "base.marker_x": -0.035 * fx,
            "base.marker_y": -0.035 * fy,
            "base.marker_yaw": -0.025 * jac[:, 2],
        }

    def rivals(self, hidden: Collection[str]) -> dict[str, FloatArray]:
        """Return the changes by what is not hidden, at a usual size."""
        out = self._linear()
        for name in LASER:
            if "laser." + name in out or name == "map_error" or (name == "temperature" and name not in self.g.cov):
                continue
            rival = draw_cause(name, np.random.default_rng(3), self.sc, 1.0)
            if rival.mean:
                d = rival.mean(self.mu, self.g) - self.mu
                out["laser." + name] = np.where(np.abs(d) < 0.3, d, 0)
        return {name: np.where(self.ok, d, 0) for name, d in out.items() if name not in hidden}
