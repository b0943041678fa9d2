# SPDX-License-Identifier: BSD-3-Clause
"""How strongly a recording shows what is hidden in it, alone and beside rivals; and what can be predicted by it."""

from __future__ import annotations

import numpy as np
from scipy.linalg import cho_factor, cho_solve, solve_triangular

from kurumaisu.bench.strangers.tarn import base
from kurumaisu.bench.strangers.tarn.base import DT, Array, Drive, Effect, Effects, Lab, Pose, Rng, seen
from kurumaisu.bench.strangers.tarn.labs import IDS, SCATTER, possible, typical
from kurumaisu.bench.strangers.tarn.laser import Rays, Room, Where, density, lost, mean, scatter, trace

ON_REFERENCE = {"base.marker_x", "base.marker_y", "base.marker_yaw", "base.clock_scale", "unknown", ""}
STEP = 0.05
RIVALS: list[tuple[str, dict[str, float], tuple[float, ...]]] = [
    ("laser.range_noise", {"share": 0.1}, (-2, -1, 1, 2, 4, 8, 20)),
    ("laser.reflectance", {"noise": 0.2}, (1, 3, 8)),
    ("laser.incidence_noise", {"gain": 0.1}, (1, 3, 8, 20)),
    ("laser.heavy_tails", {"inverse_nu": 0.1}, (1, 2, 4)),
    ("laser.heavy_tails", {"outliers": 0.01, "reach": 0.3}, (1, 4)),
    ("laser.beam_correlation", {"rho": 0.1}, (1, 4)),
    ("laser.heavy_tails", {"outliers": 0.01, "reach": 2.0}, (1, 3)),
    ("laser.common_mode", {"sd": 0.0005}, (1, 2, 4)),
    ("laser.mixed_pixels", {"probability": 0.1}, (1, 3, 6)),
]


def true_time(d: Drive, fx: Effects, stamp: Array) -> Array:
    """When a row of the reference was measured."""
    return np.asarray(d.t[0] + (stamp - d.t[0]) / (1 + fx.p("base.clock_scale", "scale")))


def forward(lab: Lab, d: Drive, fx: Effects) -> Pose:
    """The path without noise."""
    return base.integrate((0.0, 0.0, 0.0), *base.rates(lab, d, fx, d.th[:-1]))


def errors(lab: Lab, t: Array, v: Array) -> list[Array]:
    """Covariances of the reference's x, y, and headings at times t, at speeds v."""
    r, far = lab.ref, np.exp(-np.abs(t[:, None] - t) / lab.ref.tau)
    p = np.diag(r.sd_p**2 + 0.5 * (v * r.jitter) ** 2) + r.drift_p**2 * far
    return [p, p.copy(), np.eye(len(t)) * r.sd_h**2 + r.drift_h**2 * far]


def base_link(d: Drive, fx: Effects, reference: Where) -> Where:
    """Where the robot is at a time of its own clock, by what the reference says at its stamps."""
    mx, my, odd = fx.p("base.marker_x", "x"), fx.p("base.marker_y", "y"), fx.odd("base.pose")

    def where(t: Array) -> Pose:
        x, y, th = reference(t + fx.p("base.clock_scale", "scale") * (t - d.t[0]))
        th = th - fx.p("base.marker_yaw", "yaw")
        if odd:
            x, y = (x - base.curve(x, odd.p), y) if odd.covariate == "x" else (x, y - base.curve(y, odd.p))
        return x - mx * np.cos(th) + my * np.sin(th), y - mx * np.sin(th) - my * np.cos(th), th

    return where


