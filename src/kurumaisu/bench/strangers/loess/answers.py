# SPDX-License-Identifier: BSD-3-Clause
"""Queries of the test drive, and what the model with and without the hidden answers to them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kurumaisu.bench.strangers.loess.case import Case, motions, scans_from
from kurumaisu.bench.strangers.loess.driving import Drive
from kurumaisu.bench.strangers.loess.noise import motion_covariance
from kurumaisu.bench.strangers.loess.plant import between
from kurumaisu.bench.strangers.loess.pose_effects import clock, unclock
from kurumaisu.bench.strangers.loess.recording import NATURE, Tables
from kurumaisu.bench.strangers.loess.sensing import look, read
from kurumaisu.bench.strangers.loess.strength import mean_rates
from kurumaisu.bench.strangers.loess.values import Array, Hidden

DRAWS = 120
OFF = 2 * 0.12**2


@dataclass(frozen=True)
class Answer:
    """One row of answers.csv: value, then mean and sd of the model and of the truth."""

    channel: str
    t0: float
    t1: float
    beam: str
    value: float
    base: tuple[float, float]
    oracle: tuple[float, float]


def _predicted(case: Case, drive: Drive, span: tuple[float, float], hidden: list[Hidden]) -> tuple[Array, Array]:
    true = unclock(np.array(span), hidden)
    mean = motions(case, drive, (true[:1], true[1:]), hidden)[0]
    rates = mean_rates(case, drive, (true[0], true[1]), hidden)
    sd = np.sqrt(np.diag(motion_covariance(case.robot, rates, (true[1] - true[0]) / len(rates))))
    return mean, sd


def ask_motions(case: Case, drive: Drive, tables: Tables, rng: np.random.Generator) -> list[Answer]:
    """Choose motions of about 2 s, take what they ask for out of the poses, and answer them."""
    pose, fair = tables.pose, tables.fair
    since = pose[:, 0] - tables.start
    keep, found = np.ones(len(pose), dtype=bool), list[Answer]()
    spans: list[list[float]] = []
    at = 4.0
    while at < since[-1] - 4 and len(spans) < 28:
        i = int(np.searchsorted(since, at))
        j = int(np.searchsorted(since, since[i] + rng.uniform(1.8, 2.2)))
        at += rng.uniform(4.0, 6.5) if since[-1] > 120 else rng.uniform(3.5, 5.0)
        if not (fair[i] and fair[j]) or since[j] - since[i] > 2.5:
            continue
        value = between(pose[i : i + 1, 1:], pose[j : j + 1, 1:])[0]
        span = (float(since[i]), float(since[j]))
        base, oracle = _predicted(case, drive, span, []), _predicted(case, drive, span, case.hidden)
        for k, channel in enumerate(("dx", "dy", "dtheta")):
            both = [(float(m[k]), float(sd[k])) for m, sd in (base, oracle)]
            found.append(Answer(channel, pose[i, 0], pose[j, 0], "", float(value[k]), both[0], both[1]))
        keep[i + 1 : j + 1] = False
        spans.append([pose[i, 0], pose[j, 0]])
    tables.query = np.array(spans).reshape(-1, 2)
    tables.pose, tables.fair = pose[keep], fair[keep]
    return found


def _pose(case: Case, tables: Tables, stamp: float) -> tuple[Array, Array]:
    """The measured pose between the two rows about a stamp, and its sds."""
    since, ref = tables.pose[:, 0] - tables.start, case.robot.reference
    i = int(np.searchsorted(since, stamp))
    share = float((stamp - since[i - 1]) / (since[i] - since[i - 1]))
    mean = (1 - share) * tables.pose[i - 1, 1:] + share * tables.pose[i, 1:]
    white = np.hypot(share, 1 - share)
    place, turn = np.hypot(ref.position * white, ref.wander), np.hypot(ref.heading * white, ref.wander_heading)
    return mean, np.array([place, place, turn])


def _cloud(case: Case, drive: Drive, t: float, tables: Tables, hidden: list[Hidden]) -> tuple[Array, Array]:
    """Mean and sd of the readings of a scan over what its pose may be."""
    assert case.laser is not None
    rng = np.random.default_rng(int(t * 1000))
    measured, sds = _pose(case, tables, float(clock(np.array([t]), hidden)[0]))
    poses = measured + rng.standard_normal((DRAWS, 3)) * sds
    scans = scans_from(case, drive, np.full(DRAWS, t), poses, hidden)
    sight = look(case.laser, case.room, scans, hidden)
    rare = max([h.size for h in hidden if h.id == "laser.heavy_tails"], default=NATURE[0].size)
    r = read(case.laser, sight, [h for h in hidden if h.id != "laser.heavy_tails"], rng)
    r[np.isinf(r)] = np.nan
    enough = np.isfinite(r).mean(axis=0) > 0.6
    r[:, ~enough] = 0.0
    mean, sd = np.nanmean(r, axis=0), np.nanstd(r, axis=0)
    return np.where(enough, mean, np.nan), np.sqrt(np.maximum(sd, case.laser.resolution / 3) ** 2 + rare * OFF)


def ask_scans(case: Case, drive: Drive, tables: Tables, rng: np.random.Generator) -> list[Answer]:
    """Choose scans away from the motions that are asked for, take them out, and answer them."""
    pose, fair, found = tables.pose, tables.fair, []
    since, looks = pose[:, 0] - tables.start, tables.scan[:, 0] - tables.start
    chosen: list[int] = []
    for k in rng.permutation(len(looks)):
        i = int(np.searchsorted(since, clock(looks[k : k + 1], case.hidden)[0]))
        if len(chosen) == 9:
            break
        if not 2 < i < len(since) - 2 or since[i] - since[i - 1] > 0.25 or not fair[i - 1 : i + 1].all():
            continue
        chosen.append(int(k))
    for k in sorted(chosen):
        t = float(looks[k])
        clouds = []
        for hidden in ([], case.hidden):
            clouds.append(_cloud(case, drive, t, tables, hidden))
        for b in np.flatnonzero(
            np.isfinite(tables.scan[k, 1:]) & np.isfinite(clouds[0][0]) & np.isfinite(clouds[1][0])
        ):
            both = [(float(m[b]), float(sd[b])) for m, sd in clouds]
            stamp = tables.scan[k, 0]
            found.append(Answer("range", stamp, stamp, str(b), float(tables.scan[k, 1 + b]), both[0], both[1]))
    asked = tables.scan[sorted(chosen), 0]
    tables.query = np.vstack([tables.query, np.column_stack([asked, asked])])
    tables.scan = np.delete(tables.scan, chosen, axis=0)
    return found
