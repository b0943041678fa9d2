# SPDX-License-Identifier: BSD-3-Clause
"""How strongly a cause shows in what was recorded, alone and beside its rivals."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.linalg import cholesky, solve_triangular, toeplitz
from scipy.stats import norm
from scipy.stats import t as student

from kurumaisu.bench.strangers.holm.chair import Noise
from kurumaisu.bench.strangers.holm.core import LASER_HOOKS, USUAL, Array, Effect, Law, relative
from kurumaisu.bench.strangers.holm.drives import Drive, Reference, Scene, true_time
from kurumaisu.bench.strangers.holm.faults import seen
from kurumaisu.bench.strangers.holm.fog import FAMILIES, SCATTER_HOOKS
from kurumaisu.bench.strangers.holm.laser import Fan, Look, look
from kurumaisu.bench.strangers.holm.rooms import Room

STEP = 1.0
_BENT = "delay lag_v lag_w accel_limit dead_zone_v dead_zone_w payload backlash understeer dac_quantisation"
BENT = {"base." + name for name in _BENT.split()}


def increments(d: Drive, effects: Sequence[Effect], law: Law) -> Array:
    """Motions (n, 3) over a second each that the reference would see without noise."""
    dt = 0.01 if any(e.hook == "plant" for e in effects) else 0.02
    motion = d.again(effects, law, d.motion.at(np.zeros(1))[0], dt)
    edges = np.clip(true_time(np.arange(0.0, d.duration, STEP), d.start, effects), 0, d.duration)
    poses = motion.at(edges)
    if any(e.hook == "bend" for e in effects):
        poses = poses + (seen(d.motion.at(edges), effects) - d.motion.at(edges))
    else:
        poses = seen(poses, effects)
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
    return [
        cholesky(m, lower=True)
        for m in (noise.sd_v**2 * process + place + side, place + tilt, noise.sd_w**2 * process + turn)
    ]


class View:
    """Some beams of some scans of a drive, and how they change with the pose."""

    def __init__(self, d: Drive, room: Room, fan: Fan) -> None:
        self.drive, self.room, self.fan = d, room, fan
        self.take = np.unique(np.linspace(1, d.stamps.size - 2, 30).astype(int))
        self.beams = np.unique(np.linspace(0, fan.beams - 1, min(fan.beams, 100)).astype(int))
        self.ratio = fan.beams / self.beams.size
        self.first, slopes = self.look([]), []
        for step in np.diag([0.002, 0.002, 0.001]):
            ahead, behind = self.look([], step).mu, self.look([], -step).mu
            with np.errstate(invalid="ignore"):
                slopes.append((ahead - behind) / (2 * step.max()))
        self.jac = np.stack(slopes, axis=-1)
        self.ok = self.first.valid & np.isfinite(self.jac).all(axis=-1) & (np.abs(self.jac).max(axis=-1) < 12)
        self.jac[~self.ok] = 0

    def look(self, effects: Sequence[Effect], shift: Array | None = None) -> Look:
        """These readings, with effects or with poses shifted."""
        d = self.drive

        def poses(t: Array) -> Array:
            return d.motion.at(t) if shift is None else d.motion.at(t) + shift

        stamps, more = d.stamps[self.take], {"index": self.take, "beams": self.beams}
        return look(self.room, poses, stamps, self.fan, effects, start=d.start, extra=d.extra, **more)

    def change(self, with_it: Sequence[Effect], without: Sequence[Effect]) -> Array:
        """How mean readings at the measured poses differ between two sets of effects."""
        with np.errstate(invalid="ignore"):
            delta = self.look(with_it).mu - self.look(without).mu
        for sign, group in ((1, with_it), (-1, without)):
            if any(e.hook == "pose" for e in group):
                moved = seen(self.first.pose, group) - self.first.pose
                delta = delta - sign * (self.jac * moved).sum(axis=-1)
        return np.asarray(np.where(self.ok & np.isfinite(delta) & (np.abs(delta) < 0.4), delta, 0))

    def white(self, delta: Array, ref: Reference) -> Array:
        """A change, whitened, with what errors of the poses may do taken out."""
        d = self.drive
        alike = min(2 * ref.wander_tau * d.stamps.size / d.duration, d.stamps.size)
        slow = ref.wander * np.sqrt(max(alike, 1.0))
        place = np.hypot(ref.sd, slow)
        prior = np.array([place, place, np.hypot(ref.sd_th, 0.3 * slow)])
        rows = []
        for y, a, s in zip(delta, self.jac, self.first.sd / np.sqrt(self.ratio), strict=True):
            u, w, _ = np.linalg.svd(a * prior / s[:, None], full_matrices=False)
            e = y / s
            rows.append(e - u @ ((1 - 1 / np.sqrt(1 + w * w)) * (u.T @ e)))
        return np.asarray(np.concatenate(rows) * np.sqrt(max(d.stamps.size / self.take.size, 1.0)))


def _left(mine: Array, others: list[Array]) -> float:
    """The length of what is left of a column when others have taken what they can."""
    basis = [b / np.linalg.norm(b) for b in others if np.linalg.norm(b) > 1e-9]
    if basis:
        m = np.stack(basis, axis=1)
        mine = mine - m @ np.linalg.lstsq(m, mine, rcond=1e-9)[0]
    return float(np.linalg.norm(mine))


class Judge:
    """What effects change over the drives to fit, whitened."""

    def __init__(self, drives: Sequence[Drive], scene: Scene) -> None:
        self.drives, self.scene = drives, scene
        self.white = [whitener(increments(d, [], scene.law), scene.noise, scene.ref) for d in drives]
        self.views = [View(d, scene.room, scene.fan) for d in drives if scene.room and scene.fan]

    def column(self, with_it: Sequence[Effect], without: Sequence[Effect] = ()) -> Array:
        """What differs between two sets of effects, whitened: the base's drives, then scans."""
        out, law = [], self.scene.law
        touched = {e.hook for e in [*with_it, *without]}
        for d, factors in zip(self.drives, self.white, strict=True):
            change = np.zeros((len(factors[0]), 3))
            if touched - LASER_HOOKS:
                change = increments(d, with_it, law) - increments(d, without, law)
            out += [solve_triangular(f, change[:, k], lower=True) for k, f in enumerate(factors)]
        for view in self.views:
            laser = touched & {"mount", "stamps", "sweep", "tilt", "room", "mean", "pose"}
            delta = view.change(with_it, without) if laser else np.zeros(view.ok.shape)
            out.append(view.white(delta, self.scene.ref))
        return np.concatenate(out)

    def strength(self, hidden: Sequence[Effect], rng: np.random.Generator) -> list[tuple[float, float]]:
        """How strongly each hidden effect shows (z), and beside its rivals, the others there."""
        means = {e.id: e for e in hidden if e.hook not in SCATTER_HOOKS}
        columns = {i: self.column(hidden, [x for x in hidden if x is not e]) for i, e in means.items()}
        rivals: list[list[Array]] = [[]]
        for name, (size, maker) in USUAL.items() if means else ():
            group = [maker(size * k, rng) for k in ((1, 3) if name in BENT else (1,))]
            hook = group[0].hook
            if hook in SCATTER_HOOKS or any(e.id == name for e in hidden) or (hook in LASER_HOOKS and not self.views):
                continue
            families = FAMILIES.get(name, [group])
            if name == "laser.temperature" and "temperature" in self.drives[0].extra:
                families = [*families, group]
            rivals += [[self.column([e]) for e in family] for family in families]
        found = []
        for e in hidden:
            if e.id not in means:
                found.append(self.scatter(e))
                continue
            rest = [column for i, column in columns.items() if i != e.id]
            left = min(_left(columns[e.id], [*rest, *family]) for family in rivals)
            found.append((float(np.linalg.norm(columns[e.id])), left))
        return found

    def scatter(self, e: Effect) -> tuple[float, float]:
        """How strongly an effect of the scatter shows, alone and beside its rivals, by the likelihood ratio."""
        total, beside = 0.0, 0.0
        for view in self.views:
            many = view.ratio * view.drive.stamps.size / view.take.size
            a, b = nats(e, view)
            total, beside = total + a * many, beside + b * many
        return float(np.sqrt(2 * total)), float(np.sqrt(2 * beside))


