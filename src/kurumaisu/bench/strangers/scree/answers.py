# SPDX-License-Identifier: BSD-3-Clause
"""What was withheld, and how well the model without and with the causes predicts it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kurumaisu.bench.strangers.scree.basics import STEP, Array, Cause, Rng, between, compose
from kurumaisu.bench.strangers.scree.driving import activity
from kurumaisu.bench.strangers.scree.plant import Causes, Drive, reference_path, stamp, unseen, unstamp
from kurumaisu.bench.strangers.scree.ranges import Site, look, mean_reading
from kurumaisu.bench.strangers.scree.recorded import Setup, Taken
from kurumaisu.bench.strangers.scree.reference import Reference
from kurumaisu.bench.strangers.scree.scatter import ODD, chance, edges, log_spread


@dataclass(frozen=True)
class Answer:
    """One row of answers.csv; beam is -1 for motions."""

    channel: str
    t0: float
    t1: float
    beam: int
    value: float
    base: tuple[float, float]
    oracle: tuple[float, float]


def _integrated(drive: Drive, a: float, b: float) -> tuple[float, float]:
    """Variances of the noise of both rates, integrated over a time."""
    i, j = round(a / STEP), max(round(b / STEP), round(a / STEP) + 1)
    busy = activity(drive, drive.n)[i:j]
    t = STEP * np.arange(len(busy))
    robot = drive.robot
    c = np.exp(-np.abs(np.subtract.outer(t, t)) / robot.tau)
    one = float(busy @ c @ busy) * STEP**2
    return one * robot.noise_v**2, one * robot.noise_w**2


def _motion_sd(drive: Drive, r: Reference, motion: Array, a: float, b: float) -> Array:
    forward, yaw = _integrated(drive, a, b)
    slow = 2 * r.wander**2 * (1 - np.exp(-(b - a) / r.tau))
    place = 2 * r.place**2 + slow
    dx, dy, turn = motion.tolist()
    swing = r.heading**2
    c, s = np.cos(0.5 * turn), np.sin(0.5 * turn)
    x = forward * c * c + place + dy * dy * (swing + yaw / 3)
    y = forward * s * s + place + dx * dx * (swing + yaw / 3)
    return np.sqrt([x, y, yaw + 2 * r.heading**2])


def motion_answers(taken: Taken, causes: Causes, r: Reference) -> list[Answer]:
    """The motions that the queries ask for."""
    out = []
    asked = taken.asked[taken.asked[:, 1] > taken.asked[:, 0]]
    drive, poses = taken.drive, taken.poses
    ends = asked.ravel()
    oracle, base = (reference_path(drive, c, ends).reshape(-1, 2, 3) for c in (causes, ()))
    rows = np.searchsorted(poses.t, ends)
    real = poses.pose[rows].reshape(-1, 2, 3)
    motions = [between(p[:, 0], p[:, 1]) for p in (real, base, oracle)]
    true_times = unstamp(causes, ends).reshape(-1, 2)
    for k, (t0, t1) in enumerate(asked.tolist()):
        value, b, o = (m[k] for m in motions)
        sb = _motion_sd(drive, r, b, t0, t1)
        so = _motion_sd(drive, r, o, *true_times[k].tolist())
        for n, channel in enumerate(("dx", "dy", "dtheta")):
            known = (float(b[n]), float(sb[n])), (float(o[n]), float(so[n]))
            out.append(Answer(channel, t0, t1, -1, float(value[n]), *known))
    return out


def _shape(causes: Causes, laser_step: float) -> tuple[float, float, float]:
    """What causes of the scatter add: a factor on the variance, a variance, a shift."""
    factor, more, shift = 1.0, laser_step**2 / 12, 0.0
    for c in causes:
        if c.id == "laser.heavy_tails":
            nu = 1 / min(c.size, 0.42)
            factor *= 1 + 0.1 * c.size * 60 if c.other else nu / (nu - 2)
        elif c.id == "laser.common_mode":
            more += c.size**2
        elif c.id == "laser.quantisation":
            more += c.size**2 / 12
            shift -= 0.5 * c.size if c.other else 0.0
    return factor, more, shift


def _with_odd(c: Cause, m: Array, var: Array, p: Array, site: Site) -> tuple[Array, Array]:
    if c.id == "laser.crosstalk":
        high = min(site.laser.far, 5.0)
        odd, wide = np.full_like(m, 0.5 * (high + site.laser.near)), (high - site.laser.near) ** 2 / 12
    elif c.id == "laser.mixed_pixels":
        odd, wide = m, 1.0
    else:
        return m, var
    mean = (1 - p) * m + p * odd
    return mean, (1 - p) * (var + (m - mean) ** 2) + p * (wide + (odd - mean) ** 2)


def _expected(setup: Setup, causes: Causes, taken: Taken, t: float, draws: Array) -> tuple[Array, Array]:
    """Mean and sd of the readings of a scan, over poses that the reference allows."""
    site, r = setup.site, setup.reference
    assert site is not None
    drive, rows = taken.drive, taken.poses.keep(taken.poses.good)
    now = np.array([t])
    k = int(np.argmin(np.abs(rows.t - stamp(causes, now))))
    then = unstamp(causes, rows.t[k : k + 1])
    body = unseen(drive, causes, rows.pose[k : k + 1], then)
    measured = compose(body, between(drive.path.at(then), drive.path.at(now)))
    place = np.hypot(r.place, r.wander)
    poses = measured + draws * np.array([place, place, r.heading])
    stamps = np.full(len(poses), t)
    h = look(site, causes, drive, stamps, poses)
    factor, more, shift = _shape(causes, site.laser.resolution)
    means = mean_reading(site, causes, h)
    noise = np.mean((site.laser.sd(h.r) * np.exp(log_spread(causes, h))) ** 2, axis=0) * factor + more
    mean, var = np.mean(means, axis=0) + shift, np.var(means, axis=0) + noise
    jump = np.max(np.abs(edges(h, 0.1)), axis=0)
    jump[1:] = np.maximum(jump[1:], jump[:-1])
    var = var + 0.02 * jump**2
    for c in causes:
        if c.id in ODD:
            mean, var = _with_odd(c, mean, var, np.mean(chance(c, h, site), axis=0), site)
    return mean, np.sqrt(var)


def range_answers(setup: Setup, causes: Causes, taken: Taken, rng: Rng) -> list[Answer]:
    """The readings that the queries ask for, where there is one."""
    out: list[Answer] = []
    if setup.site is None or taken.scans is None:
        return out
    laser = setup.site.laser
    for t in taken.asked[taken.asked[:, 0] == taken.asked[:, 1], 0].tolist():
        values = taken.scans.r[int(np.searchsorted(taken.scans.t, t))]
        draws = rng.standard_normal((40, 3))
        bm, bs = _expected(setup, (), taken, t, draws)
        om, os = _expected(setup, causes, taken, t, draws)
        for k in np.flatnonzero(np.isfinite(values)).tolist():
            if max(bm[k], om[k]) > laser.far or min(bm[k], om[k]) < laser.near:
                continue
            both = (float(bm[k]), float(bs[k])), (float(om[k]), float(os[k]))
            out.append(Answer("range", t, t, k, float(values[k]), *both))
    return out
