# SPDX-License-Identifier: BSD-3-Clause
"""Rooms built around the paths that were driven; what a laser reads in them: mean and scatter."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.signal import lfilter
from scipy.special import ndtr
from scipy.stats import t as student

from kurumaisu.bench.strangers.tarn.base import Array, Drive, Effects, Ints, Lab, Laser, Pose, Rng, curve

THICK, CORNERS = 0.2, ((-1, -1), (1, -1), (1, 1), (-1, 1), (-1, -1))


class Room(NamedTuple):
    """Boxes: centre x, y, angle, length, width, reflectance; the map's pixel, 0 if it is a world."""

    boxes: Array
    pixel: float

    def segments(self) -> Array:
        """Rows of ax, ay, ex, ey: four sides of each box."""
        x, y, a, long, w = self.boxes[:, :5].T
        c, s = np.cos(a) / 2, np.sin(a) / 2
        p = np.array([(x + c * i * long - s * j * w, y + s * i * long + c * j * w) for i, j in CORNERS])
        return np.asarray(np.concatenate([p[:-1], np.diff(p, axis=0)], 1).transpose(0, 2, 1).reshape(-1, 4))

    def moved(self, scale: float, sd: float, swell: float) -> Room:
        """The room as it is, if the map is off: larger by a share, or with every box shifted."""
        b = self.boxes.copy()
        b[:, :2] *= 1 + scale + swell * np.hypot(b[:, 0:1], b[:, 1:2])
        b[:, 3:5] *= 1 + scale
        b[:, :2] += sd * np.random.default_rng(len(b)).normal(size=(len(b), 2))
        return Room(b, self.pixel)


def _wall(a: Array, b: Array, shade: float) -> list[float]:
    long, turn = float(np.hypot(*(b - a))), float(np.arctan2(*(b - a)[::-1]))
    x, y = (a + b) / 2 + np.array([np.sin(turn), -np.cos(turn)]) * THICK / 2
    return [float(x), float(y), turn, long + 2 * THICK, THICK, shade]


def build(rng: Rng, lab: Lab, px: Array, py: Array) -> Room:
    """Walls around all that was driven, with boxes where nothing was driven."""
    path, free, m, out = np.stack([px, py], 1), lab.pixel == 0, lab.margin, np.array(CORNERS[:4])
    lo, hi = path.min(0) - m - rng.uniform(0.1, 0.8, 2), path.max(0) + m + rng.uniform(0.1, 0.8, 2)
    if not free:
        lo, hi = np.floor(lo * 10) / 10, np.ceil(hi * 10) / 10
    corner = np.where(out > 0, hi, lo)
    if lab.room == "askew":
        corner = corner + out * rng.uniform(0, 0.25, (4, 2)) * (hi - lo)
    rows = [_wall(corner[k], corner[(k + 1) % 4], rng.uniform(0.15, 1) if free else 1.0) for k in range(4)]
    many, size = {"office": (14, 0.8), "corridor": (16, 0.5), "hall": (12, 0.35), "askew": (10, 0.6)}[lab.room]
    for _ in range(400):
        n = size * rng.uniform(0.4, 1.6) * min(float(np.max(hi - lo)) / 6, 2.0)
        n, w = (2 * n, 0.1) if lab.room == "office" and rng.random() < 0.3 else (n, n * rng.uniform(0.3, 1.0))
        c, a = rng.uniform(corner.min(0) + 0.05, corner.max(0) - 0.05), rng.uniform(0, np.pi)
        a = float(rng.choice([0.0, np.pi / 2])) if lab.room in ("office", "corridor") else a
        if not free:
            n, w = (round(k, 1) + 0.1 for k in ((n, w) if a < np.pi / 4 else (w, n)))
            a, c = 0.0, np.round(c * 10) / 10 + np.array([n, w]) / 2
        u, v = (path - c) @ [np.cos(a), np.sin(a)], (path - c) @ [-np.sin(a), np.cos(a)]
        gap = np.hypot(np.maximum(np.abs(u) - n / 2, 0), np.maximum(np.abs(v) - w / 2, 0))
        if gap.min() > m and len(rows) < 4 + many:
            rows.append([float(c[0]), float(c[1]), a, n, w, rng.uniform(0.1, 1.0) if free else 1.0])
    return Room(np.asarray(rows), lab.pixel)


