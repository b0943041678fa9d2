# SPDX-License-Identifier: BSD-3-Clause
"""The period of waves over the distance travelled, such as a wheel out of round makes: the one that explains most."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from kurumaisu import effects
from kurumaisu.critic import replay
from kurumaisu.critic.evidence import Problem
from kurumaisu.critic.smooth_columns import Sensitivity
from kurumaisu.params import EffectSetting
from kurumaisu.types import FloatArray

_SHORTEST, _LONGEST = 0.3, 3.0  # [m] girths of casters and drive wheels, and more
_TURNS = 3.0  # of the wheel in all drives, at least: fewer are a slope or a carpet
_MOST = 150  # periods
_WAVING = ("v_gain", "w")  # a wheel out of round takes a share of the way, a bent caster turns the chair
_AT_ONCE = 16  # of them: more leave the processor's cache


def girth(problem: Problem, settings: Sequence[EffectSetting]) -> tuple[float, int] | None:
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
    gram, pull = np.zeros((len(_WAVING), len(waves), 2, 2)), np.zeros((len(_WAVING), len(waves), 2))
    for drive, motion, way in zip(problem.drives, motions, ways, strict=True):
        sensitivity = Sensitivity(drive, motion)
        left = (drive.measured - problem.simulated(drive, settings)).reshape(-1, 1)
        white = problem.whitened(drive, left)[:, 0]
        at = 0
        for some in _waved(way, waves):
            here = slice(at, at + some.shape[1] // 2)
            at = here.stop
            for channel, of_gram, of_pull in zip(_WAVING, gram, pull, strict=True):
                both = problem.whitened(drive, sensitivity.increments(channel, some)).reshape(len(white), -1, 2)
                of_gram[here] += np.einsum("nki,nkj->kij", both, both)
                of_pull[here] += np.einsum("nki,n->ki", both, white)
    gained = np.einsum("cki,cki->ck", pull, np.linalg.solve(gram + 1e-9 * np.eye(2), pull[..., None])[..., 0])
    return float(1 / waves[int(np.argmax(gained.max(axis=0)))]), gained.size


def _waved(way: FloatArray, waves: FloatArray) -> Iterator[FloatArray]:
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
