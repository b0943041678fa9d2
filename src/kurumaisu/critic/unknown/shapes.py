# SPDX-License-Identifier: BSD-3-Clause
"""The shape of a fitted curve: which of a few templates describes it, where, how large, and how sure that is."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import product

import numpy as np

from kurumaisu.critic.unknown.bases import Basis
from kurumaisu.critic.unknown.step_curves import StepCurve
from kurumaisu.types import FloatArray

_POINTS = 60  # at which a curve is described
_DRAWS = 300  # of the posterior
_PLACES = 25  # of a template along the covariate


@dataclass(frozen=True)
class DrawnCurve:
    """A curve over a covariate: its coefficients (m,) and their covariance (m, m)."""

    basis: Basis
    coefficients: FloatArray
    covariance: FloatArray


@dataclass(frozen=True)
class Shape:
    """kind: a key of TEMPLATES, jump, constant, periodic or irregular; place, size: estimate and 90 % interval, (3,).

    The place is that of a jump, step, threshold or bump, the period of an oscillation, and the middle of what is
    straight; size: the constant, from end to end of a line or beyond a threshold, height of a jump, step or bump,
    amplitude of an oscillation, and from the lowest to the highest value of what is irregular.
    """

    kind: str
    place: FloatArray
    size: FloatArray


# Over a covariate x from 0 to 1, about a place in it; each with a level and a factor besides.
TEMPLATES: dict[str, tuple[Callable[[FloatArray, float], FloatArray], ...]] = {
    "line": (lambda x, _: x,),
    "step": (lambda x, at: 1 / (1 + np.exp(np.clip(-(x - at) / 0.05, -50, 50))),),
    "threshold": (
        lambda x, at: np.maximum(x - at, 0.0) / max(1 - at, 1e-9),
        lambda x, at: np.maximum(at - x, 0.0) / max(at, 1e-9),
    ),
    "bump": (
        lambda x, at: np.exp(-0.5 * ((x - at) / 0.1) ** 2),
        lambda x, at: np.exp(-0.5 * ((x - at) / 0.22) ** 2),
    ),
}


def grid(curve: DrawnCurve) -> FloatArray:
    """Return values of the covariate at which its curve is known."""
    basis = curve.basis
    if len(basis.knots) == 1:
        return np.array([basis.low, basis.high])
    if isinstance(basis, StepCurve):
        return np.sort(np.append(np.linspace(basis.low, basis.high, _POINTS), basis.knots))
    if len(basis.knots):
        low, high = max(basis.low, float(basis.knots[0])), min(basis.high, float(basis.knots[-1]))
        return np.linspace(low, high, _POINTS)
    return np.linspace(0.0, basis.constants["period"], _POINTS, endpoint=False)


def band(curve: DrawnCurve, at: FloatArray) -> FloatArray:
    """Return the curve and its standard deviation at values of the covariate, (2, n)."""
    matrix = curve.basis.matrix(at)
    variance = np.einsum("ij,jk,ik->i", matrix, curve.covariance, matrix)
    return np.stack([matrix @ curve.coefficients, np.sqrt(np.maximum(variance, 0.0))])


def shape_of(curve: DrawnCurve) -> Shape:
    """Return the template that describes the curve best, with intervals from draws of its coefficients."""
    at = grid(curve)
    mean, rng = curve.coefficients, np.random.default_rng(0)
    drawn = rng.multivariate_normal(mean, curve.covariance, size=_DRAWS, check_valid="ignore")
    every = np.vstack([mean, drawn])
    curves = every @ curve.basis.matrix(at).T
    if len(curve.basis.knots) == 1:
        return Shape("constant", np.full(3, (at[0] + at[-1]) / 2), _interval(curves[:, 0]))
    if not len(curve.basis.knots):
        return _periodic(curve, every)
    if isinstance(curve.basis, StepCurve):
        return Shape("jump", curve.basis.place, _interval(np.diff(every)[:, 0]))
    x = (at - at[0]) / (at[-1] - at[0])
    noise = float(np.mean(curves[1:].var(axis=0)))
    # Each of a kind's places is a parameter more than a line has.
    costs = {k: np.log(_best(k, x, curves[0])[2] + noise) * 8 + (k != "line") * np.log(8) for k in TEMPLATES}
    kind = min(costs, key=lambda name: costs[name])
    fitted = [_best(kind, x, one) for one in curves]
    sizes = np.array([size for _, size, _ in fitted])
    if kind == "line" and np.diff(np.sign(_interval(sizes)[1:])):  # neither rises nor falls: none of the templates
        kind, sizes = "irregular", np.ptp(curves, axis=1)
    places = np.array([place for place, _, _ in fitted])
    return Shape(kind, at[0] + (at[-1] - at[0]) * _interval(places), _interval(sizes))


def _periodic(curve: DrawnCurve, coefficients: FloatArray) -> Shape:
    """Return the strongest harmonic."""
    count = (coefficients.shape[1] - 1) // 2
    sizes = np.hypot(coefficients[:, 1 : 1 + count], coefficients[:, 1 + count :])
    strongest = int(np.argmax(sizes[0]))
    period = curve.basis.constants["period"] / (strongest + 1)
    return Shape("periodic", np.full(3, period), _interval(sizes[:, strongest]))


def _interval(values: FloatArray) -> FloatArray:
    """Return the first value and the 90 % interval of the others."""
    return np.array([values[0], *np.quantile(values[1:], [0.05, 0.95])])


def _best(kind: str, x: FloatArray, curve: FloatArray) -> tuple[float, float, float]:
    """Return place, size and mean squared misfit of the best template of a kind."""
    y = curve - curve.mean()
    places = (0.5,) if kind == "line" else np.linspace(0.06, 0.94, _PLACES)
    fits = []
    for template, place in product(TEMPLATES[kind], places):
        t = template(x, float(place))
        t = t - t.mean()
        size = float(t @ y) / max(float(t @ t), 1e-12)
        fits.append((float(place), size, float(np.mean((y - size * t) ** 2))))
    return min(fits, key=lambda fit: fit[2])
