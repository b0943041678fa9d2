# SPDX-License-Identifier: BSD-3-Clause
"""How laser readings err at random, estimated on every data set: beams, neighbours, scans, poses.

Readings of one scan share its pose and its common mode, neighbours share light and wall. Counting 170 000 readings as
so many independent ones makes a critic certain of effects that are not there.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import astuple, dataclass, replace
from functools import cached_property

import numpy as np
from scipy.linalg import cho_solve_banded, cholesky_banded
from scipy.optimize import minimize, minimize_scalar
from scipy.sparse import coo_array

from kurumaisu.types import BoolArray, FloatArray, IntArray

_FLOOR = 1e-6  # [m, rad] below which no sd counts
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
class ScanNoise:
    """Errors that the readings of a scan share.

    position_sd [m], heading_sd [rad]: of each reference pose alone; common_sd [m]: of the offset of a scan, whose
    correlation with the next one falls off with a time constant common_tau [s]; lasting: how many times as large as
    the positions' own errors are those whose correlation falls off with lasting_tau [s], as of a reference that
    wanders; lasting_turn: the same of the headings.
    """

    position_sd: float
    heading_sd: float
    common_sd: float
    common_tau: float
    lasting: float = 0.0
    lasting_turn: float = 0.0
    lasting_tau: float = 5.0


@dataclass(frozen=True)
class Layout:
    """How scans hang together: times (k,) [s]; run (k,); stand (k,): scans of one and the same pose row, or -1."""

    times: FloatArray
    run: IntArray
    stand: IntArray

    @cached_property
    def nodes(self) -> tuple[IntArray, IntArray, int]:
        """Return which of the errors that scans share are each scan's (k,): its common mode, its pose; and their count.

        Of a pose the first of three, x, y, yaw: of a stand all its scans' own, else what lasts of the errors until this
        scan. In the order of the scans, so that only near ones have to do with each other.
        """
        common, pose, count = np.empty(len(self.times), dtype=np.int64), np.empty(len(self.times), dtype=np.int64), 0
        known: dict[int, int] = {}
        for k, stand in enumerate(self.stand.tolist()):
            pose[k] = known.get(stand, count) if stand >= 0 else count
            if pose[k] == count:
                known[stand] = count
                count += 3
            common[k], count = count, count + 1
        return common, pose, count

    @cached_property
    def moving(self) -> IntArray:
        """Return the scans that were not taken in a stand."""
        return np.flatnonzero(self.stand < 0)

    @cached_property
    def reach(self) -> int:
        """How far apart two errors are at most, in their order, that have to do with each other."""
        common, pose, _ = self.nodes
        steps = [np.diff(common), np.abs(common - pose) + 2, np.diff(pose[self.moving]), np.array([3])]
        return int(max(step.max(initial=0) for step in steps))


@dataclass(frozen=True)
class Gram:
    """Normal equations of one scan, whitened within the scan.

    own: number of leading columns, for the errors of its own reference poses, x, y, yaw in turn; shared: of those that
    follow, one for its common mode and three for the error of its stand's pose or, where asked for, for what lasts of
    its poses' errors; the rest are common to all scans.
    """

    matrix: FloatArray
    own: int
    shared: int


def whitened(columns: FloatArray, valid: BoolArray, sd: FloatArray, rho: float) -> FloatArray:
    """Return L^-1 X, (valid readings of the scan, m), for columns X (b, m), deviations sd (b,) [m] and neighbours' rho.

    Neighbours with gaps between them correlate by rho to the power of their distance.
    """
    at = np.flatnonzero(valid)
    z = columns[at] / sd[at, np.newaxis]
    shared = rho ** np.diff(at)[:, np.newaxis]
    out = z.copy()
    out[1:] = (z[1:] - shared * z[:-1]) / np.sqrt(1 - shared**2)
    return np.asarray(out)


def marginal(grams: Sequence[Gram], layout: Layout, noise: ScanNoise) -> tuple[FloatArray, float]:
    """Return the normal equations of the columns common to all, scans' errors integrated out, and a log determinant.

    The latter is that of the covariance, relative to independent readings.
    """
    return _Stacked(grams, layout).marginal(noise)


class _Stacked:
    """Grams in a few large arrays, for noises to be tried on."""

    def __init__(self, grams: Sequence[Gram], layout: Layout) -> None:
        self._layout = layout
        self._common = len(grams[0].matrix) - grams[0].own - grams[0].shared
        groups: dict[tuple[int, int], list[int]] = {}
        for k, gram in enumerate(grams):
            groups.setdefault((gram.own, gram.shared), []).append(k)
        self._parts = [
            _Part(np.array([grams[k].matrix for k in rows]), own, shared, self._index(np.array(rows), shared))
            for (own, shared), rows in groups.items()
        ]

    def _index(self, rows: IntArray, shared: int) -> IntArray:
        """Return of which of the errors that scans share (n, shared) these scans have theirs."""
        common, pose, _ = self._layout.nodes
        return np.column_stack([common[rows], pose[rows, np.newaxis] + np.arange(shared - 1)])

    def marginal(self, noise: ScanNoise) -> tuple[FloatArray, float]:
        """Return what marginal does."""
        band, prior_log_det = precision(self._layout, noise)
        cross, total, log_det = np.zeros((band.shape[1], self._common)), np.zeros((self._common, self._common)), 0.0
        for part in self._parts:
            within, beside, rest, more = part.without_own(own_pose_sds(noise))
            log_det += more
            total += rest
            band += banded(part.index, within, band.shape)
            cross += gathered(part.index, beside, band.shape[1])
        factor = cholesky_banded(band, lower=True)
        log_det += 2 * float(np.log(factor[0]).sum()) - prior_log_det
        return total - cross.T @ cho_solve_banded((factor, True), cross), log_det


def banded(index: IntArray, parts: FloatArray, shape: tuple[int, ...]) -> FloatArray:
    """Return symmetric parts (n, s, s), whose rows and columns are index (n, s), added up, as a lower band."""
    below = index[:, :, np.newaxis] - index[:, np.newaxis]
    use = below >= 0
    flat = (below * shape[1] + index[:, np.newaxis])[use]
    return np.asarray(np.bincount(flat, parts[use], shape[0] * shape[1]).reshape(shape), dtype=np.float64)


def gathered(index: IntArray, parts: FloatArray, count: int) -> FloatArray:
    """Return parts (n, s, c), whose rows are index (n, s), added up (count, c)."""
    places = coo_array((np.ones(index.size), (index.ravel(), np.arange(index.size))), (count, index.size))
    return np.asarray(places @ parts.reshape(index.size, -1))


class _Part:
    """Grams (n, m, m) of the same parts; index (n, shared): of which errors that scans share each has its own."""

    def __init__(self, matrices: FloatArray, own: int, shared: int, index: IntArray) -> None:
        lead = own + shared
        self.index = index
        self._own, self._outer = matrices[:, :own, :own], np.ascontiguousarray(matrices[:, :own, own:])
        self._within, self._beside = matrices[:, own:lead, own:lead], matrices[:, own:lead, lead:]
        self._rest = matrices[:, lead:, lead:].sum(axis=0)

    def without_own(self, size: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, float]:
        """Return parts of the grams when errors of sds size (3,) of their own poses are integrated out.

        (n, shared, shared) within what is shared, (n, shared, c) beside the common columns, (c, c) of these, and a log
        determinant.
        """
        own, shared = self._own.shape[1], self.index.shape[1]
        if own == 0:
            return self._within, self._beside, self._rest, 0.0
        scale = np.tile(size, own // 3)
        inner = self._own * np.outer(scale, scale) + np.eye(own)
        lower = np.linalg.cholesky(inner)
        root = (_inverse(lower) * scale) @ self._outer
        log_det = 2 * float(np.log(np.diagonal(lower, axis1=1, axis2=2)).sum())
        lead, common = root[:, :, :shared].transpose(0, 2, 1), root[:, :, shared:]
        flat = common.reshape(-1, common.shape[2])
        return (
            self._within - lead @ root[:, :, :shared],
            self._beside - lead @ common,
            self._rest - flat.T @ flat,
            log_det,
        )


def _inverse(lower: FloatArray) -> FloatArray:
    """Return the inverses of many small lower triangles (n, q, q), a row of all at a time."""
    out = np.zeros_like(lower)
    for i in range(lower.shape[1]):
        out[:, i, i] = 1 / lower[:, i, i]
        out[:, i, :i] = -np.einsum("nj,njk->nk", lower[:, i, :i], out[:, :i, :i]) * out[:, i, i, np.newaxis]
    return out


def pose_sds(noise: ScanNoise) -> FloatArray:
    """Return the sds (3,) of a reference pose."""
    return np.hypot(own_pose_sds(noise), lasting_sds(noise))


def lasting_sds(noise: ScanNoise) -> FloatArray:
    """Return the sds (3,) of what of a reference pose's error lasts."""
    return np.array([noise.lasting, noise.lasting, noise.lasting_turn]) * own_pose_sds(noise)


