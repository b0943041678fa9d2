# SPDX-License-Identifier: BSD-3-Clause
"""How strongly causes show in the training drives, alone and beside others and rivals."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import solve_triangular

from kurumaisu.bench.strangers.loess import plant
from kurumaisu.bench.strangers.loess.base_effects import BASE
from kurumaisu.bench.strangers.loess.case import Case, expected, motions, scans_from
from kurumaisu.bench.strangers.loess.driving import Drive
from kurumaisu.bench.strangers.loess.noise import roots
from kurumaisu.bench.strangers.loess.pose_effects import refer, unclock
from kurumaisu.bench.strangers.loess.sensing import look, mean_reading, read, spread
from kurumaisu.bench.strangers.loess.unknown_rates import UNKNOWN_RATES
from kurumaisu.bench.strangers.loess.values import STEP, Array, Flags, Hidden, Sight

LOOKS = 16
UNSEEN = {*BASE, *UNKNOWN_RATES, "base.clock_scale"}
NUDGE = (0.002, 0.002, 0.001)


@dataclass
class Stage:
    """A training drive made ready: pairs of stamps, roots of their noise, scans and roots of theirs."""

    drive: Drive
    stamps: Array
    motion_roots: list[Array]
    t: Array
    poses: Array
    keep: Flags
    scan_roots: list[Array]
    more: float


def _prepare(case: Case, drive: Drive) -> Stage:
    stamps = np.arange(1.0, len(drive.path) * STEP - 1.0)
    middle = plant.at(drive.caused, (stamps[:-1] + stamps[1:]) / 2)
    stage = Stage(
        drive, stamps, roots(case.robot, middle, 1.0), np.zeros(0), np.zeros((0, 3)), np.zeros(0, dtype=bool), [], 1.0
    )
    if case.laser is None:
        return stage
    laser, length = case.laser, len(drive.path) * STEP
    stage.t = np.linspace(2.0, length - 2.0, LOOKS)
    stage.more = float(np.sqrt(max(1.0, length / laser.period / LOOKS)))
    stage.poses = refer(plant.at(drive.path, stage.t), stage.t, case.hidden)
    sight = _seen(case, stage, stage.poses, [])
    stage.keep = (sight.range < 0.95 * laser.far) & (sight.range > laser.near) & (np.abs(sight.edge) < 0.25)
    slopes = []
    for i in range(3):
        moved = stage.poses.copy()
        moved[:, i] += NUDGE[i]
        slopes.append(np.clip((_seen(case, stage, moved, []).range - sight.range) / NUDGE[i], -30, 30))
    place, turn = case.robot.reference.totals()
    sd = np.hypot(spread(laser, sight, case.hidden).sd, laser.resolution / 3.5)
    for k in range(LOOKS):
        on = stage.keep[k]
        j = np.column_stack([s[k, on] for s in slopes]) * [place, place, turn]
        stage.scan_roots.append(np.linalg.cholesky(np.diag(sd[k, on] ** 2) + j @ j.T))
    return stage


def _seen(case: Case, stage: Stage, poses: Array, hidden: list[Hidden]) -> Sight:
    assert case.laser is not None
    return look(case.laser, case.room, scans_from(case, stage.drive, stage.t, poses, hidden), hidden)


class Judge:
    """Vectors of causes in the training drives of a case, whitened by its noise."""

    def __init__(self, case: Case) -> None:
        self.case = case
        self.stages = [_prepare(case, d) for d in case.drives[:-1]]
        self._moved: dict[tuple[float, tuple[Hidden, ...]], Array] = {}
        self._read: dict[tuple[float, tuple[Hidden, ...]], tuple[Array, Array]] = {}

    def _motion(self, stage: Stage, hidden: list[Hidden]) -> Array:
        key = (stage.drive.clock, tuple(h for h in hidden if not h.id.startswith(("laser", "world"))))
        if key not in self._moved:
            true = unclock(stage.stamps, hidden)
            self._moved[key] = motions(self.case, stage.drive, (true[:-1], true[1:]), hidden)
        return self._moved[key]

    def _readings(self, stage: Stage, hidden: list[Hidden]) -> tuple[Array, Array]:
        assert self.case.laser is not None
        key = (stage.drive.clock, tuple(h for h in hidden if h.id not in UNSEEN))
        if key not in self._read:
            sight = _seen(self.case, stage, stage.poses, list(key[1]))
            x = spread(self.case.laser, sight, hidden)
            self._read[key] = (mean_reading(self.case.laser, sight, hidden), np.log(x.sd))
        return self._read[key]

    def vector(self, cause: Hidden, others: list[Hidden], laser_too: bool) -> Array:
        """What a cause adds to the others, whitened."""
        parts = []
        for stage in self.stages:
            d = self._motion(stage, [*others, cause]) - self._motion(stage, others)
            parts += [solve_triangular(root, d[:, i], lower=True) for i, root in enumerate(stage.motion_roots)]
            if not laser_too or self.case.laser is None:
                continue
            (mean, log), (mean0, log0) = self._readings(stage, [*others, cause]), self._readings(stage, others)
            with np.errstate(invalid="ignore"):
                change = np.where(np.abs(mean - mean0) < 0.3, mean - mean0, 0.0)
            for k, root in enumerate(stage.scan_roots):
                on = stage.keep[k]
                parts.append(stage.more * solve_triangular(root, change[k, on], lower=True))
                parts.append(stage.more * np.sqrt(2) * (log - log0)[k, on])
        return np.concatenate(parts)

    def spoilt(self, cause: Hidden) -> float:
        """How strongly readings that are spoilt, or correlated, show."""
        assert self.case.laser is not None
        total, rng = 0.0, np.random.default_rng(17)
        for stage in self.stages:
            sight = _seen(self.case, stage, stage.poses, [])
            x = spread(self.case.laser, sight, [])
            r = read(self.case.laser, sight, [cause], rng)
            with np.errstate(invalid="ignore"):
                u = (r - mean_reading(self.case.laser, sight, [])) / np.hypot(x.sd, self.case.laser.resolution / 3.5)
            u = np.where(stage.keep | np.array(cause.id == "laser.mixed_pixels"), u, 0.0)
            u = np.where((np.abs(sight.range) < 0.97 * self.case.laser.far), u, 0.0)
            lost = float(np.mean(np.isnan(r[stage.keep])))
            n = float(stage.keep.sum())
            gain = n * (lost * np.log(max(lost, 1e-9) / 0.003) - lost + 0.003) if lost > 0.006 else 0.0
            far = np.isfinite(u) & (np.abs(u) > 4)
            gain += float(np.minimum(u[far] ** 2 / 2, 8).sum())
            m = float(np.mean(u[stage.keep & np.isfinite(u) & ~far] ** 2))
            gain += n * (m - 1 - np.log(m)) / 2 if m > 1.02 else 0.0
            total += 2 * gain * stage.more**2
        return float(np.sqrt(total))

    def correlated(self, cause: Hidden) -> float:
        """How strongly correlations of the errors of a scan show, beside larger noise."""
        assert self.case.laser is not None
        total, common = 0.0, cause.size if cause.id == "laser.common_mode" else 0.0
        for stage in self.stages:
            sight = _seen(self.case, stage, stage.poses, [])
            sd = spread(self.case.laser, sight, []).sd
            for k, root in enumerate(stage.scan_roots):
                on = np.flatnonzero(stage.keep[k])
                own = sd[k, on]
                lag = np.abs(np.subtract.outer(on, on))
                near = cause.size / (1 + cause.size**2) * (lag == 1) if cause.other else cause.size**lag * (lag > 0)
                extra = common**2 * (lag > 0) if common else np.outer(own, own) * near
                inner = solve_triangular(root, solve_triangular(root, extra, lower=True).T, lower=True)
                if common:
                    inner /= 1 + common**2 / float(np.mean(own**2))
                values = np.maximum(np.linalg.eigvalsh(inner), -0.99)
                total += float(np.sum(values - np.log1p(values))) * stage.more**2
        return float(np.sqrt(total))


def left_over(vector: Array, others: list[Array]) -> float:
    """The length of a vector after projecting on others."""
    if not others:
        return float(np.linalg.norm(vector))
    basis = np.array([o / max(float(np.linalg.norm(o)), 1e-12) for o in others])
    coefficients = np.linalg.lstsq(basis @ basis.T + 1e-9 * np.eye(len(others)), basis @ vector, rcond=None)[0]
    return float(np.linalg.norm(vector - coefficients @ basis))


def mean_rates(case: Case, drive: Drive, span: tuple[float, float], hidden: list[Hidden]) -> Array:
    """The rates expected by tenths of a second over a span."""
    n = max(2, round((span[1] - span[0]) / 0.1))
    t = span[0] + (np.arange(n) + 0.5) * (span[1] - span[0]) / n
    return plant.at(expected(case, drive, hidden), t)
