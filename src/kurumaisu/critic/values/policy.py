# SPDX-License-Identifier: BSD-3-Clause
"""What is believed before the data, and from which probability what is said: numbers that decide in several rooms."""

from __future__ import annotations

from functools import cache

import numpy as np
from scipy.special import i0e, logsumexp

from kurumaisu.types import FloatArray

# Amplitude prior of an effect: log-uniform in z, the whitened norm of its signal. Below 3 nobody can see it; with a
# broad Gaussian instead, "none" is over-confident. Beyond 50 little is left, for what is wrong beyond doubt.
Z_LOW, Z_USUAL, Z_HIGH = 3.0, 50.0, 5000.0
_USUAL = 0.9  # share of the prior up to Z_USUAL
# Factor, 1 sd, by which the sizes of one cause may be out of their usual proportion, and what may be in any.
_PROPORTION, _ANY = 2.0, 0.1
_PLACES = np.linspace(-3.0, 3.0, 13)  # [sd] about a fit, at which proportions are weighed
# Odds of one more effect at work, shared by all that the drives could show: half of all chairs have none.
_MORE = 0.7
NAMED = 0.9  # posterior from which a cause is named
RIVAL = 0.05  # posterior from which an effect counts as a rival of another
# The same from which it is a member of a set, which has to hold the truth in 95 cases of 100: of several that each may
# be left out, one acts more often than one of them by itself.
MEMBER = 0.02
FORM_ERROR = 0.15  # share of its signal by which a chair's fault may differ from the catalogue's equation for it
FORM_WAYS = 4  # in which a form may differ, of which one passes for another size, or another effect's


def log_prior(size: int, of: int) -> float:
    """Return the log prior of a set of so many effects out of so many that could show."""
    each = odds(of)
    return float(size * np.log(each) + (of - size) * np.log1p(-each))


def odds(of: int) -> float:
    """Return the prior odds of one effect out of so many that could show."""
    return _MORE / max(of, 1)


def occam(z: FloatArray | float, sides: int = 2) -> FloatArray:
    """Return what an amplitude that shows with |z| standard deviations costs, in nats, elementwise.

    z^2 / 2 less the log of the Bayes factor that the prior gives; sides: 1 where only one sign is possible.
    """
    grid, costs = _table(1)
    return np.asarray(np.interp(np.abs(z), grid, costs) - np.log(2 / sides))


def occam_plane(z: FloatArray) -> FloatArray:
    """Return what two amplitudes that show with |z| together cost, every direction being as likely, elementwise."""
    grid, costs = _table(2)
    return np.asarray(np.interp(np.abs(z), grid, costs))


def in_proportion(sizes: FloatArray, spread: FloatArray, gram: FloatArray) -> float:
    """Return by how much less two amplitudes of one cause cost than occam_plane says, in nats.

    What makes both makes them larger together, so they are likely in their usual proportion, not in every direction
    alike. sizes (2,), spread (2, 2) of the fit, gram (2, 2) of the columns: in units of the usual sizes, with those
    signs that belong together; of the second only one sign is possible. Averaged over where the fit may be.
    """
    values, vectors = np.linalg.eigh(spread)
    x, y = (one.ravel() for one in np.meshgrid(_PLACES, _PLACES))
    n = sizes[:, None] + (vectors * np.sqrt(np.maximum(values, 0.0))) @ np.stack([x, y])
    # The same over the angle in whitened space, of which occam_plane has 1 / (2 pi).
    root = float(np.sqrt(max(np.linalg.det(gram), 1e-18)))
    turned = np.einsum("in,ij,jn->n", n, gram, n) / (root * np.maximum(np.sum(n**2, axis=0), 1e-18))
    weight = np.exp(-0.5 * (x**2 + y**2))
    mean = float(np.sum(weight * _over_angle(n) * turned) / np.sum(weight))
    z = float(np.sqrt(sizes @ gram @ sizes))
    known = float(occam_plane(np.array(z)) - occam(z, sides=1))  # no proportion says more than the direction does
    return min(float(np.log(max(2 * np.pi * mean, 1e-6))), known)


def _over_angle(n: FloatArray) -> FloatArray:
    """Return the density (k,) over the angle of two sizes (2, k) in units of the usual ones."""
    both, width = (n > 0).all(axis=0), float(np.log(_PROPORTION))
    one, other = np.where(both, n, 1.0)
    usual = np.exp(-0.5 * (np.log(other / one) / width) ** 2) / (np.sqrt(2 * np.pi) * width)
    usual = usual * (one**2 + other**2) / (one * other)  # of the log of their ratio
    return np.asarray((1 - _ANY) * np.where(both, usual, 0.0) + _ANY / np.pi * (n[1] > 0))


@cache
def _table(dimensions: int) -> tuple[FloatArray, FloatArray]:
    log_x = np.linspace(np.log(Z_LOW), np.log(Z_HIGH), 8001)
    x = np.exp(log_x)
    usual = np.where(x < Z_USUAL, _USUAL / np.log(Z_USUAL / Z_LOW), (1 - _USUAL) / np.log(Z_HIGH / Z_USUAL))
    log_weight = np.log(log_x[1] - log_x[0]) + np.log(usual)
    grid = np.concatenate([np.linspace(0, 20, 101), np.geomspace(21, 0.99 * Z_HIGH, 60)])
    costs = np.array([-logsumexp(_log_mean_density(z, x, dimensions) + log_weight) for z in grid])
    return grid, costs


def _log_mean_density(z: float, x: FloatArray, dimensions: int) -> FloatArray:
    """Return the log of exp(-|estimate - signal|^2 / 2) averaged over the signal's directions."""
    if dimensions == 1:
        return np.asarray(np.logaddexp(-0.5 * (z - x) ** 2, -0.5 * (z + x) ** 2) - np.log(2))
    return np.asarray(-0.5 * (z - x) ** 2 + np.log(i0e(z * x)))


UNKNOWN_ODDS = 0.1  # that something outside the catalogue acts, before the data; all curves share it