def own_pose_sds(noise: ScanNoise) -> FloatArray:
    """Return the sds (3,) of what of a reference pose's error is its own."""
    return np.maximum([noise.position_sd, noise.position_sd, noise.heading_sd], _FLOOR)


def precision(layout: Layout, noise: ScanNoise) -> tuple[FloatArray, float]:
    """Return the precision of the errors that scans share, as a lower band (reach + 1, n), and its log determinant.

    Common modes and what lasts of the poses' errors follow the last ones of a run; stands have errors of their own.
    """
    common, pose, count = layout.nodes
    band = np.zeros((layout.reach + 1, count))
    every = np.arange(len(common))
    log_det = _chain(band, layout, every, common, max(noise.common_sd, _FLOOR), noise.common_tau)
    lasting = np.maximum(lasting_sds(noise), _FLOOR)
    stands = np.unique(pose[layout.stand >= 0])
    for axis, (slow, whole) in enumerate(zip(lasting.tolist(), pose_sds(noise).tolist(), strict=True)):
        log_det += _chain(band, layout, layout.moving, pose[layout.moving] + axis, slow, noise.lasting_tau)
        band[0, stands + axis] += whole**-2
        log_det -= 2 * len(stands) * float(np.log(whole))
    return band, log_det


def _chain(band: FloatArray, layout: Layout, rows: IntArray, at: IntArray, sd: float, tau: float) -> float:
    """Add the precision of errors of an sd that fall off with tau [s] within a run, and return its log determinant.

    rows: of scans; at: where each has its error.
    """
    times, run = layout.times[rows], layout.run[rows]
    rho = np.where(np.diff(run) == 0, np.exp(-np.abs(np.diff(times)) / tau), 0.0)
    innovation = sd**2 * np.maximum(np.concatenate([np.ones(min(len(rows), 1)), 1 - rho**2]), 1e-9)  # variances
    band[0, at] += 1 / innovation
    band[0, at[:-1]] += rho**2 / innovation[1:]
    band[np.diff(at), at[:-1]] -= rho / innovation[1:]
    return -float(np.log(innovation).sum())


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


