# SPDX-License-Identifier: BSD-3-Clause
"""Scans as a model understands them: the true ranges behind the readings, along the beams that the model believes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from kurumaisu import effects
from kurumaisu.critic.ranges.scans.beams import acts_on_readings
from kurumaisu.critic.ranges.scans.gathering import laser_of
from kurumaisu.critic.values.recording import Recording, Run
from kurumaisu.effects import Beams, Echoes
from kurumaisu.params import EffectSetting, Laser, Model
from kurumaisu.types import FloatArray

_ROUNDS = 4  # of an inversion whose error falls by the effects' relative size each time


@dataclass(frozen=True)
class Corrected:
    """stamps (n,) [s] at which the scans began, ranges (n, b) [m] on the level, and the fan as SLAM has it."""

    stamps: FloatArray
    ranges: FloatArray
    angle_min: float
    angle_increment: float
    time_increment: float
    range_max: float
    mount: list[float]


def corrected(
    recording: Recording,
    run: Run,
    rows: Sequence[int],
    model: Model,
    settings: Sequence[EffectSetting],
    *,
    known: bool,
) -> Corrected:
    """Return some scans of a run, freed of what model and effects say that the laser does to them on the mean.

    How obliquely a beam meets its wall is not known here: effects of that stay in. known: whether the model's law of
    the laser is that of this one; else readings are taken for ranges.
    """
    assert run.scan is not None
    laser = laser_of(model.laser, recording.laser, recording.runs)
    given = {setting.id for setting in settings}
    own = (own for own in model.effects if own.id not in given)
    every = tuple(s for s in (*own, *settings) if acts_on_readings(s.id) and _steady(laser, s))
    chain = effects.build_laser(every, np.random.default_rng(0))
    stamps = run.scan.t[list(rows)]
    flat = np.zeros(laser.beams)
    said = laser.time_increment * np.arange(laser.beams)
    mount = np.array([laser.mount.x, laser.mount.y, laser.mount.yaw])
    begun = float(run.scan.t[0])
    beams = [chain.aim(Beams(t, t + said, mount, laser.mount.z, laser.bearings, flat, begun)) for t in stamps.tolist()]
    readings = run.scan.values[list(rows)]
    first = laser.error.range(readings) if known else readings
    ranges = np.array(
        [_ranges(laser, chain, t, row, start) for t, row, start in zip(stamps.tolist(), readings, first, strict=True)]
    )
    level = ranges * np.cos(np.array([each.elevations for each in beams]))
    one = beams[len(beams) // 2]
    return Corrected(
        np.array([float(each.times[0]) for each in beams]),
        level,
        float(one.bearings[0]),
        float((one.bearings[-1] - one.bearings[0]) / (laser.beams - 1)),
        float((one.times[-1] - one.times[0]) / (laser.beams - 1)),
        laser.range_max if known else float(np.nanmax(readings, initial=0.0, where=readings < np.inf)),
        one.mount.tolist(),
    )


def _steady(laser: Laser, setting: EffectSetting) -> bool:
    """Tell whether an effect does the same to every laser: nobody can undo what is drawn."""
    flat = np.ones(laser.beams)
    echoes = Echoes(0.0, laser.bearings, flat, 0 * flat, flat, flat, flat, 0 * flat, flat)
    drawn = [effects.build_laser((setting,), np.random.default_rng(seed)).read(echoes) for seed in (0, 1)]
    return np.array_equal(drawn[0], drawn[1], equal_nan=True)


def _ranges(
    laser: Laser, chain: effects.LaserChain, stamp: float, readings: FloatArray, start: FloatArray
) -> FloatArray:
    """Return the ranges (b,) [m] that the chain makes these readings of, from a first guess; inf and nan stay."""
    if chain.empty:
        return start
    hit = np.isfinite(start)
    guess, zero, one = np.where(hit, start, 1.0), np.zeros_like(start), np.ones_like(start)
    # The model's own law is undone by the first guess; what the effects add to it is taken off in turn.
    for _ in range(_ROUNDS):
        mean, sd = laser.error.mean(guess), laser.error.deviation(guess)
        seen = chain.read(Echoes(stamp, laser.bearings, guess, zero, one, mean, sd, zero, guess))
        guess = np.where(hit, start - (seen - mean), 1.0)
    return np.where(hit, guess, start)
