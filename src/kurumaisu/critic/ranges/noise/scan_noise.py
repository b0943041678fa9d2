# SPDX-License-Identifier: BSD-3-Clause
"""How laser readings err at random, estimated on every data set: beams, neighbours, scans, poses.

Readings of one scan share its pose and its common mode, neighbours share light and wall. Counting 100 000 readings as
so many independent ones makes a critic certain of effects that are not there.
"""

from __future__ import annotations

from dataclasses import astuple, dataclass, replace

import numpy as np
from scipy.optimize import minimize, minimize_scalar

from kurumaisu.critic.ranges.noise.shared_errors import FLOOR, Grams, Layout, ScanNoise, Stacked
from kurumaisu.types import FloatArray, IntArray

# Of position [m], heading [rad], common mode [m], its time constant [s], how large errors of positions that last are,
# and of headings, and how long they do [s]: what is usual, the sd of its log, bounds.
_USUAL = np.array([0.005, 0.005, 2e-4, 1.0, 0.25, 0.25, 5.0])
# A common mode may be of each scan alone, at 30 ms, or last for ten seconds.
_SPREAD = np.array([2.0, 2.0, 1.0, 2.0, 1.0, 1.0, 1.0])
_LOW = np.array([1e-5, 1e-5, 1e-6, 0.01, 0.01, 0.01, 1.0])
_HIGH = np.array([0.3, 0.3, 0.1, 10.0, 7.0, 7.0, 60.0])
_WHOLE = 0.99  # of the largest common mode
_NONE = 0.05  # how much of a reference's errors lasts that does not wander, as far as can be seen
_TRIED = (0.25, 0.5, 1.2)  # how much of them, one of which must be likelier
_WEAK = 1e-9  # prior precision of a column's coefficient, in what the readings would tell if nothing else erred
CERTAIN = 5.0  # [nat] from which there is a common mode, or a reference errs by more than is said
_UNLIKELY = 0.01  # times as likely as the likeliest, below which no longer one counts
_LENGTHS = 7  # of a common mode that are tried
_APART = 0.2  # in logs, to see how surely each is known


@dataclass(frozen=True)
class CommonMode:
    """What says that whole scans are off together: log evidence [nat], and sds of the logs of its sd and its tau.

    wary: the noise with a longer one that is nearly as likely, about an sd from the likeliest, if that is known.
    """

    nats: float
    log_sd: float
    log_tau: float
    wary: ScanNoise | None = None

    def ends(self, noise: ScanNoise, sds: float) -> tuple[FloatArray, FloatArray]:
        """Return sd [m] and tau [s] at so many sds below and above those of a noise."""
        logs = np.array([-sds, sds])
        sizes, taus = noise.common_sd * np.exp(logs * self.log_sd), noise.common_tau * np.exp(logs * self.log_tau)
        if self.wary is not None:
            sizes[1] = max(sizes[1], noise.common_sd * (self.wary.common_sd / noise.common_sd) ** sds)
            taus[1] = max(taus[1], noise.common_tau * (self.wary.common_tau / noise.common_tau) ** sds)
        return sizes, taus


class NoiseLikelihood:
    """The negative log restricted likelihood of a noise: what common columns do is none."""

    def __init__(self, grams: Grams, layout: Layout, project: IntArray | None = None) -> None:
        """Take the common columns to project out, None for all; the last one is the residual."""
        chosen = grams if project is None else grams.only(project)
        self._stacked = Stacked(chosen, layout)
        # Of columns that others draw as well, as a curve over the time does one over the heading of stands, nothing is
        # learnt, whatever the noise: what is known of them beforehand must not follow it. Else each of them speaks for
        # more noise.
        self._norms = np.sqrt(np.maximum(np.diag(chosen.common)[:-1], 1e-300))

    def __call__(self, noise: ScanNoise) -> float:
        """Return it [nat], but for a constant."""
        s, log_det = self._stacked.marginal(noise)
        yy = float(s[-1, -1])
        x = s[:-1, :-1] / np.outer(self._norms, self._norms) + _WEAK * np.eye(len(s) - 1)
        b = s[:-1, -1] / self._norms
        fitted = float(b @ np.linalg.solve(x, b)) if len(b) else 0.0
        return 0.5 * (log_det + yy - fitted + float(np.linalg.slogdet(x)[1]))