class _Likelihood:
    """The negative log restricted likelihood of a noise, and how far it is from what is usual."""

    def __init__(self, grams: Sequence[Gram], layout: Layout, project: IntArray) -> None:
        """Take common columns to project out; the last common column is the residual."""
        chosen = [_only(gram, project) for gram in grams]
        self._stacked = _Stacked(chosen, layout)
        # Of columns that others draw as well, as a curve over the time does one over the heading of stands, nothing is
        # learnt, whatever the noise: what is known of them beforehand must not follow it. Else each of them speaks for
        # more noise.
        each = sum(np.diag(gram.matrix)[gram.own + gram.shared : -1] for gram in chosen)
        self._norms = np.sqrt(np.maximum(each, 1e-300))

    def __call__(self, noise: ScanNoise) -> float:
        s, log_det = self._stacked.marginal(noise)
        yy = float(s[-1, -1])
        x = s[:-1, :-1] / np.outer(self._norms, self._norms) + _WEAK * np.eye(len(s) - 1)
        b = s[:-1, -1] / self._norms
        fitted = float(b @ np.linalg.solve(x, b)) if len(b) else 0.0
        return 0.5 * (log_det + yy - fitted + float(np.linalg.slogdet(x)[1]))


def estimate(grams: Sequence[Gram], layout: Layout, truth: tuple[float, float] | None, project: IntArray) -> ScanNoise:
    """Return the scans' noise by restricted maximum likelihood; project: common columns to project out.

    The last common column is the residual. truth: sds of the reference as somebody says, if anybody does.
    """
    likelihood, usual, known = _Likelihood(grams, layout, project), np.log(_USUAL), 0
    if truth is not None:
        usual[:2], known = np.log(np.maximum(truth, 1e-5)), 2
    none = np.where(np.isin(np.arange(7), (4, 5)), np.log(_NONE), usual)
    found = _likeliest(likelihood, none, np.arange(known, 4), stated=truth is not None)
    here = likelihood(found)
    wandering = [_wandering(found, size, size, stated=truth is not None) for size in _TRIED]
    begun = min(wandering, key=likelihood)
    if likelihood(begun) > here:
        return found
    free = np.arange(7) if truth is None else np.array([2, 3, 4, 6])
    return _likeliest(likelihood, usual, free, np.log(astuple(begun))[free], stated=truth is not None)


