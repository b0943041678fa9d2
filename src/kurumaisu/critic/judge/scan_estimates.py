# SPDX-License-Identifier: BSD-3-Clause
"""What was fitted to scans: as a model file has it, as causes of a verdict, and outside the catalogue in words."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np
from scipy.special import logsumexp

from kurumaisu import effects
from kurumaisu.critic.ranges.search import block_evidence
from kurumaisu.critic.ranges.search.block_evidence import BlockComparison, SetWithBlock
from kurumaisu.critic.ranges.search.normal_equations import NormalEquations
from kurumaisu.critic.scatter.curves import ScatterCurve
from kurumaisu.critic.scatter.scatter_search import ScatterEffect
from kurumaisu.critic.unknown.bases import Basis
from kurumaisu.critic.unknown.sentences import COVARIATES, shape_over
from kurumaisu.critic.unknown.shapes import DrawnCurve
from kurumaisu.critic.values.criticism import UNKNOWN_CHANNEL, UNKNOWN_POSE, UNKNOWN_SCATTER, StandIn
from kurumaisu.critic.values.policy import FORM_ERROR, NAMED
from kurumaisu.critic.values.verdict import NORMAL90, Cause, Estimate, Unknown
from kurumaisu.effects import Echoes
from kurumaisu.params import EffectSetting
from kurumaisu.types import FloatArray

# Share of the largest size that walls may be off by, beyond which all of them surely are of another map: of rooms about
# as large, half the walls lie near those of the other one. The same where the map lacks a part of what is there, too.
_ANOTHER, _ANOTHER_LACKS = 0.4, 0.2
_SAME = 3.0  # sds of a constant error within which it is another form's
_ROUNDED = 5e-4  # [m] half a step of usual readings, by which it differs if they were rounded before
_RAMP, _ALIKE = 20000, 1e-4  # readings that show what an effect does; [m] by which near and far ones may differ
_LACKS = 0.05  # share of readings of that part, at least
_LISTED = 3
# All others of RANGE_COVARIATES are angles.
_UNITS = dict.fromkeys(("range", "hit_x", "hit_y"), "m") | {"time": "s"}


def estimates_of(setting: EffectSetting, sds: Mapping[str, float]) -> dict[str, Estimate]:
    """Return what was fitted of an effect, with its 90 % intervals within bounds; sds: of the parameters fitted."""
    out = {}
    for p in effects.by_id(setting.id).parameters:
        if p.name in sds:
            value, half = setting.parameters[p.name], NORMAL90 * sds[p.name]
            out[p.name] = Estimate(value, max(value - half, p.lower), min(value + half, p.upper), p.unit)
    return out


def of_block(
    winner: SetWithBlock, coefficients: FloatArray, normal: NormalEquations
) -> tuple[EffectSetting, dict[str, Estimate]]:
    """Return a block as a model file has it, and the estimate of its size."""
    free = winner.free
    if free.basis is not None:
        return EffectSetting(free.id, free.basis.parameters(coefficients)), {}
    p = free.parameter
    assert p is not None
    at, low, high = (
        float(np.clip(p.null + p.scale * x, p.lower, p.upper)) for x in block_evidence.block_size(winner, normal.gram)
    )
    nulls = {each.name: each.null for each in effects.by_id(free.id).parameters}
    return EffectSetting(free.id, {**nulls, p.name: at}), {p.name: Estimate(at, low, high, p.unit)}


def another_map(winner: SetWithBlock | None, normal: NormalEquations, lacking: float) -> str | None:
    """Return words for walls that are surely farther off than a map's errors; None where none are.

    lacking: share of the readings that are of something else than the map has there.
    """
    p = None if winner is None else winner.free.parameter
    if winner is None or p is None:
        return None
    low = p.null + p.scale * block_evidence.block_size(winner, normal.gram)[1]
    if low < (_ANOTHER_LACKS if lacking > _LACKS else _ANOTHER) * p.upper:
        return None
    return (
        f"scans do not match the map, whose walls would be off by {low:.2g} m or more (1 sd), each in its own "
        f"direction; another place?"
    )


def with_scatter(
    causes: Sequence[Cause], settings: Mapping[str, EffectSetting], scatter: Sequence[ScatterEffect]
) -> tuple[tuple[Cause, ...], tuple[EffectSetting, ...]]:
    """Return causes and settings, also of what acts on the scatter."""
    known, out = {cause.id: cause for cause in causes}, dict(settings)
    for each in scatter:
        name, mean = each.setting.id, settings.get(each.setting.id)
        if each.p >= NAMED:
            known[name] = _joined(known.get(name), each)
        nulls = {p.name: p.null for p in effects.by_id(name).parameters}
        off = {} if mean is None else {key: value for key, value in mean.parameters.items() if value != nulls[key]}
        out[name] = EffectSetting(name, {**each.setting.parameters, **off})
    return tuple(known.values()), tuple(out.values())


def with_shifting_forms(
    causes: Sequence[Cause], settings: Mapping[str, EffectSetting], uncertain: Sequence[Cause] = ()
) -> tuple[tuple[Cause, ...], tuple[EffectSetting, ...]]:
    """Return causes and settings with a constant error taken for what it is: another cause's, in another form.

    Where a remainder is cut off, say, readings are too short by half a step. uncertain: what may be such an error.
    """
    for cause in causes:
        forms = effects.by_id(cause.id).forms
        for form in forms[1:] if cause.id in settings else ():
            usual, other = (_constant({**settings[cause.id].parameters, **each}, cause.id) for each in (forms[0], form))
            if usual is None or other is None:
                continue
            for shift in (*causes, *uncertain):
                if shift is not cause and _is_shift(shift, other - usual):
                    setting = EffectSetting(cause.id, {**settings[cause.id].parameters, **form})
                    whole = replace(cause, gain_nats=cause.gain_nats + shift.gain_nats)
                    rest = {name: one for name, one in settings.items() if name != shift.id} | {cause.id: setting}
                    return tuple(whole if one is cause else one for one in causes if one is not shift), (
                        *rest.values(),
                    )
    return tuple(causes), tuple(settings.values())


def _is_shift(cause: Cause, by: float) -> bool:
    """Tell whether a cause is a constant error [m] that is as large as this one, and is surely none of 0."""
    ends = [_constant({n: getattr(e, end) for n, e in cause.parameters.items()}, cause.id) for end in ("lo90", "hi90")]
    low, high = ends
    if low is None or high is None:
        return False
    sd = abs(high - low) / (2 * NORMAL90)
    return abs(0.5 * (low + high) - by) < _SAME * sd + _ROUNDED and _SAME * sd < abs(by)


def _constant(values: Mapping[str, float], name: str) -> float | None:
    """Return by how much [m] an effect moves readings on the mean, all alike but for its steps; None of any other."""
    effect = effects.by_id(name)
    if effect.random or not issubclass(effect, effects.ReadingEffect):
        return None
    nulls = {p.name: p.null for p in effect.parameters}
    ranges = np.linspace(1.0, 3.0, _RAMP)
    none = np.zeros(_RAMP)
    echoes = Echoes(0.0, none, ranges, none, none + 1, ranges, none, none, ranges)
    chain = effects.build_laser((EffectSetting(name, {**nulls, **values}),), np.random.default_rng(0))
    moved = (chain.read(echoes) - ranges).reshape(2, -1).mean(axis=1)
    return float(moved.mean()) if abs(moved[0] - moved[1]) < _ALIKE else None


def _joined(cause: Cause | None, scatter: ScatterEffect) -> Cause:
    parameters = {p.name: p for p in effects.by_id(scatter.setting.id).parameters}
    estimates = dict(cause.parameters) if cause is not None else {}
    for name, (below, above) in scatter.sds.items():
        p, value = parameters[name], scatter.setting.parameters[name]
        low, high = max(value - NORMAL90 * below, p.lower), min(value + NORMAL90 * above, p.upper)
        estimates[name] = Estimate(value, low, high, p.unit)
    nats = scatter.nats + (cause.gain_nats if cause is not None else 0.0)
    return Cause(scatter.setting.id, max(min(scatter.p, 1.0), cause.p if cause is not None else 0.0), estimates, nats)


def unknowns(weighed: BlockComparison, gram: FloatArray) -> Iterator[Unknown]:
    """Yield the curve that acts, and the next ones that could stand in for it."""
    seen: set[str] = set()
    first = () if weighed.winner is None else (weighed.winner,)
    for rival in (*first, *weighed.rivals):
        basis = rival.free.basis
        if basis is None or rival.free.id in seen or len(seen) == _LISTED:
            continue
        seen.add(rival.free.id)
        p = min(weighed.p[rival.free.id], 1.0)
        _, coefficients, covariance = block_evidence.fit_with_block(rival, gram)
        curve = DrawnCurve(basis, 1e3 * coefficients, 1e6 * covariance)
        channel, unit = (UNKNOWN_CHANNEL, "mm") if rival.free.pose is None else UNKNOWN_POSE[rival.free.pose]
        yield Unknown(channel, _called(basis), shape(curve, unit), p)


def unknown_scatter(curves: Sequence[ScatterCurve]) -> Iterator[Unknown]:
    """Yield the curve that the noise of readings follows, and the next ones that could stand in for it."""
    for one in curves[:_LISTED]:
        curve = DrawnCurve(one.basis, 100 * one.coefficients, 1e4 * one.covariance)
        yield Unknown(UNKNOWN_SCATTER, _called(one.basis), f"of the noise: {shape(curve, '%')}", one.p)


def stand_ins(curves: Sequence[ScatterCurve]) -> Iterator[StandIn]:
    """Yield curves of the noise that fit nearly as well as the likeliest: no curve is of the very form of what acts.

    Each with its posterior were those before it none.
    """
    for i, one in enumerate(curves):
        if i and one.nats > (1 - FORM_ERROR) * curves[0].nats:
            p = float(np.exp(one.nats - logsumexp([0.0, *(other.nats for other in curves[i:])])))
            (unknown,) = unknown_scatter([replace(one, p=p)])
            yield StandIn(unknown, one.setting, curves[0].setting.id)


def _called(basis: Basis) -> str:
    """Return what a reader calls a covariate: a column as the recording calls it."""
    name = basis.covariate
    return name.replace("_", " ") if name in effects.RANGE_COVARIATES else COVARIATES.get(name, (name,))[0]


def shape(curve: DrawnCurve, of: str) -> str:
    """Return a curve's shape with place and size, each with its 90 % interval; of: its unit."""
    name = curve.basis.covariate
    plain = "rad" if name in effects.RANGE_COVARIATES else COVARIATES.get(name, ("",))[-1]
    return shape_over(curve, _UNITS.get(name, plain), of)
