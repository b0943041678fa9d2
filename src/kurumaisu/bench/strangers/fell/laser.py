# SPDX-License-Identifier: BSD-3-Clause
"""What the laser does: optics, clock, mount and receiver, from the pose of each beam to a reading."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from kurumaisu.bench.strangers.fell.plant import Array, Cause, Causes, Ints, Pose, Rng
from kurumaisu.bench.strangers.fell.room import Room

P0, REACH0, MISS0 = 0.002, 0.05, 0.002  # rare large errors and lost beams that any laser has
FANS = {  # degrees, beams, s, sigma, near, far
    "UTM-30LX": (270, 361, 0.025, (0.006, 0.0002, 0.0), 0.1, 30.0),
    "LMS200": (180, 181, 0.0133, (0.006, 0.0003, 0.0), 0.1, 20.0),
    "A1": (360, 360, 0.15, (0.003, 0.001, 0.0002), 0.15, 12.0),
    "LDS-01": (360, 360, 0.2, (0.005, 0.001, 0.0008), 0.12, 8.0),
    "TIM561": (270, 271, 0.067, (0.01, 0.0, 0.0001), 0.05, 10.0),
    "S300": (270, 271, 0.04, (0.008, 0.0004, 0), 0.1, 25.0),
}
URG = (0.002334, -0.000488, 0.000199)
Where = Callable[[Array], Pose]
Context = dict[str, Callable[[Array], Array]]  # what the laser's errors may follow: temperature, humidity, v, w


class Laser(NamedTuple):
    """A laser: fan, timing, error and place."""

    name: str
    angle_min: float
    increment: float
    beams: int
    scan_time: float
    tinc: float
    sigma: tuple[float, float, float]
    near: float
    far: float
    period: float
    mount: tuple[float, float, float]
    scale: float
    datum: float
    height: float


class Hits(NamedTuple):
    """Where beams meet walls: times and bearings, directions, ranges, incidence, paint, places, and the jacobian."""

    t: Array
    b: Array
    beams: Ints
    ang: Array
    r: Array
    cosi: Array
    dark: Array
    hx: Array
    hy: Array
    jac: Array

    @property
    def inc(self) -> Array:
        """Return the angles of incidence."""
        return np.asarray(np.minimum(np.arccos(np.minimum(self.cosi, 1)), 1.4))


class Readings(NamedTuple):
    """Mean, scatter, losses, steps to a neighbour, jacobian, outliers, mixed beams, and crosstalk in scans."""

    mu: Array
    sig: Array
    miss: Array
    jump: Array
    jac: Array
    out: Array
    mixed: Array
    cross: Array


def draw_laser(rng: Rng, chair: bool) -> Laser:
    """Draw one of those that are on robots."""
    mx, my = round(float(rng.uniform(0.05, 0.22)), 3), round(float(rng.choice([0, 0, 0.03])), 3)
    per = float(rng.choice([0.5, 0.8, 1.0]))
    if chair and rng.random() < 0.7:
        fan, mount, datum = (-2.086214, 0.006135923, 682, 0.1, 9.765625e-5), (0.30, 0.0, 0.0), [0.0, 0.058826]
        return Laser("URG-04LX", *fan, URG, 0.06, 4.0, per, mount, 1.004587, float(rng.choice(datum)), 0.4)
    name = str(rng.choice(list(FANS)))
    fov, k, full, sigma, near, far = FANS[name]
    yaw = float(rng.choice([0.0, 0.0, 0.1])) if fov == 360 else 0.0
    first, step = round(-np.radians(fov) / 2, 7), round(np.radians(fov) / (k - (fov < 360)), 9)
    tinc = round(full * fov / 360 / k, 9)
    return Laser(name, first, step, k, full, tinc, sigma, near, far, per, (mx, my, yaw), 1.0, 0.0, 0.4)


def _p(c: Causes, i: str, k: str) -> Any:
    return c[i].p[k] if i in c else 0.0


def _alt(c: Causes, i: str) -> bool:
    return i in c and c[i].other


def _mount(las: Laser, c: Causes, turning: Array) -> list[Any]:
    """Return x, y and yaw; a loose bracket (the other form) gives a little while the base turns."""
    out = []
    for m, k in zip(las.mount, ("x", "y", "yaw"), strict=True):
        name = "laser.mount_" + k
        out.append(m + _p(c, name, k) * (1 + 0.25 * np.tanh(2 * turning)[:, None] if _alt(c, name) else 1.0))
    return out


def _look(las: Laser, room: Room, c: Causes, pose: Where, stamps: Array, ctx: Context, beams: Ints | None) -> Hits:
    """Return where beams of scans stamped so meet walls."""
    i = np.arange(las.beams) if beams is None else beams
    late = 1 + 0.4 * np.sin(stamps * 0.9) * _alt(c, "laser.latency")
    taken = stamps - _p(c, "laser.latency", "delay") * late
    skew = 0.5 + stamps / 240 if _alt(c, "laser.clock_skew") else 1
    taken = taken - _p(c, "laser.clock_skew", "skew") * stamps * skew
    stretch = 0.7 + 0.6 * i / las.beams if _alt(c, "laser.sweep") else 1
    x, y, th = pose(taken[:, None] + i * las.tinc * (1 + _p(c, "laser.sweep", "stretch") * stretch))
    b = las.angle_min + i * las.increment
    lx, ly, yaw = _mount(las, c, ctx["w"](stamps))
    ang = th + b + yaw
    ox, oy = x + np.cos(th) * lx - np.sin(th) * ly, y + np.sin(th) * lx + np.cos(th) * ly
    if k := c.get("world.map_error"):
        room = room.shifted(k.p["sd"], np.random.default_rng(k.p["seed"]), k.other)
    r, seg = room.cast(ox, oy, ang)
    ex, ey = (room.walls[seg, j + 2] - room.walls[seg, j] for j in (0, 1))
    ca, sa = np.cos(ang), np.sin(ang)
    s = np.sign(ca * ey - sa * ex) / np.hypot(ex, ey)
    nx, ny = ey * s, -ex * s  # normals away from the laser
    cosi = np.maximum(nx * ca + ny * sa, 0.03)
    hx, hy = ox + r * ca, oy + r * sa
    jac = np.stack([-nx / cosi, -ny / cosi, (nx * (hy - y) - ny * (hx - x)) / cosi], -1)
    return Hits(stamps[:, None], b, i, ang, r, cosi, room.dark[room.owner[seg]], hx, hy, jac)


def _tilted(las: Laser, k: Cause, h: Hits) -> Array:
    """Return ranges to what a tilted laser sees; other: it nods with the floor."""
    eps = k.p["pitch"] * np.cos(h.b) + k.p["roll"] * np.sin(h.b)
    eps = eps * (1 + 0.3 * np.sin(1.1 * h.t) * k.other)
    return np.asarray(np.minimum(h.r / np.cos(eps), las.height / np.maximum(np.sin(eps), 1e-6) * np.ones_like(h.r)))


def _warmup(k: Cause, h: Hits, q: Array, las: Laser) -> Any:
    f = np.exp(-h.t / k.p["tau"])
    return k.p["amplitude"] * (0.6 * f**2.5 + 0.4 * f**0.5 if k.other else f)


def _cyclic(k: Cause, h: Hits, q: Array, las: Laser) -> Any:
    ph = 2 * np.pi * q / k.p["wavelength"] + k.p["phase"]
    return k.p["amplitude"] * (np.sin(ph) + 0.3 * np.sin(2 * ph) * k.other)


def _beam_bias(k: Cause, h: Hits, q: Array, las: Laser) -> Any:
    own, u = np.random.default_rng(k.p["seed"]).standard_normal(las.beams), np.linspace(0, 2 * np.pi, las.beams)
    return k.p["sd"] * (np.sin(u + own[0]) + 0.5 * np.sin(3 * u + own[1]) if k.other else own)[h.beams]


# What each cause adds to mean readings of ranges q, in the order in which they act; temperature is added before cyclic.
TERMS: dict[str, Callable[[Cause, Hits, Array, Laser], Any]] = {
    "laser.offset": lambda k, h, q, las: k.p["offset"] * (1 + 0.5 * np.exp(-q) * k.other),
    "laser.scale": lambda k, h, q, las: k.p["scale"] * q * ((q / 3) ** 0.3 if k.other else 1),
    "laser.quadratic": lambda k, h, q, las: k.p["quadratic"] * (1.8 * q**1.6 if k.other else q * q),
    "laser.warmup": _warmup,
    "laser.cyclic": _cyclic,
    "laser.incidence_bias": lambda k, h, q, las: k.p["k"] * (2 * h.inc**3 if k.other else np.tan(h.inc)),
    "laser.reflectance": lambda k, h, q, las: k.p["bias"] * h.dark * ((q / 3) ** 0.5 if k.other else 1),
    "laser.beam_bias": _beam_bias,
}


def _mean(las: Laser, c: Causes, h: Hits, q: Array, ctx: Context) -> Array:
    mu = las.scale * q + las.datum
    for name in TERMS:
        if name == "laser.cyclic" and (k := c.get("laser.temperature")):
            mu = mu + k.p["coefficient"] * (ctx["temperature"](h.t - 50 * k.other) - 20)
        if k := c.get(name):
            mu = mu + TERMS[name](k, h, q, las)
    return mu


def _sigma(las: Laser, c: Causes, h: Hits, q: Array) -> Array:
    sig, share = np.polyval(las.sigma[::-1], q), _p(c, "laser.range_noise", "share")
    sig = np.maximum(sig * (1 + share + 0.5 * share * (q / 3 - 1) * _alt(c, "laser.range_noise")), 1e-4)
    if k := c.get("laser.incidence_noise"):
        sig = sig * (1 + k.p["gain"] * (1.25 * h.inc**2.5 if k.other else np.tan(h.inc)))
    return np.asarray(sig * (1 + 0.5 * h.dark * ("laser.reflectance" in c)))


def _unknown(k: Cause, h: Hits, ctx: Context) -> Array:
    """Return what something outside of the catalogue does to readings."""
    p = k.p
    shapes: dict[str, Callable[[], Array]] = {
        "humidity": lambda: (ctx["humidity"](h.t) - 45) / 8,
        "direction": lambda: np.cos(2 * h.ang + p["f"]),
        "hit_x": lambda: np.sin(p["k"] * h.hx + p["f"]),
        "hit_y": lambda: np.sin(p["k"] * h.hy + p["f"]),
        "abs_v": lambda: np.abs(ctx["v"](h.t)),
        "abs_w": lambda: np.abs(ctx["w"](h.t)),
        "time": lambda: (h.t / p["period"] + p["f"]) % 1 < 0.3,
    }
    return np.asarray(p["a"] * shapes[p["of"]]())


def readings(
    las: Laser, room: Room, causes: list[Cause], pose: Where, stamps: Array, ctx: Context, beams: Ints | None = None
) -> Readings:
    """Return what to expect of each beam of the scans stamped so."""
    c = {k.id: k for k in causes}
    h = _look(las, room, c, pose, stamps, ctx, beams)
    r = h.r
    q = _tilted(las, c["laser.tilt"], h) if "laser.tilt" in c else r
    mu, sig = _mean(las, c, h, q, ctx), _sigma(las, c, h, q)
    if k := c.get("unknown.laser.range"):
        mu = mu + _unknown(k, h, ctx)
    if k := c.get("unknown.laser.spread"):
        sig = sig * np.exp(np.clip(_unknown(k, h, ctx), -1.5, 1.5))
    miss = np.full(r.shape, MISS0)
    if k := c.get("laser.dropout"):
        miss = miss + k.p["probability"] * (np.minimum(0.4 + 0.2 * q + 0.4 * h.dark, 1.1) if k.other else 1)
    jump, before, after = np.zeros_like(r), np.roll(r, 1, 1) - r, np.roll(r, -1, 1) - r
    step = np.where(np.abs(before) > np.abs(after), before, after)
    jump[:, 1:-1] = (step * (np.abs(step) > np.maximum(0.15, 8 * las.increment * r / h.cosi)))[:, 1:-1]
    out = np.full(r.shape, P0) + _p(c, "laser.heavy_tails", "outliers") * (not _alt(c, "laser.heavy_tails"))
    mixed = _p(c, "laser.mixed_pixels", "probability") * (jump != 0)
    cross = np.full(len(stamps), _p(c, "laser.crosstalk", "probability"))
    return Readings(mu, sig, miss, jump, h.jac, out, mixed, cross)


def _errors(c: Causes, shape: tuple[int, int], rng: Rng) -> Array:
    """Return errors in units of their sd."""
    e = rng.standard_normal(shape)
    if k := c.get("laser.beam_correlation"):
        rho = k.p["rho"]
        if k.other:  # a smoothing receiver: three neighbours, nothing beyond
            e = (e + rho * np.roll(e, 1, 1) + rho * np.roll(e, -1, 1)) / np.sqrt(1 + 2 * rho * rho)
        for j in range(1, 0 if k.other else shape[1]):
            e[:, j] = rho * e[:, j - 1] + np.sqrt(1 - rho * rho) * e[:, j]
    return rng.standard_t(3.2, shape) / np.sqrt(3.2 / 1.2) if _alt(c, "laser.heavy_tails") else e


def _common(k: Cause, z: Array, rng: Rng) -> None:
    """Add errors that all readings of a scan share."""
    a, rho = 0.0, k.p["rho"]
    for row in z:
        a = rho * a + np.sqrt(1 - rho * rho) * (rng.uniform(-1.7, 1.7) if k.other else rng.standard_normal())
        row += k.p["sd"] * a


def _crosstalk(k: Cause, las: Laser, z: Array, share: Array, stamps: Array, rng: Rng) -> None:
    """Enter what another laser makes the receiver see."""
    at, b = rng.uniform(-2, 2), las.angle_min + np.arange(las.beams) * las.increment
    for j in np.flatnonzero(rng.random(len(z)) < share):
        mid = (at + k.p["drift"] * stamps[j] + np.pi) % (2 * np.pi) - np.pi
        hit = np.abs(b - mid) < k.p["width"] / 2 * (rng.uniform(0.3, 1.7) if k.other else 1)
        z[j, hit] = rng.uniform(las.near, k.p["reach"], hit.sum())


def sample(las: Laser, causes: list[Cause], rd: Readings, stamps: Array, rng: Rng) -> Array:
    """Return readings with their noise, steps and gate: nan lost, inf no return."""
    c = {k.id: k for k in causes}
    shape = rd.mu.shape[0], rd.mu.shape[1]
    z = rd.mu + rd.sig * _errors(c, shape, rng)
    gone = rng.random(shape) < rd.miss
    if k := c.get("laser.common_mode"):
        _common(k, z, rng)
    reach = c["laser.heavy_tails"].p["reach"] if "laser.heavy_tails" in c else REACH0
    z = z + (rng.random(shape) < rd.out) * reach * rng.standard_normal(shape)
    z = np.where(rng.random(shape) < rd.mixed, z + rd.jump * rng.random(shape), z)
    if k := c.get("laser.crosstalk"):
        _crosstalk(k, las, z, rd.cross, stamps, rng)
    if k := c.get("laser.quantisation"):
        z = k.p["step"] * (np.floor(z / k.p["step"]) + 0.5 if k.other else np.round(z / k.p["step"]))
    z = np.round(z, 3)
    if k := c.get("laser.saturation"):
        z = np.minimum(z, 1 / k.p["inverse_far"])
    return np.where(gone | (z < las.near), np.nan, np.where(z > las.far, np.inf, z))


def clipped(causes: list[Cause], rd: Readings) -> Array:
    """Return mean readings after steps and cut."""
    mu = rd.mu
    for k in causes:
        if k.id == "laser.quantisation":
            s, w = k.p["step"], 2 * np.pi / k.p["step"]
            mu = mu + s / np.pi * np.exp(-((w * rd.sig) ** 2) / 2) * np.sin(w * mu) * (1 if k.other else -1)
        if k.id == "laser.saturation":
            mu = np.minimum(mu, 1 / k.p["inverse_far"])
    return mu
