# SPDX-License-Identifier: BSD-3-Clause
"""Answers to the queries: what was measured, and what the model says with and without what is hidden."""

from __future__ import annotations

import numpy as np

from kurumaisu.bench.strangers.reed.core import (
    DT,
    Array,
    Noise,
    Use,
    increments,
    integrate,
    ou,
    rates,
    reference,
    simulate,
)
from kurumaisu.bench.strangers.reed.laser import Fan, bias, factor, setting
from kurumaisu.bench.strangers.reed.room import Room
from kurumaisu.bench.strangers.reed.score import Ride
from kurumaisu.bench.strangers.reed.shine import look

Rng = np.random.Generator
Row = list[str]


def _moved(ride: Ride, uses: list[Use], truth: list[Use], noise: Noise, t: Array, rng: Rng) -> tuple[Array, Array]:
    """Mean and sd of a motion: chance before it is known, chance in it is not."""
    real, path = simulate(ride.drive, truth, ride.pose)
    m = rates(ride.drive, uses, path)
    grow = real.grow if uses else np.full(len(m.v), np.sqrt(np.mean(real.grow**2)))
    grid, many = np.arange(len(m.v)) * DT, 300
    past = (grid < t[0] - 1e-9) * real.grow
    rows = reference(m, integrate(m, ride.pose, ride.drive.noise_v * past, ride.drive.noise_w * past), t)
    cells = (grid >= t[0] - 1e-9) & (grid < t[1] - 1e-9)
    nv, nw = (ou(rng, int(cells.sum()), sd, noise.tau, many) * grow[cells] for sd in (noise.sd_v, noise.sd_w))
    turn = np.cumsum((m.w[cells] + nw) * DT, axis=1) + rng.normal(size=(many, 1)) * noise.head
    v, side, jolt = m.v[cells] + nv, m.vy[cells], rng.normal(size=(3, many)) * noise.pos * np.sqrt(2)
    x = np.sum(v * np.cos(turn) - side * np.sin(turn), axis=1) * DT + jolt[0]
    y = np.sum(v * np.sin(turn) + side * np.cos(turn), axis=1) * DT + jolt[1]
    th = turn[:, -1] + jolt[2] / noise.pos / np.sqrt(2) * noise.head
    return increments(rows)[0], np.std(np.stack([x, y, th], axis=1), axis=0)


def motions(rng: Rng, ride: Ride, uses: list[Use], noise: Noise, rows: Array, spans: Array) -> list[Row]:
    """Answers to queries of motion; rows are the measured ones."""
    out: list[Row] = []
    for t in spans:
        value = increments(rows[[int(np.argmin(np.abs(ride.stamps - x))) for x in t]])[0]
        (b, bs), (o, os) = (_moved(ride, who, uses, noise, t, rng) for who in ([], uses))
        for k, channel in enumerate(("dx", "dy", "dtheta")):
            out.append([channel, *(str(x) for x in t), "", *(f"{x:.6f}" for x in (value[k], b[k], bs[k], o[k], os[k]))])
    return out


def ranges(
    rng: Rng,
    ride: Ride,
    uses: list[Use],
    noise: Noise,
    where: tuple[Fan, Room],
    asked: Array,
    readings: Array,
    errors: Array,
) -> list[Row]:
    """Answers to queries of scans, from poses about the measured one; errors: of that, and a marker's part of it."""
    out: list[Row] = []
    for t, reading, err in zip(asked, readings, errors, strict=True):
        both = []
        for who in ([], uses):
            doubt = rng.normal(size=(40, 3)) * np.array([noise.pos, noise.pos, noise.head])
            spread = err[:3] - err[3:] * bool(who) + doubt
            base = [use for use in uses if use.effect.stage < 10]
            v = look(ride, base, setting(*where, who), np.full(40, t), spread)
            z, more = v.mean + bias(v, who), [u.size for u in who if u.id == "laser.common_mode"]
            sd = np.sqrt(np.var(z, axis=0) + np.mean((v.sd * factor(v, who)) ** 2, axis=0) + sum(more) ** 2)
            both += [np.mean(z, axis=0), sd]
        for k in np.flatnonzero(np.isfinite(reading)):
            out.append(["range", str(t), str(t), str(k), f"{reading[k]:.3f}", *(f"{x[k]:.6f}" for x in both)])
    return out
