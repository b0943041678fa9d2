# SPDX-License-Identifier: BSD-3-Clause
"""How much a cause does to the training drives, in units of their noise, and what is left beside others."""

from __future__ import annotations

from typing import Any

import numpy as np

from kurumaisu.bench.strangers.fell.catalogue import IDS, POSES, VOLTS, draw
from kurumaisu.bench.strangers.fell.laser import Laser, Readings, clipped, readings
from kurumaisu.bench.strangers.fell.plant import Array, Cause, Causes, Pose, Way, travel
from kurumaisu.bench.strangers.fell.scene import Drive, Scene, laser_ctx, reported


def motions(p: Array) -> Array:
    """Return motions between successive poses (N+1, 3), in the frame of the first."""
    d, c, s = np.diff(p, axis=0), np.cos(p[:-1, 2]), np.sin(p[:-1, 2])
    return np.stack([c * d[:, 0] + s * d[:, 1], c * d[:, 1] - s * d[:, 0], d[:, 2]], 1)


def motion_cov(sc: Scene, way: Way, t: Array) -> Array:
    """Return the covariance of motions between the poses at t: white and slow errors, and the rates' coloured noise."""
    n, ref = len(t) - 1, sc.ref
    x, y, th = way.at(t)
    m, jac = motions(np.stack([x, y, th], 1)), np.zeros((n, 3, n + 1, 3))
    k, c, s = np.arange(n), np.cos(th[:-1]), np.sin(th[:-1])
    for at, g in ((k + 1, 1), (k, -1)):
        jac[k, 0, at, 0], jac[k, 0, at, 1], jac[k, 2, at, 2] = g * c, g * s, g
        jac[k, 1, at, 0], jac[k, 1, at, 1] = -g * s, g * c
    jac[k, 0, k, 2], jac[k, 1, k, 2] = m[:, 1], -m[:, 0]
    slow, cov = np.exp(-np.abs(t[:, None] - t) / ref.tau), 1e-12 * np.eye(3 * n)
    for a, (w, q) in enumerate(((ref.sd, ref.slow), (ref.sd, ref.slow), (ref.sd_h, ref.slow_h))):
        j = jac[..., a].reshape(3 * n, n + 1)
        cov += j @ (w * w * np.eye(n + 1) + q * q * slow) @ j.T
    return _with_rates(cov, way, t, (x, y, th), sc.robot.tau)


def _with_rates(cov: Array, way: Way, t: Array, pose: Pose, tau: float) -> Array:
    """Return a covariance of motions with what noise of the rates, constant over five pieces of each, adds to it."""
    n, pieces, (x, y, th) = len(t) - 1, 5, pose
    e = t[:-1, None] + np.diff(t)[:, None] * np.arange(pieces + 1) / pieces
    mid, h = ((e[:, 1:] + e[:, :-1]) / 2).reshape(-1), np.diff(e, axis=1).reshape(-1)
    apart, q = np.abs(mid[:, None] - mid) - (h[:, None] + h) / 2, np.exp(-h / tau)
    (mx, my, mt), of, r = way.at(mid), np.repeat(np.arange(n), pieces), np.arange(n * pieces)
    px, py = x[of + 1] - mx, y[of + 1] - my  # what is still to go turns with an error of the rate
    c, s = np.cos(th[:-1]), np.sin(th[:-1])
    for name in ("sv", "sw"):
        sd, g = way.cell(name, mid), np.zeros((n, 3, n * pieces))
        inner = np.outer(sd * (1 - q), sd * (1 - q)) * tau * tau * np.exp(-np.maximum(apart, 0) / tau)
        inner[r, r] = sd**2 * 2 * tau * tau * (h / tau - 1 + q)
        if name == "sv":
            g[of, 0, r], g[of, 1, r] = np.cos(mt - th[of]), np.sin(mt - th[of])
        else:
            g[of, 0, r], g[of, 1, r], g[of, 2, r] = s[of] * px - c[of] * py, c[of] * px + s[of] * py, 1
        flat = g.reshape(3 * n, n * pieces)
        cov += flat @ inner @ flat.T
    return cov


