# SPDX-License-Identifier: BSD-3-Clause
"""How far the numbers of simulated scans are from those of the measured ones, in nats."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from scipy.linalg import solve_triangular

from kurumaisu.types import BoolArray, FloatArray

_SIMULATED = 0.5  # variance of the numbers of simulations, of which two are averaged, in theirs
_COUNT = 1.0  # sd of twice the root of a count, also of one that is always 0 in simulations
MATTERS = 0.02  # of any other number, the log of a square, by which it may differ and matter to nobody
# Share of twice the root of a count likewise: a spread that differs by so little has a tenth more or less beyond 3 sds.
_TAILS = 0.05
_OWN = 0.1  # share of the variance of numbers that share readings which each has to itself
_SILENT = 1e6  # sd of a number that says nothing
_FAR = 5.0  # sds from which a number pulls no harder: what nothing explains yet must not bend what explains the others
_DAMPED = 0.02  # share by which the curvature is raised: other draws make the slopes uncertain
_FORM = 0.1  # share of what an effect does to a number, by which a real effect of that name may do more or less
# Likewise, from end to end of the ranges or of the incidences.
_TREND = 0.15
# Of how far readings scatter likewise, per e-fold of the range, as a share of what it does at any: noise of a footprint
# grows with the range, a law may not.
_POWER = 0.5


@dataclass(frozen=True)
class StatisticKinds:
    """Which numbers (m,) are roots of counts, of the same sd, few or many; and which are places, alike in any form.

    trends (g, m): from -1 to 1 over numbers of readings from near to far, or from straight to oblique; 0 elsewhere.
    folds (m,): logs of the ranges at which numbers tell how far readings scatter, less their mean; 0 elsewhere.
    alike (m, m): correlations by the readings that numbers share, whatever these do. matters (m,): by how much those
    that are no counts may differ and matter to nobody.
    """

    counts: BoolArray
    places: BoolArray
    trends: FloatArray = field(default_factory=lambda: np.empty((0, 0)))
    folds: FloatArray = field(default_factory=lambda: np.empty(0))
    alike: FloatArray | None = None
    matters: FloatArray | float = MATTERS


class StatisticsLikelihood:
    """Normal numbers about those of a simulation, with the covariance of the model's own."""

    def __init__(self, nulls: FloatArray, measured: FloatArray, kinds: StatisticKinds, heard: BoolArray) -> None:
        """Take numbers of simulations of the model as it is (n, m), and the measured ones (m,).

        kinds: of which they are; heard: numbers that say anything.
        """
        self._places, self._trends, self._folds = kinds.places, kinds.trends, kinds.folds
        self.offset, self.measured = nulls.mean(axis=0), measured
        spread = nulls.std(axis=0)
        count_sd = np.hypot(np.maximum(spread, _COUNT), _TAILS * np.abs(self.offset))
        self.sd = np.where(kinds.counts, count_sd, np.hypot(spread, kinds.matters))
        self.sd = np.where(heard, self.sd, _SILENT)
        unit = (nulls - self.offset) / self.sd
        own = np.eye(len(measured))
        expected = own if kinds.alike is None else (1 - _OWN) * kinds.alike + _OWN * own
        half = 0.5 * (unit.T @ unit / len(nulls) + expected)  # few draws leave correlations uncertain
        self._covariance = (1 + _SIMULATED) * half
        self._log_det = float(np.linalg.slogdet(self._covariance)[1])
        self._most = np.abs(self.units(measured))

    def units(self, numbers: FloatArray) -> FloatArray:
        """Return how far numbers are from the model's own, in sds."""
        return np.asarray((numbers - self.offset) / self.sd)

    def places_off(self, numbers: FloatArray) -> FloatArray:
        """Return how far the places of piles are off the measured ones, in sds; 0 where a small step leads there."""
        off = ((numbers - self.measured) / self.sd)[self._places]
        return np.where(np.abs(off) < _FAR, 0.0, off)

    def cost(self, numbers: FloatArray) -> float:
        """Return the negative log likelihood of the measured numbers for simulated ones, 0 for a perfect model."""
        lower = self._root(numbers)
        white = solve_triangular(lower, (numbers - self.measured) / self.sd, lower=True)
        near = np.minimum(np.abs(white), _FAR)
        misfit = float(np.sum(near * (np.abs(white) - 0.5 * near)))
        return misfit - 0.5 * self._log_det + float(np.log(np.diag(lower)).sum())

    def heat(self, numbers: FloatArray) -> float:
        """Return the mean square by which the measured numbers are off simulated ones, in sds; 1 at least."""
        far = np.minimum(np.abs(self.whitened(numbers - self.measured, numbers)), _FAR)
        return max(float(np.mean(far**2)), 1.0)

    def step(self, numbers: FloatArray, slopes: FloatArray) -> FloatArray:
        """Return the shares (n,) of some changes of the numbers (n, m) that bring them closest to the measured ones."""
        white = np.array([self.whitened(change, numbers) for change in slopes])
        left = self.whitened(numbers - self.measured, numbers)
        weighed = white * np.minimum(1.0, _FAR / np.maximum(np.abs(left), 1e-9))
        inner = weighed @ white.T
        damped = inner + _DAMPED * np.diag(np.diag(inner)) + 1e-6 * np.eye(len(slopes))
        return np.asarray(-np.linalg.solve(damped, weighed @ left))

    def whitened(self, change: FloatArray, numbers: FloatArray) -> FloatArray:
        """Return a change of the numbers (m,) about simulated ones in independent units."""
        return np.asarray(solve_triangular(self._root(numbers), change / self.sd, lower=True))

    def _root(self, numbers: FloatArray) -> FloatArray:
        """Return the root of the covariance where effects made such numbers: their real form may do more or less."""
        done = np.where(self._places, 0.0, np.clip(self.units(numbers), -self._most, self._most))
        slack = np.diag((_FORM * done) ** 2)
        if len(self._trends):
            along = _TREND * self._trends * done
            slack += along.T @ along
        if self._folds.any():
            along = _POWER * self._folds * np.mean(done[self._folds != 0])
            slack += np.outer(along, along)
        return np.asarray(np.linalg.cholesky(self._covariance + slack))
