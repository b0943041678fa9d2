# SPDX-License-Identifier: BSD-3-Clause
"""What comes and goes: for a moment now and then a rate is another, as where packets are lost or a wheel spins.

No curve over the time has knots enough for it, and it passes for noise. But noise is as large at any time, and to
either side: where for a small share of the time a rate is off to one side, a mixture of two normal distributions is
likelier than one.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import expit
from scipy.stats import norm

from kurumaisu.critic.base import replay
from kurumaisu.critic.base.drive import Drive, FreeMoments
from kurumaisu.critic.base.sensitivity import Sensitivity, hats
from kurumaisu.critic.engine.evidence import Problem
from kurumaisu.critic.values.story import Moments
from kurumaisu.geometry import interpolate
from kurumaisu.params import EffectSetting
from kurumaisu.types import BoolArray, FloatArray, IntArray

_CHANNELS = ("v_gain", "w_gain", "v", "w")
_WIDTH = 0.5  # [s] of a moment, or
_POSES = 2.0  # intervals of the reference: what is briefer shows in none
_SEEN = 0.05  # share of the usual information about a moment, below which it tells nothing
_FEWEST = 30  # moments
_SHARES = (0.05, 0.15, 0.3)  # of the time, from which a mixture is fitted
_MOST = 0.5  # share at most: what is there more often is the rule
_APART = 2.0  # sds of the noise by which the other value must be off: noise of two sizes is no event
_SPACING = 40.0  # [s] between moments that share a column: longer than any noise that is estimated lasts
_FREE = 2.0  # times its size that it may have at any moment
_PLAUSIBLE = 0.05  # probability of a moment from which it is set free
_ROUNDS = 100
_PARAMETERS = 3  # that a mixture has more than one distribution


@dataclass(frozen=True)
class Intermittent:
    """What comes and goes in a channel.

    nats: for it over noise; share: of the time that it is there; size: of the curve in the channel meanwhile; moments:
    the drive's name, begin and end [s] of each, the surest first; samples, offsets (n,): when and where every moment of
    the drives was, and by how much the channel was off.
    """

    channel: str
    nats: float
    share: float
    size: float
    moments: tuple[tuple[str, float, float], ...]
    samples: Moments
    offsets: FloatArray

    def freed(self, drive: Drive) -> Drive:
        """Return a drive whose rates are free in those moments."""
        own = np.array([(since, until) for name, since, until in self.moments if name == drive.name])
        if not len(own):
            return drive
        free = FreeMoments(self.channel, own.mean(axis=1), float(np.ptp(own[0])), _FREE * abs(self.size))
        return replace(drive, free=free)


@dataclass(frozen=True)
class _Moments:
    """Moments (n,): the drive of each and its middle [s], z, and the information about a curve that is 1 then."""

    drive: IntArray
    middles: FloatArray
    width: float
    z: FloatArray
    information: FloatArray


@dataclass(frozen=True)
class _Mixture:
    """Two normal distributions: evidence [nat] over one; how often the second is met, and where (n,).

    apart: its mean less that of the first; sd: of the first.
    """

    nats: float
    share: float
    apart: float
    sd: float
    there: FloatArray


def intermittent(problem: Problem, drives: Sequence[Drive], settings: Sequence[EffectSetting]) -> Intermittent | None:
    """Return what comes and goes in drives beside settings where it is likeliest; None where nothing does.

    drives: those of the problem, and others like them.
    """
    every = problem.changed(drives=tuple(drives))
    found = [one for channel in _CHANNELS if (one := _in_channel(every, settings, channel)) is not None]
    return max(found, key=lambda one: one.nats, default=None)


def _in_channel(problem: Problem, settings: Sequence[EffectSetting], channel: str) -> Intermittent | None:
    moments = _moments(problem, settings, channel)
    if len(moments.z) < _FEWEST:
        return None
    best = max(_mixtures(moments.z), key=lambda one: one.nats)
    if abs(best.apart) < _APART * best.sd:
        return None
    here: BoolArray = best.there > 1 / 2
    # The rows of a moment tell its mean by weights of their information.
    size = float(np.sum((moments.z * np.sqrt(moments.information))[here]) / max(moments.information[here].sum(), 1e-12))
    order = np.argsort(-best.there, kind="stable")[: int(np.sum(best.there > _PLAUSIBLE))]
    spans = moments.middles[:, np.newaxis] + moments.width * np.array([-0.5, 0.5])
    surest = tuple((problem.drives[moments.drive[i]].name, float(spans[i, 0]), float(spans[i, 1])) for i in order)
    runs = tuple(dict.fromkeys(drive.name for drive in problem.drives))
    run = np.array([runs.index(drive.name) for drive in problem.drives])[moments.drive]
    places = np.zeros((len(moments.z), 2))
    for i, drive in enumerate(problem.drives):
        own = moments.drive == i
        places[own] = interpolate(drive.times, drive.poses, moments.middles[own])[:, :2]
    samples = Moments(runs, run, moments.middles, places)
    return Intermittent(channel, best.nats, best.share, size, surest, samples, moments.z / np.sqrt(moments.information))


def _moments(problem: Problem, settings: Sequence[EffectSetting], channel: str) -> _Moments:
    """Return what each moment of the drives says of a curve that is 1 then, alone."""
    width = max(_WIDTH, _POSES * float(np.median(np.concatenate([np.diff(one.times) for one in problem.drives]))))
    each = [_told(problem, drive, settings, channel, width) for drive in problem.drives]
    drive = np.repeat(np.arange(len(each)), [len(middles) for middles, _, _ in each])
    middles, pulls, information = (np.concatenate(some) for some in zip(*each, strict=True))
    seen = information > 0
    seen = information > _SEEN * float(np.median(information[seen])) if seen.any() else seen
    z = pulls[seen] / np.sqrt(information[seen])
    return _Moments(drive[seen], middles[seen], width, z, information[seen])


def _told(
    problem: Problem, drive: Drive, settings: Sequence[EffectSetting], channel: str, width: float
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the middles of a drive's moments, and pull and information of a curve that is 1 at each, (n,) each.

    Moments that are far apart share a column, of which each has the rows about it.
    """
    left = problem.whitened(drive, (drive.measured - problem.simulated(drive, settings)).reshape(-1, 1))[:, 0]
    motion = replay.motion(drive, problem.model, settings)
    middles = np.arange(drive.times[0] + width / 2, drive.times[-1], width)
    count = min(len(middles), int(np.ceil(_SPACING / width)))
    columns = np.zeros((len(left), 0))
    if count:
        shared = hats(drive, len(motion.moving), middles[:count], width, again=count * width)
        columns = problem.whitened(drive, Sensitivity(drive, motion).increments(channel, shared))
    at = np.repeat((drive.times[1:] + drive.times[:-1]) / 2, 3)
    pulls, information = np.zeros(len(middles)), np.zeros(len(middles))
    for j, column in enumerate(columns.T):
        own = np.arange(j, len(middles), count)
        nearest = np.clip(np.rint((at - middles[j]) / (count * width)).astype(int), 0, len(own) - 1)
        pulls[own] = np.bincount(nearest, column * left, len(own))
        information[own] = np.bincount(nearest, column**2, len(own))
    # Where no pose is for longer, one increment would be told many times.
    gaps = np.diff(drive.times)[np.clip(np.searchsorted(drive.times, middles) - 1, 0, len(drive.times) - 2)] > width
    return middles, pulls, np.where(gaps, 0.0, information)


