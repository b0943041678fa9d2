# SPDX-License-Identifier: BSD-3-Clause
"""How clearly an effect of the laser shows in the scans of a recording."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import solve_triangular
from scipy.stats import norm, t

from kurumaisu.bench.strangers.reed.core import Array, Noise, Use, simulate
from kurumaisu.bench.strangers.reed.laser import FAR, Fan, Setting, View, setting, view
from kurumaisu.bench.strangers.reed.lasers import LASER, Rng
from kurumaisu.bench.strangers.reed.room import Room
from kurumaisu.bench.strangers.reed.score import Ride

LOST = 0.002


@dataclass
class Light:
    """The scans of the drives to fit: the model's views, and how the poses of each err."""

    rides: list[Ride]
    base: list[Use]
    fan: Fan
    room: Room
    views: list[View]
    mask: Array
    sd: Array
    slopes: Array
    roots: list[Array]

    def flat(self, values: list[Array]) -> Array:
        """Whatever each view gives, scans in rows, 0 where a beam does not count."""
        return np.where(self.mask > 0, np.concatenate(values), 0.0)

    def parts(self, *given: Array) -> list[list[Array]]:
        """The root of each drive's errors, with its part of arrays of all scans."""
        ends = np.cumsum([len(v.r) for v in self.views])[:-1]
        return [list(p) for p in zip(self.roots, *[np.split(g, ends) for g in given], strict=True)]

    def white(self, plain: Array, slopes: Array) -> Array:
        """Whitened by the errors of the poses, too: what the likeliest ones leave, and these in their sds."""
        out = []
        for root, p, a in self.parts(plain, slopes):
            y = np.linalg.solve(_normal(root, a), root.T @ np.einsum("kni,kn->ki", a, p).ravel())
            out += [(p - np.einsum("kni,ki->kn", a, (root @ y).reshape(-1, 3))).ravel(), y]
        return np.concatenate(out)

    def free(self) -> Array:
        """What the likeliest poses leave of the square of each reading's error."""
        out = []
        for root, a in self.parts(self.slopes):
            half = np.linalg.solve(np.linalg.cholesky(_normal(root, a)), root.T).T.reshape(len(a), 3, -1)
            out.append(1 - np.sum((a @ (half @ np.swapaxes(half, 1, 2))) * a, axis=2))
        return self.flat(out)


def _normal(root: Array, slopes: Array) -> Array:
    """Normal equations of the poses of a drive, in units in which their errors are white."""
    gram = np.swapaxes(slopes, 1, 2) @ slopes
    return np.asarray(np.eye(len(root)) + root.T @ (gram @ root.reshape(len(gram), 3, -1)).reshape(root.shape))


def _slopes(v: View, s: Setting) -> Array:
    """Derivatives of the ranges by x, y and heading of the chair."""
    sides = s.room.sides()
    x0, y0, x1, y1 = np.moveaxis(sides[np.clip(v.side, 0, len(sides) - 1).astype(int)], -1, 0)
    c, n, th = np.cos(v.direction), np.sin(v.direction), v.direction - v.bearing - s.yaw
    den = c * (y1 - y0) - n * (x1 - x0)
    x, y = -(y1 - y0) / den, (x1 - x0) / den
    ox, oy = s.x * np.cos(th) - s.y * np.sin(th) + v.r * c, s.x * np.sin(th) + s.y * np.cos(th) + v.r * n
    return np.stack([x, y, y * ox - x * oy], axis=2)


