# SPDX-License-Identifier: BSD-3-Clause
"""The laser: where its beams end, what it makes of that, and the whitening of its readings.

C, the covariance of the readings of one scan, is the laser's own variance (with that of 1 mm steps) and what the error
of the reference's pose makes of it, J P J'. One reading counts for 5 sd at most, those at edges only for what acts at
edges (sd 5 cm). Effects of the noise have no mean: for them the whitened change of a reading is sqrt(2 KL), KL the
divergence of its distribution with from that without, in a part of its own (scatter, pairs of neighbours, tails); for
small changes that is the norm of the change in the Fisher metric.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.stats import norm
from scipy.stats import t as student

from .noise import Noise
from .odd import events
from .plant import DT, TWO_PI, Arr, Cause, Path
from .world import Room, moved

SCALE, DATUM, SIGMA = 1.004587, 0.058826, (0.002334, -0.000488, 0.000199)
HEIGHT, BEAM_TIME = 0.40, 9.765625e-5


@dataclass
class Fan:
    """The recorded part of the model's fan: every k-th beam."""

    every: int
    x: float = 0.30
    y: float = 0.0
    yaw: float = 0.0

    @property
    def bearing(self) -> Arr:
        """Angles of the recorded beams."""
        return np.asarray(-2.086214 + 0.006135923 * np.arange(0, 682, self.every))


@dataclass
class Scene:
    """What the beams of some scans meet (scans x beams), and how that changes with the pose (.., 3) and with time."""

    t: Arr  # since the start of the run
    since_on: Arr
    speed: Arr  # scans x 2
    r: Arr
    met: Arr
    oblique: Arr  # 1 / cos of the incidence
    jacobian: Arr
    turned: Arr  # by the beam's own angle
    late: Arr  # by time
    nearest: Arr  # derivative by a shift of the wall along its normal
    bearing: Arr
    heading: Arr
    dark: Arr
    edge: NDArray[np.bool_]
    columns: dict[str, Arr] = field(default_factory=dict)


def look(path: Path, t: Arr, start: float, room: Room, fan: Fan, causes: list[Cause], columns: dict[str, Arr]) -> Scene:
    """Cast all beams, each from where the chair is at its own time."""
    p: dict[str, float] = {}
    for c in causes:
        if c.id.startswith(("laser.mount", "laser.tilt", "laser.sweep", "laser.latency", "laser.clock_skew")):
            p.update({**c.p, "other": float(c.form == "other")})
    phi = fan.bearing
    late = p.get("delay", 0.0) + p.get("skew", 0.0) * t
    if p.get("other") and "delay" in p:  # the driver's queue fills and is emptied
        late = late * 2 * ((t / 7.3) % 1.0)
    times = (t - late)[:, None] + np.arange(len(phi)) * (fan.every * BEAM_TIME * (1 + p.get("stretch", 0.0)))
    clock = np.arange(len(path.v)) * DT
    x, y, th = (np.interp(times, clock, path.pose[:, i]) for i in range(3))
    v, w = np.interp(times, clock, path.v), np.interp(times, clock, path.w)
    mx, my = fan.x + p.get("x", 0.0), fan.y + p.get("y", 0.0)
    cos, sin = np.cos(th), np.sin(th)
    lever = np.stack([mx * cos - my * sin, mx * sin + my * cos], axis=-1)
    angle = th + fan.yaw + p.get("yaw", 0.0) + phi
    unit = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    r0, met0, normal = room.cast((np.stack([x, y], axis=-1) + lever).reshape(-1, 2), unit.reshape(-1, 2))
    r, met, n = r0.reshape(x.shape), met0.reshape(x.shape), normal.reshape((*x.shape, 2))
    facing = np.minimum(np.sum(unit * n, axis=-1), -0.02)
    rise = p.get("pitch", 0.0) * np.cos(phi) + p.get("roll", 0.0) * np.sin(phi)
    if np.any(rise):
        floor = np.where(rise > 1e-6, HEIGHT / np.sin(np.maximum(rise, 1e-6)), np.inf)
        r = np.minimum(r / np.cos(rise), floor)
    shift = -n / facing[..., None]
    shift[met < 0] = 0
    safe = np.where(np.isfinite(r), r, 0.0)
    turned = -safe * (-unit[..., 1] * n[..., 0] + unit[..., 0] * n[..., 1]) / facing
    d_th = turned + shift[..., 0] * -lever[..., 1] + shift[..., 1] * lever[..., 0]
    jump = np.abs(np.diff(np.minimum(np.where(np.isfinite(r), r, 9.0), 9.0), axis=1)) > 0.12
    edge = np.pad(jump, ((0, 0), (1, 0))) | np.pad(jump, ((0, 0), (0, 1)))
    by_time = (shift[..., 0] * cos + shift[..., 1] * sin) * v + d_th * w
    return Scene(
        t, t + start, np.stack([v[:, 0], w[:, 0]], axis=1), r, met.astype(float), -1 / facing,
        np.stack([shift[..., 0], shift[..., 1], d_th], axis=-1), turned, by_time, 1 / facing, phi, th,
        np.where(met >= 0, room.dark[met], False).astype(float), edge, columns,
    )  # fmt: skip