def cast(room: Room, ox: Array, oy: Array, dx: Array, dy: Array) -> tuple[Array, Ints, Array]:
    """Range, segment and cosine of incidence of each ray; inf and -1 where nothing is met."""
    (ax, ay, ex, ey), parts = room.segments().T, list[Array]()
    for k in range(0, len(ox), 4000):
        c, s = dx[k : k + 4000, None], dy[k : k + 4000, None]
        bx, by = ax - ox[k : k + 4000, None], ay - oy[k : k + 4000, None]
        with np.errstate(divide="ignore", invalid="ignore"):
            den = c * ey - s * ex
            t, q = (bx * ey - by * ex) / den, (bx * s - by * c) / den
        t = np.where((q >= 0) & (q <= 1) & (t > 1e-3), t, np.inf)
        i, j = np.arange(len(t)), np.argmin(t, 1)
        r, slant = t[i, j], np.abs(den[i, j]) / np.hypot(ex, ey)[j]
        parts.append(np.stack([r, np.where(np.isfinite(r), j, -1), np.clip(slant, 0.02, 1.0)]))
    r, hit, cosi = np.concatenate(parts, 1)
    return r, hit.astype(np.int64), cosi


def write_room(room: Room, folder: Path) -> str:
    """A Stage world, or a map with fine pixels; the name for meta.yaml."""
    b, p = room.boxes, room.pixel
    if p == 0:
        out = ['define thing model ( color "gray30" obstacle_return 1 gui_nose 0 )']
        for x, y, a, n, w, shade in b:
            out.append(
                f"thing ( pose [ {x:.6f} {y:.6f} 0 {np.degrees(a):.6f} ] size [ {n:.6f} {w:.6f} 1.5 ] "
                f'ranger_return {shade:.3f} color "gray{int(20 + 70 * shade)}" )'
            )
        (folder / "room.world").write_text("\n".join(out) + "\n")
        return "room.world"
    half = np.where(np.abs(np.cos(b[:, 2:3])) > 0.7, b[:, 3:5], b[:, 4:2:-1]) / 2
    origin = np.floor((b[:, :2] - half).min(0) * 5) / 5 - 0.2
    lo, hi = (np.round((b[:, :2] + e * half - origin) / p).astype(int) for e in (-1, 1))
    nx, ny = hi.max(0) + int(0.2 / p)
    image = np.full((ny, nx), 254, np.uint8)
    for (i0, j0), (i1, j1) in zip(np.maximum(lo, 0), hi, strict=True):
        image[j0:j1, i0:i1] = 0
    (folder / "room.pgm").write_bytes(b"P5\n%d %d\n255\n" % (nx, ny) + image[::-1].tobytes())
    (folder / "room.yaml").write_text(
        f"image: room.pgm\nresolution: {p}\norigin: [{origin[0]:.6f}, {origin[1]:.6f}, 0.0]\nnegate: 0\n"
        "occupied_thresh: 0.65\nfree_thresh: 0.196\n"
    )
    return "room.yaml"


Where = Callable[[Array], Pose]


class Rays(NamedTuple):
    """Rays of some scans: all are scans by beams, but t (scans) and beam (beams)."""

    t: Array
    beam: Ints
    r: Array
    hit: Ints
    cosi: Array
    ox: Array
    oy: Array
    a: Array
    dark: Array
    yaw_rate: Array


class Scatter(NamedTuple):
    """How readings scatter: sd of each, outliers between lo and hi, what a scan shares and its memory, tails."""

    sd: Array
    pi: Array
    lo: Array
    hi: Array
    shared: float
    memory: float
    rho: float
    inv_nu: float
    step: float


def trace(room: Room, las: Laser, fx: Effects, where: Where, t: Array, beam: Ints, t0: float) -> Rays:
    """Follow the rays; `where` is where base_link is."""
    late = fx.p("laser.latency", "delay") + fx.p("laser.clock_skew", "skew") * (
        (t - t0) ** 2 / 60 if fx.alt("laser.clock_skew") else t - t0
    )
    tb = (t - late)[:, None] + las.tinc * (1 + fx.p("laser.sweep", "stretch")) * beam
    x, y, th = where(tb)
    mx, my = las.x + fx.p("laser.mount_x", "x"), las.y + fx.p("laser.mount_y", "y")
    ox, oy = x + mx * np.cos(th) - my * np.sin(th), y + mx * np.sin(th) + my * np.cos(th)
    a = th + las.yaw + fx.p("laser.mount_yaw", "yaw") + las.amin + las.ainc * beam
    room = room.moved(*(fx.p("world.map_error", k) for k in ("scale", "sd", "swell")))
    r, hit, cosi = cast(room, ox.ravel(), oy.ravel(), np.cos(a).ravel(), np.sin(a).ravel())
    r, hit, cosi = r.reshape(a.shape), hit.reshape(a.shape), cosi.reshape(a.shape)
    dark = np.asarray(1.0 - np.tile(room.boxes[:, 5], 4)[hit], np.float64)
    return Rays(t, beam, r, hit, cosi, ox, oy, a, dark, (where(tb + 0.02)[2] - th) / 0.02)


