# SPDX-License-Identifier: BSD-3-Clause
"""How strongly causes of the laser show in the readings of the drives to fit."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy import stats

from kurumaisu.bench.strangers.scree.basics import Array, Cause, Mask
from kurumaisu.bench.strangers.scree.catalogue import LASER, SCATTER
from kurumaisu.bench.strangers.scree.plant import Causes, Drive, seen, unstamp
from kurumaisu.bench.strangers.scree.ranges import BIASES, Hits, Site, look, mean_reading
from kurumaisu.bench.strangers.scree.reference import Reference
from kurumaisu.bench.strangers.scree.scatter import LOST, ODD, SPREADS, chance, edges
from kurumaisu.bench.strangers.scree.strength import Strength, left_over


@dataclass(frozen=True)
class View:
    """Some scans of one drive, looked at from the true poses, with what poses change and what counts."""

    drive: Drive
    stamps: Array
    hits: Hits
    slopes: Array
    counts: Mask
    part: float


def slopes(site: Site, h: Hits, pose: Array) -> Array:
    """Derivatives of ranges by x, y and heading of the robot, and by the turn of the laser alone."""
    c, s = np.cos(h.angle), np.sin(h.angle)
    n = h.normal
    along = n[..., 0] * c + n[..., 1] * s
    along = np.where(np.abs(along) < 0.1, np.where(along < 0, -0.1, 0.1), along)
    by_x, by_y = -n[..., 0] / along, -n[..., 1] / along
    turn = -h.r * (-n[..., 0] * s + n[..., 1] * c) / along
    ox, oy = h.x - h.r * c - pose[:, None, 0], h.y - h.r * s - pose[:, None, 1]
    return np.stack([by_x, by_y, turn - by_x * oy + by_y * ox, turn], axis=-1)


def _countable(site: Site, h: Hits) -> Mask:
    laser = site.laser
    jump = np.abs(edges(h)) > 0
    near = jump.copy()
    near[:, 1:] |= jump[:, :-1]
    mean = laser.scale * h.r + laser.datum
    sd = 4 * laser.sd(h.r)
    return np.asarray((mean > laser.near + sd) & (mean < laser.far - sd) & ~near & (h.cos > 0.15))


def view(site: Site, drive: Drive, stamps: Array) -> View:
    """Up to 60 scans of a drive."""
    every = max(len(stamps) // 60, 1)
    some = stamps[::every]
    pose = drive.path.at(some)
    h = look(site, (), drive, some, pose)
    return View(drive, some, h, slopes(site, h, pose), _countable(site, h), len(some) / len(stamps))


def _whiten(v: View, site: Site, r: Reference, effect: Array) -> Array:
    """Whiten by the laser's noise and by what the errors of poses do to a whole scan."""
    sd = site.laser.sd(v.hits.r)
    many = max(len(v.stamps) / v.part * min(r.tau / v.drive.length, 1.0), 1.0)
    place = np.sqrt(r.place**2 + many * r.wander**2)
    on = v.counts / sd
    a = v.slopes[..., :3] * np.array([place, place, r.heading]) * on[..., None]
    value, vector = np.linalg.eigh(np.einsum("sbi,sbj->sij", a, a))
    value = np.maximum(value, 1e-12)
    u = np.einsum("sbi,sij->sbj", a, vector) / np.sqrt(value)[:, None, :]
    m = effect * on
    inside = np.einsum("sbi,sb->si", u, m) * (1 - 1 / np.sqrt(1 + value))
    return np.asarray((m - np.einsum("sbi,si->sb", u, inside)).ravel() / np.sqrt(v.part))


def _geometry(v: View, site: Site) -> list[tuple[str, Array]]:
    """What mount and clocks do to ranges, for small sizes."""
    j = v.slopes
    th = v.drive.path.at(v.stamps)[:, None, 2]
    ahead = j[..., 0] * np.cos(th) + j[..., 1] * np.sin(th)
    aside = -j[..., 0] * np.sin(th) + j[..., 1] * np.cos(th)
    late = v.hits.v * ahead + v.hits.w * j[..., 2]
    beam = np.arange(site.laser.beams) * site.laser.between
    return [
        ("laser.mount_x", ahead),
        ("laser.mount_y", aside),
        ("laser.mount_yaw", j[..., 3]),
        ("laser.latency", late),
        ("laser.clock_skew", late * v.hits.t),
        ("laser.sweep", late * beam),
    ]


def _stack(views: list[View], site: Site, r: Reference, effects: list[Array]) -> Array:
    return np.concatenate([_whiten(v, site, r, e) for v, e in zip(views, effects, strict=True)])


def _means(views: list[View], site: Site, causes: Causes) -> list[tuple[Array, Array]]:
    out = []
    for v in views:
        h = look(site, causes, v.drive, v.stamps, v.drive.path.at(v.stamps))
        out.append((mean_reading(site, causes, h), h.wall))
    return out


def mean_rivals(views: list[View], site: Site, r: Reference, without: list[str]) -> list[Array]:
    """What other causes of the mean readings would do at a usual size, whitened."""
    out = []
    for k, (name, _) in enumerate(_geometry(views[0], site)):
        if name not in without:
            out.append(_stack(views, site, r, [0.01 * _geometry(v, site)[k][1] for v in views]))
    for e in LASER:
        if e.id in BIASES and e.id not in without:
            c = Cause(e.id, e.typical)
            out.append(_stack(views, site, r, [BIASES[e.id](c, v.hits) + 0 * v.hits.r for v in views]))
    return out


