# SPDX-License-Identifier: BSD-3-Clause
"""What a laser sees from poses, what it reads on the mean, and readings with their scatter."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from kurumaisu.bench.strangers.loess.laser_effects import LASER
from kurumaisu.bench.strangers.loess.lasers import Laser
from kurumaisu.bench.strangers.loess.plant import wander
from kurumaisu.bench.strangers.loess.rooms import Room, cast, real_room
from kurumaisu.bench.strangers.loess.scatter_effects import SPOIL, SPREAD
from kurumaisu.bench.strangers.loess.values import Array, Hidden, Sight, Spread, ordered

GEOMETRY = {
    "laser.mount_x": (0.01, 0.04, "x"),
    "laser.mount_y": (0.01, 0.04, "y"),
    "laser.mount_yaw": (0.008, 0.03, "yaw"),
    "laser.tilt": (0.04, 0.1, ""),
    "laser.sweep": (0.15, 0.6, "stretch"),
    "laser.latency": (0.02, 0.09, "delay"),
    "laser.clock_skew": (1e-4, 4e-4, "skew"),
    "world.map_error": (0.01, 0.03, "sd"),
}
FLOOR = 0.4


@dataclass
class Scans:
    """Scans of a drive: stamps since its start and since all began, poses at times from the stamps, rates, columns."""

    t: Array
    clock: Array
    pose_at: Callable[[Array], Array]
    rates: Array
    columns: dict[str, Array]


def _size(hidden: list[Hidden], name: str) -> tuple[float, bool, float]:
    for h in hidden:
        if h.id == name:
            return h.size, h.other, h.extra
    return 0.0, False, 0.5


def _taken(scans: Scans, hidden: list[Hidden]) -> Array:
    """How long after its stamp each scan is taken."""
    delay, uneven, _ = _size(hidden, "laser.latency")
    skew, anew, _ = _size(hidden, "laser.clock_skew")
    late = delay * (1 + (0.3 * np.sin(1.7 * scans.t) if uneven else 0.0))
    return np.asarray(-late - skew * (3 * scans.t if anew else scans.clock))


def _tilted(r: Array, bearing: Array, hidden: list[Hidden]) -> Array:
    pitch, blind, extra = _size(hidden, "laser.tilt")
    if pitch == 0:
        return r
    down = pitch * np.cos(bearing) + pitch * (extra - 0.5) * np.sin(bearing)
    long = r / np.cos(down)
    if blind:
        return np.asarray(long)
    with np.errstate(divide="ignore"):
        return np.asarray(np.where(down > 1e-4, np.minimum(long, FLOOR / np.sin(np.maximum(down, 1e-4))), long))


def look(laser: Laser, room: Room, scans: Scans, hidden: list[Hidden]) -> Sight:
    """What each beam of each scan meets."""
    pose = scans.pose_at(_taken(scans, hidden))
    stretch, bent, _ = _size(hidden, "laser.sweep")
    n = np.arange(laser.beams)
    time = laser.beam_time * n * (1 + stretch * ((n / laser.beams) ** 0.3 if bent else 1.0))
    v, w, side = (scans.rates[:, i : i + 1] for i in range(3))
    a = pose[:, 2:3] + w * time
    middle = pose[:, 2:3] + w * time / 2
    x = pose[:, :1] + (v * np.cos(middle) - side * np.sin(middle)) * time
    y = pose[:, 1:2] + (v * np.sin(middle) + side * np.cos(middle)) * time
    (mx, slant, _), (my, skewed, _) = _size(hidden, "laser.mount_x"), _size(hidden, "laser.mount_y")
    mx, my = mx + (0.2 * my if skewed else 0.0), my + (0.2 * mx if slant else 0.0)
    myaw, wobbly, _ = _size(hidden, "laser.mount_yaw")
    yaw = laser.yaw + myaw * (1 + (0.4 * np.tanh(v / 0.3) if wobbly else 0.0))
    x = x + (laser.x + mx) * np.cos(a) - (laser.y + my) * np.sin(a)
    y = y + (laser.x + mx) * np.sin(a) + (laser.y + my) * np.cos(a)
    bearing = laser.bearings()
    direction = a + yaw + bearing
    r, incidence, bright = cast(real_room(room, hidden).segments(), x, y, direction)
    tilted = _tilted(r, bearing + laser.yaw, hidden)
    before, after = np.roll(tilted, 1, axis=1) - tilted, np.roll(tilted, -1, axis=1) - tilted
    edge = np.where(np.abs(before) > np.abs(after), before, after)
    hit_x, hit_y = x + r * np.cos(direction), y + r * np.sin(direction)
    return Sight(
        tilted,
        incidence,
        bright,
        hit_x,
        hit_y,
        direction,
        bearing,
        scans.t,
        scans.clock,
        scans.rates[:, 0],
        scans.columns,
        edge,
    )


def mean_reading(laser: Laser, sight: Sight, hidden: list[Hidden]) -> Array:
    """What the beams read on the mean."""
    mean: Array = laser.scale * sight.range + laser.offset
    for effect, h in ordered(hidden, LASER, "mean"):
        effect.act(mean, sight, h)
    return mean


def spread(laser: Laser, sight: Sight, hidden: list[Hidden]) -> Spread:
    """How the readings scatter."""
    out = Spread(laser.noise(np.minimum(sight.range, 40.0)))
    for effect, h in ordered(hidden, SPREAD, "spread"):
        effect.act(out, sight, h)
    return out


def _scatter(x: Spread, rng: np.random.Generator) -> Array:
    white = rng.standard_normal(x.sd.shape)
    if x.pairs:
        white[:, 1:] = (white[:, 1:] + x.beams * white[:, :-1]) / np.sqrt(1 + x.beams**2)
    elif x.beams:
        for i in range(1, white.shape[1]):
            white[:, i] = x.beams * white[:, i - 1] + np.sqrt(1 - x.beams**2) * white[:, i]
    shared = wander(rng, len(white), 1.0, -1 / np.log(x.rho)) if x.common else np.zeros(len(white))
    return np.asarray(x.sd * white + x.common * shared[:, None])


def read(laser: Laser, sight: Sight, hidden: list[Hidden], rng: np.random.Generator) -> Array:
    """Readings with noise, spoilt as hidden, rounded and gated."""
    r: Array = mean_reading(laser, sight, hidden) + _scatter(spread(laser, sight, hidden), rng)
    r[~np.isfinite(r)] = np.inf
    for effect, h in ordered(hidden, SPOIL, "spoil"):
        effect.act(r, sight, h, rng)
    r[:] = laser.resolution * np.round(r / laser.resolution)
    with np.errstate(invalid="ignore"):
        r[r > laser.far] = np.inf
        r[r < laser.near] = np.nan
    return r
