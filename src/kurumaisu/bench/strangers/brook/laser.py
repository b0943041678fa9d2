# SPDX-License-Identifier: BSD-3-Clause
"""The URG-04LX: rays against the edges of boxes, equation (4), and the catalogue's effects on readings."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from .catalogue import FAR, GEOMETRY, Effect
from .plant import LAY, Arr, Motion
from .rooms import Room

FIRST, INCREMENT, BEAMS, TICK, HEIGHT = -2.086214, 0.006135923, 682, 9.765625e-5, 0.40
SCALE, DATUM = 1.004587, 0.058826


@dataclass
class View:
    """What the beams of the scans of one drive meet; arrays (scans, beams)."""

    t: Arr  # of the scans
    tb: Arr  # of the beams
    r: Arr
    cos: Arr  # of incidence
    grad: Arr  # (3, scans, beams) of the range over a, l, q
    hit: Arr  # (2, scans, beams), in the map
    foot: Arr  # distance of the wall from the map's origin
    glow: Arr  # reflectance
    wall: npt.NDArray[np.int64]
    bearing: Arr  # (beams)
    pose: Arr  # (3, scans, beams) of the chair
    rate: Arr  # (2, scans, beams) v, w
    warm: Arr  # temperature - 20 and the extra column, of the scans
    edge: npt.NDArray[np.bool_]
    more: dict[str, Arr] = field(default_factory=dict)


def _edges(boxes: Arr) -> tuple[Arr, Arr, Arr, npt.NDArray[np.int64]]:
    """Edges of the boxes: start, step, outward normal, box."""
    start, step, normal, owner = [], [], [], []
    for k, (x, y, a, m, b, _) in enumerate(boxes.tolist()):
        u, w = np.array([np.cos(a), np.sin(a)]), np.array([-np.sin(a), np.cos(a)])
        for n, s, d in ((u, w, m / 2), (w, u, b / 2)):
            half = (b if d == m / 2 and n is u else m) / 2
            for sign in (1.0, -1.0):
                start.append(np.array([x, y]) + sign * d * n - half * s)
                step.append(2 * half * s)
                normal.append(sign * n)
                owner.append(k)
    return np.array(start), np.array(step), np.array(normal), np.array(owner)


def look(room: Room, m: Motion, t: Arr, every: int, warm: Arr, bent: list[Effect]) -> View:
    """Cast the scans stamped t, with the effects that bend the geometry."""
    size: dict[str, float] = {e.ident: e.size for e in bent if not e.other}
    creep = {e.ident: e.size for e in bent if e.other}
    index = np.arange(0, BEAMS, every)
    bearing = FIRST + INCREMENT * index
    real = t * (1 + size.get("laser.clock_skew", 0.0)) - size.get("laser.latency", 0.0)
    real = real - 2 * creep.get("laser.latency", 0.0) * (np.arange(len(t)) % 2)  # other: every second scan is late
    tb = real[:, None] + index * TICK * (1 + size.get("laser.sweep", 0.0))
    pose = np.array([np.interp(tb, m.t, u) for u in m.pose])
    rate = np.array([np.interp(tb, m.t, u) for u in (m.v, m.w)])
    yaw = size.get("laser.mount_yaw", 0.0) + 2 * creep.get("laser.mount_yaw", 0.0) * t[:, None] / m.t[-1]
    mx, my = LAY + size.get("laser.mount_x", 0.0), size.get("laser.mount_y", 0.0)
    c, s = np.cos(pose[2]), np.sin(pose[2])
    ox, oy, ang = pose[0] + mx * c - my * s, pose[1] + mx * s + my * c, pose[2] + bearing + yaw
    boxes = room.boxes.copy()
    for e in bent:
        if e.ident == "world.map_error":
            boxes[:, :2] += e.size * np.random.default_rng(int(e.more["seed"])).normal(size=(len(boxes), 2))
    start, step, normal, owner = _edges(boxes)
    dx, dy, px, py = np.cos(ang).ravel(), np.sin(ang).ravel(), ox.ravel(), oy.ravel()
    best, which = np.full(len(dx), 99.0), np.zeros(len(dx), dtype=np.int64)
    for k in range(len(start)):
        face = -(dx * normal[k, 0] + dy * normal[k, 1])
        ex, ey = start[k, 0] - px, start[k, 1] - py
        r = -(ex * normal[k, 0] + ey * normal[k, 1]) / np.maximum(face, 1e-9)
        along = ((r * dx - ex) * step[k, 0] + (r * dy - ey) * step[k, 1]) / (step[k] @ step[k])
        good = (face > 1e-6) & (r > 0) & (r < best) & (along >= 0) & (along <= 1)
        best[good], which[good] = r[good], k
    shape = tb.shape
    n = normal[which]
    cos = np.maximum(-(dx * n[:, 0] + dy * n[:, 1]), 0.02)
    gx, gy = (n[:, 0] / cos).reshape(shape), (n[:, 1] / cos).reshape(shape)  # of the range over the laser's place
    dq = (best * (-dy * n[:, 0] + dx * n[:, 1]) / cos).reshape(shape)  # over the direction of the beam
    ga, gl = gx * c + gy * s, gy * c - gx * s
    grad = np.array([ga, gl, dq + LAY * gl])
    r = best.reshape(shape)
    wall = owner[which].reshape(shape)
    jump = np.abs(np.diff(r, axis=1)) > 0.12 + 0.03 * r[:, 1:] / cos.reshape(shape)[:, 1:]
    edge = np.zeros(shape, dtype=bool)
    edge[:, 1:] |= jump
    edge[:, :-1] |= jump
    hit = np.array([ox + r * np.cos(ang), oy + r * np.sin(ang)])
    foot = (hit[0] * gx + hit[1] * gy) * -1.0
    warm_t = np.array([np.interp(t, m.t, row) for row in warm])
    return View(
        t,
        tb,
        r,
        cos.reshape(shape),
        grad,
        hit,
        foot,
        room.boxes[wall, 5],
        wall,
        bearing,
        pose,
        rate,
        warm_t,
        edge,
        {"yaw": dq},
    )


def mean(r: Arr) -> Arr:
    """Mean reading of equation (4)."""
    return SCALE * r + DATUM


def sd(r: Arr) -> Arr:
    """Its standard deviation."""
    return np.asarray(0.002334 - 0.000488 * r + 0.000199 * r * r)


def shift(v: View, e: Effect) -> Arr:
    """What an effect adds to the mean reading: exact where values change, first order where the geometry does."""
    k, r, p, i = e.size, v.r, e.more, e.ident
    dr_dt = v.grad[0] * v.rate[0] + v.grad[2] * v.rate[1]
    t = v.t[:, None] + 0 * r
    if i == "laser.mount_yaw":
        return np.asarray(k * v.more["yaw"] * (2 * t / t.max() if e.other else 1.0))
    if i == "laser.latency":
        return np.asarray(-k * dr_dt * (2 * (np.arange(len(v.t)) % 2)[:, None] if e.other else 1.0))
    if i == "laser.tilt":
        up = k * np.cos(v.bearing - p.get("side", 0.0))
        return np.asarray(np.minimum(r / np.cos(up), HEIGHT / np.maximum(-np.sin(up), 1e-6)) - r)
    if i == "laser.beam_bias":
        own = np.random.default_rng(int(p.get("seed", 0))).normal(size=len(v.bearing))
        return np.asarray(k * (2 * (v.bearing > p.get("split", 0.5)) if e.other else own) + 0 * r)
    if i == "world.map_error":
        move = k * np.random.default_rng(int(p["seed"])).normal(size=(int(p["boxes"]), 2))[v.wall]
        c, s = np.cos(v.pose[2]), np.sin(v.pose[2])
        gx, gy = v.grad[0] * c - v.grad[1] * s, v.grad[0] * s + v.grad[1] * c
        return np.asarray(-(move[..., 0] * gx + move[..., 1] * gy))
    if i == "laser.cyclic":
        turn = 2 * np.pi * r / p["wavelength"] + p["phase"]
        return np.asarray(k * (2 / np.pi * np.arcsin(np.sin(turn)) if e.other else np.sin(turn)))
    hot = v.warm[0][:, None] + 0 * r
    slant = np.minimum(1 / v.cos - 1, 4.0)
    table: dict[str, Callable[[], Arr]] = {
        "laser.mount_x": lambda: v.grad[0],
        "laser.mount_y": lambda: v.grad[1],
        "laser.sweep": lambda: dr_dt * (v.tb - t),
        "laser.clock_skew": lambda: dr_dt * t,
        "laser.offset": lambda: 1.0 + 0 * r,
        "laser.scale": lambda: np.sqrt(r) if e.other else r,
        "laser.quadratic": lambda: r**4 / 9 if e.other else r**2,
        "laser.warmup": lambda: np.maximum(0.0, 2 - t / 12.5) if e.other else np.exp(-t / p["tau"]),
        "laser.temperature": lambda: hot * np.abs(hot) / 4 if e.other else hot,
        "laser.incidence_bias": lambda: np.where(v.cos < 0.6, 3.0, 0.0) if e.other else slant,
        "laser.reflectance": lambda: np.where(v.glow < 0.4, r / 2, 0.0) if e.other else 1 - v.glow,
        "map.scale": lambda: v.foot,
        "unknown.sun": lambda: np.maximum(0.0, np.cos(v.pose[2] + v.bearing - p["phase"])) ** 4,
        "unknown.speed_r": lambda: np.abs(v.rate[0]) / 0.4,
        "unknown.column_r": lambda: v.warm[1][:, None] + 0 * r,
        "unknown.haze": lambda: 0.5 * (1 + np.tanh((v.pose[0] - p["edge"]) / 0.15)) * r / 2,
        "unknown.spells": lambda: 1.0 * (np.sin(t / p["period"] + p["phase"]) > 0.4) * r / 2,
    }
    return np.asarray(k * table[i]()) if i in table else 0 * r


def wider(v: View, e: Effect) -> Arr:
    """Relative change of the variance of readings."""
    k, own = e.size, np.square(1 + e.size) - 1
    if e.ident == "laser.range_noise":
        return np.asarray(own * (v.r / 2) ** 2 if e.other else own + 0 * v.r)
    if e.ident == "laser.incidence_noise":
        x = k * np.minimum(1 / v.cos - 1, 4.0)
        return np.asarray(np.square(1 + (3 * k * (v.cos < 0.5) if e.other else x)) - 1)
    if e.ident == "laser.quantisation":
        return np.asarray(max(k * k - 1e-6, 0.0) / 12 / sd(v.r) ** 2)
    if e.ident == "unknown.shake":
        return np.asarray(np.square(1 + k * np.abs(v.rate[0]) / 0.4) - 1)
    if e.ident == "unknown.blur":
        return np.asarray(np.square(1 + k * np.abs(v.rate[1]) / 0.5) - 1)
    return np.asarray(k + 0 * v.r) if e.ident == "laser.beam_correlation" else 0 * v.r


def _burst(v: View, e: Effect) -> Arr:
    """Chance of crosstalk: half of the time none; then in a window of beams that drifts."""
    on = np.sin(2 * np.pi * v.t / e.more["period"] + e.more["phase"]) > 0.3
    mid = e.more["phase"] + e.more["drift"] * v.t - np.pi
    off = np.abs((v.bearing - mid[:, None] + np.pi) % (2 * np.pi) - np.pi)
    return np.asarray(np.where(on[:, None] & (off < 0.25), e.size, 0.0))


def energy(v: View, e: Effect) -> Arr:
    """Expected square, at most 25 for a reading, of what a rare effect does."""
    if e.ident == "laser.heavy_tails":
        return 25 * e.size + 0 * v.r
    if e.ident == "laser.mixed_pixels":
        return np.asarray(25 * e.size * v.edge)
    if e.ident == "laser.saturation":
        return np.asarray(
            np.minimum(25.0, (np.maximum(mean(v.r) - FAR + e.size, 0.0) / sd(v.r)) ** 2) * (mean(v.r) < FAR)
        )
    return 25 * _burst(v, e)


def _rare(rng: np.random.Generator, v: View, effects: list[Effect], mu: Arr, out: Arr) -> Arr:
    """Rare large errors."""
    for e in effects:
        hit = rng.uniform(size=out.shape)
        if e.ident == "laser.heavy_tails":
            far = rng.choice([-1.0, 1.0], out.shape) * rng.uniform(0.02, 0.2, out.shape)
            out = np.where(hit < e.size, out + (-np.abs(far) if e.other else far), out)
        elif e.ident == "laser.mixed_pixels":
            near = np.minimum(np.roll(mu, 1, axis=1), np.roll(mu, -1, axis=1))
            gone = np.maximum(np.roll(mu, 1, axis=1), np.roll(mu, -1, axis=1))
            out = np.where(v.edge & (hit < e.size), near + (gone - near) * rng.uniform(size=out.shape), out)
        elif e.ident == "laser.crosstalk":
            out = np.where(hit < _burst(v, e), rng.uniform(0.1, 4.0, out.shape), out)
        elif e.ident == "laser.saturation":
            out = np.where(out < FAR, np.minimum(out, FAR - e.size), out)
    return out


def read(rng: np.random.Generator, v: View, effects: list[Effect]) -> Arr:
    """Readings: bias, noise, rare errors, 1 mm steps, gate. Geometry must be in the view already."""
    mu, var, grid, flat = mean(v.r), np.ones_like(v.r), 0.001, rng.normal(size=v.r.shape)
    for e in effects:
        if e.ident == "laser.beam_correlation":
            for j in range(1, flat.shape[1]):
                back = 2 if e.other and j > 1 else 1
                flat[:, j] = e.size * flat[:, j - back] + np.sqrt(1 - e.size**2) * flat[:, j]
        elif e.ident == "laser.quantisation":
            grid = e.size
        elif e.ident not in GEOMETRY:
            mu, var = mu + shift(v, e), var + wider(v, e)
    out = mu + sd(v.r) * np.sqrt(var) * flat
    out = _rare(rng, v, effects, mu, out)
    out = np.round(out / grid) * grid
    return np.where(out < 0.06, np.nan, np.where(out > FAR, np.inf, out))
