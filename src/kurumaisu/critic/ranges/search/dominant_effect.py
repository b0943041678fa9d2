# SPDX-License-Identifier: BSD-3-Clause
"""An effect that does far more than small changes tell: the rest is looked for with it in place.

Where beams come from far elsewhere, readings pass for outliers, the chair is sought where it is not, and a crowd of
small effects draws what is left.
"""

from __future__ import annotations

from copy import copy
from dataclasses import replace

import numpy as np

from kurumaisu import effects
from kurumaisu.critic.ranges.search.effect_sets import FittedForms
from kurumaisu.critic.ranges.search.misfits import Part, misfits
from kurumaisu.critic.ranges.search.normal_equations import Assembly, NormalEquations
from kurumaisu.critic.ranges.search.parameter_fit import STRONG, ParameterFit, strength
from kurumaisu.critic.values.criticism import LaserFinding
from kurumaisu.critic.values.prior import Z_LOW
from kurumaisu.critic.values.verdict import Cause
from kurumaisu.params import EffectSetting

_LINE_ERROR = 0.5  # share of what an effect does by which its line may be off


def dominant_effect(
    assembly: Assembly, normal: NormalEquations, fit: FittedForms, refitted: ParameterFit
) -> EffectSetting | None:
    """Return the loudest effect that moves beams and, refitted by simulation, does quite another thing than by line."""
    settings = {setting.id: setting for setting, _ in refitted.settings}
    loudest, out = STRONG, None
    for form, coefficients in fit.parts():
        line = assembly.columns[:, :, form.span] @ coefficients
        if issubclass(effects.by_id(form.id), effects.ReadingEffect):
            continue
        change = assembly.marks.together([settings[form.id]])
        size = strength(assembly, normal, change)
        if size > loudest and strength(assembly, normal, change - line) > _LINE_ERROR * size:
            loudest, out = size, settings[form.id]
    return out


def vanished_effects(assembly: Assembly, fit: FittedForms, refitted: ParameterFit) -> frozenset[str]:
    """Return the effects that move beams of which, refitted by simulation, nothing is left.

    They had drawn what the line of another one misses.
    """
    out = set[str]()
    sizes = {setting.id: (setting.parameters, sds) for setting, sds in refitted.settings}
    for form, coefficients in fit.parts():
        effect, column, line = effects.by_id(form.id), form.columns[0], float(coefficients[0])
        if issubclass(effect, effects.ReadingEffect) or len(form.columns) > 1 or column.squared:
            continue
        p, (values, sds) = column.parameter, sizes[form.id]
        left = values[p.name] - assembly.marks.null(effect)[p.name]
        if abs(left) < Z_LOW * sds[p.name] < abs(line * p.scale - left):
            out.add(form.id)
    return frozenset(out)


def with_dominant(
    rest: LaserFinding, lead: EffectSetting, cause: Cause, assembly: Assembly, normal: NormalEquations
) -> LaserFinding:
    """Return what was found with an effect in place, and the effect; cause: as it was found at first.

    What is still missing of it is no question of whether it acts, unless nothing is left of it beside the others.
    """
    again = next((each for each in rest.causes if each.id == lead.id), None)
    others = tuple(one for one in rest.pictures.misfits if one.explained_by != lead.id)
    if again is not None and _nothing(again):
        return replace(
            rest,
            causes=tuple(each for each in rest.causes if each is not again),
            settings=tuple(setting for setting in rest.settings if setting.id != lead.id),
            pictures=replace(rest.pictures, misfits=others),
        )
    if again is not None:
        cause = replace(cause, parameters=again.parameters)
    alone = copy(assembly)
    alone.columns = assembly.marks.together([lead])[:, :, np.newaxis].astype(np.float32)
    shown = misfits(alone, normal, [Part(lead.id, slice(0, 1), np.ones(1))])
    moved = any(setting.id == lead.id for setting in rest.settings)
    return replace(
        rest,
        causes=(cause, *(each for each in rest.causes if each is not again)),
        confounded=tuple(group for group in rest.confounded if lead.id not in group),
        settings=rest.settings if moved else (lead, *rest.settings),
        pictures=replace(rest.pictures, misfits=(*shown, *others)),
    )


def _nothing(cause: Cause) -> bool:
    """Tell whether nothing may be left of an effect, by all of its intervals."""
    nulls = {p.name: p.null for p in effects.by_id(cause.id).parameters}
    sizes = {name: one for name, one in cause.parameters.items() if one.hi90 > one.lo90}
    return bool(sizes) and all(one.lo90 <= nulls[name] <= one.hi90 for name, one in sizes.items())
