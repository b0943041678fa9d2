# SPDX-License-Identifier: BSD-3-Clause
"""One recording: room, runs, rows, causes; simulated without noise for weighing, and with noise for the files."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from .drives import Run, draw_driver, draw_run
from .hidden import READ, REFERENCE, UNKNOWN
from .plant import State, at, integrate, rates
from .room import Room, clearance, draw_room
from .scanner import Scans, with_normals
from .values import STEP, Array, Cause, Noise, Rng, coloured, draw_noise

EXTRA = {k: v[0] for k, v in UNKNOWN.items()}
EXTRA_MEAN = {k: v[0] for k, v in READ.items() if v[2] == "range"}
EXTRA_SCATTER = {k: v[0] for k, v in READ.items() if v[2] == "scatter"}


@dataclass
class Draft:
    """All that is drawn of a recording."""

    rng: Rng
    room: Room
    runs: list[Run]
    noise: Noise
    rows: list[Array]  # when the reference measures
    flaws: set[str]
    scans: list[Array]  # stamps; empty without a laser
    beams: Array
    causes: list[Cause] = field(default_factory=list)

    @property
    def jitter(self) -> float:
        """Sd of the reference's stamps."""
        return 0.003 if "jitter" in self.flaws else 0.0


FLAWS = ("jitter", "gaps", "bursts", "off", "drift", "uneven", "unix", "collision")


def draw(rng: Rng, laser: bool, dull: bool, only: str = "") -> Draft:
    """A recording in which nothing is hidden yet."""
    flaws = {k for k in FLAWS if rng.random() < 1 / 6} - ({"collision"} if only else set())
    room = draw_room(rng, dull)
    driver = draw_driver(rng, only)
    clock = round(float(rng.uniform(5.0, 60.0)), 1)
    runs: list[Run] = []
    least = 0.4
    while len(runs) < 4:
        run = draw_run(f"run_{len(runs) + 1}", clock, driver, room, rng)
        if clear(room, integrate(run, run.v, run.w, 0.0 * run.v), least):
            runs.append(run)
            clock = round(clock + run.t[-1] + float(rng.uniform(20.0, 90.0)), 1)
            _columns(run, rng)
        least -= 0.02
    noise = draw_noise(rng)
    if "drift" in flaws:
        noise = Noise(noise.wheel, noise.tau, noise.gated, noise.white, 3.0 * noise.drift, noise.drift_tau)
    if "collision" in flaws:
        _collide(runs[int(rng.integers(3))], rng)
    rate = float(rng.choice([10.0, 15.0, 20.0, 25.0, 30.0, 40.0, 60.0], p=[0.2, 0.15, 0.2, 0.15, 0.15, 0.1, 0.05]))
    rows = [_rows(r, rate, flaws, rng) for r in runs]
    scans: list[Array] = []
    every = int(rng.choice([4, 5, 6]))
    if laser:
        hz = float(rng.uniform(2.0, 3.5))
        scans = [np.arange(0.6, r.t[-1] - 1.0, 1.0 / hz) + float(rng.uniform(0.0, 0.3)) for r in runs]
    return Draft(rng, room, runs, noise, rows, flaws, scans, np.arange(int(rng.integers(every)), 682, every))


def _columns(run: Run, rng: Rng) -> None:
    """What else is measured: functions of the session's clock, and of chance."""
    t = run.start + run.t
    run.columns["battery"] = 25.4 - 0.0006 * t
    run.columns["temperature"] = 20.0 + 3.0 * np.sin(t / 70.0) + 0.5
    run.columns["humidity"] = np.sin(t / 9.0 + 1.0)
    run.columns["tyre_pressure"] = np.sin(t / 11.0)
    run.columns["wind"] = coloured(len(t), STEP, 3.0, rng)


def _collide(run: Run, rng: Rng) -> None:
    """For some seconds the chair is commanded, but stands at a wall."""
    go = np.flatnonzero((np.abs(run.v) > 0.15) & (run.t > 5.0) & (run.t < run.t[-1] - 8.0))
    run.stuck = np.zeros(len(run.v), bool)
    if len(go):
        first = int(rng.choice(go))
        run.stuck[first : first + int(rng.uniform(1.0, 2.5) / STEP)] = True


