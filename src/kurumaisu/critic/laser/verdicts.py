# SPDX-License-Identifier: BSD-3-Clause
"""Laser criticism from a recording to causes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from kurumaisu import effects
from kurumaisu.critic.laser import still
from kurumaisu.critic.laser.normal import Assembly, Normal
from kurumaisu.critic.laser.search import Fitted, Found, Search
from kurumaisu.critic.laser.shots import gather, missing
from kurumaisu.critic.laser.spread import Scatter, ScatterSearch, Simulator
from kurumaisu.critic.laser.statistics import Statistics
from kurumaisu.critic.naming import NAMED
from kurumaisu.critic.recording import Recording
from kurumaisu.critic.verdict import Cause, Estimate
from kurumaisu.params import EffectSetting, Model

MATERIAL = 3e-4  # [m] rms change of the readings below which an effect of the laser does not matter
_SCATTERED = 60  # scans whose scatter is looked at: each simulation of them takes a hundredth of a second
_NORMAL90 = 1.645  # half width of a 90 % interval, in standard deviations
Progress = Callable[[str], None]


@dataclass(frozen=True)
class LaserFinding:
    """What the scans say.

    causes: named and material; confounded: sets of which one acts; settings: what extends the model; details: for
    the report, in words; refused: why there is no laser criticism, None where there is.
    """

    causes: tuple[Cause, ...] = ()
    confounded: tuple[tuple[str, ...], ...] = ()
    settings: tuple[EffectSetting, ...] = ()
    details: tuple[str, ...] = ()
    refused: str | None = None


def criticise(
    recording: Recording, model: Model, progress: Progress, ids: frozenset[str] | None = None
) -> LaserFinding:
    """Return what the scans of a recording say against a model, or why they cannot.

    ids: the effects that may be named; None for all.
    """
    why = missing(recording)
    if why is not None:
        return LaserFinding(refused=why, details=still.words(recording, model))
    progress("laser: predicting the scans")
    assembly = Assembly(gather(recording, model), ids)
    progress("laser: estimating the noise")
    normal = assembly.settle(recording.truth)
    progress("laser: weighing effects")
    found = Search(assembly.forms, normal.gram).run()
    if found.best.forms:
        assembly.refine(found.best.forms, normal.beam_noise, normal.scan_noise)
        shaped = [form for form in assembly.forms if form.start in {each.start for each in found.best.forms}]
        normal = assembly.settle(recording.truth, shaped)
        found = Search(assembly.forms, normal.gram).run()
    progress("laser: weighing effects on the scatter")
    scatter = _scatter(assembly, normal, found, ids)
    return _finding(assembly, normal, found, scatter)


def _scatter(assembly: Assembly, normal: Normal, found: Found, ids: frozenset[str] | None) -> list[Scatter]:
    """Return the effects on how readings scatter about the best fit of their mean."""
    use = np.concatenate([np.arange(0), *(np.arange(form.span.start, form.span.stop) for form in found.best.forms)])
    error = assembly.residual - assembly.columns[:, :, use.astype(int)] @ found.best.coefficients
    few = assembly.thinned(_SCATTERED)
    rows = np.unique(np.linspace(0, len(error) - 1, _SCATTERED).astype(int))
    statistics = Statistics(few, normal.scan_noise)
    means = {f"{form.id}.{column.parameter.name}" for form in assembly.forms for column in form.columns}
    means |= {f"{form.id}.{name}" for form in assembly.forms for name in form.at}
    measured = few.shots.measured
    seen = statistics.of(measured, np.where(np.isfinite(measured), error[rows], np.nan))
    return ScatterSearch(Simulator(few, statistics), seen, sorted(means), ids).run()


def _finding(assembly: Assembly, normal: Normal, found: Found, scatter: list[Scatter]) -> LaserFinding:
    sizes = {form.id: _rms(assembly, normal, found.best, form.id) for form in found.best.forms}
    matters = {name for name, size in sizes.items() if size >= MATERIAL}
    settings = tuple(setting for setting in _settings(assembly, found.best) if setting.id in matters)
    by_id = {setting.id: setting for setting in settings}
    causes = tuple(
        Cause(name, min(found.p[name], 1.0), _estimates(found.best, by_id[name]), _gain(found, name))
        for name in found.named
        if name in matters
    )
    confounded = tuple(group for group in found.confounded if matters & set(group))
    noise = normal.scan_noise
    details = (
        f"laser: {normal.readings} readings of {len(assembly.shots.stamps)} scans; noise of neighbours correlates by "
        f"{normal.beam_noise.rho:.2f}, of whole scans {1e3 * noise.common_sd:.2g} mm over {noise.common_tau:.2g} s, of "
        f"the reference {1e3 * noise.position_sd:.2g} mm and {1e3 * noise.heading_sd:.2g} mrad.",
        *(f"{name}: changes the readings by {1e3 * size:.2g} mm (rms)." for name, size in sorted(sizes.items())),
    )
    known = {cause.id: cause for cause in causes}
    for each in scatter:
        if each.p >= NAMED:
            known[each.setting.id] = _joined(known.get(each.setting.id), each)
    joined = {setting.id: setting for setting in settings}
    for each in scatter:
        mean = joined.get(each.setting.id)
        at = {**each.setting.parameters, **(_off_null(mean) if mean else {})}
        joined[each.setting.id] = EffectSetting(each.setting.id, at)
    return LaserFinding(tuple(known.values()), confounded, tuple(joined.values()), details)


def _off_null(setting: EffectSetting) -> dict[str, float]:
    nulls = {p.name: p.null for p in effects.by_id(setting.id).parameters}
    return {name: value for name, value in setting.parameters.items() if value != nulls[name]}


def _joined(cause: Cause | None, scatter: Scatter) -> Cause:
    parameters = {p.name: p for p in effects.by_id(scatter.setting.id).parameters}
    estimates = dict(cause.parameters) if cause is not None else {}
    for name, sd in scatter.sds.items():
        p, value, half = parameters[name], scatter.setting.parameters[name], _NORMAL90 * sd
        estimates[name] = Estimate(value, max(value - half, p.lower), min(value + half, p.upper), p.unit)
    nats = scatter.nats + (cause.gain_nats if cause is not None else 0.0)
    return Cause(scatter.setting.id, max(min(scatter.p, 1.0), cause.p if cause is not None else 0.0), estimates, nats)


def _rms(assembly: Assembly, normal: Normal, fit: Fitted, name: str) -> float:
    valid = normal.beam_noise.valid
    change, start = np.zeros(int(valid.sum())), 0
    for form in fit.forms:
        stop = start + len(form.columns)
        if form.id == name:
            change = assembly.columns[valid][:, form.span] @ fit.coefficients[start:stop]
        start = stop
    return float(np.sqrt(np.mean(change**2)))


def _settings(assembly: Assembly, fit: Fitted) -> list[EffectSetting]:
    """Return the fitted effects as a model file has them."""
    out, start = [], 0
    for form in fit.forms:
        at = fit.coefficients[start : start + len(form.columns)]
        start += len(form.columns)
        effect = effects.by_id(form.id)
        if len(form.columns) > 1 and form.columns[0].beside:
            nulls = {p.name: p.null for p in effect.parameters}
            out.append(EffectSetting(form.id, {**nulls, **assembly.marks.joined(form, at)}))
            continue
        values = {p.name: p.null for p in effect.parameters}
        for column, coefficient in zip(form.columns, at.tolist(), strict=True):
            p = column.parameter
            values[p.name] = p.null + p.scale * (np.sqrt(coefficient) if column.squared else coefficient)
        out.append(EffectSetting(form.id, {**values, **form.at}))
    return out


def _estimates(fit: Fitted, setting: EffectSetting) -> dict[str, Estimate]:
    out, start = {}, 0
    for form in fit.forms:
        for i, column in enumerate(form.columns):
            if form.id == setting.id:
                p = column.parameter
                value, half = setting.parameters[p.name], _NORMAL90 * p.scale * float(fit.sds[start + i])
                out[p.name] = Estimate(value, max(value - half, p.lower), min(value + half, p.upper), p.unit)
        start += len(form.columns)
    return out


def _gain(found: Found, name: str) -> float:
    """Return the log evidence of the best set over the best one without an effect [nat]."""
    without = max((fit.score for fit in found.fits if name not in fit.ids), default=-np.inf)
    return found.best.score - without
