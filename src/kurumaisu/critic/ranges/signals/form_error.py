# SPDX-License-Identifier: BSD-3-Clause
"""What an equation that is only nearly right may miss: a free curve over what the effect itself follows.

A laser warms up, or reads dark walls, by a curve of its own, of which the catalogue has the simplest. What the simplest
leaves is no second cause, be it as sure as it may: it is drawn by a curve over the time, or over the reflectance, whose
size is what nobody can refuse of a form. No effect is named: what it follows is found by drawing what it does.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass

import numpy as np
from scipy.linalg import block_diag

from kurumaisu import effects
from kurumaisu.critic.engine.form_error import SHARES
from kurumaisu.critic.ranges.scans.beams import BeamHits, Shots
from kurumaisu.critic.ranges.signals.coefficient_blocks import echoes_of
from kurumaisu.critic.unknown.bases import Basis, knots_of, priors_of, root_of
from kurumaisu.critic.values.policy import FORM_ERROR
from kurumaisu.types import BoolArray, FloatArray, IntArray

_FOLLOWED = ("time", "range", "incidence", "bearing")
_RETURNS = "returns"
_SMOOTH = 5  # knots of a smooth function
_HATS = 16  # of a curve, as many as of one that is in no catalogue, and two more
_FINE = 64  # knots that draw whatever is a curve at all
_DRAWN = 0.01  # share of an effect's power that such a curve may leave
_SAMPLES = 20000  # readings by which curves are judged
_SAME = 1e-4  # share of a change's power beyond what another size does, below which it is that
Shares = tuple[float, float]
_MOST = 12  # reflectances that a map may have, for a step each


@dataclass(frozen=True)
class DrawnCurve:
    """A curve that an effect may follow: over a covariate, straight lines between knots, or a step for each value.

    prior (n, n): covariance of its coefficients, to a factor; signal (k, b) [m]: what the effect does, which
    the curve multiplies, None of one that stands for the effect itself.
    """

    covariate: str
    knots: FloatArray
    prior: FloatArray
    signal: FloatArray | None = None

    def columns(self, shots: Shots, seen: BeamHits) -> FloatArray:
        """Return the curve's columns (k, b, n) over the beams."""
        values = _values(self.covariate, shots, seen)
        if self.covariate == _RETURNS:
            return _steps(self.knots, values)
        hats = _hats(self.knots, values.ravel()).reshape(*values.shape, len(self.knots))
        return hats if self.signal is None else hats * self.signal[:, :, np.newaxis]


@dataclass(frozen=True)
class FormFamily:
    """Curves that an effect may follow instead of its equation."""

    curves: tuple[DrawnCurve, ...]

    @property
    def size(self) -> int:
        """Return the number of coefficients."""
        return sum(len(curve.prior) for curve in self.curves)

    @property
    def follows(self) -> str | None:
        """Return what the effect itself is a curve over, if it is one."""
        return next((curve.covariate for curve in self.curves if curve.signal is None), None)

    def columns(self, shots: Shots, seen: BeamHits) -> FloatArray:
        """Return the curves (k, b, n) over the beams."""
        return np.concatenate([curve.columns(shots, seen) for curve in self.curves], axis=2)

    def scaled(
        self, gram: FloatArray, power: float, share: float = FORM_ERROR, times: float | None = None
    ) -> FloatArray:
        """Return the prior (n, n) with which each curve is as large, for their gram (n, n), as a share of `power`.

        power: squared norm, whitened as the gram is, of what the effect does; times: the share of curves that multiply
        it, None for the same.
        """
        priors, start = [], 0
        for curve in self.curves:
            own = slice(start, start + len(curve.prior))
            start = own.stop
            size = share if curve.signal is None or times is None else times
            priors.append(curve.prior * (size**2 * power / max(float(np.sum(curve.prior * gram[own, own])), 1e-300)))
        return np.asarray(block_diag(*priors))


