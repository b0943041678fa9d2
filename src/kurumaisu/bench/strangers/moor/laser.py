# SPDX-License-Identifier: BSD-3-Clause
"""The laser: where it looks, what it reads, and how its effects change that."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, fields

import numpy as np

from kurumaisu.bench.strangers.moor.motion import Motion
from kurumaisu.bench.strangers.moor.world import Array, Flags, Ints, Room
from kurumaisu.bench.strangers.tilt import tilted

SCALE, DATUM, SIGMA, NEAR, FAR = 1.004587, 0.058826, (0.002334, -0.000488, 0.000199), 0.06, 4.0
HEIGHT = 0.4


@dataclass(frozen=True)
class Fan:
    """Beams: the first one's angle, the step, how many, the time between two, and the time between scans."""

    first: float
    step: float
    beams: int
    dt: float
    every: float


@dataclass(frozen=True)
class Optics:
    """How the laser is mounted and clocked, and where the walls are."""

    x: float = 0.30
    y: float = 0.0
    yaw: float = 0.0
    pitch: float = 0.0
    roll: float = 0.0
    stretch: float = 0.0
    delay: float = 0.0
    skew: float = 0.0
    drift: float = 0.0
    shrink: float = 0.0
    shift: float = 0.0
    turn: float = 0.0


@dataclass
class Cast:
    """What the beams of some scans meet: arrays of scans by beams, and the drive's quantities at the scans."""

    r: Array
    incidence: Array
    face: Ints
    bearing: Array
    beam: Array
    t: Array
    x: Array
    y: Array
    angle: Array
    dark: Array
    motion: Motion

    def col(self, name: str) -> Array:
        """A covariate or a rate that is asked for, at each beam's time."""
        values = self.motion.columns[name] if name in self.motion.columns else getattr(self.motion, name)
        return self.motion.at(np.asarray(values), self.t)

    def during(self, values: Array) -> Array:
        """Any quantity of the drive at each beam's time."""
        return self.motion.at(values, self.t)


@dataclass(frozen=True)
class Lens:
    """How one effect of the laser acts, on `optics`, on the `mean`, on the `sd`, or on readings (`special`)."""

    name: str
    kind: str
    low: float
    high: float
    act: Callable[[Cast, float], Array | dict[str, Array | float]]
    parameters: dict[str, float] = field(default_factory=dict)
    form: str = "same"
    signed: bool = False
    fixed: dict[str, float] = field(default_factory=dict)
    covariates: tuple[str, ...] = ()
    channel: str = ""
    column: str = ""


Lenses = Sequence[tuple[Lens, float]]
PoseAt = Callable[[Array], tuple[Array, Array, Array]]