def really(room: Room, causes: list[Cause]) -> Room:
    """The room without the errors of its map."""
    for c in causes:
        if c.id == "world.map_error":
            shifts = np.random.default_rng(int(c.p["seed"])).standard_normal((len(room.boxes), 2)) * c.p["sd"]
            if c.form == "other":  # only the furniture was pushed
                shifts[:4] = 0
            return moved(room, shifts)
    return room


def sigma(r: Arr) -> Arr:
    """Equation (4)."""
    return np.asarray(SIGMA[0] + SIGMA[1] * r + SIGMA[2] * r * r)


def _cyclic(s: Scene, c: Cause) -> Arr:
    x = TWO_PI * np.minimum(s.r, 9) / c.p["wavelength"] + c.p["phase"]
    return np.asarray(
        c.p["amplitude"] * (np.sin(x) if c.form == "plain" else 2 / np.pi * np.arcsin(np.sin(x)) * s.r / 2)
    )


def _beam(s: Scene, c: Cause) -> Arr:
    each = np.random.default_rng(int(c.p["seed"])).standard_normal(len(s.bearing))
    return np.asarray(np.broadcast_to(c.p["sd"] * each, s.r.shape))


def _warm(s: Scene, c: Cause) -> Arr:
    x = s.since_on / c.p["tau"]
    return np.asarray((c.p["amplitude"] * (np.exp(-x) if c.form == "plain" else np.maximum(1 - x / 2, 0)))[:, None])


def _heat(s: Scene, c: Cause) -> Arr:
    return np.asarray(c.p["coefficient"] * (s.columns["temperature"] - 20.0))[:, None]


Bias = Callable[[Scene, Cause], Arr]
BIASES: dict[str, Bias] = {
    "laser.offset": lambda s, c: np.full(s.r.shape, c.p["offset"]),
    "laser.scale": lambda s, c: c.p["scale"] * (s.r if c.form == "plain" else s.r**4 / 27),
    "laser.quadratic": lambda s, c: c.p["quadratic"] * s.r**2,
    "laser.warmup": _warm,
    "laser.temperature": _heat,
    "laser.cyclic": _cyclic,
    "laser.incidence_bias": lambda s, c: c.p["k"] * (s.oblique - 1 if c.form == "plain" else 4.0 * (s.oblique > 1.8)),
    "laser.reflectance": lambda s, c: c.p["bias"] * s.dark,
    "laser.beam_bias": _beam,
    "laser.odd_gain_switch": lambda s, c: c.p["a"] * np.tanh((s.r - c.p["at"]) / 0.08) * (s.r < 2.9),
    "laser.odd_lamp": lambda s, c: c.p["a"] * s.columns["lamp"][:, None],
    "laser.odd_swing": lambda s, c: c.p["a"] * np.sin(TWO_PI * s.since_on / c.p["period"] + c.p["phase"])[:, None],
    "laser.odd_flex": lambda s, c: c.p["a"] * s.speed[:, 1:2],
}
SPREADS: dict[str, Bias] = {
    "laser.range_noise": lambda s, c: (
        c.p["share"] * (np.ones(s.r.shape) if c.form == "plain" else np.minimum(s.r, 4.0) ** 2 / 4)
    ),
    "laser.incidence_noise": lambda s, c: c.p["gain"] * (s.oblique - 1 if c.form == "plain" else 3.0 * (s.oblique > 2)),
    "laser.odd_dirt": lambda s, c: (
        c.p["a"] * np.broadcast_to(np.exp(-(((s.bearing - c.p["at"]) / 0.2) ** 2)), s.r.shape)
    ),
    "laser.odd_shake": lambda s, c: c.p["a"] * np.broadcast_to(np.abs(s.speed[:, 1:2]), s.r.shape),
    "laser.odd_sun": lambda s, c: c.p["a"] * np.exp(3 * (np.cos(s.heading + s.bearing - c.p["at"]) - 1)),
}


