# SPDX-License-Identifier: BSD-3-Clause
"""What is asked for, and what is answered without and with the causes."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from kurumaisu.bench.strangers.marl.covariance import covariances, increments
from kurumaisu.bench.strangers.marl.driving import Drive, each_axis
from kurumaisu.bench.strangers.marl.laser import View
from kurumaisu.bench.strangers.marl.motions import between, integrate, unobserve
from kurumaisu.bench.strangers.marl.scans import moments
from kurumaisu.bench.strangers.marl.setting import Case
from kurumaisu.bench.strangers.marl.things import Rng
from kurumaisu.types import FloatArray

SAMPLES = 40  # poses in the reference's errors
HEAD = "run,channel,t0,t1,beam,value,base_mean,base_sd,oracle_mean,oracle_sd"


class Query(NamedTuple):
    """Motions by the rows of their poses, and scans by number."""

    motions: list[tuple[int, int]]
    scans: list[int]


def ask(rng: Rng, d: Drive) -> Query:
    """Choose motions of about 2 s, and scans outside of them."""
    n, out, k, t = rng.integers(15, 31), list[tuple[int, int]](), int(np.searchsorted(d.tp, 4.0)), d.tp
    gap = max(3.2, (d.duration - 8) / n)
    while k < len(t) - 5 and len(out) < n:
        j = int(np.searchsorted(t, t[k] + rng.uniform(1.8, 2.2)))
        if j >= len(t) - 2:
            break
        if t[j] - t[k] < 2.8 and t[k] - t[k - 1] < 0.5:
            out.append((k, j))
        k = int(np.searchsorted(t, t[k] + gap * rng.uniform(0.92, 1.08)))
    if not d.laser:
        return Query(out, [])
    free = [i for i, r in enumerate(d.scan_rows) if not any(a < r <= b for a, b in out)]
    return Query(out, sorted(rng.choice(free, min(9, len(free)), replace=False).tolist()))


def _row(name: str, channel: str, times: tuple[float, float], beam: str, values: list[float]) -> str:
    numbers = ",".join(f"{x:.6f}" for x in values)
    return f"{name},{channel},{times[0]:.6f},{times[1]:.6f},{beam},{numbers}"


def _motions(case: Case, name: str, zero: float, query: Query) -> list[str]:
    """Return the rows of motions."""
    d, ref, (a, b) = case.drives[-1], case.setting.ref, np.array(query.motions).T
    s0, s1, m0 = d.tp[a], d.tp[b], d.poses[:, a]
    columns = [between(m0, d.poses[:, b])]
    for causes in ([], case.causes):
        columns.append(increments(d, s0, s1, causes, m0))
        columns.append(np.sqrt(np.diag(sum(covariances(d, ref, s0, s1, causes)))).reshape(-1, 3).T)
    return [
        _row(name, channel, (s0[i] + zero, s1[i] + zero), "", [c[k, i] for c in columns])
        for i in range(len(a))
        for k, channel in enumerate(("dx", "dy", "dtheta"))
    ]


def _scan(rng: Rng, case: Case, i: int, z: FloatArray) -> dict[int, list[float]]:
    """Return the values of a scan with readings z, by beam."""
    d, ref = case.drives[-1], case.setting.ref
    white, wander = rng.standard_normal((2, 3, SAMPLES))
    e = white * each_axis(ref.white) + wander * each_axis(ref.wander)
    poses = d.poses[:, [d.scan_rows[i]]] - (e - e.mean(1, keepdims=True))
    t, columns = np.full(SAMPLES, d.ts[i]), [z]
    for causes in ([], case.causes):
        q = View(d, case.setting.room, t, unobserve(poses, causes), causes, integrate(d.rates(causes)))
        m, s = (x.reshape(SAMPLES, -1) for x in moments(q, causes))
        a = m.mean(0)
        jump = np.r_[0, np.diff(a)] ** 2 + np.r_[np.diff(a), 0] ** 2  # edges that no sample crossed
        sure = m.var(0) * SAMPLES / (SAMPLES - 1) + (s * s).mean(0)
        columns += [a, np.sqrt(sure + 0.01 * np.where(jump > 0.01, jump, 0))]
    near, far = np.minimum(columns[1], columns[3]), np.maximum(columns[1], columns[3])
    ok = np.isfinite(z) & (far < 0.97 * q.laser.far) & (near > q.laser.near * 1.1)
    return {int(j): [c[j] for c in columns] for j in np.flatnonzero(ok)}


def answers(rng: Rng, case: Case, name: str, zero: float, scans: FloatArray, query: Query) -> str:
    """Return answers.csv; zero: when the drive of the test starts."""
    rows = [HEAD, *_motions(case, name, zero, query)]
    for i in query.scans:
        stamp = case.drives[-1].ts[i] + zero
        for beam, values in _scan(rng, case, i, scans[i]).items():
            rows.append(_row(name, "range", (stamp, stamp), str(beam), values))
    return "\n".join(rows) + "\n"
