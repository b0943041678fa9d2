# SPDX-License-Identifier: BSD-3-Clause
"""How much a cause does to the training drives, in units of their noise, and what is left beside others."""

import numpy as np
from kurumaisu.bench.strangers.fell.catalogue import IDS, POSES, VOLTS, draw
from kurumaisu.bench.strangers.fell.laser import clipped, readings
from kurumaisu.bench.strangers.fell.plant import Cause, Way, travel
from kurumaisu.bench.strangers.fell.scene import Drive, Scene, laser_ctx, reported


def motions(p: np.ndarray) -> np.ndarray:
    """Motions between successive poses (N+1, 3), in the frame of the first."""
    d, c, s = np.diff(p, axis=0), np.cos(p[:-1, 2]), np.sin(p[:-1, 2])
    return np.stack([c * d[:, 0] + s * d[:, 1], c * d[:, 1] - s * d[:, 0], d[:, 2]], 1)


def motion_cov(sc: Scene, way: Way, t: np.ndarray) -> np.ndarray:
    """Covariance of the motions between the poses at t: white and slow errors, and the colour of the rates' noise."""
    N, ref, tau, M = len(t) - 1, sc.ref, sc.robot.tau, 5
    x, y, th = way.at(t)
    m, J = motions(np.stack([x, y, th], 1)), np.zeros((N, 3, N + 1, 3))
    k, c, s = np.arange(N), np.cos(th[:-1]), np.sin(th[:-1])
    for at, g in ((k + 1, 1), (k, -1)):
        J[k, 0, at, 0], J[k, 0, at, 1], J[k, 1, at, 0], J[k, 1, at, 1], J[k, 2, at, 2] = g * c, g * s, -g * s, g * c, g
    J[k, 0, k, 2], J[k, 1, k, 2] = m[:, 1], -m[:, 0]
    slow, C = np.exp(-np.abs(t[:, None] - t) / ref.tau), 1e-12 * np.eye(3 * N)
    for a, (w, q) in enumerate(((ref.sd, ref.slow), (ref.sd, ref.slow), (ref.sd_h, ref.slow_h))):
        j = J[..., a].reshape(3 * N, N + 1)
        C += j @ (w * w * np.eye(N + 1) + q * q * slow) @ j.T
    e = t[:-1, None] + np.diff(t)[:, None] * np.arange(M + 1) / M  # M pieces, in which the rates' noise acts
    mid, h = ((e[:, 1:] + e[:, :-1]) / 2).reshape(-1), np.diff(e, axis=1).reshape(-1)
    D, q = np.abs(mid[:, None] - mid) - (h[:, None] + h) / 2, np.exp(-h / tau)
    (mx, my, mt), of, r = way.at(mid), np.repeat(k, M), np.arange(N * M)
    px, py = x[of + 1] - mx, y[of + 1] - my  # what is still to go turns with an error of the rate
    for name in ("sv", "sw"):
        sd, G = way.cell(name, mid), np.zeros((N, 3, N * M))
        P = np.outer(sd * (1 - q), sd * (1 - q)) * tau * tau * np.exp(-np.maximum(D, 0) / tau)
        P[r, r] = sd**2 * 2 * tau * tau * (h / tau - 1 + q)
        if name == "sv":
            G[of, 0, r], G[of, 1, r] = np.cos(mt - th[of]), np.sin(mt - th[of])
        else:
            G[of, 0, r], G[of, 1, r], G[of, 2, r] = s[of] * px - c[of] * py, c[of] * px + s[of] * py, 1
        G = G.reshape(3 * N, N * M)
        C += G @ P @ G.T
    return C


def mean_poses(sc: Scene, d: Drive, causes: list[Cause], t: np.ndarray) -> np.ndarray:
    """Poses that the reference would report without noise of the rates (their motions are what counts)."""
    way = travel(sc.robot, causes, d.rows, d.n, d.start, d.ctx)
    return np.stack(reported(d, way, t, causes), 1)


