# SPDX-License-Identifier: BSD-3-Clause
"""What the reference measured, queries, the answers to them, and what an unknown follows."""

from __future__ import annotations

import numpy as np

from . import laser
from .catalogue import FAR, GEOMETRY, RARE, SCATTER, UNKNOWN, Effect, on_base
from .effects import simulate
from .judge import Case
from .plant import Arr, Motion, Noise, integral


def moments(m: Motion, base: Motion, t0: float, t1: float, noise: Noise) -> tuple[Arr, Arr, Arr]:
    """Means of dx, dy, dtheta by the model and with the causes, and the sd of the true noise."""
    out = []
    for r, kappa in ((base, 0.0), (m, m.clock)):
        t = np.linspace(t0, t1, 1 + round((t1 - t0) / 0.002)) * (1 - kappa)
        dt, real = t[1] - t[0], [np.interp(t[0], m.t, u) for u in m.pose]
        v, w, b = (np.interp(t, m.t, u) for u in (r.v0, r.w0, r.lat))
        th = real[2] + integral(w, dt)
        x = real[0] + integral(v * np.cos(th) - b * np.sin(th), dt)[-1]
        y = real[1] + integral(v * np.sin(th) + b * np.cos(th), dt)[-1]
        ends = [[real[0], real[1], real[2]], [x, y, th[-1]]]
        ref = [[np.interp(u, m.t, k) for k in r.ref] for u in (t[0], t[-1])]
        out.append(relative(*(refer(np.array(p), np.array(q)) for p, q in zip(ends, ref, strict=True))))
    t = np.linspace(t0, t1, 1 + round((t1 - t0) / 0.02))
    dt, th = t[1] - t[0], np.interp(t, m.t, m.pose[2])
    x, y, v, w, on = (np.interp(t, m.t, u) for u in (m.pose[0], m.pose[1], m.v0, m.w0, m.moving))
    c, s = np.cos(th[0]), np.sin(th[0])
    rx, ry = (x - x[0]) * c + (y - y[0]) * s, (y - y[0]) * c - (x - x[0]) * s
    gap = np.abs(t[:, None] - t)
    kv, kw = (
        sd**2 * np.exp(-gap / tau) * np.outer(on, on) * dt**2
        for sd, tau in ((noise.sv, noise.tv), (noise.sw, noise.tw))
    )
    fall = 1 - np.exp(-(t1 - t0) / noise.td)
    p2, h2 = 2 * (noise.p**2 + noise.dp**2 * fall), 2 * (noise.h**2 + noise.dh**2 * fall)
    first, edge = noise.h**2 + noise.dh**2, noise.jitter**2
    var = []
    for a, b, far in ((np.cos(th - th[0]), -(ry[-1] - ry), ry[-1]), (np.sin(th - th[0]), rx[-1] - rx, rx[-1])):
        var.append(
            a @ kv @ a + b @ kw @ b + p2 + far**2 * first + edge * (v[0] ** 2 * a[0] ** 2 + v[-1] ** 2 * a[-1] ** 2)
        )
    var.append(np.ones(len(t)) @ kw @ np.ones(len(t)) + h2 + edge * (w[0] ** 2 + w[-1] ** 2))
    return out[0], out[1], np.sqrt(np.array(var))


def refer(p: Arr, e: Arr) -> Arr:
    """A pose as the reference takes it, with its error e ahead, left, and of heading."""
    c, s = np.cos(p[2]), np.sin(p[2])
    return np.array([p[0] + e[0] * c - e[1] * s, p[1] + e[0] * s + e[1] * c, p[2] + e[2]])


def relative(p: Arr, q: Arr) -> Arr:
    """Q in the body frame of p."""
    c, s, d = np.cos(p[2]), np.sin(p[2]), q - p
    return np.array([d[0] * c + d[1] * s, d[1] * c - d[0] * s, d[2]])


