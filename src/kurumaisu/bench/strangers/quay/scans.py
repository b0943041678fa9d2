# SPDX-License-Identifier: BSD-3-Clause
"""What beams meet, and what the laser makes of it in the mean and with its scatter."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from kurumaisu.bench.strangers.quay.base import DT, Cause, Drive, Effects, quantity
from kurumaisu.bench.strangers.quay.things import Array, Bools, Ints, Laser, Scene, Segments, cast, segments

DARKNESS = {"black": 1.0, "gray30": 0.7, "tan": 0.3, "white": 0.0}
MOVES = {
    *("laser.mount_x", "laser.mount_y", "laser.mount_yaw", "laser.sweep", "laser.latency", "laser.clock_skew"),
    "world.map_error",
}


class View(NamedTuple):
    """What scans stamped t meet: true range, wall, cosine of incidence; origin and direction of each beam."""

    dr: Drive
    scene: Scene
    laser: Laser
    t: Array
    r: Array
    hit: Ints
    cosi: Array
    x: Array
    y: Array
    phi: Array


def _real_map(scene: Scene, eff: Effects) -> Segments:
    p = eff.get("world.map_error", {})
    return segments(scene.room, p.get("scale", 0.0), p.get("moved"))


def look(dr: Drive, scene: Scene, eff: Effects, t: Array, path: Array | None = None) -> View:
    """Return what scans stamped t meet from a path, or from the true one."""
    laser, stamps = scene.laser, t
    assert laser
    if p := eff.get("laser.latency"):
        t = t - p["delay"] * (1 + (0.15 * np.sin(t / 7) if p["form"] else 0))
    if p := eff.get("laser.clock_skew"):
        t = t - p["skew"] * (t + dr.since)
    k = np.arange(laser.n)
    tinc = laser.tinc * (1 + eff.get("laser.sweep", {}).get("stretch", 0.0))
    pose = dr.at(t[:, None] + k * tinc, path)
    x, y, yaw = laser.mount
    x += eff.get("laser.mount_x", {}).get("x", 0.0)
    y += eff.get("laser.mount_y", {}).get("y", 0.0)
    yaw += eff.get("laser.mount_yaw", {}).get("yaw", 0.0)
    th = pose[..., 2]
    c, s = np.cos(th), np.sin(th)
    ox, oy = pose[..., 0] + c * x - s * y, pose[..., 1] + s * x + c * y
    phi = th + yaw + laser.angle_min + k * laser.inc
    return View(dr, scene, laser, stamps, *cast(ox, oy, phi, _real_map(scene, eff)), ox, oy, phi)


def _warmup(p: Cause, g: View, r: Array) -> Any:
    s = g.t[:, None] + g.dr.since
    f = 0.6 * np.exp(-s / p["tau"]) + 0.4 * np.exp(-3 * s / p["tau"]) if p["form"] else np.exp(-s / p["tau"])
    return p["amplitude"] * f


def _temperature(p: Cause, g: View, r: Array) -> Any:
    x = np.interp(g.t, g.dr.cov_t, g.dr.cov["temperature"])[:, None] - 20
    return p["coefficient"] * (x + 0.04 * x * abs(x) if p["form"] else x)


def _cyclic(p: Cause, g: View, r: Array) -> Any:
    a = 2 * np.pi * r / p["wavelength"] + p["phase"]
    return p["amplitude"] * (np.sin(a) + (0.3 * np.sin(2 * a) if p["form"] else 0))


def _incidence(p: Cause, g: View, r: Array) -> Any:
    return p["k"] * np.minimum(np.sqrt(1 - g.cosi**2) / g.cosi if p["form"] else 1 / g.cosi - 1, 5)


def _reflectance(p: Cause, g: View, r: Array) -> Any:
    level = np.array([DARKNESS[w[6]] for w in g.scene.room.walls])
    return p["bias"] * (level[g.hit] if p["form"] else level[g.hit] > 0.5)


# What each cause adds to readings, in the order in which they act.
TERMS: dict[str, Callable[[Cause, View, Array], Any]] = {
    "laser.offset": lambda p, g, r: p["offset"],
    "laser.scale": lambda p, g, r: p["scale"] * (3 * (r / 3) ** 1.2 if p["form"] else r),
    "laser.quadratic": lambda p, g, r: p["quadratic"] * (9 * (r / 3) ** 2.4 if p["form"] else r * r),
    "laser.warmup": _warmup,
    "laser.temperature": _temperature,
    "laser.cyclic": _cyclic,
    "laser.incidence_bias": _incidence,
    "laser.reflectance": _reflectance,
    "laser.beam_bias": lambda p, g, r: p["each"],
}


def means(eff: Effects, g: View) -> Array:
    """Return mean readings."""
    r, laser = g.r, g.laser
    if p := eff.get("laser.tilt"):
        phi = p["pitch"] * np.cos(laser.bearings) + p["roll"] * np.sin(laser.bearings)
        floor = np.where(phi > 1e-3, laser.height / np.sin(np.maximum(phi, 1e-3)), np.inf)
        r = np.minimum(r / np.cos(phi), floor)
    m = laser.scale * r
    for name in (name for name in TERMS if name in eff):
        m = m + TERMS[name](eff[name], g, r)
    if p := eff.get("laser.saturation"):
        far = 1 / p["inverse_far"]
        m = np.minimum(m, far) if not p["form"] else m / (1 + (m / far) ** 16) ** (1 / 16)
    if p := eff.get("unknown.range"):
        m = m + p["size"] * p["shape"](_quantity(p["of"], g))
    return m


def _quantity(name: str, g: View) -> Array:
    """Return a covariate of each reading, scaled to about -1..1."""
    a, b = g.scene.room.free[1] + 0.75, g.scene.room.free[3] + 0.75
    if name == "bearing":
        return np.broadcast_to(g.laser.bearings / np.pi, g.r.shape)
    if name == "direction":
        return np.asarray(np.arctan2(np.sin(g.phi), np.cos(g.phi)) / np.pi)
    if name == "hit_x":
        return np.asarray(2 * (g.x + g.r * np.cos(g.phi)) / a - 1)
    if name == "hit_y":
        return np.asarray(2 * (g.y + g.r * np.sin(g.phi)) / b - 1)
    dr = g.dr
    q = quantity(dr, g.scene.robot, name, dr.path[:-1], dr.vc, dr.wc)
    return np.broadcast_to(np.interp(g.t, np.arange(dr.n) * DT, q)[:, None], g.r.shape)


def noise(eff: Effects, g: View) -> Array:
    """Return the sd of readings where no cause makes their tails heavier."""
    sd, cosi = g.laser.sd(g.r), g.cosi
    if p := eff.get("laser.range_noise"):
        sd = sd * (1 + p["share"] * (0.7 + 0.15 * np.minimum(g.r, 4) if p["form"] else 1))
    if p := eff.get("laser.incidence_noise"):
        sd = sd * (1 + p["gain"] * np.minimum(np.sqrt(1 - cosi**2) / cosi if p["form"] else 1 / cosi - 1, 4))
    if p := eff.get("unknown.spread"):
        sd = sd * np.exp(p["size"] * p["shape"](_quantity(p["of"], g)))
    return sd


def spread(eff: Effects, g: View) -> Array:
    """Return the sd of readings with all causes of scatter."""
    sd = noise(eff, g)
    if p := eff.get("laser.heavy_tails"):
        sd = sd * (1.46 if p["form"] else 1 / np.sqrt(1 - 2 * p["inverse_nu"]))
    if p := eff.get("laser.common_mode"):
        sd = np.hypot(sd, p["sd"])
    step = eff.get("laser.quantisation", {}).get("step", g.laser.res)
    return np.asarray(np.sqrt(sd**2 + step**2 / 12))


def edges(g: View) -> Bools:
    """Tell where a neighbour meets another surface."""
    far = abs(np.diff(g.r, axis=1)) > 0.1 + 0.25 * abs(g.laser.inc) / 0.02 * 0.3
    e = np.zeros(g.r.shape, bool)
    e[:, 1:] |= far
    e[:, :-1] |= far
    return e
