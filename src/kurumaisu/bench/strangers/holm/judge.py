# SPDX-License-Identifier: BSD-3-Clause
"""How strongly a cause shows in what was recorded, alone and beside its rivals."""
from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.linalg import cholesky, solve_triangular, toeplitz
from scipy.stats import norm
from scipy.stats import t as student

from . import faults, fog
from .chair import Noise, drive
from .core import Array, Effect, Law
from .drives import Drive, Reference, relative, true_time
from .laser import Fan, Look, look
from .rooms import Room

STEP = 1.0
BENT = {"base." + n for n in ("delay", "lag_v", "lag_w", "accel_limit", "dead_zone_v", "dead_zone_w", "payload",
                              "backlash",
                              "understeer", "dac_quantisation")}

def increments(d: Drive, effects: Sequence[Effect], law: Law, dt: float = 0.02) -> Array:
    """Motions (n, 3) over a second each that the reference would see without noise."""
    dt = 0.01 if any(e.hook == "plant" for e in effects) else dt
    motion = drive(d.commands, d.duration, effects, d.motion.at(np.zeros(1))[0], dt=dt, start=d.start, law=law,
                   path=d.motion, extra=d.extra)
    edges = np.clip(true_time(np.arange(0.0, d.duration, STEP), d.start, effects), 0, d.duration)
    poses = motion.at(edges)
    if any(e.hook == "bend" for e in effects):
        moved = faults.seen(d.motion.at(edges), list(effects)) - d.motion.at(edges)
        poses = poses + moved
        return relative(poses[:-1], poses[1:])
    poses = faults.seen(poses, list(effects))
    return relative(poses[:-1], poses[1:])

def whitener(rows: Array, noise: Noise, ref: Reference) -> list[Array]:
    """Lower Cholesky factors of the covariance of dx, dy, dtheta of one drive."""
    n, tau = rows.shape[0], noise.tau
    lag = np.arange(n) * STEP
    e = np.exp(-STEP / tau)
    first = 2 * tau * (STEP - tau * (1 - e))
    rest = tau**2 * (1 - e) ** 2 * np.exp(-(np.maximum(lag, STEP) - STEP) / tau)
    moves = (np.abs(rows).max(axis=1) > 1e-4) | (not noise.still)
    process = toeplitz(np.where(lag == 0, first, rest)) * np.outer(moves, moves)
    hops = toeplitz(np.concatenate([[2.0, -1.0], np.zeros(max(n - 2, 0))])[:n])
    k = np.exp(-STEP / ref.wander_tau)
    later = np.maximum(lag, STEP) - STEP
    slow = toeplitz(np.where(lag == 0, 2 * (1 - k), -((1 - k) ** 2) * np.exp(-later / ref.wander_tau)))
    heading = ref.sd_th**2 + (0.3 * ref.wander) ** 2
    turned = (noise.sd_v * np.sin(rows[:, 2] / 2)) ** 2 * first
    tilt = np.diag(rows[:, 0] ** 2 * (heading + noise.sd_w**2 * first / 3) + turned)
    place = ref.sd**2 * hops + ref.wander**2 * slow + 1e-12 * np.eye(n)
    turn = ref.sd_th**2 * hops + (0.3 * ref.wander) ** 2 * slow + 1e-12 * np.eye(n)
    side = np.diag(rows[:, 1] ** 2 * (heading + noise.sd_w**2 * first / 3))
    return [cholesky(m, lower=True) for m in (noise.sd_v**2 * process + place + side, place + tilt,
                                              noise.sd_w**2 * process + turn)]

