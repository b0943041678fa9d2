# SPDX-License-Identifier: BSD-3-Clause
"""The laser: where its beams end, and what it reads."""

from collections.abc import Callable, Sequence

import numpy as np

from kurumaisu.bench.strangers.delta.core import Array, Cause, Drive, Setup
from kurumaisu.bench.strangers.delta.law import FAR, HEIGHT, NEAR, RESOLUTION, mean_reading, sd_reading
from kurumaisu.bench.strangers.delta.optics import BIAS, SPREAD, spoil
from kurumaisu.bench.strangers.delta.quantities import of_hits
from kurumaisu.bench.strangers.delta.room import Hits, Room

LOST = 0.002
PoseAt = Callable[[Array], Array]


def taken(setup: Setup, drive: Drive, stamps: Array, causes: Sequence[Cause]) -> Array:
    """When each beam of scans was really taken, by the scans' stamps: (scans, beams)."""
    step, late, share = setup.fan.time_increment, np.zeros(len(stamps)), np.arange(setup.fan.beams) / setup.fan.beams
    turn = setup.fan.beams * step * share
    for c in causes:
        if c.id == "laser.sweep":
            wave = np.sin(np.pi * share) * 0.6 if c.other else share
            turn = turn + c.size * setup.fan.beams * step * wave
        elif c.id == "laser.latency":
            late = late + c.size * (0.5 + np.mod(stamps * 0.37, 1.0) if c.other else 1)
        elif c.id == "laser.clock_skew":
            late = late + c.size * (stamps**2 / 100 if c.other else stamps)
    return np.asarray((stamps - late)[:, None] + turn[None, :])


def real_room(setup: Setup, causes: Sequence[Cause]) -> Room:
    """The room as it is, not as the map shows it."""
    room = setup.room
    for c in causes:
        if c.id == "world.map_error":
            n = len(room.boxes)
            shifts = np.random.default_rng(7).normal(0, 1, (n, 2))
            if c.other:
                shifts *= (np.arange(n) == 1)[:, None] * 2
            else:
                shifts *= 0 if c.extra.get("scaled") else 1
            room = room.moved(shifts * c.size, 1 + c.size * c.extra.get("scaled", 0.0))
    return room


def hits(setup: Setup, drive: Drive, stamps: Array, poses: PoseAt, causes: Sequence[Cause]) -> Hits:
    """Where the beams of scans end, the chair being where `poses` says: (..., scans, beams)."""
    t = taken(setup, drive, stamps, causes)
    pose = poses(t)
    mx, my, yaw, pitch, roll = setup.fan.x, 0.0, 0.0, 0.0, 0.0
    for c in causes:
        mx += c.size * (c.id == "laser.mount_x")
        my += c.size * (c.id == "laser.mount_y")
        yaw += c.size * (c.id == "laser.mount_yaw")
        if c.id == "laser.tilt":
            pitch, roll = c.size * c.extra["pitch"], c.size * c.extra["roll"]
    bearing = np.broadcast_to(setup.fan.angles, pose.shape[:-1])
    th = pose[..., 2]
    x, y = pose[..., 0] + mx * np.cos(th) - my * np.sin(th), pose[..., 1] + mx * np.sin(th) + my * np.cos(th)
    direction = th + bearing + yaw
    r, normal, bright, cos = real_room(setup, causes).cast(x, y, direction)
    if pitch or roll:
        down = np.sin(pitch) * np.cos(bearing) - np.sin(roll) * np.sin(bearing)
        floor = np.where(down > 1e-6, HEIGHT / np.maximum(down, 1e-6), np.inf)
        r = np.minimum(r / np.sqrt(1 - down**2), floor)
        cos = np.where(r == floor, np.maximum(np.abs(down), 0.02), cos)
    grid_v, grid_w = drive.true_path().v, drive.true_path().w
    cell = np.clip(np.round(t * 100).astype(int), 0, len(grid_v) - 1)
    px, py = x + np.minimum(r, 9) * np.cos(direction), y + np.minimum(r, 9) * np.sin(direction)
    wrapped = np.arctan2(np.sin(direction), np.cos(direction))
    t, v, w = (np.broadcast_to(u, r.shape) for u in (t, grid_v[cell], grid_w[cell]))
    return Hits(r, cos, wrapped, normal, bright, px, py, bearing, t, v, w)


