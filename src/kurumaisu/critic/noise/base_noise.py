# SPDX-License-Identifier: BSD-3-Clause
"""Noise first: how the reference and the motion fluctuate, estimated on every data set.

Taking it from a table, or treating increments as independent, makes a critic name effects that are not there.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from operator import attrgetter, itemgetter

import numpy as np
from scipy.linalg import qr
from scipy.optimize import minimize
from scipy.special import expit

from kurumaisu._core import Whitener
from kurumaisu.critic.base.drive import Drive
from kurumaisu.critic.values.policy import occam
from kurumaisu.types import FloatArray

_STEP = 0.01  # of a difference
_OPTIONS = {"ftol": 3e-6, "maxiter": 60}
# Within so much of the lowest place, and no lower: a line search that comes back to where it began. By what has been
# learnt of the cost there is no way down any more, and twenty more trials, with a gradient each, would end there, too.
_BACK = 1e-5

Cost = Callable[[FloatArray], float]


@dataclass(frozen=True)
class Noise:
    """Of the reference pose and of the rates.

    position_sd [m], heading_sd [rad]: white; sd_v [m/s], sd_lateral [m/s], sd_w [rad/s]: stationary sd of
    Ornstein-Uhlenbeck processes of time constant tau [s]; slow_...: the same of a second, slower one, 0: none;
    growth: by how much they grow with the rates, as a share per Drive.pace; rest: share of a moving chair's noise that
    one at rest has; lasting: how many times as large as the white errors of the reference are such that last for
    lasting_tau [s]; wander [rad]: sd of what the reference's heading may besides be off throughout a drive, at most as
    much as it errs at any time.
    """

    position_sd: float
    heading_sd: float
    sd_v: float
    sd_lateral: float
    sd_w: float
    tau: float
    slow_v: float = 0.0
    slow_lateral: float = 0.0
    slow_w: float = 0.0
    slow_tau: float = 3.0
    growth: float = 0.0
    rest: float = 0.02
    lasting: float = 0.0
    lasting_tau: float = 2.0
    wander: float = 1.0

    @property
    def louder(self) -> float:
        """How many times as large as the white errors of the reference all its errors together are."""
        return float(np.hypot(1.0, self.lasting))

    @property
    def slowest(self) -> float:
        """Return for how long noise of the rates lasts [s]."""
        return max(self.tau, self.slow_tau) if self.slow_v else self.tau

    @property
    def quick(self) -> Noise:
        """Return the noise without what lasts: within _BRIEF it is as loud."""
        first, second = (min(1.0, float(np.sqrt(_BRIEF / tau))) for tau in (self.tau, self.slow_tau))
        sizes = {name: (second if name in _SECOND else first) * getattr(self, name) for name in _GROWING}
        slow_tau = min(self.slow_tau, _BRIEF) if self.slow_v else self.slow_tau
        return replace(self, **sizes, tau=min(self.tau, _BRIEF), slow_tau=slow_tau, lasting=0.0)


# Where the search for the noise starts, and how far from there a value remains plausible (natural log, 1 sd).
START = Noise(position_sd=0.01, heading_sd=0.005, sd_v=0.02, sd_lateral=0.005, sd_w=0.03, tau=0.3)
_SLOW = replace(START, slow_v=0.005, slow_lateral=0.001, slow_w=0.01, growth=0.3, lasting=1.0)
_LASTING = ("lasting", "lasting_tau")
_SPREAD = dict.fromkeys(vars(START), 2.0) | dict.fromkeys(("tau", "growth", "rest", *_LASTING), 1.0) | {"slow_tau": 0.7}
_FLOOR = {
    **dict.fromkeys(vars(START), 1e-5),
    **{"tau": 0.02, "slow_tau": 0.5, "growth": 1e-4, "rest": START.rest, "lasting": 0.05, "lasting_tau": 0.1},
}
_CEILING = {
    **dict.fromkeys(vars(START), 3.0),
    **dict.fromkeys(("tau", "slow_tau", "lasting_tau"), 20.0),
    **{"sd_w": 10.0, "growth": 30.0, "rest": 1.0, "lasting": 10.0},
}
ONE_COLOUR = ("position_sd", "heading_sd", "sd_v", "sd_lateral", "sd_w", "tau")
_SECOND = ("slow_v", "slow_lateral", "slow_w", "slow_tau")
_GROWN = (0.3, 1.0, 3.0)  # from which growth is searched for: from a single one the search sticks half way
# One of these explains more where the noise grows, which costs a hundredth of the searches.
_HINTED_GROWTH = (0.1, 0.3, 1.0)
_HINTED = 0.5  # [nat] more, at least
_GROWING = ("sd_v", "sd_lateral", "sd_w", "slow_v", "slow_lateral", "slow_w")
_RESTLESS = (0.1, 0.3, 1.0)  # shares of its noise that a chair at rest may have, which are tried
_HINTS = (0.1, 0.5, 1.0, 3.0)  # of a second colour's usual size
_HINTED_LASTING = (0.5, 1.0)  # of what lasts, which are tried with each time constant [s]
_HINTED_TAU = (0.5, 2.0, 8.0)
# [nat] from which a second colour is believed: it has four parameters; noise at rest and errors that last, too
_WORTH = 4.0
_BRIEF = 1.0  # [s] for which quick noise lasts at most
_PARTS = 6  # of a drive, between which a heading that wanders differs
_SLOWEST = 40.0  # [s] time constant of a heading that wanders: a slower one hardly differs
_ALIKE = 0.08  # share by which a parameter may differ and be the same; about what a few minutes tell
_NOTHING = 3e-4
_SAME = 0.03  # share of a column beyond those before it that makes it one of its own


def whitener(drive: Drive, noise: Noise) -> Whitener:
    """Return what whitens any columns of a drive as whitened does."""
    grown = 1 + noise.growth * drive.pace
    return Whitener(
        drive.poses,
        drive.times,
        np.maximum(drive.activity, noise.rest) * grown,
        drive.rolling * grown,
        drive.pose_paths,
        position_sd=noise.position_sd * noise.louder,
        heading_sd=noise.heading_sd * noise.louder,
        process_sd=[[noise.sd_v, noise.sd_lateral, noise.sd_w], [noise.slow_v, noise.slow_lateral, noise.slow_w]],
        process_tau=[noise.tau, noise.slow_tau],
        lasting=(noise.lasting / noise.louder) ** 2,
        lasting_tau=noise.lasting_tau,
    )


def whitened(drive: Drive, columns: FloatArray, noise: Noise) -> tuple[FloatArray, FloatArray]:
    """Return L^-1 X for columns X (3 m, k), L L' their covariance, and its log determinant in parts (m, 3)."""
    made = whitener(drive, noise)
    return made.whiten(columns), made.log_determinants