def beyond_stated(
    grams: Sequence[Gram], layout: Layout, truth: tuple[float, float], project: IntArray, noise: ScanNoise
) -> float:
    """Return what says [nat] that a reference errs by more, or longer, than is said, by all its scans; as of estimate.

    noise: the likeliest that it may have as stated.
    """
    likelihood, usual = _Likelihood(grams, layout, project), np.log(_USUAL)
    usual[:2] = np.log(np.maximum(truth, 1e-5))
    begun = [_wandering(noise, size, size, stated=False) for size in (max(noise.lasting, _NONE), *_TRIED)]
    at = np.log(astuple(min(begun, key=likelihood)))
    free = _likeliest(likelihood, usual, np.arange(7), at)
    far = (np.log(astuple(free)) - usual) / _SPREAD
    return likelihood(noise) - likelihood(free) - 0.5 * float(far @ far)


def with_lasting_common_mode(grams: Sequence[Gram], layout: Layout, project: IntArray, noise: ScanNoise) -> ScanNoise:
    """Return a noise whose common mode, where there is one for sure, is the mean of those that last longer, too.

    The scans of a stand tell how far it wanders while they last. How far it comes until the next stand is told by no
    more than that: the longer it lasts, the farther. Effects of the time or of the place must be surer than that.
    """
    likelihood = _Likelihood(grams, layout, project)
    least = likelihood(noise)
    if likelihood(replace(noise, common_sd=_FLOOR)) - least < CERTAIN:
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
    grams: Sequence[Gram],
    layout: Layout,
    truth: tuple[float, float] | None,
    project: IntArray,
    noise: ScanNoise,
    own_sd: float = 0.0,
) -> CommonMode:
    """Return what says that scans have a common mode, by all of them; noise: the likeliest one, other arguments alike.

    own_sd [m]: of what the model already has, which then needs another one; of how long that lasts the model knows
    only from scan to scan. By Laplace's approximation of the integral over its sd and its time constant. One as large
    as any may be stands for something else that is wrong.
    """
    if noise.common_sd > _WHOLE * _HIGH[2]:
        return CommonMode(-np.inf, 1.0, 1.0)
    likelihood = _Likelihood(grams, layout, project)

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
    none = replace(noise, common_sd=max(own_sd, _FLOOR))
    # Errors of the reference may stand in for it, where nobody knows them, and the model's own may last.
    free = [*(range(2) if truth is None else ()), *([3] if own_sd else ())]
    if free:
        none = _likeliest(likelihood, np.log(np.clip(astuple(none), _LOW, _HIGH)), np.array(free))
    return CommonMode(likelihood(none) - here - 0.5 * float(np.log(values).sum()), float(sds[0]), float(sds[1]))


def _wandering(noise: ScanNoise, lasting: float, turn: float, *, stated: bool) -> ScanNoise:
    """Return a noise of which so much lasts; stated: of what is said of the reference, which is all of its errors."""
    position, heading = 1.0, 1.0
    if stated:
        position = float(np.hypot(1.0, noise.lasting) / np.hypot(1.0, lasting))
        heading = float(np.hypot(1.0, noise.lasting_turn) / np.hypot(1.0, turn))
    return replace(
        noise,
        position_sd=position * noise.position_sd,
        heading_sd=heading * noise.heading_sd,
        lasting=lasting,
        lasting_turn=turn,
    )


def _likeliest(
    likelihood: _Likelihood,
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
        return _wandering(none, found.lasting, found.lasting, stated=True) if stated else found

    def cost(values: FloatArray) -> float:
        distance = (values - usual[free]) / _SPREAD[free]
        return likelihood(noise_at(values)) + 0.5 * float(distance @ distance)

    at = usual[free] if begin is None else begin
    for step in (1.0, 0.3):  # a second start from the end of the first: it may stop early on a ridge
        simplex = np.vstack([at, at + step * np.eye(len(at))])
        options = {"xatol": 0.05, "fatol": 0.05, "maxfev": 25 * len(at), "initial_simplex": simplex}
        at = minimize(cost, at, method="Nelder-Mead", options=options).x
    return noise_at(at)


def _only(gram: Gram, project: IntArray) -> Gram:
    """Return a gram with some of the common columns, and the last, which is the residual."""
    lead = gram.own + gram.shared
    keep = np.concatenate([np.arange(lead), lead + project, [len(gram.matrix) - 1]])
    return Gram(gram.matrix[np.ix_(keep, keep)], gram.own, gram.shared)