def measure(rng: np.random.Generator, m: Motion, t: Arr, noise: Noise) -> Arr:
    """(3, n) rows of the reference, without rows that are off."""
    real = t * (1 - m.clock) + noise.jitter * np.clip(rng.normal(size=len(t)), -2.5, 2.5)
    p = np.array([np.interp(real, m.t, u) for u in m.pose])
    p = refer(p, np.array([np.interp(real, m.t, u) for u in m.ref]))
    rho = np.exp(-np.diff(t, prepend=t[0]) / noise.td)
    walk = np.zeros((3, len(t)))
    kick, last = rng.normal(size=(3, len(t))), rng.normal(size=3)
    for k in range(len(t)):
        last = rho[k] * last + np.sqrt(1 - rho[k] ** 2) * kick[:, k]
        walk[:, k] = last
    size = np.array([[noise.p, noise.dp], [noise.p, noise.dp], [noise.h, noise.dh]])
    return np.asarray(p + size[:, :1] * rng.normal(size=(3, len(t))) + size[:, 1:] * walk)


def queries(rng: np.random.Generator, c: Case) -> tuple[list[tuple[float, float]], list[int]]:
    """Intervals of the test run between rows of poses, and scans to predict."""
    t, out, chosen = c.times[3], [], []
    now, k = 2.0, int(rng.integers(3))
    stuck = c.runs[3].stuck
    while now < t[-1] - 6.5:
        a = float(t[np.searchsorted(t, now)])
        b = float(t[np.searchsorted(t, a + (1.0, 2.0, 5.0)[k % 3])])
        if b - a < 6.4 and not (a < stuck[1] and b > stuck[0]):
            out.append((a, b))
        now, k = b + 0.9, k + 1
        if c.scans and k % 2 == 0:
            ts = c.views[3].t
            j = int(np.searchsorted(ts, now + 0.35))
            chosen.append(j)
            now = float(ts[j]) + 0.9
    return out, chosen


def answers(
    rng: np.random.Generator, c: Case, poses: Arr, readings: Arr, pairs: list[tuple[float, float]], chosen: list[int]
) -> list[str]:
    """answers.csv: for scans, the pose of 0.3 s before is known to half the reference's white error, and carried on."""
    m, t, rows = c.motions[3], c.times[3], ["run,channel,t0,t1,beam,value,base_mean,base_sd,oracle_mean,oracle_sd"]
    base = simulate(c.runs[3], [], None)
    for a, b in pairs:
        got = relative(poses[:, np.searchsorted(t, a)], poses[:, np.searchsorted(t, b)])
        mean0, mean1, sd = moments(m, base, a, b, c.noise)
        for k, name in enumerate(("dx", "dy", "dtheta")):
            rows.append(
                f"run_4,{name},{a:.4f},{b:.4f},,{got[k]:.6f},{mean0[k]:.6f},{sd[k]:.6f},{mean1[k]:.6f},{sd[k]:.6f}"
            )
    mine = [e for e in c.effects if not on_base(e)]
    for j in chosen:
        v, w, n = c.seen[3], c.views[3], c.noise
        i = round(float(np.clip(v.t[j], 0.3, None)) * 1000)
        late = [x[i - 300 : i] for x in (m.v, m.v0, base.v0, m.w, m.w0, base.w0)]
        run, run0, plain, turn, turn0, straight = (float(np.sum(x)) * 0.001 for x in late)
        wide = 0.3 * float(np.interp(v.t[j], m.t, m.moving))
        sds = np.array([np.hypot(n.p / 2, wide * n.sv), n.p / 2, np.hypot(n.h / 2, wide * n.sw)])
        off = np.array([run0 - run, 0.0, turn0 - turn]) + rng.normal(size=3) * np.array([n.p, n.p, n.h]) / 2
        mu0 = laser.mean(v.r[j]) + v.grad[:, j].T @ (off + np.array([plain - run0, 0.0, straight - turn0]))
        mu1, more, far = laser.mean(w.r[j]) + v.grad[:, j].T @ off, np.ones(len(v.bearing)), 0 * v.r[j]
        for e in mine:
            if e.ident in SCATTER and e.ident != "laser.beam_correlation":
                more = more + laser.wider(v, e)[j]
            elif e.ident in RARE and e.ident != "laser.saturation":
                far = far + laser.energy(v, e)[j] / 25 * (0.115**2 if "tails" in e.ident else 0.5)
            elif e.ident not in GEOMETRY and e.ident not in SCATTER and e.ident != "laser.saturation":
                mu1 = mu1 + laser.shift(v, e)[j]
            elif e.ident == "laser.saturation":
                mu1 = np.where(mu1 < FAR, np.minimum(mu1, FAR - e.size), mu1)
        pose = (v.grad[:, j] ** 2 * np.square(sds)[:, None]).sum(axis=0) + 1e-6 / 12
        s0, s1 = np.sqrt(laser.sd(v.r[j]) ** 2 + pose), np.sqrt(laser.sd(w.r[j]) ** 2 * more + pose + far)
        for k in range(len(v.bearing)):
            m0, m1 = (f"{u[k]:.6f}" if u[k] < FAR else "nan" for u in (mu0, mu1))
            rows.append(
                f"run_4,range,{v.t[j]:.4f},{v.t[j]:.4f},{k},{readings[j, k]:.3f},{m0},{s0[k]:.6f},{m1},{s1[k]:.6f}"
            )
    return rows


