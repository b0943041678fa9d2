# SPDX-License-Identifier: BSD-3-Clause
"""How clearly an effect shows in the training data, beside others, too; and what two models answer to queries."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from kurumaisu.bench.strangers.loch.base import noise_factor
from kurumaisu.bench.strangers.loch.driver import Noise, increments, run
from kurumaisu.bench.strangers.loch.laser import ERROR, LASER, Box, Fan, Mask, Shot, contrast, shoot
from kurumaisu.bench.strangers.loch.motion import CATALOGUE, Array, Drive, Hidden, Path, integrate, rates, seen

POSITIVE = ("delay", "lag_", "accel_limit", "saturation", "backlash", "payload", "dac_quant")


@dataclass
class Record:
    """A drive as it was measured: rows of the reference, those that are good, scans."""

    drive: Drive
    path: Path
    clean: Path
    t: Array
    poses: Array
    good: Mask
    scan_t: Array
    fan: Fan
    boxes: list[Box]

    def model(self, hidden: Sequence[Hidden], t: Array) -> Array:
        """Poses of the path without noise at some times, as the reference would see them."""
        s = rates(self.drive, hidden, self.path)
        return seen(integrate(self.drive, s.v, s.w, s.vy), hidden, self.path).at(t)


def base_columns(records: Sequence[Record], noise: Noise, columns: Sequence[Hidden]) -> Array:
    """Whitened differences of increments that each effect makes, a column each."""
    out = []
    for r in records:
        t = r.t[r.good]
        plain = increments(r.model([], t))
        out.append(run(t, plain, np.stack([increments(r.model([h], t)) - plain for h in columns], 2), noise).white)
    return np.concatenate(out)


def growth_z(records: Sequence[Record], noise: Noise, h: Hidden, hidden: Sequence[Hidden]) -> float:
    """Square root of twice the log likelihood that noise which grows has over the best that does not."""
    total, flat = 0.0, np.zeros(7)
    for r in records:
        t = r.t[r.good]
        model = increments(r.model(hidden, t))
        delta = (increments(r.poses[r.good]) - model)[:, :, None]
        factor = np.interp((t[:-1] + t[1:]) / 2, r.drive.t, noise_factor(rates(r.drive, hidden, r.path), h))
        total += run(t, model, delta, noise, factor=factor).log_likelihood
        more = float(np.sqrt(np.mean(factor**2))) - 1
        flat += [
            run(t, model, delta, noise, factor=np.full(len(factor), 1 + more * k)).log_likelihood
            for k in np.linspace(0.3, 1.5, 7)
        ]
    return float(np.sqrt(max(2 * (total - flat.max()), 0)))


def shots(records: Sequence[Record], hidden: Sequence[Hidden]) -> list[Shot]:
    """All scans of all drives without noise."""
    return [shoot(r.drive, r.fan, r.boxes, r.path, r.scan_t, hidden) for r in records]


def laser_columns(records: Sequence[Record], noise: Noise, columns: Sequence[Hidden]) -> Array:
    """Whitened differences that effects make in the readings, a column each."""
    base, sd = shots(records, []), np.array([noise.position, noise.position, noise.heading])
    return np.stack(
        [np.concatenate([contrast(a, b, sd) for a, b in zip(shots(records, [h]), base, strict=True)]) for h in columns],
        axis=1,
    )


def others(h: Hidden, laser: bool, volts: bool, keep: Sequence[Hidden]) -> list[Hidden]:
    """Everything else of the catalogue at its usual sizes, on the side of the chair where the effect is."""
    mine = {k.id for k in keep} | {h.id, "base.process_noise"}
    return [
        Hidden(i, k, 0, (a, *h.u[1:]))
        for i, e in (LASER if laser else CATALOGUE).items()
        for k in e.sizes
        for a in ((0.0, 0.25) if i == "base.slope" else (h.u[0],))
        if i not in mine and not i.startswith("unknown") and (volts or "v" not in e.flags)
    ]


def left_over(column: Array, basis: Array) -> tuple[float, Array]:
    """Norm of what a least-squares fit leaves, and its coefficients."""
    basis = basis[:, np.linalg.norm(basis, axis=0) > 1e-3]
    if basis.shape[1] == 0:
        return float(np.linalg.norm(column)), np.zeros(1)
    c = np.linalg.lstsq(basis, column, rcond=1e-6)[0]
    return float(np.linalg.norm(column - basis @ c)), c


def beside(column: Array, kept: Array, rivals: Sequence[Hidden], basis: Array, near: float) -> tuple[float, list[str]]:
    """Norm beside what is kept and the best other single effect, and which others leave nearly nothing."""
    least, same = left_over(column, kept)[0], []
    for i in dict.fromkeys(r.id for r in rivals):
        own = basis[:, [k for k, r in enumerate(rivals) if r.id == i]]
        rest, c = left_over(column, np.concatenate([kept, own], axis=1))
        least = min(least, rest)
        if rest < near and not (c[-1] < 0 and any(p in i for p in POSITIVE)):
            same.append(i)
    return least, same


Row = tuple[str, str, float, float, str, float, float, float, float, float]


def compose(a: Array, b: Array) -> Array:
    """Pose b, given in the frame of pose a."""
    c, s = np.cos(a[2]), np.sin(a[2])
    return np.array([a[0] + c * b[0] - s * b[1], a[1] + s * b[0] + c * b[1], a[2] + b[2]])


def between(a: Array, b: Array) -> Array:
    """Pose b as seen from pose a."""
    return np.asarray(increments(np.stack([a, b]))[0])


class Predictor:
    """One model with the true noise, run through the rows that are given."""

    def __init__(self, r: Record, noise: Noise, hidden: Sequence[Hidden], used: Mask) -> None:
        """Filters the drive once."""
        base = [h for h in hidden if h.id in CATALOGUE]
        self.r, self.hidden, self.rows = r, hidden, r.model(base, r.t)
        self.error = np.diag([noise.position**2, noise.position**2, noise.heading**2])
        model, factor = increments(self.rows), np.ones(len(r.t) - 1)
        delta = increments(r.poses) - model
        delta[:, 2] = (delta[:, 2] + np.pi) % (2 * np.pi) - np.pi
        for h in (h for h in base if h.id == "base.process_noise"):
            factor = np.interp(r.t[1:], r.drive.t, noise_factor(rates(r.drive, base, r.path), h))
        self.states = run(r.t, model, delta[:, :, None], noise, used, factor).states

    def motion(self, i: int, j: int) -> tuple[Array, Array]:
        """Mean and sd of the motion between two rows, as measured."""
        m, p, _ = self.states[j]
        a = between(self.rows[i], self.rows[j])
        c, s = np.cos(a[2]), np.sin(a[2])
        turn = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1.0]])
        lever = np.array([[1, 0, -a[1]], [0, 1, a[0]], [0, 0, 1.0]])
        sd = np.sqrt(np.diag(turn @ (p[:3, :3] + self.error) @ turn.T))
        return a + turn @ m[:3, 0] - lever @ self.states[i][2][:, 0], sd

    def scan(self, i: int) -> tuple[Array, Array]:
        """Means and sds of all beams of the scan at a row, the pose by all rows up to it."""
        r, (m, p, y), t = self.r, self.states[i], self.r.t[i : i + 1]
        pose = compose(r.poses[i], (m[:3] - y)[:, 0])
        if self.hidden:
            pose = compose(pose, between(r.clean.at(t)[0], r.path.at(t)[0]))
        s = shoot(r.drive, r.fan, r.boxes, r.path, t, self.hidden, pose[None])
        slopes, sd = [], np.sqrt(np.diag(p)[:3])
        for k in np.diag(1.5 * sd):
            a, b = (
                shoot(r.drive, r.fan, r.boxes, r.path, t, self.hidden, compose(pose, e)[None]).mean[0] - s.mean[0]
                for e in (k, -k)
            )
            slopes.append(np.where(np.abs(a) > np.abs(b), a, -b) / k.sum())
        j = np.stack(slopes, axis=1)
        return s.mean[0], np.sqrt(s.sd[0] ** 2 + s.common_sd**2 + np.einsum("bi,ij,bj->b", j, p[:3, :3], j))


def motion_rows(r: Record, models: Sequence[Predictor], asked: Sequence[tuple[int, int]]) -> list[Row]:
    """Rows of the answers on motion."""
    out: list[Row] = []
    for i, j in asked:
        value, ((bm, bs), (om, os)) = between(r.poses[i], r.poses[j]), (m.motion(i, j) for m in models)
        for a in (bm, value):
            a[2] += 2 * np.pi * np.round((om[2] - a[2]) / (2 * np.pi))
        out += [
            (r.drive.name, name, r.t[i], r.t[j], "", value[k], bm[k], bs[k], om[k], os[k])
            for k, name in enumerate(("dx", "dy", "dtheta"))
        ]
    return out


def scan_rows(r: Record, models: Sequence[Predictor], asked: dict[int, Array]) -> list[Row]:
    """Rows of the answers on scans: by row of the reference, the readings."""
    out: list[Row] = []
    for i, value in asked.items():
        (bm, bs), (om, os) = (m.scan(i) for m in models)
        ok = np.isfinite(value) & (bm < ERROR["range_max"]) & (om < ERROR["range_max"])
        out += [
            (r.drive.name, "range", r.t[i], r.t[i], str(b), value[b], bm[b], bs[b], om[b], os[b])
            for b in np.flatnonzero(ok)
        ]
    return out
