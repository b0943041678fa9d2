# SPDX-License-Identifier: BSD-3-Clause
"""What was fitted, as a model file has it."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from kurumaisu import effects
from kurumaisu.critic.ranges.search.effect_sets import FittedForms
from kurumaisu.critic.ranges.search.normal_equations import Assembly
from kurumaisu.effects import Mechanism
from kurumaisu.params import EffectSetting


def settings_of(assembly: Assembly, fit: FittedForms) -> list[EffectSetting]:
    """Return the fitted effects as a model file has them."""
    out = []
    for form, at in fit.parts():
        effect = effects.by_id(form.id)
        if len(form.columns) > 1 and form.columns[0].beside:
            out.append(EffectSetting(form.id, {**assembly.marks.null(effect), **assembly.marks.joined(form, at)}))
            continue
        values = assembly.marks.null(effect)
        for column, coefficient in zip(form.columns, at.tolist(), strict=True):
            if column.squared:
                values |= _squared(effect, form.at, coefficient)
            else:
                values[column.parameter.name] += column.parameter.scale * coefficient
        shape = {} if form.columns[0].squared else form.at
        values |= shape
        # Two effects that nearly cancel are fitted as sums, which no bound stops.
        within = {p.name: float(np.clip(values[p.name], p.lower, p.upper)) for p in effect.parameters}
        out.append(EffectSetting(form.id, within))
    return out


def _squared(effect: type[Mechanism], signs: Mapping[str, float], coefficient: float) -> dict[str, float]:
    """Return the parameters that act by their squares together, for their common square in units of their scales."""
    size = float(np.sqrt(max(coefficient, 0.0)))
    return {
        p.name: float(np.clip(p.null + signs[p.name] * size * p.scale, p.lower, p.upper))
        for p in effect.parameters
        if p.name in signs
    }
