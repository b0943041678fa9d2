# SPDX-License-Identifier: BSD-3-Clause
"""How people drive when they measure, and the references that watch them."""
from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from .chair import Commands, Motion, Noise, drive
from .core import CORRECTED, Array, Effect, Law, chosen, log_uniform, ornstein
from .faults import seen
from .rooms import Room


@dataclass
class Style:
    """Speeds, yaw rates and habits of a driver."""
    forward: list[float]
    reverse: list[float]
    yaw: list[float]
    ramp: float
    rate: float
    mode: str = "normal"

@dataclass
class Reference:
    """A source of poses: rows per second, errors of a row, and how it wanders."""
    kind: str
    rate: float
    sd: float
    sd_th: float
    wander: float
    wander_tau: float

@dataclass
class Drive:
    """One drive as it happened."""
    name: str
    duration: float
    start: float
    commands: Commands
    noise: Array
    motion: Motion
    extra: dict[str, Array] = field(default_factory=dict)
    stamps: Array = field(default_factory=lambda: np.zeros(0))
    test: bool = False

def style(rng: np.random.Generator, room: Room | None, mode: str = "normal") -> Style:
    """A driver for a room, or for an open field."""
    top = 0.6 if room is not None else rng.uniform(0.7, 1.2)
    forward = sorted(round(x, 2) for x in rng.uniform(0.12, top, 4)) + [round(top, 2)]
    reverse = [round(x, 2) for x in rng.uniform(0.12, 0.6 * top, 2)] + [round(0.6 * top, 2)]
    yaw = [round(x, 2) for x in rng.uniform(0.15, 1.0, 4)] + [round(rng.uniform(0.8, 1.2), 2)]
    if mode != "normal":
        speed = round(rng.uniform(0.3, 0.5), 2)
        forward, reverse, yaw = [speed], [speed], [round(rng.uniform(0.4, 0.7), 2)]
    ramp = 0.0 if mode != "normal" else chosen(rng, (0.0, 0.0, rng.uniform(0.2, 0.8)))
    return Style(forward, reverse, yaw, ramp, float(chosen(rng, (10, 20, 25, 40, 50))), mode)

def reference(rng: np.random.Generator) -> Reference:
    """A camera system, a total station, or a scan matcher."""
    kind = chosen(rng, ("camera", "camera", "station", "matcher"))
    if kind == "camera":
        return Reference(kind, float(chosen(rng, (50, 100, 100, 120))), log_uniform(rng, 0.0004, 0.002),
                         log_uniform(rng, 0.0006, 0.003), rng.uniform(0, 0.001), 40)
    if kind == "station":
        return Reference(kind, float(chosen(rng, (8, 10, 10))), log_uniform(rng, 0.0015, 0.004),
                         log_uniform(rng, 0.003, 0.008),
                         rng.uniform(0, 0.002), 60)
    return Reference(kind, float(chosen(rng, (10, 20, 40))), log_uniform(rng, 0.001, 0.004),
                     log_uniform(rng, 0.001, 0.004),
                     rng.uniform(0.001, 0.003), rng.uniform(8, 30))

def _propose(rng: np.random.Generator, s: Style) -> tuple[float, float, float]:
    kind = int(rng.choice(7, p=[0.22, 0.12, 0.24, 0.1, 0.14, 0.1, 0.08]))
    v, b, w = chosen(rng, s.forward), chosen(rng, s.reverse), chosen(rng, s.yaw) * chosen(rng, (-1, 1))
    span = rng.uniform(1.2, 4.5)
    if s.mode in ("forward", "reverse"):
        return ((v if s.mode == "forward" else -b), 0.0, span) if kind < 5 else (0.0, 0.0, rng.uniform(1, 2))
    if s.mode in ("left", "yaw"):
        w = abs(w) if s.mode == "left" else w
        return (0.0, w, span) if kind < 5 else (0.0, 0.0, rng.uniform(1, 2))
    return [(v, 0.0, span), (-b, 0.0, span), (v, w, span), (-b, w, span), (0.0, w, span),
            (0.0, 0.0, rng.uniform(0.8, 2.5)), (v, 0.5 * w, span)][kind]

def _profile(times: Array, parts: Sequence[tuple[float, float, float]], ramp: float) -> Commands:
    ends = np.cumsum([p[2] for p in parts])
    v, w = np.array([p[0] for p in parts]), np.array([p[1] for p in parts])
    if ramp <= 0:
        index = np.minimum(np.searchsorted(ends, times, side="right"), len(parts) - 1)
        past = times >= ends[-1]
        return Commands(times, np.where(past, 0, v[index]), np.where(past, 0, w[index]))
    begins = np.concatenate([[0.0], ends[:-1]])
    before_v, before_w = np.append(0.0, v[:-1]), np.append(0.0, w[:-1])
    knots = np.stack([begins, begins + ramp], axis=1).ravel()
    knots = np.append(knots, [ends[-1], ends[-1] + ramp])
    shape_v = np.append(np.stack([before_v, v], axis=1).ravel(), [v[-1], 0.0])
    shape_w = np.append(np.stack([before_w, w], axis=1).ravel(), [w[-1], 0.0])
    return Commands(times, np.round(np.interp(times, knots, shape_v), 4), np.round(np.interp(times, knots, shape_w), 4))

