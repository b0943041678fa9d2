# SPDX-License-Identifier: BSD-3-Clause
"""What is asked for of the test drive, and what the model predicts without and with the causes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from kurumaisu.bench.strangers.knoll.driving import growth, open_rates
from kurumaisu.bench.strangers.knoll.motions import MotionErrors, in_frame, integral_cov, motions, untracked
from kurumaisu.bench.strangers.knoll.scans import beam_times, shoot
from kurumaisu.bench.strangers.knoll.things import DT, Cause, Drive, Hits, Pose, Rng, Scene
from kurumaisu.types import BoolArray, FloatArray, IntArray

_SAMPLES = 100  # of a scan's pose
HEAD = "run,channel,t0,t1,beam,value,base_mean,base_sd,oracle_mean,oracle_sd"


@dataclass(frozen=True)
class Asked:
    """Motions as pairs of rows of the reference, scans, and which rows are held back."""

    pairs: list[tuple[int, int]]
    scans: list[int]
    gone: BoolArray


def ask(rng: Rng, x: Drive, scans: bool) -> Asked:
    """Choose what is asked for."""
    pairs, t, speed, stamps = list[tuple[int, int]](), 5.0, np.abs(x.vm) + np.abs(x.wm), x.rt
    while t < x.n * DT - 6 and len(pairs) < 30:
        a = int(np.searchsorted(stamps, t))
        b = int(np.searchsorted(stamps, stamps[min(a, stamps.size - 1)] + rng.uniform(1.7, 2.3)))
        if b >= stamps.size - 5:
            break
        still = speed[int(stamps[a] / DT) : int(stamps[b] / DT)].max() < 1e-3
        if not x.bad[[a, b]].any() and stamps[b] - stamps[a] < 3 and not (still and rng.random() < 0.8):
            pairs.append((a, b))
            t = stamps[b] + rng.uniform(1.2, 2.5)
        else:
            t += 0.7
    gone = np.zeros(stamps.size, bool)
    for a, b in pairs:
        gone[a + 1 : b + 1] = True
    fit = [int(k) for k in rng.permutation(x.st.size) if _known(x, gone, x.st[k])] if scans else []
    return Asked(pairs, sorted(fit[:9]), gone)


def _known(x: Drive, gone: BoolArray, t: float) -> bool:
    """Return whether the reference tells poses before and after a scan."""
    j = np.flatnonzero((x.rt <= t) & (x.rt > t - 0.4) & ~gone & ~x.bad)
    return bool(j.size >= 3 and j[-1] + 1 < x.rt.size and not gone[j[-1] + 1] and x.rt[j[-1]] > t - 0.2)


def _motion_answers(
    sc: Scene, causes: Sequence[Cause], x: Drive, pairs: Sequence[tuple[int, int]]
) -> tuple[FloatArray, FloatArray]:
    ia, ib = np.array([a for a, _ in pairs]), np.array([b for _, b in pairs])
    moved = motions(sc, causes, x, x.rt[ia], x.rt[ib], x.ref[:, ia], 200)
    return moved.means, np.sqrt(np.einsum("nii->ni", MotionErrors(sc, causes, x, ia, ib, moved).each()))


def motion_answers(sc: Scene, causes: Sequence[Cause], x: Drive, asked: Asked) -> list[list[tuple[str, str]]]:
    """Return channels and numbers of each motion that is asked for."""
    (m0, s0), (m1, s1) = (_motion_answers(sc, some, x, asked.pairs) for some in ([], causes))
    out = []
    for j, (a, b) in enumerate(asked.pairs):
        real = in_frame(x.ref[:, a], x.ref[:, b])
        rows = zip(("dx", "dy", "dtheta"), np.transpose([real, m0[j], s0[j], m1[j], s1[j]]), strict=True)
        out.append([(channel, ",".join(f"{y:.7g}" for y in row)) for channel, row in rows])
    return out


def scan_answers(
    rng: Rng, sc: Scene, causes: Sequence[Cause], x: Drive, k: int, gone: BoolArray
) -> list[tuple[int, str]]:
    """Return beams and their numbers of a scan that is asked for."""
    (m0, s0), (m1, s1) = (_beams(rng, sc, some, x, k, gone) for some in ([], causes))
    cols = np.stack([x.scans[k], m0, s0, m1, s1], 1)
    fit = np.flatnonzero(np.isfinite(cols[:, [0, 1, 3]]).all(1))
    return [(int(b), ",".join(f"{y:.7g}" for y in cols[b])) for b in fit]


def _first_pose(
    rng: Rng, sc: Scene, causes: Sequence[Cause], x: Drive, rows: IntArray, goal: float
) -> tuple[Pose, float, float]:
    """Draw the true pose at goal by rows of the reference, and return the sd of the rates' noise then."""
    n, start = rows.size, x.ref[:, rows]
    m = motions(sc, causes, x, x.rt[rows], np.full(n, goal), start).means
    c, s = np.cos(start[2]), np.sin(start[2])
    ends = [start[0] + c * m[:, 0] - s * m[:, 1], start[1] + s * m[:, 0] + c * m[:, 1], start[2] + m[:, 2]]
    qx, qy, qth = np.array(ends).mean(1)[:, None]
    p = [float(a[0]) for a in untracked(causes, np.array([goal]), (qx, qy, qth))]
    ago = goal - x.rt[rows]
    near = int(np.clip(goal / DT, 0, x.n - 1))
    v, w, _ = open_rates(sc, causes, x)
    sd_v, sd_w = (sd * g[near] for sd, g in zip((sc.sd_v, sc.sd_w), growth(causes, v, w), strict=True))
    both = integral_cov(-ago[:, None], 0 * ago[:, None], -ago, 0 * ago, 1.0, sc.noise_time).mean()
    lever = v[near] * ago.mean() / 2
    var_p = sc.ref.white_p**2 / n + sc.ref.slow_p**2 + sd_v**2 * both + (lever * sc.ref.white_h) ** 2 / n
    var_h = sc.ref.white_h**2 / n + sc.ref.slow_h**2 + sd_w**2 * both
    d = rng.normal(size=(3, _SAMPLES, 1)) * np.sqrt([var_p, var_p, var_h])[:, None, None]
    d -= d.mean(1, keepdims=True)
    return (p[0] + d[0], p[1] + d[1], p[2] + d[2]), sd_v, sd_w


