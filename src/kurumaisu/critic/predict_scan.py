# SPDX-License-Identifier: BSD-3-Clause
"""What a scan will read: mean and standard deviation per beam, by a model and by how far such readings were off."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize

from kurumaisu.critic.laser.shots import Shots, look, predict
from kurumaisu.critic.laser.trust import trusted_place
from kurumaisu.params import EffectSetting
from kurumaisu.types import BoolArray, FloatArray

_START = (1.0, 0.005, 0.005, 3e-4)  # factor on the laser's own deviation; pose [m], [rad]; common to all [m]
# Of their natural logarithms, 1 sd: how far from there they remain plausible; poses between rows err less than rows.
_SPREAD = (0.4, 1.5, 1.5, 1.5)
_KNOWN = (0.4, 0.5, 0.5, 1.5)
_MOVE = np.array([0.006, 0.006, 0.006])  # [m, m, rad] by which poses are moved to see what their errors do
_OUTLIER = 5.0  # deviations from which a reading does not say how wide the others scatter
_CAP = 6.0  # deviations that an outlier counts as
_FEWEST = 50  # readings
_INDEPENDENT = 2000.0  # readings that all of them are worth at most
_LEAST = 1e-4  # [m]
Settings = Sequence[EffectSetting]


@dataclass(frozen=True)
class Expected:
    """Mean (k, b) [m], nan where nothing is to be expected; parts of the variance (4, k, b) [m^2] for unit factors.

    place: (k, b) which beams meet a wall well inside, where errors are small and alike.
    """

    mean: FloatArray
    parts: FloatArray
    place: BoolArray


@dataclass(frozen=True)
class ScanModel:
    """Effects, and the scatter about them: factors (4,) on the parts of the variance; tails beside and at edges."""

    settings: tuple[EffectSetting, ...]
    factors: FloatArray
    tails: tuple[float, float]

    def predict(self, shots: Shots) -> tuple[FloatArray, FloatArray]:
        """Return means and standard deviations (k, b) [m]; both nan where no return is to be expected."""
        return self.of(expected(shots, self.settings))

    def of(self, what: Expected) -> tuple[FloatArray, FloatArray]:
        """Return the same of readings that are worked out."""
        sd = np.sqrt(np.tensordot(self.factors**2, what.parts, 1)) * np.where(what.place, self.tails[0], self.tails[1])
        return what.mean, np.where(np.isfinite(what.mean), np.maximum(sd, _LEAST), np.nan)


def expected(shots: Shots, settings: Settings) -> Expected:
    """Return what shots are to read with these effects, and what makes them scatter."""
    seen = look(shots, settings, 0)
    mean = predict(shots, settings, seen, 0)
    mean = np.where((mean <= shots.laser.range_max) & (mean >= shots.laser.range_min), mean, np.nan)
    own = np.square(predict(shots, settings, seen, 0, noise=1.0) - mean)
    moved = np.zeros((3, *mean.shape))
    for i, size in enumerate(_MOVE):
        for sign in (-1.0, 1.0):
            there = look(shots, settings, 0, shift=sign * size * np.eye(3)[i], like=seen)
            # Where a moved beam meets nothing, the move says nothing.
            off = np.nan_to_num(predict(shots, settings, there, 0) - mean)
            moved[i] += 0.5 * np.square(off / size)
    parts = np.array([own, moved[0] + moved[1], moved[2], np.ones_like(mean)])
    return Expected(mean, parts, trusted_place(shots, seen, np.nan_to_num(mean)))


def fit_scatter(shots: Shots, settings: Settings, truth: tuple[float, float] | None) -> ScanModel:
    """Return a model of readings whose scatter is that of measured ones; truth: known sd of the reference's poses."""
    what = expected(shots, settings)
    return scattered(what, shots.measured, tuple(settings), truth)


def scattered(
    what: Expected, measured: FloatArray, settings: tuple[EffectSetting, ...], truth: tuple[float, float] | None
) -> ScanModel:
    """Return the same, of readings that are worked out."""
    error = measured - what.mean
    inside = what.place & np.isfinite(error)
    start = np.log(_START)
    if truth is not None:
        start[1:3] = np.log(np.maximum(truth, 1e-5))
    factors = np.exp(start)
    for _ in range(2):
        z = error / ScanModel(settings, factors, (1.0, 1.0)).of(what)[1]
        middle = float(np.median(np.abs(z[inside]))) if inside.any() else 1.0
        near = inside & (np.abs(np.nan_to_num(z)) < _OUTLIER * 1.4826 * max(middle, 0.1))
        if near.sum() < _FEWEST:
            break
        factors = _factors(what.parts[:, near], error[near], start, np.array(_SPREAD if truth is None else _KNOWN))
    z = error / ScanModel(settings, factors, (1.0, 1.0)).of(what)[1]
    return ScanModel(settings, factors, (_tail(z[inside]), _tail(z[~what.place & np.isfinite(z)])))


def _factors(parts: FloatArray, error: FloatArray, start: FloatArray, spread: FloatArray) -> FloatArray:
    """Return the likeliest factors (4,), near their start; readings that share an error count as few."""
    weight = min(1.0, _INDEPENDENT / len(error))

    def cost(values: FloatArray) -> float:
        variance = np.tensordot(np.exp(2 * values), parts, 1)
        away = (values - start) / spread
        return 0.5 * weight * float(np.sum(np.log(variance) + error**2 / variance)) + 0.5 * float(away @ away)

    simplex = np.vstack([start, start + 0.5 * np.eye(4)])
    options = {"xatol": 0.01, "fatol": 0.01, "maxfev": 200, "initial_simplex": simplex}
    return np.asarray(np.exp(minimize(cost, start, method="Nelder-Mead", options=options).x))


def _tail(z: FloatArray) -> float:
    """Return the factor by which rare large errors widen the scatter, for those who judge by a normal density."""
    return float(np.sqrt(np.mean(np.minimum(z**2, _CAP**2)))) if len(z) >= _FEWEST else 1.0