def estimate(likelihood: NoiseLikelihood, truth: tuple[float, float] | None) -> ScanNoise:
    """Return the scans' noise by restricted maximum likelihood.

    truth: sds of the reference [m, rad] as somebody says, if anybody does.
    """
    usual, known = np.log(_USUAL), 0
    if truth is not None:
        usual[:2], known = np.log(np.maximum(truth, 1e-5)), 2
    none = np.where(np.isin(np.arange(7), (4, 5)), np.log(_NONE), usual)
    found = _likeliest(likelihood, none, np.arange(known, 4), stated=truth is not None)
    here = likelihood(found)
    wandering = [_wandering(found, size, stated=truth is not None) for size in _TRIED]
    begun = min(wandering, key=likelihood)
    if likelihood(begun) > here:
        return found
    free = np.arange(7) if truth is None else np.array([2, 3, 4, 6])
    return _likeliest(likelihood, usual, free, np.log(astuple(begun))[free], stated=truth is not None)


def beyond_stated(likelihood: NoiseLikelihood, truth: tuple[float, float], noise: ScanNoise) -> float:
    """Return what says [nat] that a reference errs by more, or longer, than is said, by all its scans.

    truth: sds [m, rad] as stated; noise: the likeliest that it may have as stated.
    """
    usual = np.log(_USUAL)
    usual[:2] = np.log(np.maximum(truth, 1e-5))
    begun = [_wandering(noise, size, stated=False) for size in (max(noise.lasting, _NONE), *_TRIED)]
    at = np.log(astuple(min(begun, key=likelihood)))
    free = _likeliest(likelihood, usual, np.arange(7), at)
    far = (np.log(astuple(free)) - usual) / _SPREAD
    return likelihood(noise) - likelihood(free) - 0.5 * float(far @ far)


def with_lasting_common_mode(likelihood: NoiseLikelihood, noise: ScanNoise) -> ScanNoise:
    """Return a noise whose common mode, where there is one for sure, is the mean of those that last longer, too.

    The scans of a stand tell how far it wanders while they last. How far it comes until the next stand is told by no
    more than that: the longer it lasts, the farther. Effects of the time or of the place must be surer than that.
    """
    least = likelihood(noise)
    if likelihood(replace(noise, common_sd=FLOOR)) - least < CERTAIN:
        return noise
    found = [(1.0, noise.common_sd**2, noise.common_tau)]
    for tau in np.geomspace(noise.common_tau, _HIGH[3], _LENGTHS)[1:].tolist():
        reach = np.log(noise.common_sd) + np.array([0.0, 0.5 * np.log(tau / noise.common_tau) + _APART])

        def cost(log_sd: float, tau: float = tau) -> float:
            return likelihood(replace(noise, common_sd=float(np.exp(log_sd)), common_tau=tau))

        best = minimize_scalar(cost, bounds=reach, method="bounded", options={"maxiter": 8})
        found.append((float(np.exp(min(least - best.fun, 0.0))), float(np.exp(2 * best.x)), tau))
        if found[-1][0] < _UNLIKELY:
            break
    weights, squares, taus = np.array(found).T
    mean = weights / weights.sum()
    return replace(noise, common_sd=float(np.sqrt(mean @ squares)), common_tau=float(mean @ taus))


