# SPDX-License-Identifier: BSD-3-Clause
"""What the laser reads: means with each of its causes, noise, and how sure the causes of scatter are."""
from typing import Any

import numpy as np
from scipy.special import ndtr

from kurumaisu.bench.strangers.quay.base import DT, Drive, Effects, quantity, refer
from kurumaisu.bench.strangers.quay.things import Array, Laser, Robot, Room, cast, segments

DARK = ("black", "gray30")
OUT, DROP = 0.002, 0.003  # what a clean laser does: share of outliers, of readings that are lost


def real_map(room: Room, eff: Effects) -> tuple[Array, Array, Array]:
    """The walls as they are."""
    if p := eff.get("world.map_error"):
        return segments(room, p.get("scale", 0.0), p.get("moved"))
    return segments(room)


def origins(dr: Drive, laser: Laser, eff: Effects, t: Array, path: Array | None = None) -> tuple[Array, Array, Array]:
    """Origin and direction of each ray of scans stamped t, on the path (the true one) or at fixed poses (n, 3)."""
    if p := eff.get("laser.latency"):
        t = t - p["delay"] * (1 + (0.15 * np.sin(t / 7) if p["form"] else 0))
    if p := eff.get("laser.clock_skew"):
        t = t - p["skew"] * (t + dr.since)
    k = np.arange(laser.n)
    tinc = laser.tinc * (1 + eff.get("laser.sweep", {}).get("stretch", 0.0))
    pose = dr.at(t[:, None] + k * tinc, path)
    x, y, yaw = laser.mount
    x += eff.get("laser.mount_x", {}).get("x", 0.0)
    y += eff.get("laser.mount_y", {}).get("y", 0.0)
    yaw += eff.get("laser.mount_yaw", {}).get("yaw", 0.0)
    th = pose[..., 2]
    c, s = np.cos(th), np.sin(th)
    return pose[..., 0] + c * x - s * y, pose[..., 1] + s * x + c * y, th + yaw + laser.angle_min + k * laser.inc


Geo = tuple[Array, Array, Array, tuple[Array, Array, Array]]
MOVES = ("laser.mount_x", "laser.mount_y", "laser.mount_yaw", "laser.sweep", "laser.latency", "laser.clock_skew",
         "world.map_error")


def rays(dr: Drive, laser: Laser, room: Room, eff: Effects, t: Array, path: Array | None = None) -> Geo:
    """True range, wall, cosine of incidence of each beam, and the rays."""
    o = origins(dr, laser, eff, t, path)
    return *cast(*o, real_map(room, eff)), o


def means(dr: Drive, robot: Robot, laser: Laser, room: Room, eff: Effects, t: Array, geo: Geo) -> Array:
    """Mean readings for rays that are cast."""
    r, hit, cosi, _ = geo
    beta = laser.angle_min + np.arange(laser.n) * laser.inc
    on = eff.get
    if p := on("laser.tilt"):
        phi = p["pitch"] * np.cos(beta) + p["roll"] * np.sin(beta)
        floor = np.where(phi > 1e-3, laser.height / np.sin(np.maximum(phi, 1e-3)), np.inf)
        r = np.minimum(r / np.cos(phi), floor)
    m = laser.scale * r
    if p := on("laser.offset"):
        m = m + p["offset"]
    if p := on("laser.scale"):
        m = m + p["scale"] * (3 * (r / 3) ** 1.2 if p["form"] else r)
    if p := on("laser.quadratic"):
        m = m + p["quadratic"] * (9 * (r / 3) ** 2.4 if p["form"] else r * r)
    if p := on("laser.warmup"):
        s = t[:, None] + dr.since
        f = 0.6 * np.exp(-s / p["tau"]) + 0.4 * np.exp(-3 * s / p["tau"]) if p["form"] else np.exp(-s / p["tau"])
        m = m + p["amplitude"] * f
    if p := on("laser.temperature"):
        x = np.interp(t, dr.cov_t, dr.cov["temperature"])[:, None] - 20
        m = m + p["coefficient"] * (x + 0.04 * x * abs(x) if p["form"] else x)
    if p := on("laser.cyclic"):
        a = 2 * np.pi * r / p["wavelength"] + p["phase"]
        m = m + p["amplitude"] * (np.sin(a) + (0.3 * np.sin(2 * a) if p["form"] else 0))
    if p := on("laser.incidence_bias"):
        m = m + p["k"] * (np.minimum(np.sqrt(1 - cosi**2) / cosi, 5) if p["form"] else np.minimum(1 / cosi - 1, 5))
    if p := on("laser.reflectance"):
        level = np.array([{"black": 1.0, "gray30": 0.7, "tan": 0.3, "white": 0.0}[w[6]] for w in room.walls])
        m = m + p["bias"] * (level[hit] if p["form"] else level[hit] > 0.5)
    if p := on("laser.beam_bias"):
        m = m + p["each"]
    if p := on("laser.saturation"):
        far = 1 / p["inverse_far"]
        m = np.minimum(m, far) if not p["form"] else m / (1 + (m / far) ** 16) ** (1 / 16)
    if p := on("unknown.range"):
        m = m + p["size"] * p["shape"](beam_quantity(dr, robot, room, p["of"], t, geo, beta))
    return m


