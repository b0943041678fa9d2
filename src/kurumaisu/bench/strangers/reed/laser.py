# SPDX-License-Identifier: BSD-3-Clause
"""The laser: where its beams go, equation (4), and the readings that come of it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from kurumaisu.bench.strangers.reed.core import Array, Path, Use
from kurumaisu.bench.strangers.reed.room import COLOURS, Room, cast
from kurumaisu.bench.strangers.tilt import tilted

SCALE, DATUM, SIGMA = 1.004587, 0.058826, (0.002334, -0.000488, 0.000199)
Flags = np.ndarray[Any, np.dtype[np.bool_]]
NEAR, FAR, STEP, HEIGHT = 0.06, 4.0, 0.001, 0.40


@dataclass
class Fan:
    """The laser's mounting and fan, as meta.yaml says them."""

    x: float
    y: float
    yaw: float
    angle_min: float
    angle_increment: float
    beams: int
    time_increment: float


@dataclass
class Setting(Fan):
    """What the geometry of a scan depends on, with what is wrong in it."""

    room: Room
    pitch: float = 0.0
    roll: float = 0.0
    delay: float = 0.0
    skew: float = 0.0


@dataclass
class View:
    """Where each beam ends, and what else errors can follow; a row per scan, a column per beam."""

    r: Array
    side: Array
    cosine: Array
    bright: Array
    bearing: Array
    direction: Array
    hit_x: Array
    hit_y: Array
    time: Array
    v: Array
    w: Array
    columns: dict[str, Array]
    edge: Flags

    @property
    def mean(self) -> Array:
        """The mean of equation (4)."""
        return SCALE * self.r + DATUM

    @property
    def sd(self) -> Array:
        """The standard deviation of equation (4), with that of the steps."""
        return np.asarray(np.sqrt((SIGMA[0] + SIGMA[1] * self.r + SIGMA[2] * self.r**2) ** 2 + STEP**2 / 12))

    @property
    def good(self) -> Flags:
        """Beams that the gate lets pass and that meet something."""
        return (self.mean < FAR - 0.02) & (self.mean > NEAR + 0.02) & (self.side >= 0)


def fan_of(rng: np.random.Generator) -> Fan:
    """Every second or third beam of the URG-04LX, mounted about where the model has it."""
    every = int(rng.choice([2, 3]))
    return Fan(
        round(float(rng.uniform(0.2, 0.35)), 3),
        round(float(rng.uniform(-0.05, 0.05)), 3),
        round(float(rng.uniform(-0.1, 0.1)), 4),
        -2.086214,
        0.006135923 * every,
        682 // every,
        9.765625e-5 * every,
    )


def setting(fan: Fan, room: Room, uses: list[Use]) -> Setting:
    """The geometry with what is wrong in it."""
    s = Setting(**vars(fan), room=room)
    for use in uses:
        if use.effect.stage == 10:
            use.act(s)
    return s


def view(
    path: Path,
    rates: tuple[Array, Array],
    stamps: Array,
    start: float,
    s: Setting,
    columns: dict[str, Array],
    spread: Array | None = None,
) -> View:
    """Cast all beams of the scans of a drive; spread: errors of the pose of each scan."""
    k, fan = np.arange(s.beams), s
    bearing = fan.angle_min + fan.angle_increment * k
    taken = stamps * (1 - s.skew) - start * s.skew - s.delay
    t = taken[:, None] + fan.time_increment * k[None, :]
    x, y, th = path.at(t)
    if spread is not None:
        x, y, th = x + spread[:, :1], y + spread[:, 1:2], th + spread[:, 2:]
    ox, oy = x + fan.x * np.cos(th) - fan.y * np.sin(th), y + fan.x * np.sin(th) + fan.y * np.cos(th)
    seen, down = tilted(bearing, s.pitch, s.roll)
    angle = th + fan.yaw + seen
    o, d = np.stack([ox, oy], axis=2).reshape(-1, 2), np.stack([np.cos(angle), np.sin(angle)], axis=2).reshape(-1, 2)
    r, side, cosine = (a.reshape(t.shape) for a in cast(s.room.sides(), o, d))
    level, floor = r / np.cos(down), np.where(down > 1e-3, HEIGHT / np.sin(np.maximum(down, 1e-3)), 99.0)
    side = np.where(floor < level, 998.0, side)
    shade = np.array([COLOURS[c] for c in s.room.colours])
    bright = shade[np.clip(side // 4, 0, len(shade) - 1).astype(int)]
    jump = (np.abs(np.diff(r, axis=1, prepend=r[:, :1])) > 0.1) & (np.diff(side, axis=1, prepend=side[:, :1]) != 0)
    grid = path.t[:-1]
    wide = np.ones_like(r)
    v, w = (np.interp(stamps, grid, rate)[:, None] * wide for rate in rates)
    held = {key: np.interp(stamps, grid, value)[:, None] * wide for key, value in columns.items()}
    return View(
        np.minimum(level, floor),
        side,
        cosine,
        bright,
        bearing * wide,
        angle,
        ox + r * np.cos(angle),
        oy + r * np.sin(angle),
        (start + stamps)[:, None] * wide,
        v,
        w,
        held,
        jump | np.roll(jump, -1, axis=1),
    )


def bias(look: View, uses: list[Use]) -> Array:
    """All systematic errors of the readings."""
    return np.asarray(sum([use.law(look, use) for use in uses if use.effect.stage == 11], np.zeros_like(look.r)))


def factor(look: View, uses: list[Use]) -> Array:
    """By how much the scatter is larger."""
    return np.asarray(np.prod([np.ones_like(look.r), *[u.law(look, u) for u in uses if u.effect.stage == 12]], axis=0))


def read(rng: np.random.Generator, look: View, uses: list[Use], dead: float = 0.002) -> Array:
    """The readings: bias, noise, what goes wrong with single beams, steps, gate."""
    unit = rng.normal(size=look.r.shape)
    for use in uses:
        if use.effect.stage == 13:
            unit = use.law(rng, unit, look, use)
    sigma = SIGMA[0] + SIGMA[1] * look.r + SIGMA[2] * look.r**2
    z = look.mean + bias(look, uses) + sigma * factor(look, uses) * unit
    z = np.where(look.side < 0, 99.0, z)
    for use in uses:
        if use.effect.stage == 14:
            z = use.law(rng, z, look, use)
    z = np.round(z / STEP) * STEP
    z = np.where(z < NEAR, np.nan, np.where(z > FAR, np.inf, z))
    return np.where(rng.random(z.shape) < dead, np.nan, z)
