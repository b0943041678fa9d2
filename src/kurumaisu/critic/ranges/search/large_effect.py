# SPDX-License-Identifier: BSD-3-Clause
"""An effect that sends beams so far elsewhere that no line leads to its size: sought by where readings then belong."""

from __future__ import annotations

from collections.abc import Mapping
from copy import copy
from dataclasses import replace
from functools import cache

import numpy as np
from scipy.optimize import minimize_scalar

from kurumaisu import effects
from kurumaisu.critic.ranges.scans.beams import Shots, hits_of, predict, thin
from kurumaisu.critic.ranges.scans.valid_readings import without_cut_off
from kurumaisu.critic.ranges.search.effect_sets import FittedForms
from kurumaisu.critic.ranges.search.misfits import Part, misfits
from kurumaisu.critic.ranges.search.normal_equations import Assembly, NormalEquations
from kurumaisu.critic.ranges.search.parameter_fit import STRONG, ParameterFit, strength
from kurumaisu.critic.values.criticism import LaserFinding
from kurumaisu.critic.values.policy import Z_LOW
from kurumaisu.critic.values.verdict import Cause
from kurumaisu.effects import BeamEffect, LaserStage, Mechanism, Parameter
from kurumaisu.params import EffectSetting

_SCANS = 25  # that are looked at: each look takes a hundredth of a second
_TOLERANCE = (0.1, 0.02)  # [m] and share of the range, within which a reading is where it belongs
_FEW, _MOST = 0.9, 0.95  # share of them that do: more need no search; of fewer, something else is wrong as well
_ALTERNATIVE = (
    0.5  # share of what it mends that another effect may mend: small changes must tell it from one that mends more
)
_STEP = 2.0**0.5  # between sizes that are tried
_LARGEST = 32.0  # times a usual size
_FINER = 8  # sizes that are tried about the best
_LINE_ERROR = 0.5  # share of what an effect does by which its line may be off


def large_effect(shots: Shots, ids: frozenset[str] | None) -> EffectSetting | None:
    """Return the one effect on beams that sends nearly all readings where they belong, which are elsewhere without it.

    ids: the effects that may be named; None for all.
    """
    sought = _SizeSearch(thin(shots, _SCANS))
    plain = sought.plain
    if plain > _FEW:
        return None
    own = {setting.id for setting in shots.own}
    known = [effect for effect in effects.LASER if effect.id not in own and effect.stage <= LaserStage.BIAS]
    asked = [effect for effect in known if ids is None or effect.id in ids]
    tried = [sought.best(effect, form) for effect in asked for form in effect.forms or ({},)]
    ranked = sorted(tried, key=lambda each: -each[0])
    if not ranked or ranked[0][0] < _MOST or not issubclass(effects.by_id(ranked[0][1].id), BeamEffect):
        return None
    rival = max((share for share, other in ranked if other.id != ranked[0][1].id), default=plain)
    return ranked[0][1] if rival - plain < _ALTERNATIVE * (ranked[0][0] - plain) else None


class _SizeSearch:
    """Which share of the readings of some scans are where they belong."""

    def __init__(self, shots: Shots) -> None:
        self._shots, self._measured = shots, without_cut_off(shots.measured)
        self._seen = np.isfinite(self._measured)
        self.plain = self.share(())

    def share(self, settings: tuple[EffectSetting, ...]) -> float:
        """Return the share with effects at work."""
        off = np.abs(self._measured - predict(self._shots, settings, hits_of(self._shots, settings, 0), 0))
        near = off[self._seen] < _TOLERANCE[0] + _TOLERANCE[1] * self._measured[self._seen]
        return float(near.mean()) if near.size else 1.0

    def best(self, effect: type[Mechanism], form: Mapping[str, float]) -> tuple[float, EffectSetting]:
        """Return the greatest share with one of an effect's parameters off its null, in a form, and the setting."""
        null = {p.name: p.null for p in effect.parameters} | dict(form)
        out = (0.0, EffectSetting(effect.id, null))
        for p in effect.parameters:

            @cache
            def missed(value: float, name: str = p.name) -> float:
                return 1 - self.share((EffectSetting(effect.id, {**null, name: value}),))

            sizes = _sizes(p)
            if not sizes or missed(sizes[0]) == missed(sizes[-1]) == 1 - self.plain:
                continue  # alone it does nothing
            value = min(sizes, key=missed)
            ends = np.clip(p.null + (value - p.null) * np.array([1 / _STEP, _STEP]), p.lower, p.upper)
            finer = minimize_scalar(missed, bounds=np.sort(ends), method="bounded", options={"maxiter": _FINER})
            value = min((value, float(finer.x)), key=missed)
            if 1 - missed(value) > out[0]:
                out = (1 - missed(value), EffectSetting(effect.id, {**null, p.name: value}))
        return out


def _sizes(p: Parameter) -> list[float]:
    """Return sizes of a parameter from its usual one on, either way, within bounds."""
    steps = p.scale * _STEP ** np.arange(np.log(_LARGEST) / np.log(_STEP) + 1e-9)
    values = p.null + np.r_[-steps[::-1], steps]
    return [float(value) for value in values if p.lower <= value <= p.upper]


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
    nulls = {p.name: p.null for p in effects.by_id(lead.id).parameters}
    sizes = {} if again is None else {name: one for name, one in again.parameters.items() if one.hi90 > one.lo90}
    # Nothing may be left of it, by all of its intervals.
    if sizes and all(one.lo90 <= nulls[name] <= one.hi90 for name, one in sizes.items()):
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