def plan(rng: np.random.Generator, name: str, s: Style, duration: float, start: float, room: Room | None,
         effects: Sequence[Effect], noise: Noise, law: Law = CORRECTED, extra: dict[str, Array] | None = None) -> Drive:
    """Drive about for a while, looking where one goes."""
    duration = round(duration, 1)
    cells = int(round(duration * 100))
    shaken = np.concatenate([ornstein(rng, cells, 0.01, sd, noise.tau) for sd in (noise.sd_v, noise.sd_w)])
    coarse = shaken.reshape(2, -1, 5).mean(axis=2)
    times = np.arange(0, duration, 1 / s.rate)
    times[1:] += rng.uniform(-0.3, 0.3, times.size - 1) / s.rate * (rng.random() < 0.7)
    times = np.round(times, 4)
    pose = [0.0, 0.0, float(rng.uniform(-np.pi, np.pi))]
    for _ in range(200):
        if room is not None:
            pose[:2] = (rng.uniform(-0.45, 0.45, 2) * room.size).tolist()
            if room.clear(np.array([pose[:2]])) > 0.65:
                break
    parts = [(0.0, 0.0, float(rng.uniform(1.5, 3)))]
    here, last_end, tries = np.array(pose), parts[0][2], 0
    while last_end < duration - 2 and tries < 600:
        tries += 1
        part = _propose(rng, s)
        close = 0.5 if tries < 400 else 0.3
        ts = np.arange(0, part[2] + 0.3 + s.ramp, 0.1)
        th = here[2] + part[1] * ts
        x, y = here[0] + np.cumsum(part[0] * np.cos(th)) * 0.1, here[1] + np.cumsum(part[0] * np.sin(th)) * 0.1
        points = np.stack([x, y], axis=1)
        bad = room.clear(points) < close if room is not None else np.abs(points).max() > 6 and s.mode == "normal"
        if part[0] and bad:
            continue
        trial = [*parts, part]
        end = last_end + part[2]
        upto = min(round((end + s.ramp) / 0.05) * 0.05, duration)
        done = drive(_profile(times, trial, s.ramp), upto, effects, pose, dt=0.05, start=start, law=law,
                     noise=coarse[:, :int(round(upto / 0.05))], extra=extra, still=noise.still)
        recent = np.stack([done.x[-int(part[2] * 20):], done.y[-int(part[2] * 20):]], axis=1)
        if room is not None and part[0] and room.clear(recent[::3]) < 0.35:
            continue
        parts, last_end, here = trial, end, np.array([done.x[-1], done.y[-1], done.th[-1]])
    commands = _profile(times, parts, s.ramp)
    keep = commands.t < duration
    stop = commands.t > duration - 1.2
    commands = Commands(commands.t[keep], np.where(stop, 0, commands.v)[keep], np.where(stop, 0, commands.w)[keep])
    motion = drive(commands, duration, effects, pose, start=start, law=law, noise=shaken, extra=extra,
                   still=noise.still)
    return Drive(name, duration, start, commands, shaken, motion, dict(extra or {}))

def stamped(t: Array, start: float, effects: Sequence[Effect]) -> Array:
    """Reference stamps of true times."""
    scale = sum(e.settings.get("scale", 0.0) for e in effects if e.hook == "stamp")
    return np.asarray(t + scale * (t + start))

def true_time(stamp: Array, start: float, effects: Sequence[Effect]) -> Array:
    """True times of reference stamps."""
    scale = sum(e.settings.get("scale", 0.0) for e in effects if e.hook == "stamp")
    return np.asarray((stamp - scale * start) / (1 + scale), dtype=float)

def measure(rng: np.random.Generator, ref: Reference, d: Drive, t: Array, effects: Sequence[Effect]) -> Array:
    """Poses (n, 3) that the reference gives at true times."""
    poses = seen(d.motion.at(t), list(effects))
    for k, (white, slow) in enumerate(((ref.sd, ref.wander), (ref.sd, ref.wander), (ref.sd_th, 0.3 * ref.wander))):
        grid = np.arange(0, d.duration + 0.2, 0.1)
        wander = ornstein(rng, grid.size, 0.1, max(slow, 1e-9), ref.wander_tau)[0]
        poses[:, k] += rng.normal(0, white, t.size) + np.interp(t, grid, wander)
    return poses

def relative(a: Array, b: Array) -> Array:
    """Motion from poses a to poses b, in the frame of a."""
    d = b - a
    c, s = np.cos(a[..., 2]), np.sin(a[..., 2])
    return np.stack([c * d[..., 0] + s * d[..., 1], -s * d[..., 0] + c * d[..., 1], d[..., 2]], axis=-1)
