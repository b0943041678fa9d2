# SPDX-License-Identifier: BSD-3-Clause
"""A URG-04LX on its bracket: rays against the boxes of a room, what can be wrong with it, and its readings."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kurumaisu.bench.strangers.tilt import tilted

from .drive import Room
from .plant import Array, Flags

ANGLE, STEP, TICK, BEAMS, HEIGHT = -2.086214, 0.006135923, 9.765625e-5, 682, 0.40
MOUNT = (0.30, 0.0, 0.0)
GEOMETRY = {"x", "y", "yaw", "pitch", "roll", "stretch", "delay", "skew", "map_scale", "map_sd", "delay_some"}
ODD = {"tails", "mixed", "wide", "near", "far", "talk", "skewed"}


@dataclass
class Scans:
    """Stamps (from the run's start) and run of each scan, and the paths that they are taken from."""

    t: Array
    run: Array
    every: int
    grid: Array  # times of the path's points
    pose: Array  # (points, 3, runs)
    room: Room
    warm: Array  # temperature of each scan
    hours: Array  # time since the laser was switched on, of each scan
    draws: Array  # (beams,) normal numbers of this unit
    walls: Array  # (boxes, 2) normal numbers of this room

    def angles(self) -> Array:
        """Bearings of the recorded beams."""
        return ANGLE + STEP * self.every * np.arange((BEAMS + self.every - 1) // self.every)


@dataclass
class View:
    """What each beam (scans, beams) meets: range, tangent of incidence, box, where, and its changes with the pose."""

    r: Array
    tan: Array
    box: Array
    direction: Array
    edge: Flags
    jac: Array  # (3, scans, beams): with x, y forward and left, and heading
    pace: Array  # metres per second of delay
    pose: Array  # (3, scans, beams)


def cast(x: Array, y: Array, a: Array, segments: Array) -> tuple[Array, Array, Array]:
    """Range, signed tangent of incidence and index of the nearest side of rays from (x, y) in direction a."""
    shape, best = x.shape, np.full(x.size, 1e3)
    dx, dy, ox, oy = np.cos(a).ravel(), np.sin(a).ravel(), x.ravel(), y.ravel()
    side = np.zeros(x.size, int)
    for i, (x1, y1, x2, y2) in enumerate(segments):
        ex, ey = x2 - x1, y2 - y1
        facing = dx * ey - dy * ex
        r = ((x1 - ox) * ey - (y1 - oy) * ex) / np.where(facing == 0, 1e-12, facing)
        u = ((x1 - ox) * dy - (y1 - oy) * dx) / np.where(facing == 0, 1e-12, facing)
        hit = (r > 0) & (u >= 0) & (u <= 1) & (r < best)
        best[hit], side[hit] = r[hit], i
    e = segments[side, 2:] - segments[side, :2]
    length = np.hypot(e[:, 0], e[:, 1])
    along, across = (dx * e[:, 0] + dy * e[:, 1]) / length, (dx * e[:, 1] - dy * e[:, 0]) / length
    tan = np.clip(along / np.where(across == 0, 1e-9, across), -8, 8)
    return best.reshape(shape), tan.reshape(shape), side.reshape(shape)


def mapped(room: Room, s: Scans, f: dict[str, float]) -> Array:
    """Boxes as the map has them, if it is not true."""
    boxes = room.boxes.copy()
    middle = np.array(room.middle)
    boxes[:, :2] = middle + (boxes[:, :2] - middle) * (1 + f.get("map_scale", 0.0)) + f.get("map_sd", 0.0) * s.walls
    boxes[:, 3:] *= 1 + f.get("map_scale", 0.0)
    return boxes


def look(s: Scans, f: dict[str, float]) -> View:
    """Rays of all scans, with the faults that change where they go."""
    bearing = s.angles()[None, :]
    some = f.get("delay_some", 0.0) * (np.sin(s.t * 7.3 + s.run) > 0)
    start = s.t * (1 - f.get("skew", 0.0)) - f.get("delay", 0.0) - some
    t = start[:, None] + np.arange(bearing.size) * s.every * TICK * (1 + f.get("stretch", 0.0))
    pose = np.empty((3, *t.shape))
    rate = np.empty((3, *t.shape))
    for run in np.unique(s.run):
        i = s.run == run
        for c in range(3):
            pose[c, i] = np.interp(t[i], s.grid, s.pose[:, c, run])
            rate[c, i] = (np.interp(t[i] + 0.02, s.grid, s.pose[:, c, run]) - pose[c, i]) / 0.02
    c, q = np.cos(pose[2]), np.sin(pose[2])
    mx, my = MOUNT[0] + f.get("x", 0.0), MOUNT[1] + f.get("y", 0.0)
    seen, down = tilted(bearing, f.get("pitch", 0.0), f.get("roll", 0.0))
    a = pose[2] + seen + f.get("yaw", 0.0)
    r, tan, side = cast(pose[0] + mx * c - my * q, pose[1] + mx * q + my * c, a, s.room.segments(mapped(s.room, s, f)))
    r = np.minimum(r / np.cos(down), np.where(down > 1e-3, HEIGHT / np.sin(np.maximum(down, 1e-3)), 1e3))
    jump = (np.diff(side, axis=1) != 0) & (np.abs(np.diff(r, axis=1)) > 0.04)
    edge = np.zeros(r.shape, bool)
    edge[:, 1:] |= jump
    edge[:, :-1] |= jump
    turn = a - pose[2]
    jx, jy = -(np.cos(turn) + np.sin(turn) * tan), -(np.sin(turn) - np.cos(turn) * tan)
    jh = -r * -tan + mx * jy - my * jx
    forward, left = rate[0] * c + rate[1] * q, -rate[0] * q + rate[1] * c
    pace = -(jx * forward + jy * left + jh * rate[2])
    return View(r, tan, side // 4, a % (2 * np.pi), edge, np.stack([jx, jy, jh]), pace, pose)


def level(s: Scans, v: View, f: dict[str, float], speed: Array) -> tuple[Array, Array]:
    """Mean and standard deviation of the readings; speed of each scan for what shakes."""

    def g(name: str) -> float:
        return f.get(name, 0.0)

    r, tan = v.r, abs(v.tan)
    inc = np.arctan(tan)
    bearing = s.angles()[None, :]
    cyc = np.sin(2 * np.pi * r / 3.0 + 1.0)
    mean = 1.004587 * r + 0.058826 + g("offset") + g("scale") * r + g("quad") * r * r
    mean = mean + (g("warm") * np.exp(-s.hours / 600.0) + g("set_in") * np.minimum(s.hours / 900.0, 1))[:, None]
    mean = mean + (g("temp") * (s.warm - 20.0))[:, None] + g("cyclic") * cyc + g("sharp") * np.tanh(4 * cyc)
    mean = mean + g("slant") * tan + g("slant_sat") * np.sin(inc) ** 4 + g("dark") * s.room.dark[v.box]
    mean = mean + g("beam") * s.draws[None, :] + g("wave") * np.sin(3 * bearing + 1.0)
    near = np.exp(4 * (np.cos(v.direction - 1.0) - 1))
    inside = (v.pose[0] - s.room.middle[0]) * 0.6 + (v.pose[1] - s.room.middle[1]) * 0.8 > 0
    mean = mean + g("sun") * near + g("fog") * inside + g("shake") * abs(speed)[:, None]
    mean = mean + g("jolt") * (s.t > 25.0)[:, None]
    sd = 0.000199 * r * r - 0.000488 * r + 0.002334
    sd = sd * (1 + g("noise")) * np.sqrt(1 + g("slant_noise") * tan**2) * (1 + g("range_noise") * (r - 1) ** 2)
    sd = sd * (1 + g("shake_sd") * np.minimum(abs(speed) / 0.3, 1)[:, None]) * (1 + g("sun_sd") * near)
    sd = sd * (1 + g("blink_sd") * (np.sin(s.t / 3.1) > 0.2)[:, None])
    if g("step") > 0.001:
        k = g("step")
        damp = np.exp(-2 * np.pi**2 * sd**2 / k**2)
        mean = mean - k / np.pi * damp * np.sin(2 * np.pi * mean / k)
        sd = np.sqrt(sd**2 + k**2 / 12 * (1 - damp))
    return mean, sd


def odd(rng: np.random.Generator, s: Scans, v: View, f: dict[str, float], x: Array) -> Array:
    """Readings that are far from their mean: replaces them."""

    def g(name: str) -> float:
        return f.get(name, 0.0)

    chance, size = rng.random(x.shape), rng.normal(size=x.shape)
    x = np.where(chance < g("tails"), x + 0.05 * size, x)
    x = np.where((chance > 0.5) & (chance < 0.5 + g("skewed")), x + 0.04 + 0.03 * abs(size), x)
    other = np.where(v.edge, np.roll(v.r, 1, axis=1) - v.r, 0.0)
    other = np.where(abs(other) > 0.12, other, np.where(v.edge, np.roll(v.r, -1, axis=1) - v.r, 0.0))
    other = np.clip(other, -4, 4)
    share = rng.random(x.shape)
    x = np.where(v.edge & (chance < g("mixed")), x + share * other, x)
    x = np.where(v.edge & (share < min(g("wide") / 0.01, 1)), x + other * (1 - share) ** 2, x)
    if g("talk") > 0:
        ang = s.angles()[None, :]
        centre = (0.5 * s.t + 2.0 * s.run)[:, None] % 4.2 - 2.1
        burst = (np.sin(s.t * 0.8 + s.run) > 0.6)[:, None] & (abs(ang - centre) < 0.15)
        x = np.where(burst & (chance < g("talk")), rng.uniform(0.1, 4.0, x.shape), x)
    if g("far") > 0:
        x = np.minimum(x, 1 / g("far"))
    return np.asarray(np.maximum(x, g("near")))


def read(rng: np.random.Generator, s: Scans, v: View, f: dict[str, float], speed: Array) -> tuple[Array, Flags]:
    """Readings (inf: no return, nan: not valid), and which of them are far from their mean by a fault."""
    mean, sd = level(s, v, {**f, "step": 0.0}, speed)
    e = rng.normal(size=mean.shape)
    rho = f.get("rho", 0.0)
    for j in range(1, e.shape[1]):
        e[:, j] = rho * e[:, j - 1] + np.sqrt(1 - rho**2) * e[:, j]
    plain = mean + sd * e
    x = odd(rng, s, v, f, plain)
    far_off = (abs(x - plain) > 5 * sd) & (mean < 4.0)
    step = max(f.get("step", 0.0), 0.001)
    x = np.round(np.round(x / step) * step, 3)
    x = np.where((v.r > 100) | (x > 4.0), np.inf, x)
    lost = (rng.random(x.shape) < 0.003) | (x < 0.06)
    return np.where(lost, np.nan, x), far_off


def gram(
    s: Scans, v: View, base: tuple[Array, Array], views: list[tuple[Array, Array]], pose_sd: tuple[float, float]
) -> Array:
    """Products of the signals (mean and sd by view, against base) under the readings' covariance.

    The covariance of the readings of a scan is diagonal plus what white errors of the reference's pose add to all of
    them; other scans are independent. A change of the scatter counts by its Fisher information, 2 (ln ratio)^2.
    """
    mean, sd = base
    ok = (mean < 3.95) & ~v.edge & (v.r < 100) & (abs(v.tan) < 6)
    m = np.stack([np.where(ok & (abs(a - mean) < 0.15), (a - mean) / sd, 0.0) for a, _ in views])
    h = np.stack([np.where(ok, np.log(b / sd), 0.0) for _, b in views])
    jac = np.where(ok, v.jac / sd, 0.0)
    weight = np.diag([pose_sd[0] ** -2, pose_sd[0] ** -2, pose_sd[1] ** -2])
    a = np.einsum("isb,jsb->sij", jac, jac) + weight
    b = np.einsum("isb,msb->sim", jac, m)
    flat = m.reshape(len(m), -1)
    full = flat @ flat.T - np.einsum("sim,sin->mn", b, np.linalg.solve(a, b))
    wide = h.reshape(len(h), -1)
    return np.asarray(full + 2 * wide @ wide.T)
