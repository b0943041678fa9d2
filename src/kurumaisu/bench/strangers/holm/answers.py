# SPDX-License-Identifier: BSD-3-Clause
"""What the model predicts for the queries, without and with what is hidden."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from kurumaisu.bench.strangers.holm.chair import integrate
from kurumaisu.bench.strangers.holm.core import Array, Effect, compose, ornstein, relative
from kurumaisu.bench.strangers.holm.drives import Drive, Scene, true_time
from kurumaisu.bench.strangers.holm.faults import seen
from kurumaisu.bench.strangers.holm.laser import look, read

MOTIONS, SCANS = 300, 150  # draws of either


def motions(
    d: Drive, spans: Sequence[tuple[float, float]], effects: Sequence[Effect], scene: Scene, rng: np.random.Generator
) -> list[tuple[Array, Array]]:
    """Mean and sd (3,) of each span's motion as the reference measures it."""
    plain, noise, ref, out = d.again(effects, scene.law), scene.noise, scene.ref, []
    axes = np.array([1, 1, 0.3])
    for span in spans:
        a, b = true_time(np.array(span), d.start, effects)
        edges = np.linspace(a, b, max(int((b - a) / 0.02), 2) + 1)
        dt = float(edges[1] - edges[0])
        poses = plain.at(edges)
        middle = poses[:-1].copy()
        middle[:, 2] += 0.5 * np.diff(poses[:, 2])
        step = np.column_stack([relative(middle, poses[1:])[:, :2], np.diff(poses[:, 2])]) / dt
        shake = [ornstein(rng, len(step), dt, sd, noise.tau, MOTIONS) for sd in (noise.sd_v, noise.sd_w)]
        moving = (np.abs(step).max(axis=1) > 1e-6) | (not noise.still)
        begin = d.motion.at(np.array([a]))[0]
        rows = []
        for nv, nw in (np.zeros((2, 1, len(step))), (shake[0] * moving, shake[1] * moving)):
            path = integrate(step[:, 0] + nv, step[:, 1] + 0 * nv, step[:, 2] + nw, dt, begin)
            ends = np.stack([c[:, -1] for c in path], axis=-1)
            rows.append([seen(np.broadcast_to(begin, ends.shape), effects), seen(ends, effects)])
        mean = relative(*rows[0])[0]
        turned = np.exp(-(b - a) / ref.wander_tau)
        slow = ref.wander * axes * rng.standard_normal((MOTIONS, 3))
        for end in rows[1]:
            end += slow + rng.standard_normal(end.shape) * np.array([ref.sd, ref.sd, ref.sd_th])
            fresh = rng.standard_normal((MOTIONS, 3)) * ref.wander * axes
            slow = turned * slow + np.sqrt(1 - turned**2) * fresh
        out.append((mean, np.sqrt(np.mean((relative(*rows[1]) - mean) ** 2, axis=0))))
    return out


def scans(
    d: Drive, index: int, row: Array, effects: Sequence[Effect], scene: Scene, rng: np.random.Generator
) -> tuple[Array, Array]:
    """Mean and sd per beam of a scan, at whose stamp row is the measured pose."""
    assert scene.room
    assert scene.fan
    stamp, ref = d.stamps[index], scene.ref
    begin = d.motion.at(true_time(np.array([stamp]), d.start, effects))[0]
    at = row
    if any(e.hook in ("pose", "bend") for e in effects):
        at = row - (seen(begin[None], effects)[0] - begin)
    place, turn = np.hypot(ref.sd, ref.wander), np.hypot(ref.sd_th, 0.3 * ref.wander)
    starts = at + rng.standard_normal((SCANS, 3)) * [place, place, turn]

    def poses(t: Array) -> Array:
        here = d.motion.at(t)
        return compose(starts[:, None, :], relative(np.broadcast_to(begin, here.shape), here))

    stamps, number = np.full(SCANS, stamp), np.full(SCANS, index)
    made = look(scene.room, poses, stamps, scene.fan, effects, start=d.start, index=number, extra=d.extra)
    got = read(made, effects, rng)
    got = np.where(np.isfinite(got), got, np.nan)
    few = np.isfinite(got).sum(axis=0) < 10
    got[:, few] = 0
    mean, sd = np.nanmean(got, axis=0), np.nanstd(got, axis=0)
    jump = np.max([np.abs(np.roll(mean, k) - mean) for k in (-2, -1, 1, 2)], axis=0)
    sd = np.sqrt(sd**2 + np.minimum(jump, 4.0) ** 2 / SCANS * (jump > 0.1))
    return np.where(few, np.nan, mean), np.where(few, np.nan, np.maximum(sd, 0.001))