def _kl(k: Array) -> float:
    return float(0.5 * np.sum(k - 1 - np.log(k)))


def nats(e: Effect, view: View) -> tuple[float, float]:
    """Nats of a scatter effect in these readings, against nothing and against its nearest rival."""
    first, changed, ok, name = view.first, view.look([e]), view.ok, e.id
    sd, n = first.sd[ok], int(ok.sum())
    changed.rng = np.random.default_rng(3)
    if e.hook == "spread":
        k = (changed.sd[ok] / sd) ** 2
        tan = np.minimum(np.tan(first.incidence[ok]), 6)
        rivals = [k / (1 + g * tan) ** 2 for g in np.geomspace(0.02, 5, 30)] if name != "laser.incidence_noise" else []
        if name != "laser.range_noise":
            rivals += [k / (1 + g) ** 2 for g in np.linspace(-0.5, 6, 60)]
        return _kl(k), min([_kl(x) for x in rivals] + [_kl(k)])
    if name == "laser.common_mode":
        info = np.array([(1 / s[o] ** 2).sum() * view.ratio for s, o in zip(first.sd, ok, strict=True)])
        lam = np.minimum(e.settings["size"] ** 2 * info, 50)
        full = float(np.sum(0.5 * (lam - np.log1p(lam)))) / view.ratio
        return full, 0.4 * full
    if name in ("laser.beam_correlation", "laser.heavy_tails"):
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
        y = np.round((mu + sd * np.random.default_rng(5).standard_normal(n)) / step) * step
        p = norm.cdf(y + step / 2, mu, sd) - norm.cdf(y - step / 2, mu, sd)
        q = 0.001 * norm.pdf(y, mu, sd)
        wide = 0.001 * norm.pdf(y, mu, np.hypot(sd, step / np.sqrt(12)))
        gain = [float(np.sum(np.log(np.maximum(p, 1e-12) / np.maximum(x, 1e-12)))) for x in (q, wide)]
        return max(gain[0], 1e-6), max(min(gain), 1e-6)
    before = np.where(first.valid, first.mu, np.inf)
    changed.read = before.copy()
    e.act(changed)
    with np.errstate(invalid="ignore"):
        off = np.where(np.isfinite(changed.read), np.abs(changed.read - before) / first.sd, 5.0)
    off = off[first.valid & ((changed.read != before) | ~np.isfinite(changed.read))]
    worth = float(np.sum(np.minimum(0.5 * off**2, 6.0)))
    return worth, 0.4 * worth