class Motions:
    """The increments of one drive over about a second, in the frame at their beginning, with their covariance."""

    def __init__(self, lab: Lab, d: Drive, fx: Effects) -> None:
        good = np.flatnonzero(~d.bad)
        rows = np.unique(good[np.searchsorted(d.stamp[good], np.arange(d.stamp[0] + 0.1, d.stamp[-1] - 0.1, 1.0))])
        self.lab, self.d, self.rows, n = lab, d, rows, len(rows) - 1
        t, (v, w, _) = true_time(d, fx, d.stamp[rows]), base.rates(lab, d, fx, d.th[:-1])
        sv, sw = base.spread(lab.noise, v, w)
        sums = (np.append(0.0, np.cumsum(c) * DT) for c in (sv**2, sw**2, np.abs(v)))
        qv, qw, far = (np.diff(np.interp(t, d.edges, c)) for c in sums)
        qv, qw = np.sqrt(qv * 2.1 * lab.noise.tau_v), np.sqrt(qw * 2.1 * lab.noise.tau_w)
        self.inc = self.body(d.px[rows], d.py[rows], d.pth[rows])
        c, s, i, a = np.cos(d.pth[rows[:-1]]), np.sin(d.pth[rows[:-1]]), np.arange(n), np.zeros((3, n, 3, n + 1))
        for q, row in ((1, i + 1), (-1, i)):
            a[0, i, 0, row] = a[1, i, 1, row] = q * c
            a[0, i, 1, row], a[1, i, 0, row], a[2, i, 2, row] = q * s, -q * s, q
        a[0, i, 2, i], a[1, i, 2, i] = self.inc[n : 2 * n], -self.inc[:n]
        m, cov = a.reshape(3 * n, 3, n + 1), np.zeros((3 * n, 3 * n))
        for k, e in enumerate(errors(lab, t, np.interp(t, d.t, v))):
            cov += m[:, k] @ e @ m[:, k].T
        turn, zero = self.mean(fx)[2 * n :] / 2, np.zeros(n)
        c, s, side = np.cos(turn), np.sin(turn), far * qw / np.sqrt(12)
        for b in ((c * qv, s * qv, zero), (-s * side, c * side, zero), (-s * far / 2 * qw, c * far / 2 * qw, qw)):
            f = np.concatenate([np.diag(k) for k in b])
            cov += f @ f.T
        self.chol = np.linalg.cholesky(cov + 1e-10 * np.eye(3 * n))

    def body(self, x: Array, y: Array, th: Array) -> Array:
        """All dx, then all dy, then all dtheta."""
        dx, dy, c, s = np.diff(x), np.diff(y), np.cos(th[:-1]), np.sin(th[:-1])
        return np.concatenate([c * dx + s * dy, c * dy - s * dx, np.diff(th)])

    def mean(self, fx: Effects) -> Array:
        """What the increments would be without noise."""
        t = true_time(self.d, fx, self.d.stamp[self.rows])
        return self.body(*seen(self.d, fx, forward(self.lab, self.d, fx), t))

    def white(self, change: Array) -> Array:
        """Whitened."""
        return np.asarray(solve_triangular(self.chol, change, lower=True))