def walked(setup: Setup, drive: Drive, h: Hits, poses: PoseAt) -> Array:
    """True ranges with the person that walks through the room, if there is one."""
    begin, offset, slant = drive.walker
    if begin < 0:
        return h.r
    pose = poses(h.t)
    lx, ly = pose[..., 0] + setup.fan.x * np.cos(pose[..., 2]), pose[..., 1] + setup.fan.x * np.sin(pose[..., 2])
    gone = h.t - begin
    px, py = 0.8 * gone, offset + slant * gone
    ux, uy = np.cos(h.direction), np.sin(h.direction)
    ahead = (px - lx) * ux + (py - ly) * uy
    aside = np.abs((py - ly) * ux - (px - lx) * uy)
    depth = ahead - np.sqrt(np.maximum(0.2**2 - aside**2, 0))
    seen = (aside < 0.2) & (depth > 0.05) & (gone > 0) & (px < setup.room.width) & (depth < h.r)
    return np.asarray(np.where(seen, depth, h.r))


def expected(setup: Setup, drive: Drive, h: Hits, causes: Sequence[Cause], r: Array | None = None) -> Array:
    """Mean readings before noise and gate."""
    r = h.r if r is None else r
    mean = mean_reading(r)
    for c in causes:
        if c.id in BIAS:
            mean = mean + BIAS[c.id](setup, drive, h, c)
        if c.curve and c.curve.channel == "range":
            mean = mean + c.size * c.curve.shape(of_hits(setup, drive, h, c.curve.covariate))
    return mean


def spread(setup: Setup, drive: Drive, h: Hits, causes: Sequence[Cause]) -> Array:
    """Standard deviation of the noise of readings."""
    sd = sd_reading(np.minimum(h.r, 6.0))
    for c in causes:
        if c.id in SPREAD:
            sd = sd * SPREAD[c.id](h, c)
        if c.curve and c.curve.channel == "range_noise":
            sd = sd * np.exp(c.size * c.curve.shape(of_hits(setup, drive, h, c.curve.covariate)))
    return sd


def read(
    setup: Setup, drive: Drive, h: Hits, causes: Sequence[Cause], rng: np.random.Generator, r: Array | None = None
) -> Array:
    """Readings: noise, what else spoils them, steps, and the gate."""
    mean, sd = expected(setup, drive, h, causes, r), spread(setup, drive, h, causes)
    reading = spoil(setup, h, mean, sd, causes, rng)
    step = RESOLUTION
    for c in causes:
        if c.id == "laser.quantisation":
            step = c.size
    coarse = np.round(np.where(np.isfinite(reading), reading, 1e3) / step) * step
    out = np.where(coarse > FAR, np.inf, np.where(coarse < NEAR, np.nan, coarse))
    for c in causes:
        if c.id == "laser.saturation":
            near, far = c.extra["near"] * c.size, FAR - c.size
            fade = rng.normal(0, 0.1, out.shape) if c.other else 0.0
            out = np.where(np.isfinite(out) & (out > far + fade), np.inf, np.where(out < near, np.nan, out))
        if c.id == "laser.dropout":
            out = np.where(rng.random(out.shape) < missing(h, c), np.nan, out)
    return np.asarray(np.where(rng.random(out.shape) < LOST, np.nan, out))


def missing(h: Hits, c: Cause) -> Array:
    """Probability that a reading is lost; other: where little light comes back."""
    if c.other:
        return np.asarray(c.size * np.minimum(h.r, 4) ** 2 / 4 * (1.5 - h.cos))
    return np.full(h.r.shape, c.size)


def scan(setup: Setup, drive: Drive, causes: Sequence[Cause], dry: bool = False) -> None:
    """All scans of a drive; dry: only their stamps."""
    rng, path = setup.rng, drive.true_path()

    def poses(t: Array) -> Array:
        """True poses."""
        return np.stack(path.at(t), -1)

    period = setup.facts["scan_period"]
    stamps = np.arange(1.0, drive.length - 1.0, period)
    stamps = np.round(stamps + np.clip(rng.normal(0, 0.002, len(stamps)), -0.01, 0.01), 5)
    drive.scan_t = stamps
    if dry:
        return
    h = hits(setup, drive, stamps, poses, causes)
    drive.scans = read(setup, drive, h, causes, rng, walked(setup, drive, h, poses))
