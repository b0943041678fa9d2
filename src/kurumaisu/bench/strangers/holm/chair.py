# SPDX-License-Identifier: BSD-3-Clause
"""The chair: joystick volts, controller, two motors, tyres and casters, and the path that comes of it."""
from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from .core import CORRECTED, RIM_MASS, TRACK, TRANSLATION, VISCOUS, Array, Effect, Law


@dataclass
class Commands:
    """Rates that are asked for: row i holds from t[i] until the next."""
    t: Array
    v: Array
    w: Array

    def mean(self, edges: Array) -> tuple[Array, Array]:
        """Mean of either rate between neighbouring edges."""
        found = []
        for rate in (self.v, self.w):
            knots = np.append(self.t, self.t[-1] + 1e4)
            area = np.concatenate([[0.0], np.cumsum(rate * np.diff(knots))])
            found.append(np.diff(np.interp(edges, knots, area)) / np.diff(edges))
        return found[0], found[1]

@dataclass
class Noise:
    """How the rates fluctuate: sd of either, how long it lasts, and whether a chair that stands is still."""
    sd_v: float
    sd_w: float
    tau: float
    still: bool = False

@dataclass
class State:
    """What the hooks act on, per cell of the grid; x, y, th are in the middle of a cell."""
    t: Array
    dt: float
    start: float
    law: Law
    v: Array
    w: Array
    vf: Array
    vs: Array
    vy: Array
    x: Array
    y: Array
    th: Array
    extra: dict[str, Array] = field(default_factory=dict)
    decode: Law | None = None

    @property
    def session(self) -> Array:
        """Time since the first drive began."""
        return self.t + self.start

@dataclass
class Motion:
    """Where the chair is at the edges of the grid, and its rates without noise within the cells."""
    edges: Array
    v: Array
    w: Array
    vy: Array
    x: Array
    y: Array
    th: Array

    def at(self, t: Array) -> Array:
        """Pose (n, 3) at any times."""
        return np.stack([np.interp(t, self.edges, c) for c in (self.x, self.y, self.th)], axis=-1)

def integrate(v: Array, vy: Array, w: Array, dt: float, pose: Sequence[float]) -> tuple[Array, Array, Array]:
    """Poses at the edges; rates may have a leading axis of many draws."""
    zero = np.zeros(v.shape[:-1] + (1,))
    th = pose[2] + np.concatenate([zero, np.cumsum(w, axis=-1) * dt], axis=-1)
    mid = 0.5 * (th[..., 1:] + th[..., :-1])
    cos, sin = np.cos(mid), np.sin(mid)
    x = pose[0] + np.concatenate([zero, np.cumsum(v * cos - vy * sin, axis=-1) * dt], axis=-1)
    y = pose[1] + np.concatenate([zero, np.cumsum(v * sin + vy * cos, axis=-1) * dt], axis=-1)
    return x, y, th

def _axes(want_v: Array, want_w: Array, dt: float, p: dict[str, float]) -> tuple[Array, Array]:
    """Filters and ramps of the controller's two channels."""
    out = []
    for rate, axis in ((want_v, "v"), (want_w, "w")):
        tau, slow, stages = p.get("tau_" + axis, 0.0), p.get("slow_" + axis, 0.0), int(p.get("stages", 1))
        for _ in range(stages if tau > 0 else 0):
            share, y, kept = 1 - float(np.exp(-dt * stages / tau)), 0.0, []
            for u in rate.tolist():
                before = y
                y += share * (u - y)
                kept.append(0.5 * (before + y))
            rate = np.array(kept)
        if slow > 0:
            most, y, kept = dt / slow, 0.0, []
            for u in rate.tolist():
                before = y
                y += min(max(u - y, -most), most)
                kept.append(y if y == u else 0.5 * (before + y))
            rate = np.array(kept)
        out.append(rate)
    return out[0], out[1]