class Judge:
    """Features of what causes do to the training drives, whitened."""

    def __init__(self, sc: Scene):
        self.sc, self.parts, las, ref = sc, [], sc.las, sc.ref
        for d in sc.drives[:-1]:
            ok = d.tp[~d.off]
            t = np.unique(ok[np.minimum(np.searchsorted(ok, np.arange(ok[0], ok[-1], 1.0)), len(ok) - 1)])
            t = t[np.concatenate([[True], np.diff(t) > 0.5])]
            part = {"d": d, "t": t, "L": np.linalg.inv(np.linalg.cholesky(motion_cov(sc, d.way, t)))}
            if las:
                ts, b = d.ts[:: max(1, len(d.ts) // 45)], np.arange(0, las.beams, max(1, las.beams // 100))
                rd = readings(las, sc.room, sc.causes, d.way.at, ts, laser_ctx(d), b)
                P = np.diag([ref.sd**2 / 1.5 + ref.slow**2] * 2 + [ref.sd_h**2 / 1.5 + ref.slow_h**2])
                S, share = np.einsum("kia,ab,kjb->kij", rd["jac"], P, rd["jac"]), len(b) / las.beams
                S[:, np.arange(len(b)), np.arange(len(b))] += rd["sig"] ** 2 * share + 1e-10
                one = np.linalg.solve(S, np.ones((len(ts), len(b), 1)))[..., 0].sum(1)
                ok = (rd["mu"] < 0.96 * las.far) & (rd["jump"] == 0)
                ok &= np.roll(ok, 1, 1) & np.roll(ok, -1, 1)
                part.update(
                    ts=ts,
                    b=b,
                    LS=np.linalg.inv(np.linalg.cholesky(S)),
                    ok=ok,
                    g=np.sqrt(len(d.ts) / len(ts)),
                    dense=1 / np.sqrt(share),
                    one=one,
                    edge=ok | (rd["jump"] != 0),
                )
            self.parts.append(part)
        self.zero = self.base([]) * 0, self.laser([]) * 0

    def base(self, causes: list[Cause]) -> np.ndarray:
        """Motions of the reference, and the size of their noise (as it differs from a larger one throughout)."""
        out, sc = [], self.sc
        for p in self.parts:
            d, f = p["d"], np.zeros((len(p["t"]) - 1, 2))
            out.append(p["L"] @ motions(mean_poses(sc, d, causes, p["t"])).reshape(-1))
            if any(c.id == "base.process_noise" for c in causes):
                a, b = (
                    np.log(
                        np.diag(motion_cov(sc, travel(sc.robot, cs, d.rows, d.n, d.start, d.ctx), p["t"])).reshape(
                            -1, 3
                        )[:, ::2]
                    )
                    for cs in (causes, [])
                )
                f = np.where(a - b > 1e-3, a - b - (a - b)[a - b > 1e-3].mean(), 0) / np.sqrt(2)
            out.append(f.reshape(-1))
        return np.concatenate(out)

    def laser(self, causes: list[Cause]) -> np.ndarray:
        """Mean, scatter, losses and outliers of readings, and what a scan has in common."""
        las, room, out, c = self.sc.las, self.sc.room, [np.zeros(0)], {k.id: k for k in causes}
        size = lambda i, k: c[i].p[k] if i in c else 0.0  # noqa: E731
        asin = lambda q: 2 * np.arcsin(np.sqrt(np.minimum(q, 0.99)))  # noqa: E731
        moved = [k for k in causes if k.id in POSES]
        for p in self.parts if las else []:
            d, g, n, ctx, ok = p["d"], p["g"], p["g"] * p["dense"], laser_ctx(p["d"]), p["ok"]
            rd = readings(las, room, causes, d.way.at, p["ts"], ctx, p["b"])
            mu = clipped(causes, rd)
            if moved:
                at = [
                    readings(las, room, [], f, p["ts"], ctx, p["b"])["mu"]
                    for f in (d.way.at, lambda t: reported(d, d.way, t, moved))
                ]
                mu = mu + at[0] - at[1]
            mu = np.where(ok, np.minimum(mu, las.far), 0)
            var = rd["sig"] ** 2 + size("laser.quantisation", "step") ** 2 / 12
            part = min(size("laser.crosstalk", "width") / (las.increment * las.beams), 1)
            bad = rd["out"] + rd["mixed"] + rd["cross"][:, None] * part
            if "laser.heavy_tails" in c and c["laser.heavy_tails"].other:
                bad = np.full_like(bad, 0.03)
            rho = size("laser.beam_correlation", "rho")
            out += [
                g * (p["LS"] @ mu[..., None]).reshape(-1),
                (n * np.log(var) * ok / np.sqrt(2)).reshape(-1),
                (n * asin(rd["miss"]) * p["edge"]).reshape(-1),
                (n * asin(bad) * p["edge"]).reshape(-1),
                g * 3 * asin(rd["cross"]),
                g * np.sqrt(-ok.sum(1) * p["dense"] ** 2 * np.log(1 - rho * rho)),
                g * np.log(1 + p["one"] * size("laser.common_mode", "sd") ** 2) / np.sqrt(2),
            ]
        return np.concatenate(out)

    def effect(self, causes: list[Cause], without: list[Cause], i: str) -> np.ndarray:
        """What the first have that the second have not: a cause with that id."""
        b, a = self.zero
        if "base." in i:
            b = self.base(causes) - self.base(without)
        if "base." not in i or i in POSES:
            a = self.laser(causes) - self.laser(without)
        return np.concatenate([b, a])

    def score(self) -> list[tuple[float, float]]:
        """z and beside of each hidden cause."""
        sc, hidden, rng = self.sc, self.sc.causes, np.random.default_rng(1)
        own = [self.effect(hidden, [k for k in hidden if k is not c], c.id) for c in hidden]
        if min(z := [float(np.linalg.norm(o)) for o in own]) < 10:
            return [(a, 0.0) for a in z]
        skip = {c.id for c in hidden} | {"base.steering_law", "base.sign", "laser.saturation"}
        skip |= {"base.gain_v", "base.gain_w"} if any(c.id == "base.sign" for c in hidden) else set()  # out of bounds
        rivals, out = [], []
        for i in IDS:
            if i not in skip and (sc.robot.volts or i not in VOLTS) and (sc.las or i.startswith("base.")):
                k = draw(i, rng, usual=True)
                if i == "base.saturation":
                    k.p = {"inverse_v": 1.3 / sc.robot.vmax, "inverse_w": 1.3 / sc.robot.wmax}
                rivals.append(self.effect([k], [], i))
        for j, o in enumerate(own):
            others = [u / np.linalg.norm(u) for m, u in enumerate(own) if m != j]
            q = np.linalg.qr(np.array(others).T)[0] if others else np.zeros((len(o), 0))
            o = o - q @ (q.T @ o)
            left = [float(np.linalg.norm(o))]
            for u in (r - q @ (q.T @ r) for r in rivals):
                if u @ u > 1e-6:
                    left.append(float(np.linalg.norm(o - u * (u @ o) / (u @ u))))
            out.append((z[j], min(left)))
        return out
