# SPDX-License-Identifier: BSD-3-Clause
"""Effects that no sentence of the catalogue describes, and the scatter of readings by causes of the catalogue."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.stats import laplace, norm, t

from .base import State
from .laser import SPREAD, Look, gate, speeds, width
from .model import STEP, Cause, F, Run, arr, wrap

P = dict[str, float]


@dataclass
class Sort:
    """Where an unknown effect shows, and what it follows; `a` is its usual size."""

    channel: str
    covariates: tuple[str, ...]
    a: float
    column: str = ""


def _bump(z: F, at: float, wide: float) -> F:
    return arr(np.exp(-0.5 * ((z - at) / wide) ** 2))


def _around(z: F, at: float, wide: float) -> F:
    return arr(np.exp(-0.5 * (wrap(z - at) / wide) ** 2))


def _far(s: State) -> F:
    return np.cumsum(np.abs(s.v) * s.dt)


def _moves(s: State) -> F:
    return np.where(np.abs(s.v) > 0.02, 1.0, 0.0)


def _turns(s: State) -> F:
    return np.where(np.abs(s.w) > 0.02, 1.0, 0.0)


def _puls(s: State) -> F:
    """Moments now and then."""
    rng, t = np.random.default_rng(s.run.seed + 7), s.mid
    out = np.zeros(len(t))
    for at in np.cumsum(rng.exponential(9.0, 40) + 1.0):
        out[(t > at) & (t < at + rng.uniform(0.3, 0.8))] = 1.0
    return out


def _v(s: State, more: F) -> None:
    s.v = s.v + more


def _w(s: State, more: F) -> None:
    s.w = s.w + more


def _unit(run: Run, name: str, t: F) -> F:
    """A column, about -1 to 1: drive.columns makes it so."""
    return (run.column(name, t) - 10) / 2


Act = Callable[[State, P, int], None]
RATES: dict[str, Act] = {
    "unknown.v.abs_w": lambda s, p, f: _v(s, p["a"] * s.v * _bump(np.abs(s.w), 0.4 + 0.2 * p["q"], 0.12)),
    "unknown.v.x": lambda s, p, f: _v(s, p["a"] * s.v * _bump(s.x, p["q"] - 0.5, 0.5)),
    "unknown.v.y": lambda s, p, f: _v(s, p["a"] * s.v * np.tanh((s.y + 0.5 - p["q"]) / 0.15)),
    "unknown.v.distance": lambda s, p, f: _v(s, p["a"] * s.v * np.sin(2 * np.pi * _far(s) / (0.7 + p["q"]))),
    "unknown.w.distance": lambda s, p, f: _w(s, p["a"] * np.abs(s.v) * np.sin(2 * np.pi * _far(s) / (0.7 + p["q"]))),
    "unknown.w.t": lambda s, p, f: _w(s, p["a"] * _moves(s) * np.sin(s.mid / (2 + 4 * p["q"]))),
    "unknown.v.t": lambda s, p, f: _v(s, p["a"] * s.v * np.where(s.mid > 12 + 20 * p["q"], 1.0, 0.0)),
    "unknown.w.heading": lambda s, p, f: _w(s, p["a"] * _moves(s) * np.sin(2 * s.th + 6 * p["q"])),
    "unknown.w.x": lambda s, p, f: _w(s, p["a"] * _moves(s) * np.sin(3 * s.x + 6 * p["q"])),
    "unknown.v.heading": lambda s, p, f: _v(s, p["a"] * s.v * np.cos(3 * s.th + 6 * p["q"])),
    "unknown.w.v": lambda s, p, f: _w(s, p["a"] * _bump(s.v, 0.25 + 0.1 * p["q"], 0.07)),
    "unknown.v.v": lambda s, p, f: _v(s, -p["a"] * np.sign(s.v) * _bump(np.abs(s.v), 0.25 + 0.1 * p["q"], 0.06)),
    "unknown.w.w": lambda s, p, f: _w(s, p["a"] * np.sign(s.w) * _bump(np.abs(s.w), 0.35 + 0.2 * p["q"], 0.07)),
    "unknown.v.age": lambda s, p, f: _v(s, p["a"] * s.v * -(1 - np.exp(-s.age / 0.4))),
    "unknown.w.tyre": lambda s, p, f: _w(s, p["a"] * s.v * _unit(s.run, "tyre", s.mid)),
    "unknown.v.load": lambda s, p, f: _v(s, p["a"] * s.v * _unit(s.run, "load", s.mid)),
    "unknown.w.motor": lambda s, p, f: _w(s, p["a"] * s.w * np.abs(_unit(s.run, "motor", s.mid))),
    "unknown.w.comes": lambda s, p, f: _w(s, p["a"] * _puls(s)),
    "unknown.v.comes": lambda s, p, f: _v(s, p["a"] * s.v * _puls(s)),
    "unknown.w.y": lambda s, p, f: _w(s, p["a"] * s.v * np.tanh((s.y + 0.5 - p["q"]) / 0.2)),
}
Refer = Callable[[Run, P, F, F, F, F], tuple[F, F, F]]
REFERENCE: dict[str, Refer] = {
    "unknown.heading.heading": lambda r, p, x, y, th, t: (0 * t, 0 * t, p["a"] * np.sin(th + 6 * p["q"])),
    "unknown.heading.t": lambda r, p, x, y, th, t: (0 * t, 0 * t, p["a"] * np.sin(t / (2 + 3 * p["q"]))),
    "unknown.position.x": lambda r, p, x, y, th, t: (p["a"] * np.sin(2.5 * x + 6 * p["q"]), 0 * t, 0 * t),
    "unknown.position.t": lambda r, p, x, y, th, t: (p["a"] * np.sin(t / (1 + 2 * p["q"])), 0 * t, 0 * t),
    "unknown.position.y": lambda r, p, x, y, th, t: (0 * t, p["a"] * np.sin(2.5 * y + 6 * p["q"]), 0 * t),
}
Read = Callable[[Look, P], F]
RANGE: dict[str, Read] = {
    "unknown.range.direction": lambda k, p: p["a"] * _around(k.direction, 6 * p["q"], 0.4),
    "unknown.range.heading": lambda k, p: p["a"] * np.sin(2 * k.th + 6 * p["q"]),
    "unknown.range.x": lambda k, p: p["a"] * np.sin(2 * k.x + 6 * p["q"]),
    "unknown.range.t": lambda k, p: p["a"] * np.where(k.t > 12 + 20 * p["q"], 1.0, 0.0),
    "unknown.range.w": lambda k, p: p["a"] * np.abs(speeds(k)[2]),
    "unknown.range.v": lambda k, p: p["a"] * np.tanh(speeds(k)[0] / 0.2),
    "unknown.range.range": lambda k, p: p["a"] * _bump(k.r, 1.2 + 0.8 * p["q"], 0.15),
    "unknown.range.dust": lambda k, p: p["a"] * _unit(k.run, "dust", k.t),
}
SCATTER: dict[str, Read] = {
    "unknown.scatter.v": lambda k, p: 1 + p["a"] * np.abs(speeds(k)[0]) * 2,
    "unknown.scatter.w": lambda k, p: 1 + p["a"] * np.abs(speeds(k)[2]) * 2,
    "unknown.scatter.t": lambda k, p: 1 + p["a"] * np.where(k.t > 12 + 20 * p["q"], 1.0, 0.0),
    "unknown.scatter.direction": lambda k, p: 1 + 2 * p["a"] * _around(k.direction, 6 * p["q"], 0.5),
    "unknown.scatter.bearing": lambda k, p: 1 + 2 * p["a"] * _around(k.bearing, (p["q"] - 0.5) * 2, 0.25),
    "unknown.scatter.light": lambda k, p: 1 + p["a"] * np.maximum(_unit(k.run, "light", k.t), 0),
}
SORTS: dict[str, Sort] = {
    "unknown.v.abs_w": Sort("v", ("abs_w", "w"), 0.2),
    "unknown.v.x": Sort("v", ("x",), 0.2),
    "unknown.v.y": Sort("v", ("y",), 0.1),
    "unknown.v.distance": Sort("v", ("distance",), 0.1),
    "unknown.w.distance": Sort("w", ("distance",), 0.1),
    "unknown.w.t": Sort("w", ("t",), 0.03),
    "unknown.v.t": Sort("v", ("t",), 0.1),
    "unknown.w.heading": Sort("w", ("heading",), 0.03),
    "unknown.w.x": Sort("w", ("x",), 0.03),
    "unknown.v.heading": Sort("v", ("heading",), 0.1),
    "unknown.w.v": Sort("w", ("v", "abs_v"), 0.05),
    "unknown.v.v": Sort("v", ("v", "abs_v"), 0.04),
    "unknown.w.w": Sort("w", ("w", "abs_w"), 0.05),
    "unknown.v.age": Sort("v", ("age", "since_command", "time since the last command"), 0.2),
    "unknown.w.tyre": Sort("w", ("tyre",), 0.05, "tyre"),
    "unknown.v.load": Sort("v", ("load",), 0.05, "load"),
    "unknown.w.motor": Sort("w", ("motor",), 0.05, "motor"),
    "unknown.w.comes": Sort("w", ("t",), 0.1),
    "unknown.v.comes": Sort("v", ("t",), -0.4),
    "unknown.w.y": Sort("w", ("y",), 0.05),
    "unknown.heading.heading": Sort("heading", ("heading",), 0.02),
    "unknown.heading.t": Sort("heading", ("t",), 0.02),
    "unknown.position.x": Sort("position", ("x",), 0.02),
    "unknown.position.t": Sort("position", ("t",), 0.02),
    "unknown.position.y": Sort("position", ("y",), 0.02),
    "unknown.range.direction": Sort("range", ("direction",), 0.01),
    "unknown.range.heading": Sort("range", ("heading",), 0.003),
    "unknown.range.x": Sort("range", ("x",), 0.003),
    "unknown.range.t": Sort("range", ("t",), 0.004),
    "unknown.range.w": Sort("range", ("w", "abs_w"), 0.01),
    "unknown.range.v": Sort("range", ("v",), 0.004),
    "unknown.range.range": Sort("range", ("range",), 0.01),
    "unknown.range.dust": Sort("range", ("dust",), 0.003, "dust"),
    "unknown.scatter.v": Sort("scatter", ("abs_v", "v"), 0.4),
    "unknown.scatter.w": Sort("scatter", ("abs_w", "w"), 0.4),
    "unknown.scatter.t": Sort("scatter", ("t",), 0.4),
    "unknown.scatter.direction": Sort("scatter", ("direction",), 0.4),
    "unknown.scatter.bearing": Sort("scatter", ("bearing",), 0.4),
    "unknown.scatter.light": Sort("scatter", ("light",), 0.4, "light"),
}

RARE = 1e-3  # share of readings that anything may spoil


def _neighbours(n: F, rho: float, f: int, rng: np.random.Generator) -> F:
    """Errors of neighbouring beams that are alike."""
    out = n.copy()
    if f == 1:  # as an average over three beams
        e = rng.standard_normal((n.shape[0], n.shape[1] + 2))
        out = e[:, 1:-1] + rho * (e[:, :-2] + e[:, 2:])
        return arr(out / np.sqrt(1 + 2 * rho * rho))
    for i in range(1, n.shape[1]):
        out[:, i] = rho * out[:, i - 1] + np.sqrt(1 - rho * rho) * n[:, i]
    return out


def _alike(m: int, rho: float, f: int, rng: np.random.Generator) -> F:
    """What the readings of a scan share, of variance 1."""
    e = rng.standard_normal(m)
    out = e.copy()
    for i in range(1, m):
        if f == 1:  # jumps to another value now and then
            out[i] = out[i - 1] if rng.random() < rho else e[i]
        else:
            out[i] = rho * out[i - 1] + np.sqrt(1 - rho * rho) * e[i]
    return out


def _tails(n: F, p: P, f: int, rng: np.random.Generator) -> F:
    """Large errors."""
    if f == 1:
        return arr(rng.laplace(size=n.shape))
    if f == 2:  # a share of the readings with ten times the noise
        return arr(n * np.where(rng.random(n.shape) < p["inverse_nu"] / 5, 8.0, 1.0))
    return arr(rng.standard_t(1 / p["inverse_nu"], size=n.shape))


def _density(n: F, p: P, f: int) -> F:
    """Log density of large errors."""
    if f == 1:
        return arr(laplace.logpdf(n))
    q = p["inverse_nu"] / 5
    two = np.log((1 - q) * norm.pdf(n) + q * norm.pdf(n, scale=8))
    return arr(t.logpdf(n, 1 / p["inverse_nu"]) if f == 0 else two)


def _usual(n: F) -> F:
    """Log density of normal errors of the best size, with a rare outlier."""
    s = float(np.sqrt(np.mean(np.minimum(n * n, 16.0))))
    return arr(np.log((1 - RARE) * norm.pdf(n, scale=s) + RARE * 6e-4))


def errors(k: Look, causes: list[Cause], rng: np.random.Generator) -> tuple[F, F]:
    """Errors in units of the standard deviation, and twice the log likelihood ratio of each."""
    n = rng.standard_normal(k.r.shape)
    told = np.zeros(k.r.shape)
    sd = width(k, causes)
    for c in causes:
        if c.id == "laser.beam_correlation":
            rho = c.p["rho"]
            n = _neighbours(n, rho, c.form, rng)
            info = rho * rho if c.form == 0 else 0.5 * rho * rho
            told = told - np.log(1 - min(info, 0.95))
        elif c.id == "laser.common_mode":
            e = _alike(len(n), c.p["rho"], c.form, rng)[:, None] * c.p["sd"]
            if c.form == 2:
                e = e * (0.5 + np.where(np.isfinite(k.r), k.r, 0) / 2)
            n = n + e / sd
            per = max(float(k.ok.sum(1).mean()), 1.0)
            told = told + np.log1p(per * (c.p["sd"] / 0.0022) ** 2) / per
        elif c.id == "laser.heavy_tails":
            n = _tails(n, c.p, c.form, rng)
            told = told + 2 * (_density(n, c.p, c.form) - _usual(n))
        elif c.id in SPREAD or c.id.startswith("unknown.scatter"):
            g = sd / np.maximum(width(k, [d for d in causes if d is not c]), 1e-9)
            told = told + np.where(k.ok > 0, (n * g) ** 2 - n**2 - 2 * np.log(g), 0.0)
    return n, told


def _mixed(k: Look, z: F, c: Cause, rng: np.random.Generator) -> tuple[F, F]:
    a = np.where(np.isfinite(z), z, 0.0)
    back = np.roll(a, -1, axis=1)
    wild = (a > 0) & (back > 0) & (np.abs(back - a) > c.p["jump"])
    wild[:, -1] = False
    wild &= rng.random(z.shape) < c.p["probability"]
    share = rng.random(z.shape)
    share = share if c.form == 0 else np.sqrt(share) if c.form == 1 else 0.5 + 0.2 * (share - 0.5)
    return np.where(wild, a + share * (back - a), z), wild.astype(float)


def _lost(k: Look, z: F, c: Cause, rng: np.random.Generator) -> tuple[F, F]:
    p = np.full(z.shape, c.p["probability"])
    if c.form == 1:  # in patches of beams
        patch = rng.random((z.shape[0], z.shape[1] // 8 + 1)) < p[0, 0]
        lost = np.repeat(patch, 8, axis=1)[:, : z.shape[1]]
    else:
        far = np.where(np.isfinite(k.r), k.r, 0.0) / 1.5
        lost = rng.random(z.shape) < (p if c.form == 0 else p * far**2)
    return np.where(lost, np.nan, z), (lost & np.isfinite(z)).astype(float)


def _cross(k: Look, z: F, c: Cause, rng: np.random.Generator) -> tuple[F, F]:
    on, state = np.zeros(len(z), bool), False
    for i in range(len(z)):
        state = state if rng.random() < 0.7 else rng.random() < c.p["probability"]
        on[i] = state
    at = rng.uniform(-np.pi, np.pi) + c.p["drift"] * k.t[:, 0] * (0.0 if c.form == 1 else 1.0)
    off = (k.bearing - at[:, None] + np.pi) % (2 * np.pi) - np.pi
    here = on[:, None] & (np.abs(off) < c.p["width"] / 2)
    if c.form == 2:
        here &= rng.random(z.shape) < 0.5
    return np.where(here, rng.uniform(0.1, c.p["reach"], z.shape), z), here.astype(float)


def _cut(k: Look, z: F, c: Cause, rng: np.random.Generator) -> tuple[F, F]:
    far, near = 1 / c.p["inverse_far"], c.p["near"]
    if c.form == 1:
        out = np.where(z > far, far + 0.1 * np.tanh((z - far) / 0.1), z)
        return out, (z > far + 0.05).astype(float)
    lost = (z > far) & np.isfinite(z)
    soft = lost & (rng.random(z.shape) < 0.8) if c.form == 2 else lost
    out = np.where(soft, np.inf, np.where(z < near, np.nan, z))
    return out, (soft & (z < 3.95)).astype(float)


def finish(k: Look, z: F, causes: list[Cause], rng: np.random.Generator, told: F) -> tuple[F, F]:
    """Lost and false readings, steps and the gate."""
    acts = {"laser.mixed_pixels": _mixed, "laser.dropout": _lost, "laser.crosstalk": _cross, "laser.saturation": _cut}
    told = told * k.ok
    coarse = [c for c in causes if c.id == "laser.quantisation"]
    z = np.where(np.isfinite(z), z, np.inf)
    for c in causes:
        if c.id in acts:
            z, hit = acts[c.id](k, z, c, rng)
            rate = max(float(hit.mean()), 1e-6)
            bits = np.log(rate / RARE * 4) if rate > RARE else 0.2
            told = told + 2 * hit * min(max(float(bits), 0.2), 6.0)
    for c in coarse:
        q = c.p["step"]
        z = (np.round(z / q), np.floor(z / q), np.round(z / q + rng.uniform(-0.3, 0.3, z.shape)))[c.form] * q
        told = told + k.ok * (2 * np.log(max(q / STEP, 1.0)) * (c.form < 2) + (q * q / 12 / width(k, []) ** 2) * 0.5)
    return gate(z), told
