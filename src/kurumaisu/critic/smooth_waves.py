# SPDX-License-Identifier: BSD-3-Clause
"""The period of waves over the distance travelled, such as a wheel out of round makes: the one that explains most."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from kurumaisu import effects
from kurumaisu.critic import replay
from kurumaisu.critic.evidence import Problem
from kurumaisu.critic.noise import whitened
from kurumaisu.critic.smooth_columns import Sensitivity
from kurumaisu.params import EffectSetting

_SHORTEST, _LONGEST = 0.3, 3.0  # [m] girths of casters and drive wheels, and more
_TURNS = 3.0  # of the wheel in all drives, at least: fewer are a slope or a carpet
_MOST = 150  # periods


def girth(problem: Problem, settings: Sequence[EffectSetting]) -> tuple[float, int] | None:
    """Return the period [m] of waves of the forward speed that explain most beside effects, and out of how many.

    None where the drives are too short for any.
    """
    motions = [replay.motion(drive, problem.model, settings) for drive in problem.drives]
    ways = [effects.Follower("distance", 0.0).values(motion) for motion in motions]
    longest = max((float(way[-1]) for way in ways if len(way)), default=0.0)
    if longest < _TURNS * _SHORTEST:
        return None
    low, high = max(1 / _LONGEST, _TURNS / longest), 1 / _SHORTEST
    waves = np.linspace(low, high, int(np.clip(2 * longest * (high - low), 2, _MOST)))
    gram, pull = np.zeros((len(waves), 2, 2)), np.zeros((len(waves), 2))
    for drive, motion, way in zip(problem.drives, motions, ways, strict=True):
        phase = 2 * np.pi * np.multiply.outer(way, waves)
        sensitivity = Sensitivity(drive, motion)
        parts = [sensitivity.increments("v_gain", side(phase)) for side in (np.cos, np.sin)]
        left = (drive.measured - problem.simulated(drive, settings)).reshape(-1, 1)
        white = whitened(drive, np.column_stack([left, *parts]), problem.noise)[0]
        both = np.stack([white[:, 1 : 1 + len(waves)], white[:, 1 + len(waves) :]], axis=-1)
        gram += np.einsum("nki,nkj->kij", both, both)
        pull += np.einsum("nki,n->ki", both, white[:, 0])
    gained = np.einsum("ki,ki->k", pull, np.linalg.solve(gram + 1e-9 * np.eye(2), pull[..., None])[..., 0])
    return float(1 / waves[int(np.argmax(gained))]), len(waves)
