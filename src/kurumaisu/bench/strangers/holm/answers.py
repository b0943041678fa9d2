# SPDX-License-Identifier: BSD-3-Clause
"""What the model predicts for the queries, without and with what is hidden."""
from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .chair import Noise, drive, integrate
from .core import Array, Effect, Law, ornstein
from .drives import Drive, Reference, relative, true_time
from .faults import seen
from .laser import Fan, look, read
from .rooms import Room


def compose(a: Array, b: Array) -> Array:
    """Pose a, then motion b in its frame."""
    c, s = np.cos(a[..., 2]), np.sin(a[..., 2])
    return np.stack([a[..., 0] + c * b[..., 0] - s * b[..., 1], a[..., 1] + s * b[..., 0] + c * b[..., 1],
                     a[..., 2] + b[..., 2]], axis=-1)

def motions(d: Drive, spans: Sequence[tuple[float, float]], effects: Sequence[Effect], law: Law, noise: Noise,
            ref: Reference,
            rng: np.random.Generator, draws: int = 300) -> list[tuple[Array, Array]]:
    """Mean and sd (3,) of each span's motion as the reference measures it."""
    plain = drive(d.commands, d.duration, effects, (0.0, 0.0, 0.0), start=d.start, law=law, path=d.motion,
                  extra=d.extra)
    out = []
    for t0, t1 in spans:
        a, b = true_time(np.array([t0, t1]), d.start, effects)
        edges = np.linspace(a, b, max(int((b - a) / 0.02), 2) + 1)
        dt = float(edges[1] - edges[0])
        poses = plain.at(edges)
        middle = poses[:-1].copy()
        middle[:, 2] += 0.5 * np.diff(poses[:, 2])
        step = np.column_stack([relative(middle, poses[1:])[:, :2], np.diff(poses[:, 2])]) / dt
        shake = [ornstein(rng, step.shape[0], dt, sd, noise.tau, draws) for sd in (noise.sd_v, noise.sd_w)]
        if noise.still:
            moving = np.abs(step).max(axis=1) > 1e-6
            shake = [n * moving for n in shake]
        begin = d.motion.at(np.array([a]))[0]
        rows = []
        for nv, nw in ((np.zeros((1, len(step))), np.zeros((1, len(step)))), (shake[0], shake[1])):
            x, y, th = integrate(step[:, 0] + nv, step[:, 1] + 0 * nv, step[:, 2] + nw, dt, begin)
            ends = np.stack([x[:, -1], y[:, -1], th[:, -1]], axis=-1)
            first = np.broadcast_to(begin, ends.shape).copy()
            rows.append([seen(first, list(effects)), seen(ends, list(effects))])
        mean = relative(rows[0][0], rows[0][1])[0]
        turned = np.exp(-(b - a) / ref.wander_tau)
        slow = ref.wander * np.array([1, 1, 0.3]) * rng.standard_normal((draws, 3))
        for end in rows[1]:
            end += slow + rng.standard_normal(end.shape) * np.array([ref.sd, ref.sd, ref.sd_th])
            fresh = rng.standard_normal((draws, 3)) * ref.wander * np.array([1, 1, 0.3])
            slow = turned * slow + np.sqrt(1 - turned**2) * fresh
        made = relative(rows[1][0], rows[1][1])
        out.append((mean, np.sqrt(np.mean((made - mean) ** 2, axis=0))))
    return out

def scans(d: Drive, stamp: float, index: int, row: Array, effects: Sequence[Effect], room: Room, fan: Fan,
          ref: Reference,
          rng: np.random.Generator, draws: int = 150) -> tuple[Array, Array]:
    """Mean and sd per beam of the scan of a stamp, whose measured pose is row."""
    begin = d.motion.at(true_time(np.array([stamp]), d.start, effects))[0]
    at = row.copy()
    if any(e.hook in ("pose", "bend") for e in effects):
        at = row - (seen(begin[None], list(effects))[0] - begin)
    place, turn = np.hypot(ref.sd, ref.wander), np.hypot(ref.sd_th, 0.3 * ref.wander)
    starts = at + rng.standard_normal((draws, 3)) * [place, place, turn]

    def poses(t: Array) -> Array:
        here = d.motion.at(t)
        return compose(starts[:, None, :], relative(np.broadcast_to(begin, here.shape), here))
    extra = {k: (np.arange(v.size), v) for k, v in d.extra.items()}
    made = look(room, poses, np.full(draws, stamp), fan, effects, start=d.start, index=np.full(draws, index),
                extra=extra)
    got = read(made, effects, rng)
    got = np.where(np.isfinite(got), got, np.nan)
    few = np.isfinite(got).sum(axis=0) < 10
    got[:, few] = 0
    mean, sd = np.nanmean(got, axis=0), np.nanstd(got, axis=0)
    jumps = [np.abs(np.roll(mean, k) - mean) for k in (-2, -1, 1, 2)]
    sd = np.sqrt(sd**2 + np.minimum(np.max(jumps, axis=0), 4.0) ** 2 / draws * (np.max(jumps, axis=0) > 0.1))
    return np.where(few, np.nan, mean), np.where(few, np.nan, np.maximum(sd, 0.001))