def beam_quantity(dr: Drive, robot: Robot, room: Room, name: str, t: Array, geo: Geo, beta: Array) -> Array:
    """A covariate of each reading, scaled to about -1..1."""
    r, _, cosi, (ox, oy, phi) = geo
    a, b = room.free[1] + 0.75, room.free[3] + 0.75
    if name == "bearing":
        return np.broadcast_to(beta / np.pi, r.shape)
    if name == "direction":
        return np.arctan2(np.sin(phi), np.cos(phi)) / np.pi
    if name == "hit_x":
        return 2 * (ox + r * np.cos(phi)) / a - 1
    if name == "hit_y":
        return 2 * (oy + r * np.sin(phi)) / b - 1
    q = quantity(dr, robot, name, dr.path[:-1], dr.vc, dr.wc)
    return np.broadcast_to(np.interp(t, np.arange(dr.n) * DT, q)[:, None], r.shape)


def edges(laser: Laser, r: Array) -> Array:
    """Whether a neighbour meets another surface."""
    far = abs(np.diff(r, axis=1)) > 0.1 + 0.25 * abs(laser.inc) / 0.02 * 0.3
    e = np.zeros(r.shape, bool)
    e[:, 1:] |= far
    e[:, :-1] |= far
    return e


def read(dr: Drive, robot: Robot, laser: Laser, room: Room, eff: Effects, t: Array, rng: np.random.Generator,
         clean: Array) -> tuple[Array, dict[str, tuple[float, float]]]:
    """Scans at t as they are written, and (z, beside) squared of each cause of scatter; clean: base means."""
    geo = rays(dr, laser, room, eff, t)
    r, hit, cosi, _ = geo
    m = means(dr, robot, laser, room, eff, t, geo)
    on, sure = eff.get, {}
    sd0 = laser.sd(r)
    sd = sd0.copy()
    good = np.isfinite(m) & (m < laser.rmax) & (m > laser.rmin) & ~edges(laser, r)
    beta = laser.angle_min + np.arange(laser.n) * laser.inc
    if p := on("laser.range_noise"):
        sd = sd * (1 + p["share"] * (0.7 + 0.15 * np.minimum(r, 4) if p["form"] else 1))
    if p := on("laser.incidence_noise"):
        x = 1 / cosi - 1 if not p["form"] else np.sqrt(1 - cosi**2) / cosi
        sd = sd * (1 + p["gain"] * np.minimum(x, 4))
    if p := on("unknown.spread"):
        sd = sd * np.exp(p["size"] * p["shape"](beam_quantity(dr, robot, room, p["of"], t, geo, beta)))
    e = rng.standard_normal(r.shape)
    if p := on("laser.beam_correlation"):
        rho = p["rho"]
        for k in range(1, laser.n):
            e[:, k] = rho * e[:, k - 1] + np.sqrt(1 - rho**2) * e[:, k]
        sure["laser.beam_correlation"] = (-good.sum() * np.log(1 - rho**2),) * 2
    if p := on("laser.heavy_tails"):
        nu = 1 / p["inverse_nu"]
        e = rng.standard_t(nu, r.shape) if not p["form"] else e * np.where(rng.random(r.shape) < 0.1, 4.0, 0.8)
    for key in ("laser.range_noise", "laser.incidence_noise", "unknown.spread", "laser.heavy_tails"):
        if on(key):
            q, w = ((sd / sd0) ** 2)[good], (e * sd / sd0)[good]
            if key == "laser.heavy_tails":
                var = np.var(w)
                lo = np.log(0.97 * np.exp(-w**2 / 2 / var) / np.sqrt(2 * np.pi * var) + 0.03 * 0.001)
                h, b = np.histogram(w, 120, (-12, 12), density=True)
                hi = np.log(h[np.clip(np.digitize(w, b) - 1, 0, 119)] + 1e-4)
                both = 2 * max(float((hi - lo).sum()) - 100, 0.0)
                sure[key] = (both, both)
            else:
                d = q / q.mean()
                z2 = float((q - 1 - np.log(q)).sum())
                sure[key] = (z2, z2 if key == "laser.range_noise" else float((d - 1 - np.log(d)).sum()))
    y = m + sd * e
    if p := on("laser.common_mode"):
        c = rng.standard_normal(len(t))
        for k in range(1, len(t)):
            c[k] = p["rho"] * c[k - 1] + np.sqrt(1 - p["rho"] ** 2) * c[k]
        y = y + p["sd"] * c[:, None] * (r / np.maximum(r, 0.1).mean() if p["form"] else 1)
    drop = np.full(r.shape, DROP)
    if p := on("laser.dropout"):
        dark = np.array([w[6] in DARK for w in room.walls])[hit]
        kind = p["of"]
        x = {"probability": 1.0, "per_metre": r, "oblique": 1 - cosi, "dark": dark}[kind]
        drop = np.clip(drop + p[kind] * x, 0, 0.9)
        kl = drop * np.log(drop / DROP) + (1 - drop) * np.log((1 - drop) / (1 - DROP))
        sure["laser.dropout"] = (2 * float(kl[np.isfinite(m) & (m < laser.rmax)].sum()),) * 2
    p_out = np.full(r.shape, OUT)
    u = rng.uniform(0.1, 1, r.shape) * np.minimum(m, laser.rmax)
    if p := on("laser.mixed_pixels"):
        edge = edges(laser, r)
        far = np.maximum(np.roll(r, 1, 1), np.roll(r, -1, 1)) - r
        near = np.minimum(np.roll(r, 1, 1), np.roll(r, -1, 1)) - r
        gap = np.where(far > -near, far, near)
        gap = np.clip(gap, -3, 3)
        mix = edge & (abs(gap) > p["jump"]) & (rng.random(r.shape) < p["probability"])
        y = np.where(mix, m + gap * (rng.uniform(0.1, 0.9, r.shape) if not p["form"] else rng.beta(2, 2, r.shape)), y)
        ok = mix & np.isfinite(gap) & (y < laser.rmax)
        n = float(ok.sum())
        sure["laser.mixed_pixels"] = (5 * n, 2 * n * max(float(np.log(edge.size / max(edge.sum(), 1))) - 0.5, 0.1))
    if p := on("laser.crosstalk"):
        burst = rng.random(len(t)) < p["probability"]
        at = rng.uniform(beta[0], beta[-1]) + p["drift"] * (t - t[0])
        off = np.mod(beta - at[:, None] + np.pi, 2 * np.pi) - np.pi
        inb = burst[:, None] & (abs(off) < p["width"] / 2)
        inb &= rng.random(r.shape) < (0.6 if p["form"] else 1.0)
        y = np.where(inb, rng.uniform(laser.rmin, p["reach"], r.shape), y)
        n = float((inb & good).sum())
        sure["laser.crosstalk"] = (4 * n, max(2 * n * np.log(0.6 * good.sum() / (n + 1)) - 12.0 * burst.sum(), 0))
    y = np.where(rng.random(r.shape) < p_out, u, y)
    step = laser.res
    if p := on("laser.quantisation"):
        step = p["step"]
        y = np.floor(y / step) * step if p["form"] else np.round(y / step) * step
        z = (y - m)[good] / sd0[good]
        pr = ndtr(z + step / 2 / sd0[good]) - ndtr(z - step / 2 / sd0[good])
        p0 = np.exp(-z**2 / 2) / np.sqrt(2 * np.pi) * laser.res / sd0[good] + 1e-4
        sure["laser.quantisation"] = (2 * max(float(np.log((pr + 1e-4) / p0).sum()), 0.0),) * 2
    if p := on("laser.saturation"):
        cut = good & (clean > 1 / p["inverse_far"] + 0.02) & (clean < laser.rmax)
        sure["laser.saturation"] = (2 * 3.0 * float(cut.sum()),) * 2
        if p["lost"]:
            y = np.where(m >= 1 / p["inverse_far"] - 1e-6, np.inf, y)
    y = np.round(np.round(y / laser.res) * laser.res, 4)
    y = np.where(np.isfinite(m), y, np.inf)
    y = np.where(y > laser.rmax, np.inf, np.where(y < laser.rmin, np.nan, y))
    y[rng.random(r.shape) < drop] = np.nan
    return y, sure