def form_family(change: FloatArray, shots: Shots, seen: BeamHits, valid: BoolArray) -> FormFamily | None:
    """Return the curves that what an effect does (k, b) [m] to the mean may follow instead; None if it does nothing.

    One over the quantity that draws it, if any does, of two the one that leaves less; and what it does times smooth
    functions of others. valid (k, b): of which readings that must hold.
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
    drawn = () if best is None else (_over(best, _values(best, shots, seen)[known][::step], target),)
    there = np.where(known, change, 0.0)
    more = []
    for name in _FOLLOWED:
        knots = knots_of(_values(name, shots, seen)[known][::step], _SMOOTH)
        if name != best and len(knots) > 1:
            more.append(DrawnCurve(name, knots, np.eye(len(knots)), there))
    return FormFamily((*drawn, *more)) if drawn or more else None


def beam_family(shots: Shots) -> FormFamily:
    """Return curves over the bearing: what single beams keep, be it as smooth as it may."""
    ends = shots.laser.bearings[[0, -1]]
    return FormFamily((DrawnCurve("bearing", np.linspace(ends.min(), ends.max(), _HATS), np.eye(_HATS)),))


def over_shares(weigh: Callable[[Shares], float]) -> dict[Shares, float]:
    """Return what weighs shares of a signal that equations may miss, for those that hold nearly all that is likely.

    The share of a curve in the place of the signal first, then that of curves that multiply it.
    """
    nats = {(0.0, 0.0): weigh((0.0, 0.0))}
    for i in range(2):
        best = max(nats, key=lambda shares: nats[shares])
        for share in SHARES:
            shares = (share, best[1]) if i == 0 else (best[0], share)
            nats[shares] = weigh(shares)
    return nats


def priors_in(
    gram: FloatArray, parts: Iterable[tuple[slice, FormFamily, float]], shares: Shares
) -> Iterator[FloatArray]:
    """Yield the priors (n, n) of families: where in the gram each has its coefficients, and power of what it is of."""
    return (family.scaled(gram[span, span], power, *shares) for span, family, power in parts)


def integrated_out(gram: FloatArray, columns: IntArray, prior: FloatArray) -> FloatArray:
    """Return normal equations with some columns' coefficients integrated out, which are normal with a covariance."""
    root = root_of(prior)
    cross = root.T @ gram[columns]
    inner = np.eye(len(prior)) + root.T @ gram[np.ix_(columns, columns)] @ root
    return np.asarray(gram - cross.T @ np.linalg.solve(inner, cross))


def _over(name: str, values: FloatArray, change: FloatArray) -> DrawnCurve:
    """Return curves over a quantity; change [m]: what the effect does there. Other forms bend where it does, too."""
    if name == _RETURNS:
        steps = np.unique(values)
        return DrawnCurve(name, steps, np.eye(len(steps)))
    fine = _knots(values, _FINE)
    drawn = _fitted(_hats(fine, values), change)
    ways = (fine, np.searchsorted(np.sort(values), fine), np.cumsum(np.abs(np.diff(drawn, prepend=drawn[:1]))))
    along = np.sum([(way - way[0]) / max(float(way[-1] - way[0]), 1e-300) for way in ways], axis=0)
    knots = np.interp(np.linspace(0.0, along[-1], _HATS), along, fine)
    hats = _hats(knots, values)
    # Rough or smooth along these, with a level of its own or without, or of another power or scale: nobody knows.
    every = [
        *priors_of(np.arange(_HATS, dtype=float), hats),
        *_deformations(knots, np.interp(knots, fine, drawn), hats),
    ]
    return DrawnCurve(name, knots, np.mean(every, axis=0))


def _deformations(knots: FloatArray, heights: FloatArray, hats: FloatArray) -> Iterator[FloatArray]:
    """Yield covariances of a curve's heights (n,) at knots by which another power of it, and another scale, differs.

    hats (samples, n): each is as large there as a curve of priors_of, without what another size of the curve does.
    """
    top = max(float(np.abs(heights).max()), 1e-300)
    power = heights * np.log(np.maximum(np.abs(heights) / top, 1e-9))
    for way in (power, knots * np.gradient(heights, knots)):
        own, other = hats @ heights, hats @ way
        rest = way - heights * float(own @ other) / max(float(own @ own), 1e-300)
        size = float(np.mean((hats @ rest) ** 2))
        if size > _SAME * float(np.mean(other**2)):
            yield np.outer(rest, rest) / size


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