def spread(s: Scene, causes: list[Cause]) -> Arr:
    """By how much the sd is larger than equation (4)'s."""
    factor = np.ones(s.r.shape)
    for c in causes:
        if c.id in SPREADS:
            factor = factor * np.maximum(1 + SPREADS[c.id](s, c), 0.2)
    return factor


@dataclass
class Dice:
    """The random numbers of some scans, kept so that effects can be compared on the same ones."""

    z: Arr
    u: Arr
    k: Arr


def throw(rng: np.random.Generator, shape: tuple[int, ...]) -> Dice:
    """New ones."""
    return Dice(rng.standard_normal(shape), rng.random(shape), rng.random(shape))


def mean(s: Scene, causes: list[Cause]) -> Arr:
    """Expected reading, before steps and gate."""
    far = np.where(np.isfinite(s.r), s.r, 99.0)
    mu = SCALE * far + DATUM
    for c in causes:
        if c.id in BIASES:
            mu = mu + np.where(far < 9, BIASES[c.id](s, c), 0.0)
    return np.asarray(mu)


def errors(z: Arr, causes: list[Cause]) -> Arr:
    """Normal errors, or those of a laser whose errors are not."""
    for c in causes:
        if c.id == "laser.beam_correlation":
            rho, out = c.p["rho"], z.copy()
            if c.form == "other":  # pairs share a receiver
                out[:, 1::2] = rho * z[:, : 2 * out[:, 1::2].shape[1] : 2] + np.sqrt(1 - rho**2) * z[:, 1::2]
                return out
            for i in range(1, z.shape[1]):
                out[:, i] = rho * out[:, i - 1] + np.sqrt(1 - rho**2) * z[:, i]
            z = out
        if c.id == "laser.heavy_tails":
            nu = 1 / c.p["inverse_nu"]
            z = student.ppf(norm.cdf(z), nu) * np.sqrt((nu - 2) / nu)
    return z


def raw(s: Scene, causes: list[Cause], dice: Dice) -> Arr:
    """Readings before the rounding, with what replaces them at times."""
    y = mean(s, causes) + sigma(np.minimum(s.r, 6)) * spread(s, causes) * errors(dice.z, causes)
    for c in causes:
        if c.id == "laser.mixed_pixels":
            r = np.where(np.isfinite(s.r), s.r, 5.5)
            side = np.stack([np.pad(r, ((0, 0), (1, 0)), "edge")[:, :-1], np.pad(r, ((0, 0), (0, 1)), "edge")[:, 1:]])
            gap = side.max(axis=0) - r
            where = (gap > 0.1) & (dice.u < c.p["probability"])
            y = np.where(where, y + gap * (dice.k if c.form == "plain" else dice.k**0.3), y)
        if c.id == "laser.crosstalk":
            on = (
                events(s.since_on, int(c.p["seed"]), 4.0, 1.0)
                if c.form == "other"
                else dice.u[:, :1].T[0] < c.p["probability"]
            )
            at = c.p["drift"] * s.since_on % 4.2 - 2.1
            where = (np.abs(s.bearing - at[:, None]) < 0.5 * c.p["width"]) & (on > 0)[:, None]
            y = np.where(where, 0.1 + dice.k * (c.p["reach"] - 0.1), y)
    return saturated(y, causes)