def refers(eff: Effects) -> bool:
    """Whether the reference measures something else than base_link."""
    return any(k.startswith(("base.marker", "base.clock", "unknown.pose")) for k in eff)


class Fan:
    """Scans of one drive at known poses: effects of causes on the mean, whitened by noise and errors of poses."""

    def __init__(self, dr: Drive, robot: Robot, laser: Laser, room: Room, ref: Any) -> None:
        self.a = (dr, robot, laser, room)
        self.t = dr.scan_t
        self.geo = rays(dr, laser, room, {}, self.t)
        self.base = means(dr, robot, laser, room, {}, self.t, self.geo)
        r = self.geo[0]
        sd = np.sqrt(laser.sd(r) ** 2 + laser.res**2 / 12)
        jac = []
        for k, h in enumerate((0.005, 0.005, 0.002)):
            p = dr.path.copy()
            p[:, k] += h
            jac.append((rays(dr, laser, room, {}, self.t, p)[0] - r) / h)
        self.jac = np.stack(jac, -1)
        bad = (abs(self.jac) > 40).any(-1) | ~np.isfinite(self.base) | (self.base > laser.rmax - 3 * sd)
        bad |= edges(laser, r) | (self.base < laser.rmin)
        self.w = np.where(bad, 0, 1 / sd**2)
        self.jac[bad] = 0
        self.base[~np.isfinite(self.base)] = 0
        self.ref = ref

    def effect(self, eff: Effects) -> Array:
        """Mean reading with the causes less that of the base model at the poses that are measured."""
        dr, robot, laser, room = self.a
        geo = rays(dr, laser, room, eff, self.t) if any(k in eff for k in MOVES) else self.geo
        m = means(dr, robot, laser, room, eff, self.t, geo)
        base = self.base
        if refers(eff):
            path = refer(dr, robot, eff, dr.path, np.arange(len(dr.path)) * DT)
            base = laser.scale * rays(dr, laser, room, {}, self.t, path)[0]
        d = np.where(np.isfinite(m) & np.isfinite(base), m - base, 0)
        return np.where(abs(d) > 0.4, 0, d) if any(k in eff for k in MOVES) or refers(eff) else d

    def common(self, sd: float) -> float:
        """Twice the log likelihood ratio of an error of sd that all readings of a scan share."""
        lam, pi = [], np.diag([1 / self.ref.sp**2, 1 / self.ref.sp**2, 1 / self.ref.sh**2])
        for w, j in zip(self.w, self.jac):
            c = w @ j
            lam.append(sd**2 * (w.sum() - c @ np.linalg.inv((j.T * w) @ j + pi) @ c))
        x = np.array(lam)
        return float((x - np.log1p(x)).sum())

    def gram(self, vecs: list[Array]) -> Array:
        """Inner products of effects."""
        dr, ref = self.a[0], self.ref
        e = np.stack(vecs)
        pi = np.diag([1 / ref.sp**2, 1 / ref.sp**2, 1 / ref.sh**2])
        wi = np.diag([1 / ref.wp**2, 1 / ref.wp**2, 1 / ref.wh**2])
        g = np.zeros((len(e), len(e)))
        block = (self.t / ref.wtau).astype(int)
        for b in np.unique(block):
            c_all, m_all = np.zeros((len(e), 3)), np.zeros((3, 3))
            for s in np.flatnonzero(block == b):
                w, j = self.w[s], self.jac[s]
                ew = e[:, s] * w
                m = (j.T * w) @ j
                k = np.linalg.inv(m + pi)
                c = ew @ j
                g += ew @ e[:, s].T - c @ k @ c.T
                c_all += c - c @ k @ m
                m_all += m - m @ k @ m
            g -= c_all @ np.linalg.inv(m_all + wi) @ c_all.T
        return g
