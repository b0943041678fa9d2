# SPDX-License-Identifier: BSD-3-Clause
"""The period of waves that explain most: over the way, as of a wheel out of round, over the time, or over the place."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from kurumaisu import effects
from kurumaisu.critic.base import replay
from kurumaisu.critic.base.drive import Drive
from kurumaisu.critic.base.sensitivity import Sensitivity
from kurumaisu.critic.engine.evidence import Problem
from kurumaisu.params import EffectSetting
from kurumaisu.types import FloatArray


@dataclass(frozen=True)
class Wave:
    """Waves over a covariate that are looked for: their shortest and longest, in its unit, and in which channels."""

    shortest: float
    longest: float
    channels: tuple[str, ...]


# Girths of casters and drive wheels, and more: a wheel out of round takes a share of the way, a bent caster turns the
# chair. People who sway, pumps and fans; tiles, seams and ramps of a floor.
WAVES: Mapping[str, Wave] = {
    "distance": Wave(0.3, 3.0, ("v_gain", "w")),
    "time": Wave(2.0, 60.0, ("v_gain", "w")),
    "x": Wave(0.3, 3.0, ("v_gain", "curvature")),
    "y": Wave(0.3, 3.0, ("v_gain", "curvature")),
}
_TURNS = 3.0  # in all of a drive, at least: fewer are a slope or a carpet
_MOST = 150  # periods
_AT_ONCE = 16  # of them: more leave the processor's cache
_OVERTONES = 4
_PARTS = (1, 2, 3)  # of a turn, after which it may be as large as after all of it
_CLOSER = 8  # periods for one about the best: an overtone is out of step sooner


def wave_periods(problem: Problem, settings: Sequence[EffectSetting]) -> dict[str, tuple[float, int]]:
    """Return the period of waves over each covariate that explain most beside effects, and out of how many.

    None of a covariate that no drive goes through often enough.
    """
    motions = [replay.motion(drive, problem.model, settings) for drive in problem.drives]
    left = [drive.measured - problem.simulated(drive, settings) for drive in problem.drives]
    white = [problem.whitened(drive, one.reshape(-1, 1))[:, 0] for drive, one in zip(problem.drives, left, strict=True)]
    sensitive = [Sensitivity(drive, motion) for drive, motion in zip(problem.drives, motions, strict=True)]
    found = {}
    for name, kind in WAVES.items():
        along = [effects.Follower(name, 0.0).values(motion) for motion in motions]
        sought = _PeriodSearch(problem, list(zip(problem.drives, sensitive, along, white, strict=True)))
        period = _wave_period(sought, kind, max((float(np.ptp(one)) for one in along if len(one)), default=0.0))
        if period is not None:
            found[name] = period
    return found


def _wave_period(sought: _PeriodSearch, kind: Wave, longest: float) -> tuple[float, int] | None:
    """Return the period that explains most, and out of how many; longest: as far as a drive goes."""
    if longest < _TURNS * kind.shortest:
        return None
    low, high = max(1 / kind.longest, _TURNS / longest), 1 / kind.shortest
    waves = np.linspace(low, high, int(np.clip(2 * longest * (high - low), 2, _MOST)))
    gained = np.stack([sought.gained(channel, waves, 1) for channel in kind.channels])
    channel, best = np.unravel_index(int(np.argmax(gained)), gained.shape)
    # What comes once per turn, but briefly, has overtones as large, any of which may stand out.
    apart, closer = waves[1] - waves[0], np.arange(-_CLOSER, _CLOSER + 1) / _CLOSER
    near = [(waves[best] + apart * closer) / turns for turns in _PARTS]
    near = [some[(some >= low) & (some <= high)] for some in near]
    found = [(wave, sought.gained(kind.channels[channel], wave, _OVERTONES)) for wave in near if len(wave) > 1]
    likeliest, _ = max(((wave[np.argmax(g)], g.max()) for wave, g in found), key=lambda one: one[1])
    return float(1 / likeliest), gained.size


class _PeriodSearch:
    """What is left about simulated drives, whitened, and what waves over a covariate explain of it."""

    def __init__(self, problem: Problem, drives: Sequence[tuple[Drive, Sensitivity, FloatArray, FloatArray]]) -> None:
        """Take drives with how they react, the covariate, and what is left."""
        self._problem, self._drives = problem, drives

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