def saturated(y: Arr, causes: list[Cause]) -> Arr:
    """Cut off at the largest value, or bent towards it."""
    for c in causes:
        if c.id == "laser.saturation":
            far = 4.0 - c.p["cut"]
            less = np.minimum(y, far) if c.form == "plain" else y - 0.6 * np.maximum(y - far, 0)
            y = np.where(y < 4.0005, less, y)
    return np.asarray(y)


def rounded(y: Arr, causes: list[Cause]) -> Arr:
    """In steps, gated: nan below, inf above."""
    for c in causes:
        if c.id == "laser.quantisation":
            y = (np.floor if c.form == "other" else np.round)(y / c.p["step"]) * c.p["step"]
    y = np.round(y, 3)
    return np.where(y < 0.06, np.nan, np.where(y > 4.0, np.inf, y))


class Readings:
    """The scans of the runs to fit, and the whitening of changes of their readings."""

    def __init__(self, scenes: list[Scene], dice: list[Dice], noise: Noise) -> None:
        self.scenes, self.dice = scenes, dice
        self.valid = [rounded(mean(s, []), []) < 3.99 for s in scenes]
        self.sd = [np.where(s.edge, 0.05, np.sqrt(sigma(np.minimum(s.r, 6)) ** 2 + 1e-6 / 12)) for s in scenes]
        self.bases: list[list[tuple[Arr, Arr]]] = []
        for s, sd, ok in zip(scenes, self.sd, self.valid, strict=True):
            rows = []
            for i in range(len(s.t)):
                p = pose_cov(noise, s.heading[i, 0], s.speed[i])
                inner = (~s.edge[i] / sd[i])[ok[i]]
                g = s.jacobian[i][ok[i]] * inner[:, None] @ np.linalg.cholesky(p)
                u, size, _ = np.linalg.svd(g, full_matrices=False)
                rows.append((u, 1 - 1 / np.sqrt(1 + size**2)))
            self.bases.append(rows)

    def whiten(self, changes: list[Arr]) -> Arr:
        """Changes of the mean (scans x beams x columns) of each run, whitened."""
        out = []
        for y, sd, ok, rows in zip(changes, self.sd, self.valid, self.bases, strict=True):
            for i, (u, less) in enumerate(rows):
                e = np.clip(y[i][ok[i]] / sd[i][ok[i], None], -5, 5)
                out.append(e - u @ (less[:, None] * (u.T @ e)))
        return np.concatenate(out)

    def change(self, scenes: list[Scene], causes: list[Cause], less: list[Scene], fewer: list[Cause]) -> Arr:
        """What some causes change beside others: whitened mean, then scatter, pairs, tails."""
        steps = any(c.id == "laser.quantisation" for c in causes)
        edges = any(c.id in ("laser.mixed_pixels", "laser.crosstalk") for c in set(causes) ^ set(fewer))
        quiet = ("laser.beam_correlation", "laser.heavy_tails", *SPREADS)
        a, b = ([c for c in group if c.id not in quiet] for group in (causes, fewer))
        means, ratio = [], []
        for s, o, dice in zip(scenes, less, self.dice, strict=True):
            y, x = raw(s, a, dice), raw(o, b, dice)
            y, x = np.minimum(y, 50.0), np.minimum(x, 50.0)
            d = np.nan_to_num(rounded(y, a), posinf=99) - np.nan_to_num(rounded(x, b), posinf=99) if steps else y - x
            off = ~np.isfinite(d) | (np.abs(d) > 9) | ((s.edge | o.edge) & (not edges))
            means.append(np.where(off, 0.0, d)[..., None])
            ratio.append((spread(s, causes) / spread(o, fewer)) ** 2)
        whole = np.concatenate(
            [
                (np.sign(r - 1) * np.sqrt(np.maximum(r - 1 - np.log(r), 0)))[ok]
                for r, ok in zip(ratio, self.valid, strict=True)
            ]
        )
        extra = [part(causes) - part(fewer) for part in (pair_size, tail_size)]
        n = np.sqrt(float(len(whole)))
        return np.concatenate([self.whiten(means)[:, 0], whole, np.array(extra) * n])

    def rivals(self) -> list[tuple[str, Arr]]:
        """Linearised signals of the catalogue: id, columns, in the same space as `change`."""
        names, means, scatter = columns(self.scenes)
        white = self.whiten(means)
        flat = np.concatenate([s[ok] for s, ok in zip(scatter, self.valid, strict=True)])
        m, k = white.shape[1], flat.shape[1]
        both = np.zeros((len(white) + len(flat) + 2, m + k))
        both[: len(white), :m], both[len(white) : -2, m:] = white, flat
        ids = sorted(set(names))
        return [(i.split("|")[0], both[:, [j for j, name in enumerate(names) if name == i]]) for i in ids]