def mean_poses(sc: Scene, d: Drive, causes: list[Cause], t: Array) -> Array:
    """Return poses that the reference would report without noise of the rates (their motions are what counts)."""
    way = travel(sc.robot, causes, d.rows, d.n, d.start, d.ctx)
    return np.stack(reported(d, way, t, causes), 1)


def _angle(share: Array) -> Array:
    """Return shares so that their noise is the same everywhere."""
    return np.asarray(2 * np.arcsin(np.sqrt(np.minimum(share, 0.99))))


def _size(c: Causes, i: str, name: str) -> Any:
    return c[i].p[name] if i in c else 0.0


class Scans:
    """Some readings of a drive, with what makes their noise white."""

    def __init__(self, sc: Scene, las: Laser, d: Drive) -> None:
        self.sc, self.las, self.d, self.ctx, ref = sc, las, d, laser_ctx(d), sc.ref
        self.ts = d.ts[:: max(1, len(d.ts) // 45)]
        self.b = np.arange(0, las.beams, max(1, las.beams // 100))
        rd, n = self._expect(sc.causes), len(self.b)
        poses = np.diag([ref.sd**2 / 1.5 + ref.slow**2] * 2 + [ref.sd_h**2 / 1.5 + ref.slow_h**2])
        cov, share = np.einsum("kia,ab,kjb->kij", rd.jac, poses, rd.jac), n / las.beams
        cov[:, np.arange(n), np.arange(n)] += rd.sig**2 * share + 1e-10
        self.one = np.linalg.solve(cov, np.ones((len(self.ts), n, 1)))[..., 0].sum(1)
        ok = (rd.mu < 0.96 * las.far) & (rd.jump == 0)
        self.ok = ok & np.roll(ok, 1, 1) & np.roll(ok, -1, 1)
        self.edge = self.ok | (rd.jump != 0)
        self.white = np.linalg.inv(np.linalg.cholesky(cov))
        self.more, self.dense = np.sqrt(len(d.ts) / len(self.ts)), 1 / np.sqrt(share)

    def _expect(self, causes: list[Cause]) -> Readings:
        return readings(self.las, self.sc.room, causes, self.d.way.at, self.ts, self.ctx, self.b)

    def features(self, causes: list[Cause]) -> list[Array]:
        """Return mean, scatter, losses and outliers of readings, and what a scan has in common."""
        las, ok, c, g = self.las, self.ok, {k.id: k for k in causes}, self.more
        n = g * self.dense
        rd = self._expect(causes)
        mu = clipped(causes, rd)
        if moved := [k for k in causes if k.id in POSES]:
            d, room = self.d, self.sc.room
            seen = readings(las, room, [], lambda t: reported(d, d.way, t, moved), self.ts, self.ctx, self.b)
            mu = mu + self._expect([]).mu - seen.mu
        mu = np.where(ok, np.minimum(mu, las.far), 0)
        var = rd.sig**2 + _size(c, "laser.quantisation", "step") ** 2 / 12
        part = min(_size(c, "laser.crosstalk", "width") / (las.increment * las.beams), 1)
        bad = rd.out + rd.mixed + rd.cross[:, None] * part
        if "laser.heavy_tails" in c and c["laser.heavy_tails"].other:
            bad = np.full_like(bad, 0.03)
        rho, sd = _size(c, "laser.beam_correlation", "rho"), _size(c, "laser.common_mode", "sd")
        return [
            g * (self.white @ mu[..., None]).reshape(-1),
            (n * np.log(var) * ok / np.sqrt(2)).reshape(-1),
            (n * _angle(rd.miss) * self.edge).reshape(-1),
            (n * _angle(bad) * self.edge).reshape(-1),
            g * 3 * _angle(rd.cross),
            g * np.sqrt(-ok.sum(1) * self.dense**2 * np.log(1 - rho * rho)),
            g * np.log(1 + self.one * sd**2) / np.sqrt(2),
        ]


class Judge:
    """Features of what causes do to the training drives, whitened."""

    def __init__(self, sc: Scene) -> None:
        self.sc, self.parts = sc, list[tuple[Drive, Array, Array]]()
        for d in sc.drives[:-1]:
            ok = d.tp[~d.off]
            t = np.unique(ok[np.minimum(np.searchsorted(ok, np.arange(ok[0], ok[-1], 1.0)), len(ok) - 1)])
            t = t[np.concatenate([[True], np.diff(t) > 0.5])]
            self.parts.append((d, t, np.linalg.inv(np.linalg.cholesky(motion_cov(sc, d.way, t)))))
        self.scans = [Scans(sc, sc.las, d) for d in sc.drives[:-1]] if sc.las else []
        self.zero = self._base([]) * 0, self._laser([]) * 0

    def _base(self, causes: list[Cause]) -> Array:
        """Return motions of the reference, and the size of their noise (as it differs from a larger one throughout)."""
        out = []
        for d, t, white in self.parts:
            f = np.zeros((len(t) - 1, 2))
            out.append(white @ motions(mean_poses(self.sc, d, causes, t)).reshape(-1))
            if any(c.id == "base.process_noise" for c in causes):
                more = self._log_noise(d, t, causes) - self._log_noise(d, t, [])
                f = np.where(more > 1e-3, more - more[more > 1e-3].mean(), 0) / np.sqrt(2)
            out.append(f.reshape(-1))
        return np.concatenate(out)

    def _log_noise(self, d: Drive, t: Array, causes: list[Cause]) -> Array:
        way = travel(self.sc.robot, causes, d.rows, d.n, d.start, d.ctx)
        return np.asarray(np.log(np.diag(motion_cov(self.sc, way, t))).reshape(-1, 3)[:, ::2])

    def _laser(self, causes: list[Cause]) -> Array:
        return np.concatenate([np.zeros(0), *(f for s in self.scans for f in s.features(causes))])

    def _effect(self, causes: list[Cause], without: list[Cause], i: str) -> Array:
        """Return what the first have that the second have not: a cause with that id."""
        b, a = self.zero
        if "base." in i:
            b = self._base(causes) - self._base(without)
        if "base." not in i or i in POSES:
            a = self._laser(causes) - self._laser(without)
        return np.concatenate([b, a])

    def _rivals(self) -> list[Array]:
        """Return what causes do at their usual size that are not hidden."""
        sc, hidden, rng, out = self.sc, {c.id for c in self.sc.causes}, np.random.default_rng(1), list[Array]()
        skip = hidden | {"base.steering_law", "base.sign", "laser.saturation"}
        skip |= {"base.gain_v", "base.gain_w"} if "base.sign" in hidden else set()  # out of bounds
        for i in IDS:
            if i not in skip and (sc.robot.volts or i not in VOLTS) and (sc.las or i.startswith("base.")):
                k = draw(i, rng, usual=True)
                if i == "base.saturation":
                    k.p = {"inverse_v": 1.3 / sc.robot.vmax, "inverse_w": 1.3 / sc.robot.wmax}
                out.append(self._effect([k], [], i))
        return out

    def score(self) -> list[tuple[float, float]]:
        """Return z and beside of each hidden cause."""
        hidden, out = self.sc.causes, list[tuple[float, float]]()
        own = [self._effect(hidden, [k for k in hidden if k is not c], c.id) for c in hidden]
        z = [float(np.linalg.norm(o)) for o in own]
        if min(z) < 10:
            return [(a, 0.0) for a in z]
        rivals = self._rivals()
        for j, o in enumerate(own):
            others = [u / np.linalg.norm(u) for m, u in enumerate(own) if m != j]
            q = np.linalg.qr(np.array(others).T)[0] if others else np.zeros((len(o), 0))
            rest = o - q @ (q.T @ o)
            left = [float(np.linalg.norm(rest))]
            for u in (r - q @ (q.T @ r) for r in rivals):
                if u @ u > 1e-6:
                    left.append(float(np.linalg.norm(rest - u * (u @ rest) / (u @ u))))
            out.append((z[j], min(left)))
        return out