def _root(ride: Ride, base: list[Use], noise: Noise) -> Array:
    """Root of the covariance of the poses at all scans of a drive, given the rows of its reference."""
    n, t = len(ride.scans), np.concatenate([ride.scans, ride.stamps])
    ago, grow = np.exp(-t / noise.tau), np.mean(simulate(ride.drive, base, ride.pose)[0].grow ** 2)
    wander = 2 * np.minimum(t[:, None], t) / noise.tau - 1 + ago[:, None] + ago
    wander = grow * noise.tau**2 * (wander - np.exp(-np.abs(t[:, None] - t) / noise.tau))
    turn = 2 * np.pi * ride.stamps[:, None] / np.linspace(80, 200, 5)
    slow = noise.drift / np.sqrt(10) * np.concatenate([np.cos(turn), np.sin(turn)], axis=1)
    out = np.zeros((n, 3, n, 3))
    for axes, sd, err, drift in (((0, 1), noise.sd_v, noise.pos, slow), ((2,), noise.sd_w, noise.head, 0 * slow)):
        k = 1 + sd**2 * wander
        rows = np.linalg.cholesky(k[n:, n:] + drift @ drift.T + err**2 * np.eye(len(turn)))
        told = solve_triangular(rows, k[n:, :n], lower=True)
        for i in axes:
            out[:, i, :, i] = np.linalg.cholesky(k[:n, :n] - told.T @ told + 1e-12 * np.eye(n))
    return out.reshape(3 * n, 3 * n)


def look(ride: Ride, base: list[Use], s: Setting, stamps: Array, spread: Array | None = None) -> View:
    """What the beams of a drive meet."""
    m, path = simulate(ride.drive, base, ride.pose)
    return view(path, (m.v, m.w), stamps, ride.drive.start, s, ride.drive.columns, spread)


def light(rides: list[Ride], base: list[Use], fan: Fan, room: Room, noise: Noise) -> Light:
    """Cast the scans of the model."""
    s = setting(fan, room, [])
    views = [look(ride, base, s, ride.scans) for ride in rides]
    good, sd = (np.concatenate([getattr(v, key) for v in views]) for key in ("good", "sd"))
    slopes = np.where(good[..., None], np.concatenate([_slopes(v, s) for v in views]), 0.0) / sd[..., None]
    roots = [_root(ride, base, noise) for ride in rides]
    return Light(rides, base, fan, room, views, good.astype(float), sd, slopes, roots)


def marked(s: Setting, m: Array) -> Setting:
    """The laser as seen from a marker that sits elsewhere on the chair."""
    c, n = np.cos(m[2]), np.sin(m[2])
    x, y = s.x - m[0], s.y - m[1]
    s.x, s.y, s.yaw = c * x + n * y, -n * x + c * y, s.yaw - m[2]
    return s


def response(lit: Light, use: Use) -> Array | None:
    """What an effect does to the readings, whitened, or to the log of their sd; None where it has no such thing."""
    stage = use.effect.stage
    if stage == 11:
        return lit.white(lit.flat([use.law(v, use) for v in lit.views]) / lit.sd, lit.slopes)
    if stage == 12:
        return np.asarray(np.sqrt(2 * lit.free()) * lit.flat([np.log(use.law(v, use)) for v in lit.views]))
    if stage == 10 or "marker" in use.id:
        s = setting(lit.fan, lit.room, [use])
        if stage == 5:
            s = marked(s, use.law(np.zeros(3), None, use, "marker"))
        views = [look(ride, lit.base, s, ride.scans) for ride in lit.rides]
        same = np.concatenate([a.side == b.side for a, b in zip(views, lit.views, strict=True)])
        d = lit.flat([a.r - b.r for a, b in zip(views, lit.views, strict=True)]) / lit.sd
        mean = (lit.slopes + np.concatenate([_slopes(v, s) for v in views]) / lit.sd[..., None]) / 2
        return lit.white(np.where(same, d, 0.0), np.where((same & (lit.mask > 0))[..., None], mean, 0.0))
    return None


def vector(lit: Light, use: Use) -> Array:
    """The whitened response, effects on the scatter behind those on the mean."""
    plain = response(lit, use)
    out = [np.zeros(lit.mask.size + 3 * len(lit.mask)), np.zeros(lit.mask.size)]
    if plain is not None:
        out[use.effect.stage == 12] = plain.ravel()
    return np.concatenate(out)