def pair_size(causes: list[Cause]) -> float:
    """Sqrt(2 KL) per reading of correlated neighbours."""
    for c in causes:
        if c.id == "laser.beam_correlation":
            return float(np.sqrt(-np.log(1 - c.p["rho"] ** 2) * (0.5 if c.form == "other" else 1.0)))
    return 0.0


def tail_size(causes: list[Cause]) -> float:
    """Sqrt(2 KL) per reading of Student's t from the normal distribution of the same sd."""
    for c in causes:
        if c.id == "laser.heavy_tails":
            nu = 1 / c.p["inverse_nu"]
            unit = np.sqrt((nu - 2) / nu)
            z = np.linspace(-60, 60, 40001)
            q = student.pdf(z / unit, nu) / unit
            return float(np.sqrt(2 * np.sum(q * (np.log(q) - norm.logpdf(z))) * (z[1] - z[0])))
    return 0.0


def pose_cov(noise: Noise, heading: float, speed: Arr) -> Arr:
    """Covariance of the reference's pose at a scan."""
    along = np.array([speed[0] * np.cos(heading), speed[0] * np.sin(heading), speed[1]]) * noise.jitter
    place, head = noise.position**2 + noise.drift[0] ** 2, noise.heading**2 + noise.drift[1] ** 2
    return np.asarray(np.diag([place, place, head]) + np.outer(along, along))


def columns(scenes: list[Scene]) -> tuple[list[str], list[Arr], list[Arr]]:
    """Names of the linearised effects, and their columns per run: of the mean, of the scatter."""
    means, scatter = [], []
    for s in scenes:
        one, r = np.ones(s.r.shape), np.where(np.isfinite(s.r), s.r, 0.0)
        c, n = np.cos(s.heading), np.sin(s.heading)
        jx, jy = s.jacobian[..., 0], s.jacobian[..., 1]
        x = TWO_PI * r / 3.0
        named: list[tuple[str, Arr]] = [
            ("laser.mount_x", jx * c + jy * n), ("laser.mount_y", jy * c - jx * n), ("laser.mount_yaw", s.turned),
            ("laser.sweep", s.late * np.linspace(0, 1, r.shape[1])), ("laser.latency", s.late),
            ("laser.clock_skew", s.late * s.t[:, None]), ("laser.offset", one), ("laser.scale", r),
            ("laser.quadratic", r * r), ("laser.incidence_bias", s.oblique - 1), ("laser.reflectance", s.dark),
            ("laser.cyclic", np.sin(x)), ("laser.cyclic", np.cos(x)),
            ("laser.temperature", one * (s.columns["temperature"] - 20)[:, None]),
            ("laser.beam_bias", one * np.sin(s.bearing)), ("laser.beam_bias", one * np.cos(s.bearing)),
        ]  # fmt: skip
        named += [(f"laser.warmup|{tau}", one * np.exp(-s.since_on / tau)[:, None]) for tau in (60, 300, 900)]
        named += [(f"laser.tilt|{k}", r * np.cos(s.bearing - k * np.pi / 8) ** 2) for k in range(8)]
        named += [("world.map_error", s.nearest * (s.met == k)) for k in range(4)]
        noisy = [
            ("laser.range_noise", one), ("laser.range_noise", r),
            ("laser.incidence_noise", s.oblique - 1), ("laser.reflectance", s.dark),
        ]  # fmt: skip
        means.append(np.stack([a for _, a in named], axis=-1) * np.where(s.edge, 0.0, 1e-4)[..., None])
        scatter.append(np.stack([a for _, a in noisy], axis=-1))
    return [name for name, _ in named] + [name for name, _ in noisy], means, scatter
