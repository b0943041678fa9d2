# SPDX-License-Identifier: BSD-3-Clause
"""What a scan will read: mean and standard deviation per beam, by a model and by how far such readings were off."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize

from kurumaisu import effects
from kurumaisu.critic.ranges.scans.beams import BeamHits, Shots, hits_of, predict, thin
from kurumaisu.critic.ranges.scans.valid_readings import usable_beams
from kurumaisu.params import EffectSetting
from kurumaisu.robust import SIGMA_PER_MAD
from kurumaisu.types import BoolArray, FloatArray

_START = (1.0, 1.0, 1.0, 3e-4)  # factors on the laser's own deviation, on the doubt of the pose; common to all [m]
_SPREAD = (0.4, 1.0, 1.0, 1.5)  # of their natural logarithms, 1 sd: how far from there they remain plausible
_MOVE = np.array([0.006, 0.006, 0.006])  # [m, m, rad] by which poses are moved to see what their errors do
_WIDER = 2.0  # times as wide as poses are likely, those are drawn that are tried for what a beam meets
_DRAWS, _LOOKS = (16, 128), 4096  # so many of each scan, at least and at most, and so many in all
OUTLIER = 5.0  # deviations from which a reading does not say how wide the others scatter
_PROBE = 2  # scans on which it is tried what is drawn
_CAP = 6.0  # deviations that an outlier counts as
_ELSEWHERE = float(np.log(0.01 / 4.0))  # log density [nat] of what one reading in a hundred is, anywhere in 4 m
_ROUNDS = 2  # in which it is told which readings those are
_FEWEST = 50  # readings
_LEAST = 1e-4  # [m]
_SURE = 1e-5  # [m, rad] no pose is known better


@dataclass(frozen=True)
class Expected:
    """Mean (k, b) [m], nan where nothing is to be expected; parts of the variance (4, k, b) [m^2] for unit factors.

    shared (k, b, 4): what a reading does by errors that its scan shares: of the pose, x, y, yaw, as shares of their
    doubt, and of all readings [m]. place: (k, b) which beams meet a wall well inside, where errors are small and alike.
    """

    mean: FloatArray
    parts: FloatArray
    shared: FloatArray
    place: BoolArray


@dataclass(frozen=True)
class ScanModel:
    """Effects, and the scatter about them: factors (4,) on the parts of the variance; tails beside and at edges."""

    settings: tuple[EffectSetting, ...]
    factors: FloatArray
    tails: tuple[float, float]

    def predict(self, shots: Shots) -> tuple[FloatArray, FloatArray]:
        """Return means and standard deviations (k, b) [m]; both nan where no return is to be expected.

        Where the pose decides which of two walls a beam meets, the mean and deviation are those of either.
        """
        settings = without_random(shots, self.settings)
        around = shifted_hits(shots, settings)
        mean, sd = self.of(expected_from(shots, settings, around))
        place = (doubts(shots) * self.factors[[1, 1, 2]])[:, np.newaxis]
        total, first, second, farthest = np.zeros((4, *mean.shape))
        for move in np.random.default_rng(0).normal(
            0.0, _WIDER, (int(np.clip(_LOOKS // max(len(mean), 1), *_DRAWS)), 3)
        ):
            weight = float(np.exp(-0.5 * move @ move * (1 - _WIDER**-2)))
            hits = hits_of(shots, settings, 0, shift=move * place, like=around[0])
            off = predict(shots, settings, hits, 0) - mean
            seen, off = weight * np.isfinite(off), np.nan_to_num(off)
            total, first, second = total + seen, first + seen * off, second + seen * off**2
            farthest = np.maximum(farthest, np.abs(off))
        drift = first / np.maximum(total, 1e-9)
        spread = np.sqrt(np.maximum(second / np.maximum(total, 1e-9) - drift**2, 0.0))
        jumps = (farthest > OUTLIER * sd) & (spread > sd)
        return np.where(jumps, mean + drift, mean), np.where(jumps, np.hypot(sd, spread), sd)

    def of(self, what: Expected) -> tuple[FloatArray, FloatArray]:
        """Return the same of readings that are worked out."""
        sd = np.sqrt(np.tensordot(self.factors**2, what.parts, 1)) * np.where(what.place, self.tails[0], self.tails[1])
        return what.mean, np.where(np.isfinite(what.mean), np.maximum(sd, _LEAST), np.nan)


def expected(shots: Shots, settings: Sequence[EffectSetting]) -> Expected:
    """Return what shots are to read with these effects, and what makes them scatter."""
    settings = without_random(shots, settings)
    return expected_from(shots, settings, shifted_hits(shots, settings))


def shifted_hits(shots: Shots, settings: Sequence[EffectSetting]) -> list[BeamHits]:
    """Return what the beams meet, and what they would from poses that are moved back and forth, along each axis."""
    seen = hits_of(shots, settings, 0)
    moves = [sign * size * np.eye(3)[i] for i, size in enumerate(_MOVE) for sign in (-1.0, 1.0)]
    return [seen, *(hits_of(shots, settings, 0, shift=move, like=seen) for move in moves)]


def expected_from(shots: Shots, settings: Sequence[EffectSetting], around: Sequence[BeamHits]) -> Expected:
    """Return what expected does; settings: without what is drawn; around: of looks with the same settings."""
    seen = around[0]
    mean = predict(shots, settings, seen, 0)
    mean = np.where((mean <= shots.laser.range_max) & (mean >= shots.laser.range_min), mean, np.nan)
    own = np.square(predict(shots, settings, seen, 0, noise=1.0) - mean)
    moved = np.zeros((3, *mean.shape))
    shared = np.ones((*mean.shape, 4))
    doubt = doubts(shots)
    for i, size in enumerate(_MOVE):
        sides = around[1 + 2 * i : 3 + 2 * i]
        # Where a moved beam meets nothing, the move says nothing.
        scale = doubt[:, i, np.newaxis] / size
        low, high = (np.nan_to_num((predict(shots, settings, side, 0) - mean) * scale) for side in sides)
        moved[i] = 0.5 * (low**2 + high**2)  # at an edge one side jumps
        shared[:, :, i] = 0.5 * (high - low)
    parts = np.array([own, moved[0] + moved[1], moved[2], np.ones_like(mean)])
    return Expected(mean, parts, shared, usable_beams(shots, seen, np.nan_to_num(mean)))


def doubts(shots: Shots) -> FloatArray:
    """Return what the pose of each scan may be off, (k, 3) [m, m, rad]."""
    return np.maximum([shots.tracks[i].doubt for i in shots.run.tolist()], _SURE)[:, [0, 0, 1]]


def without_random(shots: Shots, settings: Sequence[EffectSetting]) -> Sequence[EffectSetting]:
    """Return the effects without those of their parameters whose mark on the mean is drawn: nobody can expect it."""
    few, out = thin(shots, _PROBE), list(settings)
    for i, setting in enumerate(settings):
        effect = effects.by_id(setting.id)
        if not effect.random or _steady(few, out):
            continue
        for p in effect.parameters:
            without = EffectSetting(setting.id, {**out[i].parameters, p.name: p.null})
            if _steady(few, [without]):
                out[i] = without
                break
    return tuple(out)


def _steady(shots: Shots, settings: Sequence[EffectSetting]) -> bool:
    drawn = [predict(shots, settings, hits_of(shots, settings, seed), seed) for seed in (0, 1)]
    return np.array_equal(drawn[0], drawn[1], equal_nan=True)


def fit_scatter(shots: Shots, settings: Sequence[EffectSetting]) -> ScanModel:
    """Return a model of readings whose scatter is that of measured ones."""
    return scattered(expected(shots, settings), shots.measured, tuple(settings))


def scattered(what: Expected, measured: FloatArray, settings: tuple[EffectSetting, ...]) -> ScanModel:
    """Return the same, of readings that are worked out."""
    error = measured - what.mean
    inside = what.place & np.isfinite(error)
    start = np.log(_START)
    factors = np.exp(start)
    for _ in range(2):
        z = error / ScanModel(settings, factors, (1.0, 1.0)).of(what)[1]
        middle = float(np.median(np.abs(z[inside]))) if inside.any() else 1.0
        near = inside & (np.abs(np.nan_to_num(z)) < OUTLIER * SIGMA_PER_MAD * max(middle, 0.1))
        if near.sum() < _FEWEST:
            break
        factors = _factors(Joint(what, error, _no_outliers(what, error, near, factors)), start, np.array(_SPREAD))
    z = error / ScanModel(settings, factors, (1.0, 1.0)).of(what)[1]
    return ScanModel(settings, factors, (_tail(z[inside]), _tail(z[~what.place & np.isfinite(z)])))


class Joint:
    """Readings of whole scans, whose shared errors make them err together."""

    def __init__(self, what: Expected, error: FloatArray, use: BoolArray) -> None:
        """Take errors (k, b) [m] and which of them count."""
        own = np.where(use, what.parts[0], np.inf)
        left = np.where(use, np.nan_to_num(error), 0.0)
        weighed = what.shared / own[:, :, np.newaxis]
        self._count = use.sum(axis=1)
        self._shared = what.shared
        self._inner = weighed.transpose(0, 2, 1) @ what.shared
        self._cross = (weighed.transpose(0, 2, 1) @ left[:, :, np.newaxis])[:, :, 0]
        self._square = np.sum(left**2 / own, axis=1)
        self._log = np.sum(np.log(np.where(use, own, 1.0)), axis=1)

    def common(self, factors: FloatArray) -> FloatArray:
        """Return what each scan's shared errors most likely do to its readings, (k, b) [m]."""
        size, inner, cross = self._solved(factors)
        shared = np.linalg.solve(inner, cross[:, :, np.newaxis])
        return np.asarray((self._shared @ (size[:, np.newaxis] * shared))[:, :, 0])

    def _solved(self, factors: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        size = factors[[1, 1, 2, 3]] / factors[0]
        return size, np.eye(4) + self._inner * np.outer(size, size), self._cross * size

    def log_density(self, factors: FloatArray) -> FloatArray:
        """Return the log density of each scan's readings together, (k,) [nat]; factors (4,) as of ScanModel."""
        k = factors[0]
        _, inner, cross = self._solved(factors)
        rest = self._square - np.sum(cross * np.linalg.solve(inner, cross[:, :, np.newaxis])[:, :, 0], axis=1)
        log_det = self._log + 2 * self._count * np.log(k) + np.linalg.slogdet(inner)[1]
        return np.asarray(-0.5 * (rest / k**2 + log_det + self._count * np.log(2 * np.pi)))


def _no_outliers(what: Expected, error: FloatArray, use: BoolArray, factors: FloatArray) -> BoolArray:
    """Return which of the readings (k, b) that count are no outliers beside what their scans share."""
    own, near = np.maximum(factors[0] * np.sqrt(what.parts[0]), _LEAST), use
    for _ in range(_ROUNDS):
        z = np.abs(np.where(use, error - Joint(what, error, near).common(factors), 0.0)) / own
        middle = float(np.median(z[near])) if near.any() else 1.0
        near = use & (z < OUTLIER * SIGMA_PER_MAD * max(middle, 0.1))
    return near


def log_density(what: Expected, error: FloatArray, use: BoolArray, factors: FloatArray) -> FloatArray:
    """Return the log density of each scan's readings that count, (k,) [nat]; outliers may be anywhere.

    Beside what a whole scan shares, the noise of a reading is small: else a few that met something else decide all.
    """
    near = _no_outliers(what, error, use, factors)
    return np.asarray(Joint(what, error, near).log_density(factors) + _ELSEWHERE * (use & ~near).sum(axis=1))


def _factors(joint: Joint, start: FloatArray, spread: FloatArray) -> FloatArray:
    """Return the likeliest factors (4,), near their start."""

    def cost(values: FloatArray) -> float:
        away = (values - start) / spread
        return 0.5 * float(away @ away) - float(joint.log_density(np.exp(values)).sum())

    simplex = np.vstack([start, start + 0.5 * np.eye(4)])
    options = {"xatol": 0.01, "fatol": 0.1, "maxfev": 300, "initial_simplex": simplex}
    return np.asarray(np.exp(minimize(cost, start, method="Nelder-Mead", options=options).x))


def _tail(z: FloatArray) -> float:
    """Return the factor by which rare large errors widen the scatter, for those who judge by a normal density."""
    return float(np.sqrt(np.mean(np.minimum(z**2, _CAP**2)))) if len(z) >= _FEWEST else 1.0