def mean_effects(views: list[View], site: Site, causes: Causes, r: Reference) -> list[Array]:
    """What each cause does to the mean readings, whitened."""
    full = _means(views, site, causes)
    effects = []
    for c in causes:
        less = _means(views, site, tuple(o for o in causes if o is not c))
        parts = [
            np.where((a[1] == b[1]) & (np.abs(a[0] - b[0]) < 0.5), a[0] - b[0], 0.0)
            for a, b in zip(full, less, strict=True)
        ]
        effects.append(_stack(views, site, r, parts))
    return effects


def pose_effect(views: list[View], site: Site, causes: Causes, r: Reference) -> Array:
    """What causes that bend the reference do to readings predicted from its poses, whitened."""
    parts = []
    for v in views:
        t = unstamp(causes, v.stamps)
        off = seen(v.drive, causes, v.drive.path.at(t), t) - v.drive.path.at(v.stamps)
        parts.append(-np.einsum("sbk,sk->sb", v.slopes[..., :3], off))
    return _stack(views, site, r, parts)


def _against(p: Array, q: Array) -> float:
    """How much a reading tells on average that odd ones come with p, not with q."""
    p, q = np.clip(p, 1e-9, 1 - 1e-9), np.clip(q, 1e-9, 1 - 1e-9)
    return float(np.sum(p * np.log(p / q) + (1 - p) * np.log((1 - p) / (1 - q))))


def _tails(c: Cause) -> tuple[float, float]:
    """The same for the shape of the noise, against the stated and against the best normal one."""
    x = np.linspace(-40, 40, 16001)
    if c.other:
        wide = np.linspace(3, 12, 40)
        p = 0.1 * c.size * np.mean([stats.norm.pdf(x, scale=s) for s in wide], axis=0)
        p = p + (1 - 0.1 * c.size) * stats.norm.pdf(x)
    else:
        p = stats.t.pdf(x, 1 / min(c.size, 0.42))
    p = p / np.sum(p)
    sd = float(np.sqrt(np.sum(p * x * x)))
    gains = [float(np.sum(p * (np.log(p / (x[1] - x[0])) - stats.norm.logpdf(x, scale=s)))) for s in (1.0, sd)]
    return gains[0], gains[1]


def _spread(views: list[View], c: Cause) -> Strength:
    log = np.concatenate([(SPREADS[c.id](c, v.hits) + 0 * v.hits.r)[v.counts] for v in views])
    part = views[0].part
    z = float(np.sqrt(np.sum(np.exp(2 * log) - 1 - 2 * log) / part))
    rivals: dict[str, Callable[[Hits], Array]] = {
        "laser.range_noise": lambda h: np.ones_like(h.r),
        "laser.incidence_noise": lambda h: h.tangent,
        "laser.reflectance": lambda h: 1 - h.bright,
        "slope": lambda h: h.r,
    }
    use = [f for k, f in rivals.items() if k != c.id and not (k == "slope" and c.id == "laser.range_noise")]
    vectors = [np.concatenate([f(v.hits)[v.counts] for v in views]) for f in use]
    rest = min(left_over(log, [u]) for u in vectors)
    return Strength(z, z * rest / max(float(np.linalg.norm(log)), 1e-12))


def _odd_readings(views: list[View], site: Site, c: Cause) -> Strength:
    p = np.concatenate([chance(c, v.hits, site)[v.hits.r < site.laser.far] for v in views])
    part = views[0].part
    null = np.full_like(p, LOST if c.id in ("laser.dropout", "laser.saturation") else 1e-3)
    z = np.sqrt(2 * _against(p, null) / part) if np.any(p > 1e-3) else 0.0
    if c.id == "laser.dropout":
        return Strength(float(z), float(z))
    rest = np.sqrt(2 * max(_against(p, np.full_like(p, np.mean(p))), 0.0) / part)
    return Strength(float(z), float(min(z, rest)))


def scatter_strength(views: list[View], site: Site, c: Cause, r: Reference) -> Strength:
    """The strength of a cause of the scatter."""
    n = sum(float(np.sum(v.counts)) for v in views) / views[0].part
    if c.id in SPREADS:
        return _spread(views, c)
    if c.id in ODD:
        return _odd_readings(views, site, c)
    if c.id == "laser.heavy_tails":
        a, b = _tails(c)
        return Strength(float(np.sqrt(2 * n * a)), float(np.sqrt(2 * n * b)))
    if c.id == "laser.beam_correlation":
        rho = c.size * (0.72 if c.other else 1.0)
        z = float(np.sqrt(-n * np.log(1 - rho**2)))
        return Strength(z, 0.8 * z)
    if c.id == "laser.quantisation":
        step = site.laser.resolution
        z = float(np.sqrt(2 * n * max(np.log(c.size / step), 0.0))) if c.size > 1.4 * step else 0.0
        return Strength(min(z, 300.0), min(z, 300.0))
    total = 0.0
    for v in views:
        one = _whiten(replace(v, part=1.0), site, r, np.ones_like(v.hits.r)).reshape(v.hits.r.shape)
        big = c.size**2 * np.sum(one**2, axis=1)
        total += float(np.sum(big - np.log(1 + big))) / v.part
    return Strength(float(np.sqrt(total)), float(np.sqrt(total)) * 0.8)


def scatters(c: Cause) -> bool:
    """Whether a cause shows in the scatter of readings."""
    return c.id in SCATTER or c.id in SPREADS
