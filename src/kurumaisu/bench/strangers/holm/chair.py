# SPDX-License-Identifier: BSD-3-Clause
"""The chair: joystick volts, controller, two motors, tyres and casters, and the path that comes of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from kurumaisu.bench.strangers.holm.core import RIM_MASS, TRACK, TRANSLATION, VISCOUS, Array, Effect, Law


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
    """Where the chair is at the edges of the grid."""

    edges: Array
    x: Array
    y: Array
    th: Array

    def at(self, t: Array) -> Array:
        """Pose (n, 3) at any times."""
        return np.stack([np.interp(t, self.edges, c) for c in (self.x, self.y, self.th)], axis=-1)


def integrate(v: Array, vy: Array, w: Array, dt: float, pose: Sequence[float]) -> tuple[Array, Array, Array]:
    """Poses at the edges; rates may have a leading axis of many draws."""
    zero = np.zeros((*v.shape[:-1], 1))
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
    free, stall = p.get("free", np.inf), p.get("stall", np.inf)
    done = []
    for want in (v - 0.5 * TRACK * w, v + 0.5 * TRACK * w):
        s, kept = 0.0, []
        for u in want.tolist():
            force = RIM_MASS * (u - s) / loop + VISCOUS * s
            force = min(max(force, -stall * (1 + s / free)), stall * (1 - s / free))
            rub = drag if s > 1e-3 else -drag if s < -1e-3 else 0.0
            before = s
            s += dt * (force - VISCOUS * s - load * s - rub) / mass
            kept.append(0.5 * (before + s) if loop > dt else s)
        done.append(np.array(kept))
    return 0.5 * (done[0] + done[1]), (done[1] - done[0]) / TRACK


def _sent(commands: Commands, duration: float, edges: Array, effects: Sequence[Effect]) -> tuple[Array, Array]:
    """The rates that reach the controller in each cell."""
    late = [e.settings for e in effects if e.hook == "late"]
    hold = max((s.get("period", 0.0) for s in late), default=0.0)
    if hold > 0:
        ticks = np.arange(0.0, duration + hold, hold)
        index = np.searchsorted(commands.t, ticks, side="right") - 1
        commands = Commands(ticks, commands.v[index.clip(0)], commands.w[index.clip(0)])
    return commands.mean(edges - sum(s.get("delay", 0.0) for s in late))


def drive(
    commands: Commands,
    duration: float,
    effects: Sequence[Effect],
    pose: Sequence[float],
    *,
    law: Law,
    extra: dict[str, Array],
    start: float,
    dt: float = 0.01,
    noise: Array | None = None,
    still: bool = False,
    path: Motion | None = None,
) -> Motion:
    """Drive by commands; noise (2, cells) is added to the rates. With path, places are taken from that one."""
    cells = round(duration / dt)
    edges, zero = np.arange(cells + 1) * dt, np.zeros(cells)
    mid = 0.5 * (edges[1:] + edges[:-1])
    v, w = _sent(commands, duration, edges, effects)
    s = State(mid, dt, start, law, v, w, TRANSLATION.volts(v), law.volts(w), zero, zero, zero, zero)
    s.extra = {name: np.interp(mid, np.arange(values.size), values) for name, values in extra.items()}

    def act(hook: str) -> bool:
        found = [e for e in effects if e.hook == hook]
        for e in found:
            e.act(s)
        return bool(found)

    if act("volt"):
        s.v, s.w = TRANSLATION.rate(s.vf, v), (s.decode or law).rate(s.vs, w)
    act("want")
    plant = {k: x for e in effects if e.hook == "plant" for k, x in e.settings.items()}
    if plant:
        s.v, s.w = motors(s.v, s.w, dt, plant)
    act("tyre")
    moving = (np.abs(s.v) + np.abs(s.w) > 1e-6) | (not still)
    nv, nw = (np.zeros((2, cells)) if noise is None else noise) * moving
    kept = s.v, s.w, s.vy
    x, y, th = integrate(s.v + nv, s.vy, s.w + nw, dt, pose)
    for _ in range(3 if any(e.hook == "place" for e in effects) else 0):
        s.v, s.w, s.vy = kept
        s.x, s.y, s.th = path.at(mid).T if path else (0.5 * (c[1:] + c[:-1]) for c in (x, y, th))
        act("place")
        x, y, th = integrate(s.v + nv, s.vy, s.w + nw, dt, pose)
    return Motion(edges, x, y, th)