def motors(v: Array, w: Array, dt: float, p: dict[str, float]) -> tuple[Array, Array]:
    """Two motors follow the wanted rates; with nothing wrong the loop is done within one step."""
    v, w = _axes(v, w, dt, p)
    loop = max(p.get("loop", 0.0), dt)
    mass = RIM_MASS * (1 + p.get("mass", 0.0))
    load, drag = p.get("load", 0.0), p.get("drag", 0.0)
    force_most = p.get("force", np.inf)
    free, stall = p.get("free", np.inf), p.get("stall", np.inf)
    done = []
    for want in (v - 0.5 * TRACK * w, v + 0.5 * TRACK * w):
        s, kept = 0.0, []
        for u in want.tolist():
            force = RIM_MASS * (u - s) / loop + VISCOUS * s
            ahead, behind = min(force_most, stall * (1 - s / free) if free < np.inf else np.inf), 0.0
            behind = min(force_most, stall * (1 + s / free) if free < np.inf else np.inf)
            force = min(max(force, -behind), ahead)
            rub = drag if s > 1e-3 else -drag if s < -1e-3 else 0.0
            before = s
            s += dt * (force - VISCOUS * s - load * s - rub) / mass
            kept.append(0.5 * (before + s) if loop > dt else s)
        done.append(np.array(kept))
    return 0.5 * (done[0] + done[1]), (done[1] - done[0]) / TRACK

def drive(commands: Commands, duration: float, effects: Sequence[Effect], pose: Sequence[float], *, dt: float = 0.01,
          start: float = 0.0, law: Law = CORRECTED, noise: Array | None = None, path: Motion | None = None,
          extra: dict[str, Array] | None = None, still: bool = False) -> Motion:
    """Drive by commands; noise (2, cells) is added to the rates. With path, places are taken from that one."""
    cells = int(round(duration / dt))
    edges = np.arange(cells + 1) * dt
    late = sum(e.settings.get("delay", 0.0) for e in effects if e.hook == "late")
    hold = max((e.settings.get("period", 0.0) for e in effects if e.hook == "late"), default=0.0)
    shifted = edges - late
    if hold > 0:
        ticks = np.arange(0.0, duration + hold, hold)
        index = np.searchsorted(commands.t, ticks, side="right") - 1
        commands = Commands(ticks, commands.v[index.clip(0)], commands.w[index.clip(0)])
    v, w = commands.mean(shifted)
    mid = 0.5 * (edges[1:] + edges[:-1])
    zero = np.zeros(cells)
    s = State(mid, dt, start, law, v, w, TRANSLATION.volts(v), law.volts(w), zero.copy(), zero, zero, zero)
    for name, values in (extra or {}).items():
        s.extra[name] = np.interp(mid, np.arange(values.size), values)
    hooks = {name: [e for e in effects if e.hook == name] for name in ("volt", "want", "plant", "tyre", "place")}
    if hooks["volt"]:
        for e in hooks["volt"]:
            e.act(s)
        s.v, s.w = TRANSLATION.rate(s.vf, v), (s.decode or law).rate(s.vs, w)
    for e in hooks["want"]:
        e.act(s)
    if hooks["plant"]:
        s.v, s.w = motors(s.v, s.w, dt, {k: x for e in hooks["plant"] for k, x in e.settings.items()})
    for e in hooks["tyre"]:
        e.act(s)
    nv, nw = (zero, zero) if noise is None else (noise[0], noise[1])
    if still:
        moving = np.abs(s.v) + np.abs(s.w) > 1e-6
        nv, nw = nv * moving, nw * moving
    kept = (s.v.copy(), s.w.copy(), s.vy.copy())
    x, y, th = integrate(s.v + nv, s.vy, s.w + nw, dt, pose)
    for _ in range(3 if hooks["place"] else 0):
        s.v, s.w, s.vy = kept[0].copy(), kept[1].copy(), kept[2].copy()
        if path is None:
            s.x, s.y, s.th = (0.5 * (c[1:] + c[:-1]) for c in (x, y, th))
        else:
            s.x, s.y, s.th = path.at(mid).T
        for e in hooks["place"]:
            e.act(s)
        x, y, th = integrate(s.v + nv, s.vy, s.w + nw, dt, pose)
    return Motion(edges, s.v, s.w, s.vy, x, y, th)