def alike(one: Noise, other: Noise) -> bool:
    """Tell whether two noises differ by no more than a recording can tell: nothing is weighed anew for that."""
    pairs = [(getattr(one, name), getattr(other, name)) for name in vars(one)]
    return all(abs(a - b) <= max(_ALIKE * max(abs(a), abs(b)), _NOTHING) for a, b in pairs)


@dataclass(frozen=True)
class NoiseEstimate:
    """The noise found, and minus its restricted log posterior up to a constant."""

    noise: Noise
    cost: float


@dataclass(frozen=True)
class NoiseGrowth:
    """Does the noise grow with the rates? p: that it does; gain_nats: log evidence; noise: that which grows."""

    p: float
    gain_nats: float
    noise: Noise


class NoiseResiduals:
    """What the noise is estimated from: residuals about a model, with what might be the model's fault left out."""

    def __init__(
        self,
        drives: Sequence[Drive],
        residuals: Sequence[FloatArray],
        columns: Sequence[FloatArray],
        truth: tuple[float, float] | None,
    ) -> None:
        """Take residuals (m, 3) and columns (3 m, k) per drive: measured minus simulated, and effects to project out.

        truth: known sd of the reference's position and heading, else they are estimated too.
        """
        self._drives = drives
        kept = _independent(np.concatenate(columns))
        self._stacked = [np.column_stack([r.ravel(), c[:, kept]]) for r, c in zip(residuals, columns, strict=True)]
        self._truth = truth

    def estimate(self, start: Noise = START) -> NoiseEstimate:
        """Return the noise of one colour, or of two where they explain more; of a chair at rest as much as it has.

        The reference's errors are white, or last where that explains more. What its heading may besides be off is what
        it does within drives.
        """
        found = self._coloured(start)
        return replace(found, noise=replace(found.noise, wander=self._wander(found.noise)))

    def _coloured(self, start: Noise) -> NoiseEstimate:
        plain = replace(start, slow_v=0.0, slow_lateral=0.0, slow_w=0.0, lasting=0.0)
        one = self._restless(self._lasting(self._best(plain, _searched(plain))))
        second = start if start.slow_v else _SLOW
        slow = {name: getattr(second, name) for name in _SECOND}
        if not self._hints_at(one.noise, slow):
            return one
        two = self._best(replace(one.noise, **slow), (*_searched(one.noise), *_SECOND))
        if two.cost >= one.cost - _WORTH:
            return one
        return two if two.noise.lasting else self._lasting(two)

    def _lasting(self, white: NoiseEstimate) -> NoiseEstimate:
        """Return the noise of a reference whose errors last for longer than one pose, if that explains more."""
        tried = (
            self._as_known(replace(white.noise, lasting=size, lasting_tau=tau))
            for size in _HINTED_LASTING
            for tau in _HINTED_TAU
        )
        cost, start = min(((self._cost(noise), noise) for noise in tried), key=itemgetter(0))
        if cost > self._cost(white.noise):
            return white
        found = self._best(start, (*_searched(start), *(_SECOND if start.slow_v else ())))
        return found if found.cost < white.cost - _WORTH else white

    def _wander(self, noise: Noise) -> float:
        """Return what the heading may be off throughout a drive [rad], by how it differs between parts of each."""
        most = noise.heading_sd * noise.louder
        if most <= 0:
            return most
        count, drives = self._stacked[0].shape[1], len(self._drives)
        gram = np.zeros(2 * (count + _PARTS * drives,))
        for i, (drive, columns) in enumerate(zip(self._drives, self._stacked, strict=True)):
            here = np.r_[:count, count + _PARTS * i : count + _PARTS * (i + 1)]
            rows = len(drive.measured)
            part = np.eye(_PARTS)[np.arange(rows) * _PARTS // max(rows, 1)]  # in which each row lies
            parts = most * turned(drive) * np.repeat(part, 3, axis=0)
            gram[np.ix_(here, here)] += whitener(drive, noise).gram(np.column_stack([columns, parts]))
        free = np.zeros((len(gram), count - 1 + drives))  # effects, and each drive as a whole
        free[1:count, : count - 1] = np.eye(count - 1)
        free[count:, count - 1 :] = np.kron(np.eye(drives), np.ones((_PARTS, 1)))
        gram -= gram @ free @ np.linalg.solve(free.T @ gram @ free + 1e-6 * np.eye(free.shape[1]), free.T @ gram)
        sizes, ways = np.linalg.eigh(gram[count:, count:])
        pulls, sizes = np.square(ways.T @ gram[count:, 0]), np.maximum(sizes, 0.0)
        within = np.geomspace(1e-6, 1.0, 121)[:, np.newaxis]  # variances, of `most`
        likelihood = 0.5 * np.sum(pulls * within / (1 + within * sizes) - np.log1p(within * sizes), axis=1)
        likely = within[likelihood > likelihood.max() - 0.5].max()
        length = float(np.median([drive.times[-1] - drive.times[0] for drive in self._drives]))
        # How much more what wanders varies between drives than within them, as a variance.
        share = max(length, 1e-3) / _SLOWEST
        mean = 2 / share * (1 - (1 - np.exp(-share)) / share)
        return most * min(float(np.sqrt(likely * float(mean / (1 - mean)))), 1.0)

    def _as_known(self, noise: Noise) -> Noise:
        """Return noise with all errors of the reference as large as they are known to be, if they are."""
        if self._truth is None:
            return noise
        position_sd, heading_sd = np.maximum(self._truth, _FLOOR["position_sd"]) / noise.louder
        return replace(noise, position_sd=float(position_sd), heading_sd=float(heading_sd))

    def _restless(self, still: NoiseEstimate) -> NoiseEstimate:
        """Return the noise of a chair that fluctuates at rest, too, if that explains more."""
        if still.noise.rest > START.rest:
            return still
        tried = (
            replace(still.noise, rest=rest, sd_v=k * still.noise.sd_v, sd_w=k * still.noise.sd_w)
            for rest in _RESTLESS
            for k in (1.0, 0.7)
        )
        cost, start = min(((self._cost(noise), noise) for noise in tried), key=itemgetter(0))
        return self._best(start, _searched(start)) if cost <= self._cost(still.noise) - _WORTH else still

    def _hints_at(self, one: Noise, slow: dict[str, float]) -> bool:
        """Tell whether some of a second colour explains more than none: a tenth of the price of a search."""
        sizes = [name for name in _SECOND if name != "slow_tau"]
        tried = (
            replace(
                one, **{**slow, **{name: share * slow[name] for name in sizes}}, sd_v=k * one.sd_v, sd_w=k * one.sd_w
            )
            for share in _HINTS
            for k in (1.0, 0.85)
        )
        alone = self._cost(one)
        return any(self._cost(noise) < alone for noise in tried)

    def growth(self, about: NoiseEstimate, prior_odds: float) -> NoiseGrowth:
        """Return how likely it is that the noise grows with the rates, about the estimate of noise that does not."""
        growing = min(
            (self._best(start, names) for start, names in self._growing(about.noise)),
            key=attrgetter("cost"),
            default=about,
        )
        better = max(about.cost - growing.cost, 0.0)
        nats = better - float(occam(np.sqrt(2 * better), sides=1))
        return NoiseGrowth(float(expit(nats + np.log(prior_odds))), nats, growing.noise)

    def _growing(self, about: Noise) -> Iterator[tuple[Noise, tuple[str, ...]]]:
        """Yield what to begin with, and what is searched for; nothing where some growth explains no more than none."""
        alone = self._cost(about)
        if min(self._cost(_growing_noise(about, size)) for size in _HINTED_GROWTH) < alone - _HINTED:
            names = (*_searched(about), *(_SECOND if about.slow_v else ()), "growth")
            yield from ((_growing_noise(about, size), names) for size in _GROWN)

    def _best(self, start: Noise, names: Sequence[str]) -> NoiseEstimate:
        if self._truth is not None:
            names = [name for name in names if name not in ("position_sd", "heading_sd")]
        centre = np.log([getattr(_SLOW, name) for name in names])
        spread = np.array([_SPREAD[name] for name in names])
        bounds = np.log([[_FLOOR[name], _CEILING[name]] for name in names])

        def noise_at(log_values: FloatArray) -> Noise:
            return self._as_known(replace(start, **dict(zip(names, np.exp(log_values).tolist(), strict=True))))

        def cost(log_values: FloatArray) -> float:
            distance = (log_values - centre) / spread
            return self._cost(noise_at(log_values)) + 0.5 * float(distance @ distance)

        begin = np.clip(np.log([getattr(start, name) for name in names]), *bounds.T)
        where, least = minimise(cost, begin, bounds)
        return NoiseEstimate(noise_at(where), least)

    def _cost(self, noise: Noise) -> float:
        """Return minus the restricted log likelihood, up to a constant."""
        log_determinant, gram = 0.0, np.zeros(2 * self._stacked[0].shape[1:])
        for drive, columns in zip(self._drives, self._stacked, strict=True):
            made = whitener(drive, noise)
            log_determinant += float(made.log_determinants.sum())
            gram += made.gram(columns)
        square, b, inner = gram[0, 0], gram[1:, 0], gram[1:, 1:] + 1e-6 * np.eye(len(gram) - 1)
        rest = square - b @ np.linalg.solve(inner, b)
        return 0.5 * float(log_determinant + rest + np.linalg.slogdet(inner)[1])


def turned(drive: Drive) -> FloatArray:
    """Return what a turn of all headings by 1 rad changes of the measured increments, (3 m, 1)."""
    dx, dy, _ = drive.measured.T
    return np.asarray(np.stack([dy, -dx, np.zeros_like(dx)], axis=1).reshape(-1, 1))


def _searched(noise: Noise) -> tuple[str, ...]:
    """Return what is searched for in noise of one colour."""
    rest = ("rest",) if noise.rest > START.rest else ()
    return (*ONE_COLOUR, *rest, *(_LASTING if noise.lasting else ()))


def _growing_noise(noise: Noise, growth: float) -> Noise:
    """Return noise that grows, and is about as large as before at usual rates."""
    return replace(noise, growth=growth, **{name: getattr(noise, name) / (1 + growth) for name in _GROWING})


def _independent(columns: FloatArray) -> FloatArray:
    """Return which columns (rows, k) are not nearly made of others; so few that most rows are left for the noise."""
    norms = np.linalg.norm(columns, axis=0)
    loud = np.flatnonzero(norms > 0)
    if not len(loud):
        return np.array([], dtype=int)
    _, triangle, order = qr(columns[:, loud] / norms[loud], mode="economic", pivoting=True)
    sizes = np.abs(np.diag(triangle))
    return np.asarray(np.sort(loud[order[: len(sizes)][sizes > _SAME][: len(columns) // 3]]))


class _StuckError(Exception):
    pass


def minimise(cost: Cost, begin: FloatArray, bounds: FloatArray) -> tuple[FloatArray, float]:
    """Return the place (k,) of a local minimum within bounds (k, 2), searched for from another, and its cost.

    Where it is stuck it forgets what it has learnt, and begins anew from there, until that is of no use.
    """
    where, least = begin, np.inf
    while True:
        before, (where, least, stuck) = least, _attempt(cost, where, bounds)
        if not stuck or before - least <= _OPTIONS["ftol"] * max(abs(least), 1.0):
            return where, least


def _attempt(cost: Cost, begin: FloatArray, bounds: FloatArray) -> tuple[FloatArray, float, bool]:
    """Return the lowest place that was seen, its cost, and whether the search got stuck there."""
    best, least = begin, np.inf

    def with_gradient(at: FloatArray) -> tuple[float, FloatArray]:
        nonlocal best, least
        here = cost(at)
        if here >= least and np.abs(at - best).max() < _BACK:
            raise _StuckError
        if here < least:
            best, least = at.copy(), here
        return here, _gradient(cost, at, here, bounds)

    try:
        found = minimize(with_gradient, begin, jac=True, method="L-BFGS-B", bounds=bounds, options=_OPTIONS)
    except _StuckError:
        return best, least, True
    return found.x, float(found.fun), False


def _gradient(cost: Cost, at: FloatArray, here: float, bounds: FloatArray) -> FloatArray:
    """Return the differences to neighbours, above where there is room."""
    out = np.empty(len(at))
    for i, upper in enumerate(bounds[:, 1]):
        moved = at.copy()
        moved[i] += _STEP if at[i] + _STEP <= upper else -_STEP
        out[i] = (cost(moved) - here) / (moved[i] - at[i])
    return out
