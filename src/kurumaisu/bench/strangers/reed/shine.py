# SPDX-License-Identifier: BSD-3-Clause
"""How clearly an effect of the laser shows in the scans of a recording."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.stats import norm, t

from kurumaisu.bench.strangers.reed.core import Array, Noise, Use, simulate
from kurumaisu.bench.strangers.reed.laser import FAR, Fan, Setting, View, setting, view
from kurumaisu.bench.strangers.reed.lasers import LASER, Rng
from kurumaisu.bench.strangers.reed.room import Room
from kurumaisu.bench.strangers.reed.score import Ride

LOST = 0.002


@dataclass
class Light:
    """The scans of the drives to fit: the model's views, and the pose's share of each."""

    rides: list[Ride]
    base: list[Use]
    fan: Fan
    room: Room
    views: list[View]
    mask: Array
    sd: Array
    spread: Array

    def flat(self, values: list[Array]) -> Array:
        """Whatever each view gives, scans in rows, 0 where a beam does not count."""
        return np.where(self.mask > 0, np.concatenate(values), 0.0)

    def white(self, plain: Array) -> Array:
        """Whiten by the errors of the poses, too."""
        u, s, _ = np.linalg.svd(self.spread, full_matrices=False)
        part = np.einsum("kni,kn->ki", u, plain) * (1 / np.sqrt(1 + s**2) - 1)
        return np.asarray((plain + np.einsum("kni,ki->kn", u, part)).ravel())


def look(ride: Ride, base: list[Use], s: Setting, stamps: Array, spread: Array | None = None) -> View:
    """What the beams of a drive meet."""
    m, path = simulate(ride.drive, base, ride.pose)
    return view(path, (m.v, m.w), stamps, ride.drive.start, s, ride.drive.columns, spread)


def light(rides: list[Ride], base: list[Use], fan: Fan, room: Room, noise: Noise) -> Light:
    """Cast the scans of the model, and those with its pose moved a little."""
    s = setting(fan, room, [])
    views = [look(ride, base, s, ride.scans) for ride in rides]
    flat = [np.concatenate([getattr(v, key) for v in views]) for key in ("good", "sd", "r", "side")]
    columns = []
    for k, err in enumerate((noise.pos, noise.pos, noise.head)):
        moved = [look(ride, base, s, ride.scans, np.eye(3)[k] * err * np.ones((len(ride.scans), 1))) for ride in rides]
        same = np.concatenate([v.side for v in moved]) == flat[3]
        columns.append(np.where(same & flat[0], (np.concatenate([v.r for v in moved]) - flat[2]) / flat[1], 0.0))
    return Light(rides, base, fan, room, views, flat[0].astype(float), flat[1], np.stack(columns, axis=2))


def marked(s: Setting, m: Array) -> Setting:
    """The laser as seen from a marker that sits elsewhere on the chair."""
    c, n = np.cos(m[2]), np.sin(m[2])
    x, y = s.x - m[0], s.y - m[1]
    s.x, s.y, s.yaw = c * x + n * y, -n * x + c * y, s.yaw - m[2]
    return s


def response(lit: Light, use: Use) -> Array | None:
    """What an effect does to the readings over their sd; None where it has no such thing."""
    stage = use.effect.stage
    if stage == 11:
        return lit.flat([use.law(v, use) for v in lit.views]) / lit.sd
    if stage == 12:
        return lit.flat([np.sqrt(2) * np.log(use.law(v, use)) for v in lit.views])
    if stage == 10 or "marker" in use.id:
        s = setting(lit.fan, lit.room, [use])
        if stage == 5:
            s = marked(s, use.law(np.zeros(3), None, use, "marker"))
        views = [look(ride, lit.base, s, ride.scans) for ride in lit.rides]
        same = [a.side == b.side for a, b in zip(views, lit.views, strict=True)]
        d = [np.where(k, a.r - b.r, 0.0) for k, a, b in zip(same, views, lit.views, strict=True)]
        return lit.flat(d) / lit.sd
    return None


def vector(lit: Light, use: Use) -> Array:
    """The whitened response, effects on the scatter behind those on the mean."""
    plain = response(lit, use)
    none = np.zeros(lit.mask.size)
    if plain is None:
        return np.concatenate([none, none])
    return np.concatenate([none, plain.ravel()] if use.effect.stage == 12 else [lit.white(plain), none])


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


def scatter(lit: Light, use: Use) -> float:
    """Z of an effect that has no mean: the root of twice the expected log likelihood ratio."""
    n, size = float(lit.mask.sum()), use.size
    if use.id == "laser.common_mode":
        share = size**2 * np.sum(lit.white(lit.mask / lit.sd).reshape(lit.mask.shape) ** 2, axis=1)
        return float(np.sqrt(np.sum(share - np.log1p(share))))
    if use.id == "laser.heavy_tails":
        return float(np.sqrt(2 * n * _tails(use)))
    mean = np.concatenate([v.mean for v in lit.views])
    over = np.maximum(mean - FAR / (1 + size), 0.0)[lit.mask > 0] if use.id == "laser.saturation" else np.zeros(1)
    oblique = np.concatenate([1 - v.cosine for v in lit.views])[lit.mask > 0]
    squares = {
        "laser.beam_correlation": -n * np.log(max(1 - size**2 / (1 + size**2 / 2 * use.other) ** 2, 1e-3)),
        "laser.mixed_pixels": 64 * size * float((np.concatenate([v.edge for v in lit.views]) * lit.mask).sum()),
        "laser.dropout": _lost(size * (2.5 * oblique if use.other else np.ones(int(n)))),
        "laser.saturation": float(np.sum(np.minimum((over / 0.003) ** 2, 64 if use.other else 12.4))),
        "laser.crosstalk": 64 * n * size * 0.3 / (lit.fan.beams * lit.fan.angle_increment),
        "laser.quantisation": float(np.sum(lit.mask * size**2 / 12 / lit.sd**2)),
    }
    return float(np.sqrt(squares[use.id]))


def strength(lit: Light, use: Use) -> float:
    """Z as it is asked for: without the errors of poses; of scatter, by likelihood."""
    plain = response(lit, use)
    if plain is None:
        return scatter(lit, use)
    if use.effect.stage == 12:
        ratio = np.exp(np.sqrt(2) * plain[lit.mask > 0])
        return float(np.sqrt(np.sum(ratio - 1 - np.log(ratio))))
    return float(np.linalg.norm(plain))


def rivals(lit: Light, rng: Rng) -> dict[str, Array]:
    """The whitened responses of all effects that have one, at their usual sizes."""
    aux = {"phase": float(rng.uniform(0, 6)), "seed": 1, "tau": 300.0, "wavelength": 3.0}
    return {name: vector(lit, Use(e, e.size, False, aux)) for name, e in LASER.items() if e.stage < 13}
