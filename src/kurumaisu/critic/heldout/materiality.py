# SPDX-License-Identifier: BSD-3-Clause
"""Does it matter? How far an effect moves the chair from where it would be without it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from kurumaisu import geometry
from kurumaisu.critic.base import replay
from kurumaisu.critic.base.drive import Drive
from kurumaisu.critic.engine.evidence import Problem
from kurumaisu.critic.noise.base_noise import whitened
from kurumaisu.critic.values.verdict import NORMAL90, ChannelGain, Gain
from kurumaisu.params import EffectSetting
from kurumaisu.types import FloatArray, IntArray

MATERIAL = 0.005  # share of the way (or of the turn) from which an effect matters to a driver
_FELT = 0.1  # share of what is uncertain anyway, per increment, from which an effect matters to a prediction
_LEAST = 1e-4  # share of the way that must be moved for that: beside no noise at all anything would be felt
_SAME = 1e-6  # [s] less than any clock resolves: stamps of equal spacing differ by rounding
# [nat] of evidence from which _LIKELY will do, of effects and of a free curve
_STRONG, STRONG_CURVE = 5.0, 8.0
# [nat] over nothing: were the noise twice as large as estimated, a quarter of it would still be beyond doubt.
NO_NOISE = 50.0
_LIKELY = 0.84  # standard deviations: a gain with a probability of 0.8
CERTAIN = 12.0  # [nat] of evidence from which data held out need but gain
HORIZON = 2.0  # [s] over which ways and turns are compared


def confirmed(gain: Gain | ChannelGain | None, nats: float, *, free: bool = False) -> bool:
    """Return whether data held out confirm a finding that gains so much evidence on the drives it was fitted to.

    Blocks of a few drives scatter widely: what is certain by the evidence need not be so by the blocks again. A short
    drive held out may gain by chance as little as what is not there would lose, but for a free curve, which has sizes
    enough to fit what comes once.
    """
    if gain is None:
        return False
    density = gain.log_density_per_sample
    sd = max(density.hi90 - density.lo90, 1e-12) / (2 * NORMAL90)
    least = 0.0 if nats >= CERTAIN and not free else _LIKELY * sd
    return density.lo90 > 0 or (nats >= (STRONG_CURVE if free else _STRONG) and density.gain > least)


def simulates_nearer(gain: Gain | None, channels: Sequence[str]) -> bool:
    """Return whether drives held out are simulated nearer to what was measured in one of some channels, in none less.

    What a curve or an equation leaves of something strong is no normal noise: a few surprises may cost all that the
    density gains. Where they cost more, the chair must also come nearer to where it came.
    """
    if gain is None:
        return False
    path = next(iter(gain.rmse.values()), None)  # over the shortest horizon
    if gain.log_density_per_sample.gain < 0 and path is not None and path.gain < 0:
        return False
    errors = [gain.channels[name].rmse for name in channels if name in gain.channels]
    known = [error for error in errors if error is not None]
    return any(error.lo90 > 0 for error in known) and all(error.hi90 > 0 for error in known)


def holds(gain: Gain | None, nats: float) -> bool:
    """Return whether drives held out confirm effects with so much evidence.

    What is no noise by far, but other from drive to drive, brings surprises; then it must simulate them better.
    """
    return confirmed(gain, nats) or (gain is not None and nats >= NO_NOISE and simulates_nearer(gain, [*gain.channels]))


def matters(share: float, felt: float) -> bool:
    """Return whether an effect matters, by its share of the way and of the noise."""
    return share >= MATERIAL or (felt >= _FELT and share >= _LEAST)


def share_of_way(problem: Problem, settings: Sequence[EffectSetting], without: Sequence[EffectSetting]) -> float:
    """Return how far the chair is moved within HORIZON by what `settings` have and `without` lack.

    As a share of the way or of the turn made meanwhile (rms over all starts), whichever is larger.
    """
    moved, made = np.zeros(2), np.zeros(2)
    for drive in problem.drives:
        starts, ends = spans(drive, HORIZON)
        paths = [replay.path(drive, problem.model, some) for some in (settings, without)]
        one, other = (geometry.between(path[starts], path[ends]) for path in paths)
        moved += _squares(one - other)
        made += _squares(other)
    return float(np.sqrt((moved / np.maximum(made, 1e-12)).max()))


def share_of_noise(problem: Problem, settings: Sequence[EffectSetting], without: Sequence[EffectSetting]) -> float:
    """Return what `settings` have and `without` lack, in standard deviations of an increment's noise (rms)."""
    count = sum(len(drive.measured) for drive in problem.drives)
    return float(np.sqrt(2 * expected_nats(problem, problem.drives, settings, without) / count))


def expected_nats(
    problem: Problem, drives: Sequence[Drive], settings: Sequence[EffectSetting], without: Sequence[EffectSetting]
) -> float:
    """Return what some drives would tell for `settings` over `without` [nat], if the chair were as `settings` say."""
    total = 0.0
    for drive in drives:
        moved = problem.simulated(drive, settings) - problem.simulated(drive, without)
        white = whitened(drive, moved.reshape(-1, 1), problem.noise)[0]
        total += float(np.sum(white**2))
    return total / 2


def spans(drive: Drive, horizon: float) -> tuple[IntArray, IntArray]:
    """Return the indices of reference poses and of those a horizon [s] later, for all starts that have one."""
    ends = np.searchsorted(drive.times, drive.times + horizon - _SAME)
    starts = np.flatnonzero(ends < len(drive.times))
    return starts, ends[starts]


def _squares(increments: FloatArray) -> FloatArray:
    return np.array([np.sum(increments[:, :2] ** 2), np.sum(increments[:, 2] ** 2)])