def follows(c: Case, e: Effect) -> list[str]:
    """What the unknown honestly follows: what it was made of, and whatever curve explains 0.85 of it."""
    known, channel = list(UNKNOWN[e.ident][2]), UNKNOWN[e.ident][1]
    if e.ident in ("unknown.place_v", "unknown.haze"):
        known = ["xy"[int(e.more["axis"])]] if e.ident == "unknown.place_v" else ["x"]
    if channel not in ("v", "w", "lateral"):
        return known
    parts: dict[str, list[Arr]] = {}
    for r, m in zip(c.runs[:3], c.motions, strict=False):
        without = simulate(r, [], None, 1, given=m.pose.copy())
        s = slice(0, None, 40)
        run = {
            "d": (m.v0 - without.v0, m.w0 - without.w0, m.lat)[("v", "w", "lateral").index(channel)],
            "v": m.v0,
            "w": m.w0,
            "time": m.t,
        }
        still, back = m.moving < 0.5, np.sign(m.v0)
        turned = np.isin(m.t, r.tc[np.flatnonzero((np.diff(r.vc) != 0) | (np.diff(r.wc) != 0)) + 1])
        flips = np.concatenate(([False], (back[1:] * back[:-1] < 0)))
        for name, mask in (("since_rest", still), ("since_command", turned), ("since_reversal", flips)):
            run[name] = m.t - np.maximum.accumulate(np.where(mask, m.t, 0.0))
        run.update(
            x=m.pose[0],
            y=m.pose[1],
            heading=np.mod(m.pose[2], 2 * np.pi),
            distance=np.cumsum(np.abs(m.v)) * 0.001,
            abs_v=np.abs(m.v0),
            abs_w=np.abs(m.w0),
        )
        for name, u in run.items():
            parts.setdefault(name, []).append(u[s][m.moving[s] > 0.5])
    cols = {name: np.concatenate(u) for name, u in parts.items()}
    d = cols.pop("d")
    for name, u in cols.items():
        bins = np.clip(np.digitize(u, np.quantile(u, np.linspace(0, 1, 15)[1:-1])), 0, 13)
        best = 0.0
        for g in (np.ones(len(u)), cols["v"], cols["w"]):
            top, low = np.bincount(bins, d * g, 14), np.maximum(np.bincount(bins, g * g, 14), 1e-12)
            best = max(best, 1 - float(np.sum((d - g * (top / low)[bins]) ** 2) / max(np.sum(d * d), 1e-12)))
        if best > 0.85 and name not in known:
            known.append(name)
    return known