class Scans:
    """Some readings of one drive, with what the poses' errors make of them."""

    def __init__(self, lab: Lab, d: Drive, room: Room, fx: Effects, most: int, beams: int) -> None:
        assert lab.laser
        self.las, self.d, self.room, self.lab = lab.laser, d, room, lab
        self.number = np.unique(np.linspace(0, len(d.ts) - 1, most).astype(int))
        self.beam = np.unique(np.linspace(0, lab.laser.beams - 1, beams).astype(int))
        self.more = len(d.ts) / len(self.number), lab.laser.beams / len(self.beam)
        self.where: Where = lambda t: seen(d, fx, (d.x, d.y, d.th), true_time(d, fx, t))
        self.q, self.m = self.at(fx)
        q, m, self.z = self.q, self.m, d.scans[np.ix_(self.number, self.beam)]
        self.s = scatter(self.las, fx, q, m, d)
        self.ok = (m > self.las.rmin * 1.1) & (m < self.las.rmax * 0.97) & (q.hit >= 0) & np.isfinite(self.z)
        ex, ey, c, s = *room.segments()[q.hit].transpose(2, 0, 1)[2:], np.cos(q.a), np.sin(q.a)
        gx, gy, turn = -ey / (c * ey - s * ex), ex / (c * ey - s * ex), q.r * (s * ey + c * ex) / (c * ey - s * ex)
        x, y = (np.interp(q.t, d.edges, k)[:, None] for k in (d.x, d.y))
        self.g = np.stack([gx, gy, turn - gx * (q.oy - y) + gy * (q.ox - x)], 2)
        self.g[~self.ok] = 0

    def at(self, fx: Effects) -> tuple[Rays, Array]:
        """Rays and means by these effects at what the reference says."""
        which = self.d.ts[self.number], self.beam, float(self.d.t[0])
        q = trace(self.room, self.las, fx, base_link(self.d, fx, self.where), *which)
        return q, mean(self.las, fx, q, self.d)

    def change(self, fx: Effects) -> Array:
        """How the means change if these effects act, where the same wall is met."""
        q, m = self.at(fx)
        return np.asarray(np.where(self.ok & (q.hit == self.q.hit), m - self.m, 0.0))

    def gram(self, cols: list[Array]) -> Array:
        """Inner products of changes (scans by beams), whitened, errors of poses integrated out."""
        r, k = self.lab.ref, len(cols)
        one, slow = (np.diag([a**-2, a**-2, b**-2]) for a, b in ((r.sd_p / 1.7, r.sd_h / 1.7), (r.drift_p, r.drift_h)))
        block, out = ((self.q.t - self.q.t[0]) / (2 * r.tau)).astype(int), np.zeros((k, k))
        for b in np.unique(block):
            f = np.zeros((k + 3, k + 3))
            for i in np.flatnonzero(block == b):
                h = np.stack([*(c[i] for c in cols), *self.g[i].T], 1)
                a = h.T @ (h * (self.ok[i] / self.s.sd[i] ** 2 * self.more[1])[:, None])
                f += a - a[:, k:] @ np.linalg.solve(a[k:, k:] + one, a[k:])
            out += f[:k, :k] - f[:k, k:] @ np.linalg.solve(f[k:, k:] + slow, f[k:, :k])
        return out * self.more[0]

    def loglik(self, fx: Effects) -> float:
        """Of the readings, if they scatter like this, scaled up to all of them."""
        s, m, total = scatter(self.las, fx, self.q, self.m, self.d), self.m, 0.0
        if not (s.shared or s.rho):
            return float(density(s, m, self.z, self.las.res)[self.ok].sum() * np.prod(self.more))
        for i, k in enumerate(self.ok):
            if k.sum() > 5:
                far = np.abs(self.beam[k][:, None] - self.beam[k])
                e, sd = np.clip((self.z - m)[i] / s.sd[i], -6, 6)[k], s.sd[i][k]
                f = cho_factor((s.rho**far if s.rho else np.eye(len(e))) + s.shared**2 / np.outer(sd, sd), lower=True)
                total -= 0.5 * e @ cho_solve(f, e) + np.log(np.diag(f[0])).sum() + np.log(sd * np.sqrt(2 * np.pi)).sum()
        return float(total * np.prod(self.more))