def mean(las: Laser, fx: Effects, q: Rays, d: Drive) -> Array:
    """The mean of each reading, before rounding and gate."""
    p, alt, age = fx.p, fx.alt, (q.t - d.t[0])[:, None] / fx.p("laser.warmup", "tau", 1.0)
    r, phi = np.where(np.isfinite(q.r), q.r, 99.0), las.amin + las.ainc * q.beam
    if fx.get("laser.tilt"):
        a = p("laser.tilt", "pitch") * np.cos(phi) + p("laser.tilt", "roll") * np.sin(phi)
        r = np.minimum(r / np.cos(a), np.where(a > 1e-3, las.z / np.sin(np.maximum(a, 1e-3)), 99.0))
    m = las.scale * r + las.offset + p("laser.offset", "offset") + p("laser.scale", "scale") * r
    m = m + p("laser.quadratic", "quadratic") * (r**2.5 / 1.5 if alt("laser.quadratic") else r * r)
    m = m + p("laser.warmup", "amplitude") * (1 / (1 + age) if alt("laser.warmup") else np.exp(-age))
    warm = np.interp(q.t, d.t, d.cov["temperature"])[:, None] - 20.0
    warm = warm + 0.12 * warm * np.abs(warm) if alt("laser.temperature") else warm
    z = 2 * np.pi * r / p("laser.cyclic", "wavelength", 1.0) + p("laser.cyclic", "phase")
    wave = np.arcsin(np.sin(z)) * 2 / np.pi if alt("laser.cyclic") else np.sin(z)
    m = m + p("laser.temperature", "coefficient") * warm + p("laser.cyclic", "amplitude") * wave
    slant = (1 - q.cosi**2) * 2 if alt("laser.incidence_bias") else 1 / q.cosi - 1
    m = m + p("laser.incidence_bias", "k") * np.minimum(slant, 10)
    m = m + p("laser.reflectance", "bias") * (q.dark**3 if alt("laser.reflectance") else q.dark)
    own = np.random.default_rng(7).normal(size=las.beams)[q.beam] * p("laser.beam_bias", "sd")
    m = m + own + p("laser.beam_bias", "amplitude") * np.sin(phi + p("laser.beam_bias", "phase"))
    odd, far = fx.odd("laser.range"), p("laser.saturation", "inverse_far")
    if odd:
        m = m + curve(_series(odd.covariate, q, d), odd.p)
    if far > 0:
        m = m / (1 + (m * far) ** 12) ** (1 / 12) if alt("laser.saturation") else np.minimum(m, 1 / far)
    return np.asarray(m)


def _series(name: str, q: Rays, d: Drive) -> Array:
    if name in ("hit_x", "hit_y"):
        end = q.ox + q.r * np.cos(q.a) if name == "hit_x" else q.oy + q.r * np.sin(q.a)
        return np.asarray(np.where(np.isfinite(end), end, 0.0))
    if name == "w":
        return q.yaw_rate
    u = q.t - d.t[0] if name == "time" else np.interp(q.t, d.t, d.cov[name])
    return np.asarray(np.repeat(u[:, None], len(q.beam), 1))