def _mixtures(z: FloatArray) -> Iterator[_Mixture]:
    """Yield mixtures of two normal distributions of z (n,), each fitted from another start."""
    for share in _SHARES:
        for sign in (1.0, -1.0):
            yield _fitted(z, (sign * z >= np.quantile(sign * z, 1 - share)).astype(float))


def _fitted(z: FloatArray, there: FloatArray) -> _Mixture:
    """Return the mixture that z (n,) leads to; there (n,): where the second one may be met, to begin with."""
    one = float(norm.logpdf(z, z.mean(), z.std()).sum()) + 0.5 * _PARAMETERS * float(np.log(len(z)))
    share, apart, sd, nats = 0.0, 0.0, 0.0, -np.inf
    for _ in range(_ROUNDS):
        share = float(np.clip(there.mean(), 1e-3, _MOST))
        (middle, sd), (other, wide) = (_mean_and_sd(z, weights + 1e-12) for weights in (1 - there, there))
        usual = np.log1p(-share) + norm.logpdf(z, middle, sd)
        # No narrower than half of the first: else a single moment would be infinitely likely.
        rare = np.log(share) + norm.logpdf(z, other, max(wide, 0.5 * sd))
        there, nats, apart = expit(rare - usual), float(np.logaddexp(usual, rare).sum()) - one, other - middle
    return _Mixture(nats, share, apart, sd, there)


def _mean_and_sd(z: FloatArray, weights: FloatArray) -> tuple[float, float]:
    """Return weighted mean and sd."""
    mean = float(np.average(z, weights=weights))
    return mean, float(np.sqrt(np.average((z - mean) ** 2, weights=weights)))