def _beams(
    rng: Rng, sc: Scene, causes: Sequence[Cause], x: Drive, k: int, gone: BoolArray
) -> tuple[FloatArray, FloatArray]:
    """Return mean, where there is one, and sd of each beam of scan k, from the rows up to it."""
    ta = beam_times(sc, causes, x.st[[k]])
    stop = min(x.st[k], ta[0, 0])
    known = (x.rt <= stop) & ~gone & ~x.bad
    rows = np.flatnonzero(known & (x.rt > stop - 0.35))
    if not rows.size:
        rows = np.flatnonzero(known)[-1:]
    (px, py, pth), sd_v, sd_w = _first_pose(rng, sc, causes, x, rows, ta[0, 0] * (1 + sum(c.clock for c in causes)))
    ahead, turn, aside = (x.integral(rate, ta) for rate in open_rates(sc, causes, x))
    ahead, turn, aside = (a - a[:, :1] for a in (ahead, turn, aside))
    ahead, turn = (a + rng.normal(size=(_SAMPLES, 1)) * sd * (ta - ta[0, 0]) for a, sd in ((ahead, sd_v), (turn, sd_w)))
    mid = pth + turn / 2
    c, s = np.cos(mid), np.sin(mid)
    poses = px + ahead * c - aside * s, py + ahead * s + aside * c, pth + turn
    mu, sd, g = shoot(sc, causes, x, poses, np.repeat(ta, _SAMPLES, 0))
    return _mixed(sc, causes, mu, sd, g)


def _mixed(
    sc: Scene, causes: Sequence[Cause], mu: FloatArray, sd: FloatArray, g: Hits
) -> tuple[FloatArray, FloatArray]:
    """Return mean and sd of each beam over the samples of the pose."""
    fan, var = sc.laser, sd**2 + sc.laser.resolution**2 / 12
    for c in causes:
        if c.common:
            var = var + c.common[0] ** 2
        if c.moments:
            mu, var = c.moments(mu, var, g)
    mu, var, r = (a.reshape(_SAMPLES, -1) for a in (mu, var, g.r))
    lost, r = (r > 99).any(0), r.mean(0)
    gap = np.maximum(abs(np.diff(r, prepend=r[0])), abs(np.diff(r, append=r[-1])))
    edge = 0.5 / _SAMPLES * np.where(gap > 0.1, np.minimum(gap, 10), 0) ** 2
    m, s = mu.mean(0), np.sqrt(var.mean(0) + mu.var(0) + edge)
    lost |= (m > fan.far - 4 * sd[: s.size]) | (m < fan.near)
    return np.where(lost, np.nan, m), s
