# SPDX-License-Identifier: BSD-3-Clause
"""How people drive when they measure, and the references that watch them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import partial

import numpy as np

from kurumaisu.bench.strangers.holm.chair import Commands, Motion, Noise, drive
from kurumaisu.bench.strangers.holm.core import Array, Effect, Law, chosen, log_uniform, ornstein
from kurumaisu.bench.strangers.holm.faults import seen
from kurumaisu.bench.strangers.holm.laser import Fan
from kurumaisu.bench.strangers.holm.rooms import Room


@dataclass
class Style:
    """Speeds, yaw rates and habits of a driver."""

    forward: list[float]
    reverse: list[float]
    yaw: list[float]
    ramp: float
    rate: float
    mode: str


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
class Scene:
    """What stays while sizes are changed."""

    room: Room | None
    fan: Fan | None
    law: Law
    noise: Noise
    ref: Reference
    style: Style
    durations: list[float]
    scan_rate: float
    extra: list[str]


@dataclass
class Drive:
    """One drive as it happened."""

    name: str
    duration: float
    start: float
    commands: Commands
    motion: Motion
    extra: dict[str, Array]
    stamps: Array = field(default_factory=lambda: np.zeros(0))
    test: bool = False

    def again(self, effects: Sequence[Effect], law: Law, pose: Sequence[float] = (0, 0, 0), dt: float = 0.01) -> Motion:
        """The motion by the same commands without noise; where it acts by place, at the places of this drive."""
        run = partial(drive, law=law, extra=self.extra, start=self.start, path=self.motion)
        return run(self.commands, self.duration, effects, pose, dt=dt)


def style(rng: np.random.Generator, room: Room | None, mode: str) -> Style:
    """A driver for a room, or for an open field."""
    top = 0.6 if room is not None else rng.uniform(0.7, 1.2)
    forward = [*sorted(round(x, 2) for x in rng.uniform(0.12, top, 4)), round(top, 2)]
    reverse = [*(round(x, 2) for x in rng.uniform(0.12, 0.6 * top, 2)), round(0.6 * top, 2)]
    yaw = [*(round(x, 2) for x in rng.uniform(0.15, 1.0, 4)), round(rng.uniform(0.8, 1.2), 2)]
    ramp = 0.0
    if mode != "normal":
        speed = round(rng.uniform(0.3, 0.5), 2)
        forward, reverse, yaw = [speed], [speed], [round(rng.uniform(0.4, 0.7), 2)]
    else:
        ramp = chosen(rng, (0.0, 0.0, rng.uniform(0.2, 0.8)))
    return Style(forward, reverse, yaw, ramp, float(chosen(rng, (10, 20, 25, 40, 50))), mode)


def reference(rng: np.random.Generator) -> Reference:
    """A camera system, a total station, or a scan matcher."""
    kind = chosen(rng, ("camera", "camera", "station", "matcher"))
    rates, place, turn, wander, tau = {
        "camera": ((50, 100, 100, 120), (0.0004, 0.002), (0.0006, 0.003), (0, 0.001), 40),
        "station": ((8, 10, 10), (0.0015, 0.004), (0.003, 0.008), (0, 0.002), 60),
        "matcher": ((10, 20, 40), (0.001, 0.004), (0.001, 0.004), (0.001, 0.003), None),
    }[kind]
    rate = float(chosen(rng, rates))
    errors = log_uniform(rng, *place), log_uniform(rng, *turn), rng.uniform(*wander)
    return Reference(kind, rate, *errors, tau or rng.uniform(8, 30))


def _propose(rng: np.random.Generator, s: Style) -> tuple[float, float, float]:
    kind = int(rng.choice(7, p=[0.22, 0.12, 0.24, 0.1, 0.14, 0.1, 0.08]))
    v, b, w = chosen(rng, s.forward), chosen(rng, s.reverse), chosen(rng, s.yaw) * chosen(rng, (-1, 1))
    span = rng.uniform(1.2, 4.5)
    if s.mode == "normal":
        stand = rng.uniform(0.8, 2.5)
        v, w = [(v, 0.0), (-b, 0.0), (v, w), (-b, w), (0.0, w), (0.0, 0.0), (v, 0.5 * w)][kind]
        return v, w, stand if kind == 5 else span
    if kind > 4:
        return 0.0, 0.0, rng.uniform(1, 2)
    v, w = {"forward": (v, 0.0), "reverse": (-b, 0.0), "left": (0.0, abs(w)), "yaw": (0.0, w)}[s.mode]
    return v, w, span


def _profile(times: Array, parts: Sequence[tuple[float, float, float]], ramp: float) -> Commands:
    ends = np.cumsum([p[2] for p in parts])
    rates = [np.array([p[k] for p in parts]) for k in (0, 1)]
    if ramp <= 0:
        index = np.minimum(np.searchsorted(ends, times, side="right"), len(parts) - 1)
        v, w = (np.where(times >= ends[-1], 0, r[index]) for r in rates)
        return Commands(times, v, w)
    begins = np.concatenate([[0.0], ends])
    knots = np.stack([begins, begins + ramp], axis=1).ravel()
    shapes = [np.stack([np.append(0.0, r), np.append(r, 0.0)], axis=1).ravel() for r in rates]
    v, w = (np.round(np.interp(times, knots, shape), 4) for shape in shapes)
    return Commands(times, v, w)


def _begin(rng: np.random.Generator, room: Room | None) -> list[float]:
    """A pose that is not near anything."""
    pose = [0.0, 0.0, float(rng.uniform(-np.pi, np.pi))]
    if room is not None:
        for _ in range(200):
            pose[:2] = (rng.uniform(-0.45, 0.45, 2) * room.size).tolist()
            if room.clear(np.array([pose[:2]])) > 0.65:
                break
    return pose


def plan(
    rng: np.random.Generator,
    name: str,
    scene: Scene,
    duration: float,
    start: float,
    effects: Sequence[Effect],
    extra: dict[str, Array],
) -> Drive:
    """Drive about for a while, looking where one goes."""
    s, room, noise = scene.style, scene.room, scene.noise
    cells = round(duration * 100)
    shaken = np.concatenate([ornstein(rng, cells, 0.01, sd, noise.tau) for sd in (noise.sd_v, noise.sd_w)])
    coarse = shaken.reshape(2, -1, 5).mean(axis=2)
    times = np.arange(0, duration, 1 / s.rate)
    times[1:] += rng.uniform(-0.3, 0.3, times.size - 1) / s.rate * (rng.random() < 0.7)
    times = np.round(times, 4)
    pose = _begin(rng, room)
    run = partial(drive, effects=effects, pose=pose, law=scene.law, extra=extra, start=start, still=noise.still)
    parts = [(0.0, 0.0, float(rng.uniform(1.5, 3)))]
    here, end, tries = pose, parts[0][2], 0
    while end < duration - 2 and tries < 600:
        tries += 1
        part = _propose(rng, s)
        v, w, span = part
        close = 0.5 if tries < 400 else 0.3
        ts = np.arange(0, span + 0.3 + s.ramp, 0.1)
        th = here[2] + w * ts
        x, y = here[0] + np.cumsum(v * np.cos(th)) * 0.1, here[1] + np.cumsum(v * np.sin(th)) * 0.1
        points = np.stack([x, y], axis=1)
        if v and (room.clear(points) < close if room else np.abs(points).max() > 6 and s.mode == "normal"):
            continue
        upto = min(round((end + span + s.ramp) / 0.05) * 0.05, duration)
        done = run(_profile(times, [*parts, part], s.ramp), upto, dt=0.05, noise=coarse[:, : round(upto / 0.05)])
        recent = np.stack([done.x, done.y], axis=1)[-int(span * 20) :]
        if room is not None and v and room.clear(recent[::3]) < 0.35:
            continue
        parts, end, here = [*parts, part], end + span, [done.x[-1], done.y[-1], done.th[-1]]
    c = _profile(times, parts, s.ramp)
    keep, stop = c.t < duration, c.t > duration - 1.2
    commands = Commands(c.t[keep], np.where(stop, 0, c.v)[keep], np.where(stop, 0, c.w)[keep])
    return Drive(name, duration, start, commands, run(commands, duration, noise=shaken), extra)


def _scale(effects: Sequence[Effect]) -> float:
    return sum(e.settings.get("scale", 0.0) for e in effects if e.hook == "stamp")


def stamped(t: Array, start: float, effects: Sequence[Effect]) -> Array:
    """Reference stamps of true times."""
    return np.asarray(t + _scale(effects) * (t + start))


def true_time(stamp: Array, start: float, effects: Sequence[Effect]) -> Array:
    """True times of reference stamps."""
    scale = _scale(effects)
    return np.asarray((stamp - scale * start) / (1 + scale), dtype=float)


def measure(rng: np.random.Generator, ref: Reference, d: Drive, t: Array, effects: Sequence[Effect]) -> Array:
    """Poses (n, 3) that the reference gives at true times."""
    poses, grid = seen(d.motion.at(t), effects), np.arange(0, d.duration + 0.2, 0.1)
    for k, (white, slow) in enumerate(((ref.sd, ref.wander), (ref.sd, ref.wander), (ref.sd_th, 0.3 * ref.wander))):
        wander = ornstein(rng, grid.size, 0.1, max(slow, 1e-9), ref.wander_tau)[0]
        poses[:, k] += rng.normal(0, white, t.size) + np.interp(t, grid, wander)
    return poses
