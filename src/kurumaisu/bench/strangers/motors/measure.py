# SPDX-License-Identifier: BSD-3-Clause
"""What the reference measures, and how much of it is due to what is hidden."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .drive import Room
from .noise import Noise, wandering, whiten
from .plant import Array, Flags, H, Motion


@dataclass
class Rows:
    """Rows of the reference of one run: when they were really taken, their stamps, and their errors."""

    taken: Array
    stamp: Array
    error: Array  # (rows, 3)
    off: Flags  # rows that are far off


def rows_of(rng: np.random.Generator, noise: Noise, end: float, flags: dict[str, bool]) -> Rows:
    """When the reference measures, and by how much it errs."""
    rate = 10 * 6 ** rng.random()
    n = int((end - 0.4) * rate)
    gaps = 1 / rate * (rng.uniform(0.4, 1.6, n) if flags["uneven"] else 1 + 0.05 * rng.uniform(-1, 1, n))
    t = 0.2 + np.cumsum(gaps)
    t = t[t < end - 0.1]
    if flags["gaps"]:
        for start in rng.uniform(3, end - 4, int(rng.integers(2, 5))):
            t = t[(t < start) | (t > start + rng.uniform(0.6, 1.4))]
    if flags["bursts"]:
        extra = rng.choice(t[:-1], 12, replace=False)[:, None] + rng.uniform(0.001, 0.004, (12, 2))
        t = np.sort(np.concatenate([t, extra.ravel()]))
        t = t[np.concatenate([[True], np.diff(t) > 2e-4])]
    stamp = later(t + rng.normal(size=len(t)) * noise.stamp)
    steps = int(end / 0.1) + 2
    slow = np.stack(
        [wandering(rng, steps, s, noise.slow, 0.1) for s in (noise.drift, noise.drift, noise.drift_heading)], axis=1
    )
    drift = np.stack([np.interp(t, 0.1 * np.arange(steps), slow[:, i]) for i in range(3)], axis=1)
    white = rng.normal(size=(len(t), 3)) * [noise.position, noise.position, noise.heading]
    off = np.zeros(len(t), bool)
    if flags["off"]:
        off[rng.choice(np.arange(5, len(t) - 5), 4, replace=False)] = True
        white[off] += rng.choice([-1, 1], (4, 3)) * rng.uniform([0.05, 0.05, 0.03], [0.3, 0.3, 0.15], (4, 3))
    return Rows(t, stamp, drift + white, off)


def later(t: Array) -> Array:
    """Stamps that grow: a row that is not later than all before it is stamped a microsecond after the latest."""
    latest, at = np.maximum.accumulate(t), np.arange(len(t))
    grown = np.diff(latest, prepend=-np.inf) > 0
    return np.asarray(latest + 1e-6 * (at - np.maximum.accumulate(np.where(grown, at, 0))))


def path(v: Array, w: Array, side: Array) -> Array:
    """Poses (steps + 1, 3) from the origin, by the midpoint rule."""
    heading = np.concatenate([[0.0], np.cumsum(w) * H])
    mid = heading[:-1] + w * (H / 2)
    c, s = np.cos(mid) * H, np.sin(mid) * H
    x, y = np.cumsum(v * c - side * s), np.cumsum(v * s + side * c)
    return np.stack([np.concatenate([[0.0], x]), np.concatenate([[0.0], y]), heading], axis=1)


def observe(poses: Array, real: Array, t: Array, fault: dict[str, float], room: Room) -> Array:
    """Poses (n, 3) that a reference without noise would give at t; real: where the chair really is."""
    grid = H * np.arange(len(poses))
    at = t * (1 + fault.get("clock", 0.0))
    p = np.stack([np.interp(at, grid, poses[:, i]) for i in range(3)], axis=1)
    q = np.stack([np.interp(at, grid, real[:, i]) for i in range(3)], axis=1)
    c, s = np.cos(p[:, 2]), np.sin(p[:, 2])
    mx, my = fault.get("mx", 0.0), fault.get("my", 0.0)
    far = q[:, :2] - np.array(room.middle)
    lens = fault.get("lens", 0.0) * far * (far**2).sum(axis=1, keepdims=True)
    turn = p[:, 2] - q[:, 2]  # the error lies in the room, whatever the frame of these poses
    dx = mx * c - my * s + np.cos(turn) * lens[:, 0] - np.sin(turn) * lens[:, 1]
    dy = mx * s + my * c + np.sin(turn) * lens[:, 0] + np.cos(turn) * lens[:, 1]
    return np.asarray(p + np.stack([dx, dy, fault.get("compass", 0.0) * np.sin(q[:, 2] + 0.5)], axis=1))


def increments(p: Array) -> Array:
    """Motion between successive poses in the frame of the earlier one."""
    d = np.diff(p, axis=0)
    c, s = np.cos(p[:-1, 2]), np.sin(p[:-1, 2])
    return np.stack([d[:, 0] * c + d[:, 1] * s, -d[:, 0] * s + d[:, 1] * c, d[:, 2]], axis=1)


class Meter:
    """Whitened increments of variants, in the runs to fit."""

    def __init__(self, m: Motion, rows: list[Rows], noise: Noise, ends: Array, room: Room) -> None:
        self.m, self.rows, self.noise, self.room, self.runs = m, rows, noise, room, (0, 1, 2)
        self.ends = (ends / H).astype(int)

    def increments(self, run: int, variant: int, fault: dict[str, float], t: Array | None = None) -> Array:
        """Increments of a variant without noise between the rows of a run that are not off."""
        r = self.rows[run]
        m, n = self.m, self.ends[run]
        poses = path(m.v[:n, variant, run], m.w[:n, variant, run], m.side[:n, variant, run])
        at = r.taken[~r.off] if t is None else t
        return increments(observe(poses, m.pose[: n + 1, :, run], at, fault, self.room))

    def whitened(self, signals: list[list[Array]], times: Array) -> Array:
        """Signals (increments by run, then by signal) to a matrix of whitened columns; times: of the commands."""
        out = []
        for i, run in enumerate(self.runs):
            r = self.rows[run]
            t = r.taken[~r.off]
            rows = np.abs(self.m.rows[:, :, run]).sum(axis=1) > 0
            fine = np.linspace(0, 1, 8)[None, :] * np.diff(t)[:, None] + t[:-1, None]
            moving = rows[np.maximum(np.searchsorted(times, fine) - 1, 0)].mean(axis=1)
            n = self.ends[run]
            speed = (
                float(np.sqrt(np.mean(self.m.v[:n, 0, run] ** 2))),
                float(np.sqrt(np.mean(self.m.w[:n, 0, run] ** 2))),
            )
            w = whiten(t, moving, speed, self.noise, np.stack(signals[i], axis=2).transpose(1, 0, 2))
            out.append(w.reshape(-1, w.shape[2]))
        return np.concatenate(out)


def beside(gram: Array, i: int, groups: list[list[int]]) -> list[float]:
    """What is left of signal i after least squares by each group of others alone."""
    left = []
    for g in groups:
        a, b = gram[np.ix_(g, g)], gram[g, i]
        ridge = a + np.eye(len(g)) * (1e-9 * np.trace(a) + 1e-12)
        left.append(float(np.sqrt(max(gram[i, i] - b @ np.linalg.solve(ridge, b), 0.0))))
    return left
