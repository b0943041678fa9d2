# SPDX-License-Identifier: BSD-3-Clause
"""Simulate the very run that was measured, with the plant that the simulator runs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from kurumaisu import effects, geometry
from kurumaisu.critic.drive import GRID, Drive
from kurumaisu.params import EffectSetting, Model
from kurumaisu.sim import plant
from kurumaisu.types import FloatArray


def extend(model: Model, settings: Sequence[EffectSetting]) -> Model:
    """Return the model with these effects in place of its own of the same id."""
    given = {setting.id for setting in settings}
    return replace(model, effects=(*(own for own in model.effects if own.id not in given), *settings))


def motion(drive: Drive, model: Model, settings: Sequence[EffectSetting]) -> effects.Motion:
    """Return the motion of the simulated chair on the drive's grid, without random effects."""
    heading = float(drive.poses[0, 2])  # the grid begins at the first pose, or a little before it
    random = {effect.id for effect in effects.ALL if effect.random}
    extended = extend(model, settings)
    mean = replace(extended, effects=tuple(own for own in extended.effects if own.id not in random))
    return plant.Plant(mean, GRID, np.random.default_rng(0)).from_rates(drive.v, drive.w, heading, drive.known)


def path(drive: Drive, model: Model, settings: Sequence[EffectSetting]) -> FloatArray:
    """Return the simulated poses at the reference's times, (m + 1, 3), starting at the first reference pose."""
    poses = plant.path(motion(drive, model, settings), np.zeros(3))
    grid = drive.start + GRID * np.arange(len(poses))
    at = geometry.interpolate(grid, poses, drive.times)
    return geometry.compose(drive.poses[0], geometry.between(at[0], at))


def increments(drive: Drive, model: Model, settings: Sequence[EffectSetting]) -> FloatArray:
    """Return the simulated body increments between the reference's times, (m, 3)."""
    at = path(drive, model, settings)
    return geometry.between(at[:-1], at[1:])