def common_mode(
    likelihood: NoiseLikelihood, truth: tuple[float, float] | None, noise: ScanNoise, own_sd: float = 0.0
) -> CommonMode:
    """Return what says that scans have a common mode, by all of them; noise: the likeliest one, truth as of estimate.

    own_sd [m]: of what the model already has, which then needs another one; of how long that lasts the model knows
    only from scan to scan. By Laplace's approximation of the integral over its sd and its time constant. One as large
    as any may be stands for something else that is wrong.
    """
    if noise.common_sd > _WHOLE * _HIGH[2]:
        return CommonMode(-np.inf, 1.0, 1.0)

    def cost(x: FloatArray) -> float:
        sd, tau = (np.array([noise.common_sd, noise.common_tau]) * np.exp(x)).tolist()
        far = (np.log([sd, tau]) - np.log(_USUAL[2:4])) / _SPREAD[2:4]
        return likelihood(replace(noise, common_sd=sd, common_tau=tau)) + 0.5 * float(far @ far)

    one, other = _APART * np.eye(2)
    here = cost(np.zeros(2))
    bent = [cost(x) + cost(-x) - 2 * here for x in (one, other)]
    mixed = 0.25 * (cost(one + other) + cost(-one - other) - cost(one - other) - cost(other - one))
    values, vectors = np.linalg.eigh(np.array([[bent[0], mixed], [mixed, bent[1]]]) / _APART**2)
    values = np.maximum(values, 1 / np.max(_SPREAD[2:4]) ** 2)  # no less is known than before the data
    sds = np.sqrt(np.diag(vectors @ np.diag(1 / values) @ vectors.T))
    none = replace(noise, common_sd=max(own_sd, FLOOR))
    # Errors of the reference may stand in for it, where nobody knows them, and the model's own may last.
    free = [*(range(2) if truth is None else ()), *([3] if own_sd else ())]
    if free:
        none = _likeliest(likelihood, np.log(np.clip(astuple(none), _LOW, _HIGH)), np.array(free))
    return CommonMode(likelihood(none) - here - 0.5 * float(np.log(values).sum()), float(sds[0]), float(sds[1]))


def _wandering(noise: ScanNoise, lasting: float, *, stated: bool) -> ScanNoise:
    """Return a noise of which so much lasts; stated: of what is said of the reference, which is all of its errors."""
    position, heading = 1.0, 1.0
    if stated:
        position = float(np.hypot(1.0, noise.lasting) / np.hypot(1.0, lasting))
        heading = float(np.hypot(1.0, noise.lasting_turn) / np.hypot(1.0, lasting))
    return replace(
        noise,
        position_sd=position * noise.position_sd,
        heading_sd=heading * noise.heading_sd,
        lasting=lasting,
        lasting_turn=lasting,
    )


def _likeliest(
    likelihood: NoiseLikelihood,
    usual: FloatArray,
    free: IntArray,
    begin: FloatArray | None = None,
    *,
    stated: bool = False,
) -> ScanNoise:
    """Return the noise with some of its logs fitted, from `begin` or what is usual on, the others as is usual.

    stated: as of _wandering, the usual sds of a pose being all of its errors, positions and headings alike.
    """

    def noise_at(values: FloatArray) -> ScanNoise:
        every = usual.copy()
        every[free] = np.clip(values, np.log(_LOW)[free], np.log(_HIGH)[free])
        found = ScanNoise(*(float(value) for value in np.exp(every)))
        none = replace(found, lasting=0.0, lasting_turn=0.0)
        return _wandering(none, found.lasting, stated=True) if stated else found

    def cost(values: FloatArray) -> float:
        distance = (values - usual[free]) / _SPREAD[free]
        return likelihood(noise_at(values)) + 0.5 * float(distance @ distance)

    at = usual[free] if begin is None else begin
    for step in (1.0, 0.3):  # a second start from the end of the first: it may stop early on a ridge
        simplex = np.vstack([at, at + step * np.eye(len(at))])
        options = {"xatol": 0.05, "fatol": 0.05, "maxfev": 25 * len(at), "initial_simplex": simplex}
        at = minimize(cost, at, method="Nelder-Mead", options=options).x
    return noise_at(at)