def true_pose(m: Motion, error: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> PoseAt:
    """The chair's own pose at any time, off by the same everywhere."""
    return lambda t: (m.at(m.x, t) + error[0], m.at(m.y, t) + error[1], m.at(m.heading, t) + error[2])


def optics_of(lenses: Lenses, c: Cast | None = None) -> Optics:
    """The mounting and the clock with all effects on them."""
    now = {f.name: float(getattr(Optics(), f.name)) for f in fields(Optics)}
    for lens, size in lenses:
        if lens.kind == "optics":
            for key, change in lens.act(c, size).items():  # type: ignore[union-attr,arg-type]
                now[key] += float(change)
    return Optics(**now)


def look(m: Motion, pose: PoseAt, stamps: Array, fan: Fan, room: Room, o: Optics, seed: int) -> Cast:
    """Send all beams of the scans with these stamps."""
    beam = np.arange(fan.beams)
    taken = stamps - o.delay - o.skew * stamps - o.drift * stamps**2
    t = taken[:, None] + beam * fan.dt * (1 + o.stretch)
    x, y, h = pose(t)
    bearing = np.broadcast_to(fan.first + beam * fan.step, t.shape)
    if o.shrink or o.shift or o.turn:
        room = room.moved(np.random.default_rng(seed), o.shrink, o.shift, o.turn)
    ox, oy = x + np.cos(h) * o.x - np.sin(h) * o.y, y + np.sin(h) * o.x + np.cos(h) * o.y
    seen, down = tilted(bearing, o.pitch, -o.roll)
    angle = h + o.yaw + seen
    r, incidence, face = room.cast(ox.ravel(), oy.ravel(), angle.ravel())
    r, incidence, face = r.reshape(t.shape), incidence.reshape(t.shape), face.reshape(t.shape)
    with np.errstate(divide="ignore"):
        r = np.minimum(r / np.cos(down), np.where(down > 0, HEIGHT / np.maximum(np.sin(down), 1e-9), np.inf))
    dark = np.array([b.dark for b in room.boxes for _ in range(4)] + [False])[face] * 1.0
    hit_x, hit_y = ox + r * np.cos(angle), oy + r * np.sin(angle)
    return Cast(r, incidence, face, bearing, np.broadcast_to(beam, t.shape) * 1.0, t, hit_x, hit_y, angle, dark, m)


def expect(c: Cast, lenses: Lenses) -> tuple[Array, Array]:
    """Mean and standard deviation of readings, without what happens to single ones."""
    mean, sd = SCALE * c.r + DATUM, SIGMA[0] + SIGMA[1] * c.r + SIGMA[2] * c.r**2
    for lens, size in lenses:
        if lens.kind == "mean":
            mean = mean + np.asarray(lens.act(c, size))
        if lens.kind == "sd":
            sd = sd * np.asarray(lens.act(c, size))
    return mean, sd


def edges(c: Cast, least: float = 0.12) -> Flags:
    """Beams beside which the range jumps, or, for a least jump of 0, another face is met."""
    jump = np.zeros(c.r.shape, dtype=bool)
    with np.errstate(invalid="ignore"):
        step = ~(abs(np.diff(c.r, axis=1)) < least) if least else np.diff(c.face, axis=1) != 0
    jump[:, 1:] |= step
    jump[:, :-1] |= step
    return jump


def unit_noise(rng: np.random.Generator, shape: tuple[int, int], rho: float) -> Array:
    """Normal errors, those of neighbouring beams correlated."""
    e = rng.normal(0, 1, shape)
    for i in range(1, shape[1] if rho else 0):
        e[:, i] = rho * e[:, i - 1] + np.sqrt(1 - rho * rho) * e[:, i]
    return e


def read(rng: np.random.Generator, c: Cast, lenses: Lenses, person: Array | None = None) -> Array:
    """Readings of one drive: mean, noise, what happens to single readings, rounding, gate."""
    mean, sd = expect(c, lenses)
    tricks: dict[str, Array | float] = {}
    for lens, size in lenses:
        if lens.kind == "special":
            tricks |= lens.act(c, size)
    e = unit_noise(rng, (c.r.shape[0], c.r.shape[1]), float(tricks.get("rho", 0.0)))
    if "nu" in tricks:
        e = rng.standard_t(float(tricks["nu"]), c.r.shape)
    z = np.where(np.isfinite(mean), mean, 1e3) + sd * e
    z = z + tricks.get("common", 0.0)
    if person is not None:
        z = np.where(person < c.r, SCALE * person + DATUM + sd * e, z)
    luck = rng.random(c.r.shape)
    away = (luck < tricks.get("outliers", 0.0)) | (rng.random(c.r.shape) < 1e-4)
    z = np.where(away & (z < 100), z + rng.normal(0, 1, z.shape) * tricks.get("reach", 0.1), z)
    beyond = np.stack([np.roll(z, 1, axis=1), np.roll(z, -1, axis=1)]).clip(0, 6).max(axis=0)
    mix = edges(c) & (luck < tricks.get("mixed", 0.0))
    z = np.where(mix, z.clip(0, 6) + rng.random(z.shape) * (beyond - z.clip(0, 6)), z)
    z = np.where(np.asarray(tricks.get("noisy", 0.0)) > 0.5, rng.uniform(0.1, 3.9, z.shape), z)
    step = float(tricks.get("step", 0.001))
    z = np.floor(z / step) * step if tricks.get("floor") else np.round(z / step) * step
    z = np.where(z < NEAR, np.nan, np.where(z > np.minimum(FAR, tricks.get("far", FAR)), np.inf, z))
    lost = rng.random(z.shape) < np.maximum(tricks.get("lost", 0.0), 5e-4)
    return np.where(lost, np.nan, z)


def passer(rng: np.random.Generator, c: Cast, origin: tuple[Array, Array]) -> Array:
    """Ranges to a person who walks by during some ten seconds."""
    begin = rng.uniform(10, max(float(c.t[-1, 0]) - 15, 11))
    mx, my = float(np.mean(origin[0])), float(np.mean(origin[1]))
    way, side = rng.uniform(-np.pi, np.pi), rng.uniform(-0.5, 0.5)
    along = (c.t - begin) * 0.7 - 3
    px, py = mx + along * np.cos(way) - side * np.sin(way), my + along * np.sin(way) + side * np.cos(way)
    dx, dy = px - origin[0], py - origin[1]
    ahead, across = dx * np.cos(c.angle) + dy * np.sin(c.angle), dy * np.cos(c.angle) - dx * np.sin(c.angle)
    with np.errstate(invalid="ignore"):
        near = ahead - np.sqrt(0.18**2 - across**2)
    there = (abs(along) < 3.5) & (abs(across) < 0.18) & (near > 0.1)
    return np.where(there, near, np.inf)
