# SPDX-License-Identifier: BSD-3-Clause
"""What an equation that is only nearly right may miss: a free curve over what the effect itself follows.

A laser warms up, or reads dark walls, by a curve of its own, of which the catalogue has the simplest. What the simplest
leaves is no second cause, be it as sure as it may: it is drawn by a curve over the time, or over the reflectance, whose
size is what nobody can refuse of a form. No effect is named: what it follows is found by drawing what it does.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kurumaisu import effects
from kurumaisu.critic.ranges.scans.beams import BeamHits, Shots
from kurumaisu.critic.ranges.signals.coefficient_blocks import echoes_of
from kurumaisu.critic.unknown.bases import Basis, priors_of
from kurumaisu.critic.values.policy import FORM_ERROR
from kurumaisu.types import BoolArray, FloatArray, IntArray

_FOLLOWED = ("time", "range", "incidence", "bearing")
_RETURNS = "returns"
_HATS = 16  # of a curve, as many as of one that is in no catalogue, and two more
_FINE = 64  # knots that draw whatever is a curve at all
_DRAWN = 0.01  # share of an effect's power that such a curve may leave
_SAMPLES = 20000  # readings by which curves are judged
_MOST = 12  # reflectances that a map may have, for a step each


@dataclass(frozen=True)
class FormFamily:
    """Curves that an effect may follow instead of its equation.

    covariate: what they follow; knots: of straight lines, or values with a step each where there are but few; prior
    (n, n): covariance of the coefficients, to a factor.
    """

    covariate: str
    knots: FloatArray
    prior: FloatArray

    def columns(self, shots: Shots, seen: BeamHits) -> FloatArray:
        """Return the curves (k, b, n) over the beams."""
        values = _values(self.covariate, shots, seen)
        if self.covariate == _RETURNS:
            return _steps(self.knots, values)
        return _hats(self.knots, values.ravel()).reshape(*values.shape, len(self.knots))

    def scaled(self, gram: FloatArray, power: float) -> FloatArray:
        """Return the prior (n, n) with which curves are as large, for their gram (n, n), as a form's share of `power`.

        power: squared norm, whitened as the gram is, of what the effect does.
        """
        return self.prior * (FORM_ERROR**2 * power / max(float(np.sum(self.prior * gram)), 1e-300))


def form_family(change: FloatArray, shots: Shots, seen: BeamHits, valid: BoolArray) -> FormFamily | None:
    """Return the curves over what an effect follows that does this (k, b) [m] to the mean; None if it follows nothing.

    Of two quantities that draw it, the one that leaves less; valid (k, b): of which readings it must.
    """
    known = valid & np.isfinite(change)
    step = max(int(known.sum()) // _SAMPLES, 1)
    target = change[known][::step]
    whole = float(target @ target)
    if whole == 0.0:
        return None
    best, least = None, _DRAWN * whole
    for name in (*_FOLLOWED, _RETURNS):
        values = _values(name, shots, seen)[known][::step]
        fine = np.unique(values) if name == _RETURNS else _knots(values, _FINE)
        if len(fine) < 2 or (name == _RETURNS and len(fine) > _MOST):
            continue
        left = _left(_steps(fine, values) if name == _RETURNS else _hats(fine, values), target)
        if left < least:
            best, least = name, left
    return None if best is None else _over(best, _values(best, shots, seen)[known][::step], target)


def beam_family(shots: Shots) -> FormFamily:
    """Return curves over the bearing: what single beams keep, be it as smooth as it may."""
    ends = shots.laser.bearings[[0, -1]]
    return FormFamily("bearing", np.linspace(ends.min(), ends.max(), _HATS), np.eye(_HATS))


def integrated_out(gram: FloatArray, columns: IntArray, prior: FloatArray) -> FloatArray:
    """Return normal equations with some columns' coefficients integrated out, which are normal with a covariance."""
    values, vectors = np.linalg.eigh(prior)
    root = vectors * np.sqrt(np.maximum(values, 0.0))
    cross = root.T @ gram[columns]
    inner = np.eye(len(prior)) + root.T @ gram[np.ix_(columns, columns)] @ root
    return np.asarray(gram - cross.T @ np.linalg.solve(inner, cross))


def _over(name: str, values: FloatArray, change: FloatArray) -> FormFamily:
    """Return curves over a quantity; change [m]: what the effect does there. Other forms bend where it does, too."""
    if name == _RETURNS:
        steps = np.unique(values)
        return FormFamily(name, steps, np.eye(len(steps)))
    fine = _knots(values, _FINE)
    drawn = _fitted(_hats(fine, values), change)
    ways = (fine, np.searchsorted(np.sort(values), fine), np.cumsum(np.abs(np.diff(drawn, prepend=drawn[:1]))))
    along = np.sum([(way - way[0]) / max(float(way[-1] - way[0]), 1e-300) for way in ways], axis=0)
    knots = np.interp(np.linspace(0.0, along[-1], _HATS), along, fine)
    # Rough or smooth along these, with a level of its own or without: nobody knows.
    every = priors_of(np.arange(_HATS, dtype=float), _hats(knots, values))
    return FormFamily(name, knots, np.mean(list(every), axis=0))


def _values(name: str, shots: Shots, seen: BeamHits) -> FloatArray:
    """Return what curves follow (k, b), of every beam; of those that meet nothing, anything."""
    if name == _RETURNS:
        return seen.returns
    return np.asarray(effects.RANGE_COVARIATES[name](echoes_of(shots, seen)), dtype=float)


def _knots(values: FloatArray, count: int) -> FloatArray:
    """Return knots from end to end, half way between evenly spaced ones and ones with as many samples between them."""
    knots = 0.5 * (np.linspace(values.min(), values.max(), count) + np.quantile(values, np.linspace(0, 1, count)))
    keep = np.append(True, np.diff(knots) > 1e-3 * max(float(np.ptp(values)), 1e-9))
    return np.asarray(knots[keep])


def _hats(knots: FloatArray, values: FloatArray) -> FloatArray:
    return Basis("", knots, {}, (), float(knots[0]), float(knots[-1])).matrix(values)


def _steps(steps: FloatArray, values: FloatArray) -> FloatArray:
    return np.asarray(values[..., np.newaxis] == steps, dtype=float)


def _left(columns: FloatArray, target: FloatArray) -> float:
    return float(np.sum((target - columns @ _fitted(columns, target)) ** 2))


def _fitted(columns: FloatArray, target: FloatArray) -> FloatArray:
    gram = columns.T @ columns
    inner = gram + 1e-9 * float(np.trace(gram)) / len(gram) * np.eye(len(gram))
    return np.asarray(np.linalg.solve(inner, columns.T @ target))