def scatter(las: Laser, fx: Effects, q: Rays, m: Array, d: Drive, burst: Array | None = None) -> Scatter:
    """The scatter of the readings of mean m; `burst` is where, or how probably, another laser shines in."""
    p, odd = fx.p, fx.odd("laser.spread")
    sd = np.maximum(np.polyval(las.sigma[::-1], np.minimum(q.r, 60.0)), 1e-4) * (1 + p("laser.range_noise", "share"))
    sd = sd * (1 + p("laser.incidence_noise", "gain") * (1 / np.maximum(q.cosi, 0.1) - 1))
    sd = sd * (1 + p("laser.reflectance", "noise") * q.dark)
    if odd:
        sd = sd * (1 + np.abs(curve(_series(odd.covariate, q, d), odd.p)))
    pi, lo, hi = np.full_like(sd, 5e-4), np.full_like(sd, las.rmin), np.full_like(sd, las.rmax)
    if fx.get("laser.heavy_tails"):
        pi, reach = np.maximum(pi, p("laser.heavy_tails", "outliers")), p("laser.heavy_tails", "reach", 0.1)
        lo, hi = m - reach, m + reach
    if fx.get("laser.mixed_pixels"):
        side = np.concatenate([m[:, 1:], m[:, -1:]], 1)
        edge = np.abs(side - m) > 0.12
        pi = np.where(edge, p("laser.mixed_pixels", "probability"), pi)
        lo, hi = np.where(edge, np.minimum(m, side), lo), np.where(edge, np.maximum(m, side), hi)
    e = fx.get("laser.crosstalk")
    if e:
        share = e.p["probability"] * e.p["width"] / (2 * np.pi) if burst is None else burst
        pi, hi = np.where(share > 0, 0.5 * share, pi), np.where(share > 0, min(e.p["reach"], las.rmax), hi)
    rest = "common_mode sd, common_mode rho, beam_correlation rho, heavy_tails inverse_nu, quantisation step"
    numbers = (p(f"laser.{id_}", name) for id_, name in (key.split() for key in rest.split(", ")))
    return Scatter(np.sqrt(sd**2 + las.res**2 / 12), pi, lo, hi, *numbers)


def bursts(rng: Rng, las: Laser, fx: Effects, t: Array) -> Array:
    """Where another laser's light falls in: a sector that drifts, in some scans."""
    e, on = fx.get("laser.crosstalk"), np.zeros((len(t), 1))
    if not e:
        return on
    for k in range(1, len(t)):
        on[k] = on[k - 1] if rng.random() < 0.7 else float(rng.random() < e.p["probability"])
    phi = las.amin + las.ainc * np.arange(las.beams) - rng.uniform(-1, 1) - e.p["drift"] * (t - t[0])[:, None]
    return np.asarray(on * (np.abs((phi + np.pi) % (2 * np.pi) - np.pi) < e.p["width"] / 2))


def draw(rng: Rng, las: Laser, fx: Effects, q: Rays, m: Array, s: Scatter) -> Array:
    """Readings: noise, outliers, gate, rounding, beams without a reading."""
    e, shared = rng.normal(size=m.shape), rng.normal(size=len(m)) * np.sqrt(1 - s.memory**2)
    e[:, 1:] *= np.sqrt(1 - s.rho**2)
    e = lfilter([1.0], [1.0, -s.rho], e, axis=1)
    if s.inv_nu > 0:
        e = e / np.sqrt(rng.chisquare(1 / s.inv_nu, m.shape) * s.inv_nu)
    shared = lfilter([1.0], [1.0, -s.memory], shared) * s.shared
    z = m + np.sqrt(s.sd**2 - las.res**2 / 12) * e + shared[:, None]
    z = np.where(rng.random(m.shape) < s.pi, s.lo + (s.hi - s.lo) * rng.random(m.shape), z)
    res = max(s.step, las.res)
    if res > 0:
        z = res * (np.floor(z / res) if fx.alt("laser.quantisation") else np.round(z / res))
    z = np.where((z > las.rmax) | ~np.isfinite(q.r), np.inf, np.where(z < las.rmin, np.nan, z))
    return np.asarray(np.where(rng.random(m.shape) < lost(las, fx, q), np.nan, z))


def lost(las: Laser, fx: Effects, q: Rays) -> Array:
    """The probability that a beam has no valid reading."""
    far = fx.p("laser.dropout", "per_metre") * np.minimum(q.r, las.rmax)
    return np.asarray(np.clip(0.002 + fx.p("laser.dropout", "probability") + far, 0, 0.9))


def density(s: Scatter, m: Array, z: Array, res: float) -> Array:
    """Log density of each reading, beams taken as independent."""
    e = (z - m) / s.sd
    near = student.pdf(e, 1 / s.inv_nu) / s.sd if s.inv_nu > 0 else np.exp(-0.5 * e * e) / s.sd / np.sqrt(2 * np.pi)
    if s.step > 0:
        near = (ndtr(e + s.step / 2 / s.sd) - ndtr(e - s.step / 2 / s.sd)) / max(res, 1e-3)
    inside = (z >= s.lo - 3 * s.sd) & (z <= s.hi + 3 * s.sd)
    far = np.where(inside, s.pi / (s.hi - s.lo + 6 * s.sd), 1e-9)
    return np.asarray(np.log(np.maximum(near, 1e-30) * (1 - s.pi) + far))
