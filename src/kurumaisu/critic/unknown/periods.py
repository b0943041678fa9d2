# SPDX-License-Identifier: BSD-3-Clause
"""The period of waves over the distance travelled, such as a wheel out of round makes: the one that explains most."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from kurumaisu import effects
from kurumaisu.critic.base import replay
from kurumaisu.critic.base.sensitivity import Sensitivity
from kurumaisu.critic.engine.evidence import Problem
from kurumaisu.params import EffectSetting
from kurumaisu.types import FloatArray

_SHORTEST, _LONGEST = 0.3, 3.0  # [m] girths of casters and drive wheels, and more
_TURNS = 3.0  # of the wheel in all drives, at least: fewer are a slope or a carpet
_MOST = 150  # periods
_WAVING = ("v_gain", "w")  # a wheel out of round takes a share of the way, a bent caster turns the chair
_AT_ONCE = 16  # of them: more leave the processor's cache
_OVERTONES = 4
_PARTS = (1, 2, 3)  # of a turn, after which it may be as large as after all of it
_CLOSER = 8  # periods for one about the best: an overtone is out of step sooner


def wave_period(problem: Problem, settings: Sequence[EffectSetting]) -> tuple[float, int] | None:
    """Return the period [m] of waves of either rate that explain most beside effects, and out of how many.

    None where the drives are too short for any.
    """
    motions = [replay.motion(drive, problem.model, settings) for drive in problem.drives]
    ways = [effects.Follower("distance", 0.0).values(motion) for motion in motions]
    longest = max((float(way[-1]) for way in ways if len(way)), default=0.0)
    if longest < _TURNS * _SHORTEST:
        return None
    low, high = max(1 / _LONGEST, _TURNS / longest), 1 / _SHORTEST
    waves = np.linspace(low, high, int(np.clip(2 * longest * (high - low), 2, _MOST)))
    sought = _PeriodSearch(problem, settings, motions, ways)
    gained = np.stack([sought.gained(channel, waves, 1) for channel in _WAVING])
    channel, best = np.unravel_index(int(np.argmax(gained)), gained.shape)
    # What comes once per turn, but briefly, has overtones as large, any of which may stand out.
    apart, closer = waves[1] - waves[0], np.arange(-_CLOSER, _CLOSER + 1) / _CLOSER
    near = [(waves[best] + apart * closer) / turns for turns in _PARTS]
    near = [some[(some >= low) & (some <= high)] for some in near]
    found = [(wave, sought.gained(_WAVING[channel], wave, _OVERTONES)) for wave in near if len(wave) > 1]
    likeliest, _ = max(((wave[np.argmax(g)], g.max()) for wave, g in found), key=lambda one: one[1])
    return float(1 / likeliest), gained.size


class _PeriodSearch:
    """What is left about simulated drives, and what waves along their ways explain of it."""

    def __init__(
        self,
        problem: Problem,
        settings: Sequence[EffectSetting],
        motions: Sequence[effects.Motion],
        ways: Sequence[FloatArray],
    ) -> None:
        self._problem = problem
        self._drives = []
        for drive, motion, way in zip(problem.drives, motions, ways, strict=True):
            left = (drive.measured - problem.simulated(drive, settings)).reshape(-1, 1)
            self._drives.append((drive, Sensitivity(drive, motion), way, problem.whitened(drive, left)[:, 0]))

    def gained(self, channel: str, waves: FloatArray, overtones: int) -> FloatArray:
        """Return the squares that each of evenly spaced waves, with as many overtones, explains in a channel, (n,)."""
        size = 2 * overtones
        gram, pull = np.zeros((len(waves), size, size)), np.zeros((len(waves), size))
        for drive, sensitivity, way, white in self._drives:
            tones = zip(*(_waves(way, times * waves) for times in range(1, overtones + 1)), strict=True)
            at = 0
            for some in tones:
                here = slice(at, at + some[0].shape[1] // 2)
                at = here.stop
                # (rows, waves, cosines and sines of all tones)
                whole = [
                    self._problem.whitened(drive, sensitivity.increments(channel, tone)).reshape(len(white), -1, 2)
                    for tone in some
                ]
                both = whole[0] if overtones == 1 else np.concatenate(whole, axis=2)
                gram[here] += np.einsum("nki,nkj->kij", both, both)
                pull[here] += np.einsum("nki,n->ki", both, white)
        along = np.linalg.solve(gram + 1e-9 * np.eye(size), pull[..., None])[..., 0]
        return np.asarray(np.einsum("ki,ki->k", pull, along))


def _waves(way: FloatArray, waves: FloatArray) -> Iterator[FloatArray]:
    """Yield pairs of cosine and sine (n, 2 k) of evenly spaced waves along a way (n,), few at a time.

    Each is the one before it, turned on by as much again.
    """
    first, apart = np.exp(2j * np.pi * np.multiply.outer([waves[0], waves[1] - waves[0]], way))
    for at in range(0, len(waves), _AT_ONCE):
        turned = np.empty((len(way), min(_AT_ONCE, len(waves) - at)), dtype=complex)
        turned[:, 0] = first
        turned[:, 1:] = apart[:, None]
        np.cumprod(turned, axis=1, out=turned)
        first = turned[:, -1] * apart
        yield turned.view(np.float64)
