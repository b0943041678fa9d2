# SPDX-License-Identifier: BSD-3-Clause
"""Where the beams hit, and the mean reading: mount, clocks, and the biases of the causes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from kurumaisu.bench.strangers.scree.basics import Array, Cause, between, compose
from kurumaisu.bench.strangers.scree.lasers import HEIGHT, Laser
from kurumaisu.bench.strangers.scree.plant import Causes, Drive
from kurumaisu.bench.strangers.scree.rooms import Room, cast
from kurumaisu.bench.strangers.scree.unknowns import episodes


@dataclass(frozen=True)
class Site:
    """A laser in a room."""

    room: Room
    laser: Laser


@dataclass(frozen=True)
class Hits:
    """Where beams end: arrays of scans by beams, except t, v, w (a column each) and bearing (a row)."""

    r: Array
    cos: Array
    normal: Array
    wall: Array
    bright: Array
    angle: Array
    x: Array
    y: Array
    bearing: Array
    t: Array
    v: Array
    w: Array
    drive: Drive

    @property
    def tangent(self) -> Array:
        """The tangent of the angle of incidence, up to 3."""
        return np.asarray(np.minimum(np.sqrt(1 - self.cos**2) / self.cos, 3.0))

    def column(self, c: Cause) -> Array:
        """The column that an unknown follows, at the scans."""
        columns = self.drive.columns
        return columns[int(c.draws[0] * len(columns)) % len(columns)].shape(self.t + self.drive.start)


Bias = Callable[[Cause, Hits], Array]


def _beam_times(laser: Laser, causes: Causes, stamps: Array) -> Array:
    late, stretch = np.zeros_like(stamps), 1.0
    for c in causes:
        if c.id == "laser.latency":
            late = late + c.size * (1 + (0.2 * np.sin(stamps * 1.7) if c.other else 0.0))
        elif c.id == "laser.clock_skew":
            late = late + c.size * (stamps + (12 * np.sin(stamps / 15.0) if c.other else 0.0))
        elif c.id == "laser.sweep":
            stretch = stretch + c.size
    share = np.arange(laser.beams)
    if any(c.id == "laser.sweep" and c.other for c in causes):
        share = share * (0.9 + 0.1 * share / laser.beams)
    return np.asarray((stamps - late)[:, None] + laser.between * stretch * share)


def _mount(laser: Laser, causes: Causes, bearing: Array) -> Array:
    at = np.tile(np.array(laser.mount), (len(bearing), 1))
    for c in causes:
        k = {"laser.mount_x": 0, "laser.mount_y": 1, "laser.mount_yaw": 2}.get(c.id)
        if k is not None:
            at[:, k] += c.size * (1 + 0.15 * np.cos(bearing) if c.other else 1.0)
    return at


def look(site: Site, causes: Causes, drive: Drive, stamps: Array, pose: Array) -> Hits:
    """The hits of scans with these stamps, if the robot was at these poses then."""
    laser = site.laser
    times = _beam_times(laser, causes, stamps)
    moved = between(drive.path.at(stamps)[:, None], drive.path.at(times))
    body = compose(pose[:, None], moved)
    sensor = compose(body, _mount(laser, causes, laser.bearing)[None])
    angle = sensor[..., 2] + laser.bearing
    r, k = cast(site.room, sensor, angle)
    a, b = site.room.segments()
    d = b - a
    out = np.stack([d[:, 1], -d[:, 0]], axis=-1) / np.hypot(d[:, 0], d[:, 1])[:, None]
    which = k.astype(int)
    n = out[which]
    cos = np.maximum(np.abs(n[..., 0] * np.cos(angle) + n[..., 1] * np.sin(angle)), 0.05)
    step = drive.path.at(stamps + 0.05) - drive.path.at(stamps - 0.05)
    v = np.hypot(step[:, 0], step[:, 1])[:, None] / 0.1
    hit = sensor[..., 0] + r * np.cos(angle), sensor[..., 1] + r * np.sin(angle)
    bright = site.room.bright()[which]
    return Hits(r, cos, n, k, bright, angle, *hit, laser.bearing[None], stamps[:, None], v, step[:, 2:] / 0.1, drive)


def _warmup(c: Cause, h: Hits) -> Array:
    on, tau = h.t + h.drive.start, c.draw(0, 120.0, 400.0)
    if c.other:
        return np.asarray(c.size * (0.6 * np.exp(-on / (0.5 * tau)) + 0.4 * np.exp(-on / (2.2 * tau))))
    return np.asarray(c.size * np.exp(-on / tau))


def _temperature(c: Cause, h: Hits) -> Array:
    column = h.drive.columns[0]
    off = column.at(h.t + h.drive.start - c.draw(0, 0.0, 20.0)) - 21.0
    return np.asarray(c.size * (off * (1 + 0.06 * off) if c.other else off))


def _cyclic(c: Cause, h: Hits) -> Array:
    turn = 2 * np.pi * h.r / c.draw(0, 2.0, 4.0) + c.draw(1, -3.1, 3.1)
    return np.asarray(c.size * (2 / np.pi * np.arcsin(np.sin(turn)) * 1.2 if c.other else np.sin(turn)))


def _beam_bias(c: Cause, h: Hits) -> Array:
    turn = h.bearing + c.draw(0, -3.1, 3.1)
    own = np.random.default_rng(int(1e6 * c.draws[1])).standard_normal(h.bearing.shape)
    return np.asarray(c.size * (np.sin(turn) + (0.4 * np.sin(2 * turn + 1) if c.other else 0.0) + 0.4 * own))


def _incidence(c: Cause, h: Hits) -> Array:
    return np.asarray(c.size * (1.5 * (1 / np.maximum(h.cos, 0.25) - 1) ** 0.8 if c.other else h.tangent))


def _reflectance(c: Cause, h: Hits) -> Array:
    return np.asarray(c.size * (-0.7 * np.log(h.bright) if c.other else 1 - h.bright))


def _map_error(c: Cause, h: Hits) -> Array:
    own = np.random.default_rng(int(1e6 * c.draws[0])).standard_normal((60, 2)) * c.size
    move = own[(h.wall // 4).astype(int)]
    if c.other:
        move = move + c.size * np.sin(1.3 * np.stack([h.y, h.x], axis=-1) + 6 * c.draws[1])
    along = h.normal[..., 0] * np.cos(h.angle) + h.normal[..., 1] * np.sin(h.angle)
    along = np.where(np.abs(along) < 0.15, np.sign(along) * 0.15, along)
    return np.asarray((h.normal * move).sum(-1) / along)


def _tilt(c: Cause, h: Hits) -> Array:
    roll = c.draw(0, -0.7, 0.7) * c.size
    down = c.size * np.cos(h.bearing) + roll * np.sin(h.bearing)
    if c.other:
        down = down * (1 + 0.1 * np.cos(2 * h.bearing))
    floor = np.where(down > 1e-3, HEIGHT / np.sin(np.maximum(down, 1e-3)), 1e3)
    return np.asarray(np.minimum(h.r / np.cos(down), floor) - h.r)


BIASES: dict[str, Bias] = {
    "laser.offset": lambda c, h: c.size * (1 - np.exp(-h.r / 0.2) if c.other else np.ones_like(h.r)),
    "laser.scale": lambda c, h: c.size * h.r * (1 + (0.12 * np.tanh(h.r - 3) if c.other else 0.0)),
    "laser.quadratic": lambda c, h: c.size * (h.r**2.4 / 1.6 if c.other else h.r**2),
    "laser.warmup": _warmup,
    "laser.temperature": _temperature,
    "laser.cyclic": _cyclic,
    "laser.incidence_bias": _incidence,
    "laser.reflectance": _reflectance,
    "laser.beam_bias": _beam_bias,
    "laser.tilt": _tilt,
    "world.map_error": _map_error,
    "unknown.haze": lambda c, h: c.size * np.tanh(1.5 * h.column(c)) + 0 * h.r,
    "unknown.sunlight": lambda c, h: c.size * np.exp((np.cos(h.angle - 6 * c.draws[0]) - 1) / 0.15),
    "unknown.curtain": lambda c, h: c.size * np.sin(h.x * c.draw(0, 1.4, 2.4) + 6 * c.draws[1]),
    "unknown.flicker": lambda c, h: c.size * episodes(h.t + 0.37 * h.drive.start, c) + 0 * h.r,
    "unknown.shaking": lambda c, h: c.size * np.tanh(h.v / (0.5 * h.drive.robot.v_top)) + 0 * h.r,
}


def mean_reading(site: Site, causes: Causes, h: Hits) -> Array:
    """The mean reading of each beam, before steps and gate."""
    laser = site.laser
    out = laser.scale * h.r + laser.datum
    for c in causes:
        if c.id in BIASES:
            out = out + BIASES[c.id](c, h)
    return np.asarray(out)