class Judge:
    """Templates of all effects over the drives to fit, whitened; Gram matrices of them."""

    def __init__(self, drives: Sequence[Drive], noise: Noise, ref: Reference, law: Law, room: Room | None,
                 fan: Fan | None) -> None:
        self.drives, self.noise, self.ref, self.law, self.room, self.fan = list(drives), noise, ref, law, room, fan
        self.base = [increments(d, [], law) for d in drives]
        self.white = [whitener(b, noise, ref) for b in self.base]
        self.looks: list[tuple[Drive, Array, Array, float, Look, Array]] = []
        if room is not None and fan is not None:
            for d in drives:
                self._subset(d)

    def _subset(self, d: Drive) -> None:
        assert self.room is not None and self.fan is not None
        take = np.unique(np.linspace(1, d.stamps.size - 2, 30).astype(int))
        beams = np.unique(np.linspace(0, self.fan.beams - 1, min(self.fan.beams, 100)).astype(int))
        first = look(self.room, d.motion.at, d.stamps[take], self.fan, [], beams=beams, start=d.start, index=take,
                     extra=self._extra(d))
        slopes = []
        for k, h in enumerate((0.002, 0.002, 0.001)):
            near = [look(self.room, lambda t, k=k, g=g: d.motion.at(t) + g * np.eye(3)[k],  # type: ignore[misc]
                         d.stamps[take], self.fan, [], beams=beams).mu for g in (h, -h)]
            with np.errstate(invalid="ignore"):
                slopes.append((near[0] - near[1]) / (2 * h))
        jac = np.stack(slopes, axis=-1)
        ok = first.valid & np.isfinite(jac).all(axis=-1) & (np.abs(jac).max(axis=-1) < 12)
        jac[~ok] = 0
        first.extra["ok"] = ok.astype(float)
        ratio = self.fan.beams / beams.size
        self.looks.append((d, take, beams, ratio, first, jac))

    @staticmethod
    def _extra(d: Drive) -> dict[str, tuple[Array, Array]]:
        return {k: (np.arange(v.size), v) for k, v in d.extra.items()}

    def column(self, with_it: Sequence[Effect], without: Sequence[Effect] = ()) -> list[Array]:
        """What differs between two sets of effects, whitened: the base's drives, then scans of the subset."""
        out: list[Array] = []
        touched = {e.hook for e in [*with_it, *without]}
        laser = touched & {"mount", "stamps", "sweep", "tilt", "room", "mean", "pose"}
        base = any(e.channel == "base" for e in [*with_it, *without])
        for d, zero, factors in zip(self.drives, self.base, self.white, strict=True):
            change = increments(d, with_it, self.law) - increments(d, without, self.law) if base else 0 * zero
            out.append(np.concatenate([solve_triangular(f, change[:, k], lower=True) for k, f in enumerate(factors)]))
        for d, take, beams, ratio, first, jac in self.looks:
            assert self.room is not None and self.fan is not None
            delta = np.zeros(first.mu.shape)
            if laser:
                seen = [look(self.room, d.motion.at, d.stamps[take], self.fan, s, beams=beams, start=d.start,
                             index=take,
                             extra=self._extra(d)).mu for s in (with_it, without)]
                with np.errstate(invalid="ignore"):
                    delta = seen[0] - seen[1]
                for sign, group in ((1, with_it), (-1, without)):
                    if any(e.hook == "pose" for e in group):
                        moved = faults.seen(first.pose, list(group)) - first.pose
                        delta = delta - sign * (jac * moved).sum(axis=-1)
                delta = np.where((first.extra["ok"] > 0) & np.isfinite(delta) & (np.abs(delta) < 0.4), delta, 0)
            out.append(self._scans(d, delta, first, jac, ratio) * np.sqrt(max(d.stamps.size / take.size, 1.0)))
        return out

    def _scans(self, d: Drive, delta: Array, first: Look, jac: Array, ratio: float) -> Array:
        sd = first.sd / np.sqrt(ratio)
        alike = min(2 * self.ref.wander_tau * d.stamps.size / d.duration, d.stamps.size)
        slow = self.ref.wander * np.sqrt(max(alike, 1.0))
        place = np.hypot(self.ref.sd, slow)
        prior = np.array([place, place, np.hypot(self.ref.sd_th, 0.3 * slow)])
        rows = []
        for y, a, s in zip(delta, jac, sd, strict=True):
            b = a * prior / s[:, None]
            u, w, _ = np.linalg.svd(b, full_matrices=False)
            e = y / s
            rows.append(e - u @ ((1 - 1 / np.sqrt(1 + w * w)) * (u.T @ e)))
        return np.concatenate(rows)

    def strength(self, hidden: Sequence[Effect], rng: np.random.Generator) -> list[tuple[float, float]]:
        """z and beside of each hidden effect, the others there."""
        ids = {e.id for e in hidden}
        means = [e for e in hidden if e.id not in fog.SCATTER and e.hook != "spread"]
        others = [np.concatenate(self.column(hidden, [x for x in hidden if x is not e])) for e in means]
        rivals: list[list[Array]] = []
        catalogue = {**faults.USUAL, **(fog.USUAL if self.looks else {})} if means else {}
        for name, (size, maker) in catalogue.items():
            if name in ids or name in fog.SCATTER:
                continue
            group = [maker(size * k, rng) for k in ((1, 3) if name in BENT else (1,))]
            families = fog.FAMILIES[name] if name in fog.FAMILIES else [group]
            if name == "laser.temperature" and "temperature" in self.drives[0].extra:
                families = [*families, group]
            rivals += [[np.concatenate(self.column([e])) for e in family] for family in families]
        found = []
        for e in hidden:
            if e not in means:
                found.append(self.scatter(e))
                continue
            mine = others[[x is e for x in means].index(True)]
            rest = [o for o, x in zip(others, means, strict=True) if x is not e]
            left = np.inf
            for family in [[], *rivals]:
                basis = [b / np.linalg.norm(b) for b in [*rest, *family] if np.linalg.norm(b) > 1e-9]
                gone = mine
                if basis:
                    m = np.stack(basis, axis=1)
                    gone = mine - m @ np.linalg.lstsq(m, mine, rcond=1e-9)[0]
                left = min(left, float(np.linalg.norm(gone)))
            found.append((float(np.linalg.norm(mine)), left))
        return found

    def scatter(self, e: Effect) -> tuple[float, float]:
        """z and beside of an effect of the scatter, by the likelihood ratio."""
        total, beside = 0.0, 0.0
        for d, take, beams, ratio, first, _ in self.looks:
            assert self.room is not None and self.fan is not None
            ok = first.extra["ok"] > 0
            many = ratio * d.stamps.size / take.size
            changed = look(self.room, d.motion.at, d.stamps[take], self.fan, [e], beams=beams, start=d.start,
                           index=take,
                           extra=self._extra(d))
            a, b = nats(e, first, changed, ok, ratio)
            total, beside = total + a * many, beside + b * many
        return float(np.sqrt(2 * total)), float(np.sqrt(2 * beside))