class Judge:
    """Strengths of what is hidden in some drives."""

    def __init__(self, lab: Lab, drives: list[Drive], room: Room | None, fx: Effects) -> None:
        self.lab, self.fx, self.motions = lab, fx, [Motions(lab, d, fx) for d in drives]
        self.scans, self.full = ([Scans(lab, d, room, fx, *n) for d in drives if room] for n in ((36, 90), (6, 1000)))
        self.h0 = [m.mean(fx) for m in self.motions]

    def columns(self, fx: Effects, id_: str) -> list[Array]:
        """The change of everything recorded if these effects act, of which id_ is the one that is new or gone."""
        off, on = id_.startswith(("laser", "world")), not id_.startswith("base") or id_ in ON_REFERENCE
        a = [np.zeros(len(h)) if off else m.white(m.mean(fx) - h) for m, h in zip(self.motions, self.h0, strict=True)]
        return a + [s.change(fx) if on else np.zeros_like(s.m) for s in self.scans]

    def gram(self, cols: list[list[Array]]) -> Array:
        """Inner products of columns."""
        n = len(self.motions)
        flat = np.stack([np.concatenate(c[:n]) for c in cols])
        return np.asarray(flat @ flat.T + sum(s.gram([c[n + i] for c in cols]) for i, s in enumerate(self.scans)))

    def strengths(self) -> dict[str, tuple[float, float]]:
        """How strongly each hidden effect shows (z), and beside its rivals."""
        out = {e.id: self.scattered(e) for e in self.fx.all if e.id in SCATTER or e.channel == "laser.spread"}
        hidden = [e for e in self.fx.all if e.id not in out]
        ids = [i for i in IDS if hidden and possible(self.lab, i) and i not in SCATTER and not self.fx.get(i)]
        rivals, n = [r for i in ids for r in typical(self.lab, i)], len(hidden)
        cols = [self.columns(self.fx.without(e.id), e.id) for e in hidden]
        g = self.gram(cols + [self.columns(self.fx.plus(r), r.id) for r in rivals]) if hidden else np.zeros((0, 0))
        for k, e in enumerate(hidden):
            others = [j for j in range(n) if j != k]
            rest = sorted((_left(g, k, [*others, n + j])[0], j) for j in range(len(rivals)))
            best = rest[0][0]
            for _, j in rest[:3] if n == 1 else []:
                size = -_left(g, k, [*others, n + j])[1][-1]
                near = Effect(rivals[j].id, {m: v * size for m, v in rivals[j].p.items()})
                best = min(best, max(float(self.gram([self.columns(self.fx.without(e.id).plus(near), "")])[0, 0]), 0.0))
            out[e.id] = float(np.sqrt(g[k, k])), float(np.sqrt(best))
        return out

    def scattered(self, e: Effect) -> tuple[float, float]:
        """How strongly an effect on the scatter shows, alone and beside rivals, by likelihood ratios."""
        if e.id == "laser.dropout":
            nats = 0.0
            for s in self.full:
                p = lost(s.las, self.fx, s.q)[(s.m < s.las.rmax) & (s.q.hit >= 0)]
                nats += float((p * np.log(p / 0.002) + (1 - p) * np.log((1 - p) / 0.998)).sum() * np.prod(s.more))
            return float(np.sqrt(2 * nats)), float(np.sqrt(2 * nats))
        rest = self.fx.without(e.id)
        tries = [rest.plus(Effect(i, {k: v * f for k, v in p.items()})) for i, p, fs in RIVALS if i != e.id for f in fs]
        like = [sum(s.loglik(f) for s in self.full) for f in (self.fx, rest, *tries)]
        return float(np.sqrt(max(2 * (like[0] - like[1]), 0))), float(np.sqrt(max(2 * (like[0] - max(like[1:])), 0)))


def _left(g: Array, k: int, j: list[int]) -> tuple[float, Array]:
    """What is left of column k, squared, after columns j took what they can, and how much of each that is."""
    a = np.linalg.lstsq(g[np.ix_(j, j)] + 1e-9 * np.eye(len(j)), g[j, k], rcond=1e-12)[0]
    return float(max(g[k, k] - g[k, j] @ a, 0.0)), np.asarray(a)


def to_frame(x: Array, y: Array, th: Array, k: int) -> Array:
    """Poses in the frame of the k-th: rows of x, y, theta."""
    c, s, dx, dy = np.cos(th[k]), np.sin(th[k]), x - x[k], y - y[k]
    return np.stack([c * dx + s * dy, c * dy - s * dx, th - th[k]], 1)


