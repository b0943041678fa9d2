# SPDX-License-Identifier: BSD-3-Clause
"""A chair with another voltage law than the model's turns by other rates: what no unit explains as well."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from kurumaisu import effects
from kurumaisu.critic.base import replay
from kurumaisu.critic.base.drive import GRID, prepare
from kurumaisu.critic.sanity import input_match, rates
from kurumaisu.critic.sanity.input_match import Match
from kurumaisu.critic.sanity.rates import Rates
from kurumaisu.critic.values.recording import Run
from kurumaisu.params import EffectSetting, Model

_ABOUT_ONE = (0.5, 2.0)  # factors between the rates by another law and those driven that leave no unit to blame


def match(run: Run, name: str, plain: Match, driven: Rates, model: Model) -> Match:
    """Return the match of an input by whichever law of the catalogue explains more, where plain has factors of units.

    Of the laws that a chair has or has not; what has a size is fitted later.
    """
    if all(_ABOUT_ONE[0] < abs(factor) < _ABOUT_ONE[1] for factor in plain.factor if np.isfinite(factor)):
        return plain
    others = (input_match.compare(asked, driven, name) for asked in _rates(run, driven, model))
    return max((plain, *filter(_in_units, others)), key=lambda one: float(np.abs(one.correlation).sum()))


def _in_units(one: Match) -> bool:
    """Tell whether both channels follow in proportion, as far as they are driven."""
    known = one.correlation != 0
    low, high = _ABOUT_ONE
    return bool(known.any() and np.all((one.factor[known] > low) & (one.factor[known] < high)))


def _rates(run: Run, driven: Rates, model: Model) -> Iterator[Rates]:
    """Yield the rates of a simulated chair by each of the other laws, as means about the same times."""
    drive = prepare(run, model)
    times = drive.start + GRID * np.arange(len(drive.v))
    for effect in effects.of_base(voltages=model.robot.voltages):
        for choice in effect.choices if issubclass(effect, effects.VoltageEffect) else ():
            motion = replay.motion(drive, model, [EffectSetting(effect.id, dict(choice))])
            yield rates.of_input(times, np.column_stack([motion.v, motion.w]), driven.t)