def _kl(k: Array) -> float:
    return float(0.5 * np.sum(k - 1 - np.log(k)))

def nats(e: Effect, first: Look, changed: Look, ok: Array, ratio: float) -> tuple[float, float]:
    """Nats of a scatter effect in these readings, against nothing and against its nearest rival."""
    name, sd = e.id, first.sd[ok]
    n = int(ok.sum())
    if e.hook == "spread":
        k = (changed.sd[ok] / sd) ** 2
        tan = np.minimum(np.tan(first.incidence[ok]), 6)
        rivals = [k / (1 + g * tan) ** 2 for g in np.geomspace(0.02, 5, 30)] if name != "laser.incidence_noise" else []
        if name != "laser.range_noise":
            rivals += [k / (1 + g) ** 2 for g in np.linspace(-0.5, 6, 60)]
        return _kl(k), min([_kl(x) for x in rivals] + [_kl(k)])
    rng = np.random.default_rng(5)
    if name == "laser.common_mode":
        x = e.settings["size"]
        info = np.array([(1 / s[o] ** 2).sum() * ratio for s, o in zip(first.sd, ok, strict=True)])
        lam = np.minimum(x**2 * info, 50)
        full = float(np.sum(0.5 * (lam - np.log1p(lam)))) / ratio
        return full, 0.4 * full
    if name in ("laser.beam_correlation", "laser.heavy_tails"):
        e.settings["seed"] = 3.0
        e.act(changed)
        u = changed.error
        if name == "laser.beam_correlation":
            rho = float(np.clip(np.mean(u[:, 1:] * u[:, :-1]) / np.mean(u * u), -0.95, 0.95))
            full = -0.5 * n * np.log(1 - rho**2)
            return full, 0.7 * full
        flat = np.random.default_rng(1).permutation(u[ok])
        fit = student.fit(flat[:4000], floc=0)
        ratio_llr = float(np.mean(student.logpdf(flat, *fit) - norm.logpdf(flat, 0, 1)))
        wide = float(np.mean(student.logpdf(flat, *fit) - norm.logpdf(flat, 0, flat.std())))
        return n * max(min(ratio_llr, 2.0), 1e-6), n * max(min(wide, 2.0), 1e-6)
    if name == "laser.quantisation":
        step = e.settings["size"]
        mu = first.mu[ok]
        y = np.round((mu + sd * rng.standard_normal(n)) / step) * step
        p = norm.cdf(y + step / 2, mu, sd) - norm.cdf(y - step / 2, mu, sd)
        q = 0.001 * norm.pdf(y, mu, sd)
        wide = 0.001 * norm.pdf(y, mu, np.hypot(sd, step / np.sqrt(12)))
        gain = [float(np.sum(np.log(np.maximum(p, 1e-12) / np.maximum(x, 1e-12)))) for x in (q, wide)]
        return max(gain[0], 1e-6), max(min(gain), 1e-6)
    before = np.where(first.valid, first.mu, np.inf)
    changed.read = before.copy()
    e.settings["seed"] = 3.0
    e.act(changed)
    with np.errstate(invalid="ignore"):
        off = np.where(np.isfinite(changed.read), np.abs(changed.read - before) / first.sd, 5.0)
    off = off[first.valid & ((changed.read != before) | ~np.isfinite(changed.read))]
    worth = float(np.sum(np.minimum(0.5 * off**2, 6.0)))
    return worth, 0.4 * worth