class Oracle:
    """Predictions in one drive by some effects, with the true noise."""

    def __init__(self, lab: Lab, d: Drive, room: Room | None, fx: Effects) -> None:
        self.lab, self.d, self.room, self.fx, self.path = lab, d, room, fx, forward(lab, d, fx)
        self.v, w, _ = base.rates(lab, d, fx, d.th[:-1])
        self.sv, self.sw = base.spread(lab.noise, self.v, w)

    def nominal(self, stamp: Array, i0: int) -> Array:
        """The path by the model alone, in the frame of row i0."""
        at = true_time(self.d, self.fx, np.append(stamp.ravel(), self.d.stamp[i0]))
        return to_frame(*seen(self.d, self.fx, self.path, at), -1)[:-1].reshape(*stamp.shape, 3)

    def deviation(self, i0: int, stamp: float, row: bool) -> tuple[Array, Array]:
        """Mean and covariance of how far the robot (or its row) is off the model's path from row i0."""
        d, n, fx = self.d, self.lab.noise, self.fx
        j = np.flatnonzero((d.stamp > d.stamp[i0] - 2.5) & (d.stamp <= d.stamp[i0]) & ~d.bad)
        j = np.unique(np.append(j[:: max(len(j) // 30, 1)], i0))
        s = np.append(d.stamp[j], stamp)
        t, r = true_time(d, fx, s), to_frame(d.px[j], d.py[j], d.pth[j], -1) - self.nominal(s, i0)[:-1]
        g = np.arange(t.min() - 0.1, t.max() + STEP, STEP)
        head = np.interp(g, d.edges, self.path[2]) - np.interp(t[-2], d.edges, self.path[2])
        v, sv, sw = (np.interp(g, d.t, a) for a in (self.v, self.sv, self.sw))
        part, k, m = np.clip((t[:, None] - g) / STEP, 0, 1) * STEP, len(t), len(g)
        side = np.stack([-v * np.sin(head), v * np.cos(head)], 1)
        total, before = part @ side, np.concatenate([np.zeros((1, 2)), np.cumsum(side[:-1], 0)]) * STEP
        a, prior = np.zeros((k, 3, 3 + 2 * m)), np.eye(3 + 2 * m) * 0.01
        a[:, [0, 1, 2], [0, 1, 2]], a[:, :2, 2], a[:, 2, 3 + m :] = 1, total, part
        for b, e in enumerate((np.cos(head), np.sin(head))):
            a[:, b, 3 : 3 + m], a[:, b, 3 + m :] = part * e, part * (total[:, b : b + 1] - before[:, b])
        far = np.abs(g[:, None] - g)
        prior[3 : 3 + m, 3 : 3 + m] = 1.05 * np.outer(sv, sv) * np.exp(-far / n.tau_v)
        prior[3 + m :, 3 + m :] = 1.05 * np.outer(sw, sw) * np.exp(-far / n.tau_w)
        a, o = a.reshape(3 * k, -1), 3 * (k - 1)
        cov = a @ prior @ a.T
        for b, err in enumerate(errors(self.lab, t, np.interp(t, d.t, self.v))):
            if not row:
                err[-1], err[:, -1] = 0, 0
            cov[b::3, b::3] += err
        gain = np.linalg.solve(cov[:o, :o] + 1e-12 * np.eye(o), cov[:o, o:]).T
        return gain @ r.ravel(), cov[o:, o:] - gain @ cov[:o, o:]

    def motion(self, i0: int, i1: int) -> tuple[Array, Array]:
        """Mean and sd of the motion from one row to another."""
        off, cov = self.deviation(i0, float(self.d.stamp[i1]), True)
        return self.nominal(self.d.stamp[i1 : i1 + 1], i0)[0] + off, np.sqrt(np.diag(cov))

    def ranges(self, rng: Rng, ts: float) -> tuple[Array, Array]:
        """Mean and sd of every beam of a scan; nan where no reading is sure."""
        las, d = self.lab.laser, self.d
        assert las
        assert self.room
        i0 = int(np.flatnonzero((d.stamp <= ts) & ~d.bad)[-1])
        off, cov = self.deviation(i0, ts + 0.4 * las.tinc * las.beams, False)
        z, c, s = rng.normal(size=(32, 3)), np.cos(d.pth[i0]), np.sin(d.pth[i0])
        dev = off + np.concatenate([z, -z]) @ np.linalg.cholesky(cov + 1e-14 * np.eye(3)).T

        def where(t: Array) -> Pose:
            x, y, th = (self.nominal(t, i0) + dev[:, None]).transpose(2, 0, 1)
            return d.px[i0] + c * x - s * y, d.py[i0] + s * x + c * y, d.pth[i0] + th

        q = trace(self.room, las, self.fx, base_link(d, self.fx, where), np.full(64, ts), np.arange(las.beams), d.t[0])
        m = mean(las, self.fx, q, d)
        k = scatter(las, self.fx, q, m, d)
        pi, mid = k.pi * (k.pi > 6e-4), (k.lo + k.hi) / 2
        var = k.sd**2 / (1 - 2 * k.inv_nu) + k.shared**2 + k.step**2 / 12
        mu = (1 - pi) * m + pi * mid
        var = (1 - pi) * var + pi * (k.hi - k.lo) ** 2 / 12 + pi * (1 - pi) * (m - mid) ** 2
        sure = (np.isfinite(q.r) & (m < las.rmax) & (m > las.rmin)).all(0)
        return np.where(sure, mu.mean(0), np.nan), np.where(sure, np.sqrt(var.mean(0) + mu.var(0)), np.nan)