def _rows(run: Run, rate: float, flaws: set[str], rng: Rng) -> Array:
    """When the reference measures."""
    n = int((run.t[-1] - 0.4) * rate)
    gap = np.full(n, 1.0 / rate)
    if "uneven" in flaws:
        gap = gap * np.clip(rng.lognormal(-0.1, 0.5, n), 0.2, 3.0)
    t = 0.05 + np.cumsum(gap)
    t = t[t < run.t[-1] - 0.1]
    if "gaps" in flaws:
        for a in rng.uniform(6.0, t[-1] - 5.0, 2):
            t = t[(t < a) | (t > a + rng.uniform(0.8, 1.3))]
    if "bursts" in flaws:
        more = [a + 0.002 * np.arange(1, 4) for a in rng.choice(t, 8)]
        t = np.sort(np.concatenate([t, *more]))
    return np.asarray(np.unique(np.round(t, 5)))


def ideal(draft: Draft, k: int, causes: Sequence[Cause]) -> tuple[State, Array]:
    """Rates and path of a run without noise."""
    s = rates(draft.runs[k], causes, EXTRA)
    return s, integrate(draft.runs[k], s.v, s.w, s.side)


def seen(path: Array, s: State, t: Array, causes: Sequence[Cause]) -> Array:
    """What a perfect reference would measure of it."""
    out = at(path, t, s.mark)
    for c in causes:
        if c.id in REFERENCE:
            out = REFERENCE[c.id][0](out, c.size, c)
    return out


def gate(draft: Draft, s: State, t: Array) -> Array:
    """1 where the wheels' noise acts."""
    return np.interp(t, s.run.t, s.moving) if draft.noise.gated else np.ones(len(t))


def noisy(draft: Draft, k: int, causes: Sequence[Cause]) -> tuple[State, Array]:
    """Rates and path as they were: each wheel fluctuates by itself."""
    s, _ = ideal(draft, k, causes)
    n, rng = len(s.v), draft.rng
    left, right = (
        draft.noise.wheel * coloured(n, STEP, draft.noise.tau, rng) * gate(draft, s, s.run.t) for _ in range(2)
    )
    free = 1.0 - s.run.stuck if len(s.run.stuck) else 1.0
    v, w = s.v + free * (left + right) / 2, s.w + free * (right - left) / 0.54
    return s, integrate(s.run, v, w, s.side)


def referred(draft: Draft, s: State, path: Array, k: int, causes: Sequence[Cause]) -> Array:
    """Rows of the reference, with white and drifting errors."""
    t, rng, noise = draft.rows[k], draft.rng, draft.noise
    out = seen(path, s, t + draft.jitter * rng.standard_normal(len(t)), causes)
    drift = np.column_stack([coloured(len(t), np.diff(t), noise.drift_tau, rng) for _ in range(3)])
    return np.asarray(out + noise.drift * drift + noise.white * rng.standard_normal(out.shape))


def scans_of(draft: Draft, k: int, s: State, path: Array, causes: Sequence[Cause]) -> Scans:
    """Rays of a run's scans, as cast."""
    run, t = draft.runs[k], draft.scans[k]
    extra = {"v": np.interp(t, run.t, s.v), "w": np.interp(t, run.t, s.w), "time": t}
    extra |= {c: np.interp(t, run.t, x) for c, x in run.columns.items()}
    out = Scans(t, run.start, draft.beams, lambda u: at(path, u), extra)
    return traced(draft, out, causes)


def traced(draft: Draft, scans: Scans, causes: Sequence[Cause]) -> Scans:
    """Cast, with what the walls are like."""
    scans.trace(draft.room, causes)
    with_normals(scans, draft.room)
    box = draft.room.segments()[2]
    scans.extra["dull"] = (draft.room.shine[box] < 1.0).astype(float)[scans.side]
    scans.extra["box"] = np.where(scans.side >= 0, box[scans.side], -1)
    return scans


def clear(room: Room, path: Array, least: float) -> bool:
    """True if the laser never came too near a wall."""
    some = path[::100]
    nose = some[:, :2] + 0.3 * np.column_stack([np.cos(some[:, 2]), np.sin(some[:, 2])])
    return min(clearance(room, some), clearance(room, nose)) > least
