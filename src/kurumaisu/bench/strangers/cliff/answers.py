# SPDX-License-Identifier: BSD-3-Clause
"""Queries of the test run, and what the model answers without and with what is hidden."""

from __future__ import annotations

import numpy as np

from .record import EXTRA_MEAN, EXTRA_SCATTER, Draft, gate, ideal, seen, traced
from .scanner import DATUM, SCALE, Scans, bias, sigma, spread
from .values import Array, Cause, wrap
from .weigh import is_base
from .whiten import Filter, Path, deviations, increments

Query = tuple[float, float]


def draw_queries(draft: Draft, k: int, banned: Array) -> list[Query]:
    """Intervals from row to row, one after the other, and scans."""
    rng, t = draft.rng, draft.rows[k]
    lengths = list(rng.permutation([1.0, 1.0, 1.0, 2.0, 2.0, 2.0, 5.0, 5.0] + ([0.0] * 4 if draft.scans else [])))
    now, out = 3.0, []
    good = np.setdiff1d(np.arange(len(t)), banned)
    for length in lengths:
        now += float(rng.uniform(0.7, 1.8))
        source = draft.scans[k] if length == 0.0 else t[good]
        i = int(np.searchsorted(source, now))
        j = int(np.searchsorted(source, now + length - 0.02)) if length else i
        if max(i, j) >= len(source) or source[j] > t[-1] - 1.0:
            continue
        a, b = float(source[i]), float(source[j])
        if b - a > length + 0.5:
            continue
        out.append((a, b))
        now = b + 0.3
    return out


def withheld(t: Array, queries: list[Query]) -> Array:
    """True for rows that are not given: inside an interval, and within 0.3 s before its end."""
    out = np.zeros(len(t), bool)
    for a, b in queries:
        out |= ((t > a + 1e-9) | (t >= b - 0.3)) & (t <= b + 1e-9) & ((t > a + 1e-9) | (a == b))
    return out


class Model:
    """A model's answers for one run, by a filter over the rows that are given."""

    def __init__(self, draft: Draft, k: int, causes: list[Cause], rows: Array, given: Array) -> None:
        self.draft, self.causes, self.k = draft, causes, k
        base = [c for c in causes if is_base(c)]
        s, path = ideal(draft, k, base)
        self.pose: Path = lambda t: seen(path, s, t, base)
        self.state = s
        self.rows, self.times = rows[given], draft.rows[k][given]
        self.filter = Filter(self.times, self.pose, lambda t: gate(draft, s, t), draft.noise, draft.jitter)
        self.y = deviations([self.rows], self.pose(self.times))
        self.states = self.filter.run(self.y)[1]

    def motion(self, t0: float, t1: float, measured: bool = True) -> tuple[Array, Array, int]:
        """Mean and covariance of the motion from the last row up to t0."""
        i = int(np.searchsorted(self.times, t0 + 1e-9)) - 1
        mean, cov = self.filter.predict(i, self.y[i, :, 0], self.states[i, :, 0], t1, measured)
        return mean, cov, i

    def scan(self, t0: float) -> tuple[Array, Array]:
        """Mean and sd of each beam."""
        draft, run = self.draft, self.draft.runs[self.k]
        mean, cov, i = self.motion(t0, t0, measured=False)
        row = self.rows[i]
        here = _compose(row, mean)
        laser = [c for c in self.causes if not is_base(c)]
        stamp = np.array([t0])
        extra = {"v": np.interp(stamp, run.t, self.state.v), "w": np.interp(stamp, run.t, self.state.w), "time": stamp}
        extra |= {c: np.interp(stamp, run.t, x) for c, x in run.columns.items()}

        def poses(t: Array) -> Array:
            steps = increments_from(self.pose(np.array([t0])), self.pose(t))
            return np.array([_compose(here, d) for d in steps])

        s = traced(draft, Scans(stamp, run.start, draft.beams, poses, extra), laser)
        c, n = np.cos(row[2]), np.sin(row[2])
        r = np.array([[c, -n, 0.0], [n, c, 0.0], [0.0, 0.0, 1.0]])
        with np.errstate(all="ignore"):
            h = s.slopes()[0] @ r
            true = (s.r + bias(s, laser, EXTRA_MEAN))[0]
            sd = sigma(np.minimum(true, 5.0)) * spread(s, laser, EXTRA_SCATTER)[0]
            var = sd**2 + 1e-6 / 12 + np.minimum(np.einsum("ij,jk,ik->i", h, cov, h), 0.25)
            value = SCALE * true + DATUM
            return np.where(np.isfinite(value) & (value < 4.0), value, np.nan), np.sqrt(var)


def _compose(p: Array, d: Array) -> Array:
    c, s = np.cos(p[2]), np.sin(p[2])
    return np.array([p[0] + c * d[0] - s * d[1], p[1] + s * d[0] + c * d[1], p[2] + d[2]])


def increments_from(first: Array, poses: Array) -> Array:
    """Motion from one pose to each of others."""
    d = poses - first[0]
    c, s = np.cos(first[0, 2]), np.sin(first[0, 2])
    return np.column_stack([c * d[:, 0] + s * d[:, 1], c * d[:, 1] - s * d[:, 0], wrap(d[:, 2])])


def answer(draft: Draft, k: int, rows: Array, scans: Array, queries: list[Query], clock: float) -> list[str]:
    """Lines of answers.csv, on the files' clock."""
    name, t = draft.runs[k].name, draft.rows[k]
    given = ~withheld(t, queries)
    models = [Model(draft, k, causes, rows, given) for causes in ([], draft.causes)]
    out = []
    for t0, t1 in queries:
        if t0 < t1:
            ends = rows[[np.argmin(np.abs(t - t0)), np.argmin(np.abs(t - t1))]]
            value = increments(ends)[0]
            value[2] = ends[1, 2] - ends[0, 2]
            said = [m.motion(t0, t1) for m in models]
            for c, channel in enumerate(("dx", "dy", "dtheta")):
                numbers = [v for mean, cov, _ in said for v in (mean[c], np.sqrt(cov[c, c]))]
                out.append(_line(name, channel, t0 + clock, t1 + clock, "", [value[c], *numbers]))
            continue
        both = [m.scan(t0) for m in models]
        reading = scans[int(np.argmin(np.abs(draft.scans[k] - t0)))]
        for b in range(len(draft.beams)):
            numbers = [float(x[b]) for pair in both for x in pair]
            if np.isfinite(reading[b]) and np.isfinite(numbers).all():
                out.append(_line(name, "range", t0 + clock, t1 + clock, str(b), [float(reading[b]), *numbers]))
    return out


def _line(name: str, channel: str, t0: float, t1: float, beam: str, numbers: list[float]) -> str:
    return f"{name},{channel},{t0:.6f},{t1:.6f},{beam}," + ",".join(f"{v:.6f}" for v in numbers)