def _tails(use: Use) -> float:
    """How far the tails are from a normal of the same sd, in nats a reading."""
    x = np.linspace(-60, 60, 60001)
    if use.other:
        f = 0.95 * norm.pdf(x) + 0.05 * norm.pdf(x, scale=1 + 8 * use.size)
    else:
        width = np.sqrt(1 - 2 * use.size)
        f = t.pdf(x / width, 1 / use.size) / width
    sd = np.sqrt(np.sum(f * x**2) / np.sum(f))
    return float(np.sum(f * (np.log(f + 1e-300) - norm.logpdf(x, scale=sd))) * (x[1] - x[0]))


def _lost(share: Array) -> float:
    """Twice the nats by which lost readings are more than usual."""
    p = np.clip(share + LOST, 0, 0.99)
    return float(2 * np.sum(p * np.log(p / LOST) + (1 - p) * np.log((1 - p) / (1 - LOST))))


def _shared(lit: Light, rho: float) -> Array:
    """Power of errors that all beams of a scan share, along axes that whiten those of neighbouring scans."""
    out = []
    for root, b, a in lit.parts(lit.mask / lit.sd, lit.slopes):
        at = np.arange(len(b))
        pull = np.einsum("kni,kn,kij->kj", a, b, root.reshape(len(b), 3, -1), optimize=True)
        gram = np.diag(np.sum(b**2, axis=1)) - pull @ np.linalg.solve(_normal(root, a), pull.T)
        walk = np.linalg.cholesky(rho ** np.abs(at[:, None] - at))
        out.append(np.maximum(np.linalg.eigvalsh(walk.T @ gram @ walk), 0.0))
    return np.concatenate(out)


def scatter(lit: Light, use: Use) -> float:
    """Z of an effect that has no mean: the root of twice the expected log likelihood ratio."""
    n, size = float(lit.free().sum()), use.size
    if use.id == "laser.common_mode":
        share = size**2 * _shared(lit, use.aux["rho"])
        return float(np.sqrt(np.sum(share - np.log1p(share))))
    if use.id == "laser.heavy_tails":
        return float(np.sqrt(2 * n * _tails(use)))
    mean = np.concatenate([v.mean for v in lit.views])
    over = np.maximum(mean - FAR / (1 + size), 0.0)[lit.mask > 0] if use.id == "laser.saturation" else np.zeros(1)
    oblique = np.concatenate([1 - v.cosine for v in lit.views])[lit.mask > 0]
    squares = {
        "laser.beam_correlation": -n * np.log(max(1 - size**2 / (1 + size**2 / 2 * use.other) ** 2, 1e-3)),
        "laser.mixed_pixels": 64 * size * float((np.concatenate([v.edge for v in lit.views]) * lit.mask).sum()),
        "laser.dropout": _lost(size * (2.5 * oblique if use.other else np.ones_like(oblique))),
        "laser.saturation": float(np.sum(np.minimum((over / 0.003) ** 2, 64 if use.other else 12.4))),
        "laser.crosstalk": 64 * n * size * 0.3 / (lit.fan.beams * lit.fan.angle_increment),
        "laser.quantisation": float(np.sum(lit.mask * size**2 / 12 / lit.sd**2)),
    }
    return float(np.sqrt(squares[use.id]))


def strength(lit: Light, use: Use) -> float:
    """Z as it is asked for: beside the errors of poses; of scatter, by likelihood."""
    if use.effect.stage == 12:
        ratio = np.concatenate([use.law(v, use) for v in lit.views]) ** 2
        return float(np.sqrt(np.sum(lit.free() * (ratio - 1 - np.log(ratio)))))
    plain = response(lit, use)
    return scatter(lit, use) if plain is None else float(np.linalg.norm(plain))


def rivals(lit: Light, rng: Rng) -> dict[str, Array]:
    """The whitened responses of all effects that have one, at their usual sizes."""
    aux = {"phase": float(rng.uniform(0, 6)), "seed": 1, "tau": 300.0, "wavelength": 3.0}
    return {name: vector(lit, Use(e, e.size, False, aux)) for name, e in LASER.items() if e.stage < 13}
