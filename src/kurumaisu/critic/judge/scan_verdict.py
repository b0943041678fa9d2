# SPDX-License-Identifier: BSD-3-Clause
"""Laser criticism from a recording to causes."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from kurumaisu import effects
from kurumaisu.critic.base.replay import extend
from kurumaisu.critic.judge.reference_faults import without_double_delay
from kurumaisu.critic.judge.scan_estimates import (
    another_map,
    estimates_of,
    of_block,
    stand_ins,
    unknown_scatter,
    unknowns,
    with_scatter,
    with_shifting_forms,
)
from kurumaisu.critic.judge.scan_experiment import every_id, shortcomings, supplying_experiment
from kurumaisu.critic.judge.scatter_verdict import MeanFit, Scatter, material, open_set, scatter_effects
from kurumaisu.critic.ranges.noise.scan_noise import CERTAIN, beyond_stated
from kurumaisu.critic.ranges.noise.shared_errors import pose_sds
from kurumaisu.critic.ranges.poses.creeping_stands import gather_stands
from kurumaisu.critic.ranges.scans import repeatability
from kurumaisu.critic.ranges.scans.gathering import why_not_usable
from kurumaisu.critic.ranges.search.confounding import Groups, confounded, merged
from kurumaisu.critic.ranges.search.effect_sets import FittedForms, FormPosterior, FormSearch
from kurumaisu.critic.ranges.search.large_effect import dominant_effect, large_effect, with_dominant
from kurumaisu.critic.ranges.search.mean_effects import (
    MeanEffects,
    gain_of,
    mean_effects,
    pose_curves_left,
    refitted,
    settled,
    with_doubt,
)
from kurumaisu.critic.ranges.search.misfits import alternatives, misfits, noise_rows
from kurumaisu.critic.ranges.search.normal_equations import Assembly, NormalEquations
from kurumaisu.critic.ranges.search.parameter_fit import ParameterFit, fit_parameters
from kurumaisu.critic.scatter.common_offset import own_sd
from kurumaisu.critic.values.criticism import LaserFinding, Pictures, Progress
from kurumaisu.critic.values.policy import FORM_ERROR, NAMED
from kurumaisu.critic.values.recording import Recording
from kurumaisu.critic.values.verdict import Cause, NextExperiment
from kurumaisu.params import EffectSetting, Model
from kurumaisu.types import FloatArray

MATERIAL = 1e-4  # [m] change, of the readings that it changes, below which an effect does not matter: a tenth of a step

_FEWEST = 200  # readings that tell anything: forty numbers of their scatter, five of each


@dataclass(frozen=True)
class _Question:
    """What is asked of the scans; ids: the effects that may be named, None for all."""

    recording: Recording
    model: Model
    progress: Progress
    ids: frozenset[str] | None

    def beside(self, setting: EffectSetting) -> Iterator[LaserFinding]:
        """Yield what the scans say with an effect in the model."""
        self.progress(f"laser: looking for more effects, with {setting.id} in the model")
        yield from scan_findings(self.recording, extend(self.model, [setting]), self.progress, self.ids)


def criticise_scans(
    recording: Recording, model: Model, progress: Progress, ids: frozenset[str] | None = None
) -> LaserFinding:
    """Return what the scans of a recording say against a model, or why they cannot; ids as of scan_findings."""
    *_, whole = scan_findings(recording, model, progress, ids)
    return whole


def scan_findings(
    recording: Recording, model: Model, progress: Progress, ids: frozenset[str] | None = None
) -> Iterator[LaserFinding]:
    """Yield what the scans of a recording say against a model by their mean readings, then all that they say.

    ids: the effects that may be named; None for all.
    """
    found = _findings(_Question(recording, model, progress, ids), posed=False)
    first = next(found)
    yield first
    yield next(found, first)


def _findings(question: _Question, *, posed: bool) -> Iterator[LaserFinding]:
    """Yield what the scans say, by their mean readings first if they have more to say.

    posed: whether the laser may be elsewhere than the reference says from the start on; else this is asked at the end.
    """
    recording, model, progress, ids = question.recording, question.model, question.progress, question.ids
    why = why_not_usable(recording)
    if why is not None:
        drive = supplying_experiment(model, every_id(), recording.truth) if recording.world is not None else None
        yield LaserFinding(refused=why, details=repeatability.sentences(recording, model), next_experiment=drive)
        return
    progress("laser: predicting the scans")
    assembly = Assembly(gather_stands(recording, model), ids)
    progress("laser: estimating the noise")
    normal = assembly.settle(recording.truth)
    if normal.readings < _FEWEST or assembly.shots.walls.stairs:
        yield LaserFinding(refused=_too_few(assembly, normal), details=repeatability.sentences(recording, model))
        return
    if (far := large_effect(assembly.shots, ids)) is not None:
        yield from _large_effect_first(question, assembly, normal, far)
        return
    progress("laser: comparing effects")
    normal, found = _searched(assembly, normal, recording.truth)
    normal, families = with_doubt(assembly, normal, found)
    made = mean_effects(assembly, normal, found, families, posed=posed)
    if (wrong := another_map(made.winner, normal, float(assembly.map_change.readings.mean()))) is not None:
        yield LaserFinding(wrong=wrong)
        return
    progress("laser: fitting the effects found")
    fit = refitted(assembly, normal, made, recording.truth)
    if (lead := _certain_lead(model, assembly, normal, made, fit)) is not None:
        evidence = (min(made.found.p[lead[0].id], 1.0), gain_of(made, lead[0].id))
        yield from _with_rest(question, assembly, normal, lead, evidence)
        return
    made, fit = settled(assembly, normal, made, fit, recording.truth)
    mean = MeanFit(assembly, normal, made, fit)
    if recording.truth is not None:
        beyond = beyond_stated(mean.noise_likelihood, recording.truth, fit.normal.scan_noise)
        # What equations nearly right leave of what acts looks like a reference that wanders, too.
        if beyond > max(CERTAIN, FORM_ERROR * made.fit.log_likelihood):
            progress("laser: the reference errs by more than is said")
            yield from _findings(replace(question, recording=replace(recording, truth=None)), posed=posed)
            return
    curves = ids is None or effects.SMOOTH in ids
    if curves and not posed and not made.curve and pose_curves_left(fit, normal):
        progress("laser: it is elsewhere than the reference says")
        yield from _findings(question, posed=True)
        return
    yield _finding(assembly, normal, made, fit, Scatter([], [], ()))
    yield _with_scatter(question, mean)


def _too_few(assembly: Assembly, normal: NormalEquations) -> str:
    """Return why scans say nothing: what their beams meet."""
    met = int(np.count_nonzero(np.isfinite(assembly.shots.measured) & np.isfinite(assembly.marks.seen.ranges)))
    if assembly.shots.walls.stairs:
        return (
            "the readings have the stairs that askew walls are in a map of pixels, as a simulator's do; stairs are all "
            "edges, and tell nothing: draw such walls as polygons, in the simulator, too"
        )
    return (
        f"only {normal.readings} of {met} readings of walls are away from edges of the map, fewer than the {_FEWEST} "
        "that tell anything. Walls made of many small blocks are all edges: draw them as long ones"
    )


def _large_effect_first(
    question: _Question, assembly: Assembly, normal: NormalEquations, far: EffectSetting
) -> Iterator[LaserFinding]:
    """Yield the findings where an effect is too large for lines to lead to it: it is placed, then the rest is seen."""
    form = next(form for form in assembly.forms if form.id == far.id)
    (placed,) = fit_parameters(assembly, normal, [form], [far], None, {}, question.recording.truth).settings
    evidence = (1.0, FormSearch([form], normal.gram).run().best.log_likelihood)
    yield from _with_rest(question, assembly, normal, placed, evidence)


def _searched(
    assembly: Assembly, normal: NormalEquations, truth: tuple[float, float] | None
) -> tuple[NormalEquations, FormPosterior]:
    """Return the normal equations and what acts by them, shapes refined between those of the grid."""
    found = FormSearch(assembly.forms, normal.gram).run()
    if any(form.at for form in found.best.forms):
        assembly.refine(found.best.forms, normal.beam_noise, normal.wary)
        shaped = [form for form in assembly.forms if form.start in {each.start for each in found.best.forms}]
        normal = assembly.settle(truth, shaped)
        found = FormSearch(assembly.forms, normal.gram).run()
    return normal, found


def _certain_lead(
    model: Model, assembly: Assembly, normal: NormalEquations, made: MeanEffects, fit: ParameterFit
) -> tuple[EffectSetting, dict[str, float]] | None:
    """Return the effect beside which nothing else can be seen until it is in place, with its sds; None without one."""
    lead = dominant_effect(assembly, normal, made.fit, fit)
    if lead is None or made.found.p[lead.id] < NAMED or any(own.id == lead.id for own in model.effects):
        return None
    return next(each for each in fit.settings if each[0] is lead)


def _with_scatter(question: _Question, mean: MeanFit) -> LaserFinding:
    """Return the finding of what acts on the mean and on the scatter, with what the report shows of it."""
    question.progress("laser: comparing effects on the scatter")
    assembly, normal, made = mean.assembly, mean.normal, mean.made
    own = own_sd(question.model.effects)
    scatter = scatter_effects(mean, question.recording, question.ids, own)
    heard = replace(scatter, effects=material(scatter, normal, own))
    finding = _finding(assembly, normal, made, mean.fit, heard)
    finding = without_double_delay(finding, assembly.shots.stamps, question.model)
    slight = tuple(each.setting.id for each in scatter.effects if each not in heard.effects)
    words = tuple(f"{name}: detectable, but too small to matter." for name in slight)
    finding = replace(finding, small=(*finding.small, *slight), details=(*finding.details, *words))
    finding = replace(finding, next_experiment=_next(finding, assembly, question.recording, question.model))
    shown, noise = misfits(assembly, normal, made.parts()), noise_rows(mean.fit.normal)
    return replace(finding, pictures=Pictures(shown, alternatives(made.found), noise, scatter.comparisons))


def _with_rest(
    question: _Question,
    assembly: Assembly,
    normal: NormalEquations,
    lead: tuple[EffectSetting, dict[str, float]],
    evidence: tuple[float, float],
) -> Iterator[LaserFinding]:
    """Yield an effect, which must be in place before the rest can be seen, with what else is found then.

    lead: its setting, and the sds of what was fitted; evidence: its posterior, and the log evidence of it [nat].
    """
    setting, sds = lead
    cause = Cause(setting.id, evidence[0], estimates_of(setting, sds), evidence[1])
    size = size_of(assembly.marks.together([setting])[normal.beam_noise.valid])
    for rest in question.beside(setting):
        said = tuple(line for line in rest.details if not line.startswith(f"{setting.id}: "))  # of what was left of it
        found = with_dominant(replace(rest, details=said), setting, cause, assembly, normal)
        if any(each.id == setting.id for each in found.causes):
            found = replace(found, details=(*said, *_sentences({setting.id: size}, ())))
        yield without_double_delay(found, assembly.shots.stamps, question.model)


def _next(finding: LaserFinding, assembly: Assembly, recording: Recording, model: Model) -> NextExperiment | None:
    """Return the experiment that tells apart what the scans cannot, or that supplies what they lack."""
    open_ids = sorted({name for group in finding.confounded for name in group})
    if not open_ids and not shortcomings(assembly):
        return None
    return supplying_experiment(model, open_ids or every_id(), recording.truth)


def _finding(
    assembly: Assembly, normal: NormalEquations, made: MeanEffects, fit: ParameterFit, scatter: Scatter
) -> LaserFinding:
    p = made.p
    sizes = {form.id: _rms(assembly, normal, made.fit, form.id) for form in made.fit.forms}
    settings = {setting.id: setting for setting, _ in fit.settings}
    estimates = {setting.id: estimates_of(setting, sds) for setting, sds in fit.settings}
    if made.winner is not None:
        free = made.winner.free
        valid = normal.beam_noise.valid
        sizes[free.id] = size_of(assembly.columns[valid][:, free.span] @ made.coefficients)
        if free.pose is None:  # else whether the laser moves or the reference errs, the scans alone do not tell
            settings[free.id], estimates[free.id] = of_block(made.winner, made.coefficients, normal)
    matters = {name for name, size in sizes.items() if size >= MATERIAL}
    settings = {name: setting for name, setting in settings.items() if name in matters}
    curve = made.winner is not None and made.curve and made.winner.free.id in matters
    gains = {name: gain_of(made, name) for name in settings if p.get(name, 0.0) >= NAMED}
    # A curve is what one covariate shows of a thing nobody knows: what it leaves may be as much, and looks like others.
    least = made.winner.evidence.nats if made.winner is not None and curve else -np.inf
    causes = tuple(
        Cause(name, min(p[name], 1.0), estimates[name], gain) for name, gain in gains.items() if gain >= least
    )
    # Of the scans as they are seen with what acts: a laser that is askew looks past the ends of walls.
    unknown = tuple(fit.assembly.unknowns())
    unknown += tuple(unknowns(made.weighed, normal.gram)) if curve else ()
    unknown += tuple(unknown_scatter(scatter.curves))
    groups = () if curve else _confused(assembly, normal, made, causes)
    confounded = tuple(group for group in groups if matters & set(group))
    causes = tuple(cause for cause in causes if not any(cause.id in group for group in confounded))
    small = tuple(name for name in sizes if name not in matters and p.get(name, 0.0) >= NAMED)
    passing = fit.assembly.passing_objects
    details = (_noise_sentences(assembly, fit.normal), *shortcomings(assembly), *_sentences(sizes, small))
    details += (f"laser: {passing.words}: its readings are set aside.",) if passing.many else ()
    causes, added = with_scatter(causes, settings, scatter.effects)
    open_ids = {name for group in confounded for name in group if name in estimates}
    uncertain = [Cause(name, p[name], estimates[name], gain_of(made, name)) for name in sorted(open_ids)]
    causes, added = with_shifting_forms(causes, {setting.id: setting for setting in added}, uncertain)
    placed = open_ids - {setting.id for setting in added}
    confounded = tuple(group for group in confounded if not placed & set(group))
    confounded += tuple(group for group in map(open_set, scatter.effects) if group)
    added += tuple(each.setting for each in scatter.curves[:1])
    nats, others = max((one.nats for one in scatter.curves), default=0.0), tuple(stand_ins(scatter.curves))
    return LaserFinding(causes, confounded, unknown, added, details, small=small, nats=nats, stand_ins=others)


def _confused(assembly: Assembly, normal: NormalEquations, made: MeanEffects, causes: Sequence[Cause]) -> Groups:
    # Of a set, too: what explains the readings as well as its likeliest member belongs to it.
    open_ids = {name for group in made.found.confounded for name in group}
    later = made.more.found.best.ids if made.more is not None else frozenset()
    names = [*(cause.id for cause in causes if cause.id not in later), *sorted((open_ids & made.fit.ids) - later)]
    groups = merged(made.found.confounded, confounded(made.found, made.winner, assembly.free, normal.gram, names))
    return groups if made.more is None else merged(groups, made.more.groups)


def _noise_sentences(assembly: Assembly, normal: NormalEquations) -> str:
    noise, beam = normal.scan_noise, normal.beam_noise
    position_sd, _, heading_sd = pose_sds(noise).tolist()
    return (
        f"laser: {normal.readings} readings of {len(assembly.shots.stamps)} scans. Noise: neighbours correlate by "
        f"{beam.rho:.2f}, whole scans {1e3 * noise.common_sd:.2g} mm over {noise.common_tau:.2g} s, "
        f"single beams {1e3 * beam.own_sd:.2g} mm, reference {1e3 * position_sd:.2g} mm and "
        f"{1e3 * heading_sd:.2g} mrad."
    )


def _sentences(sizes: Mapping[str, float], small: Sequence[str]) -> list[str]:
    return [
        f"{name}: changes the readings it affects by {1e3 * size:.2g} mm"
        f"{': detectable, but too small to matter' if name in small else ''}."
        for name, size in sorted(sizes.items())
    ]


def _rms(assembly: Assembly, normal: NormalEquations, fit: FittedForms, name: str) -> float:
    valid = normal.beam_noise.valid
    change = np.zeros(int(valid.sum()))
    for form, size in fit.parts():
        if form.id == name:
            change = assembly.columns[valid][:, form.span] @ size
    return size_of(change)


def size_of(change: FloatArray) -> float:
    """Return how far [m] an effect moves the readings that it moves: of dark walls, say, not divided by all."""
    power = change.astype(float) ** 2
    return float(np.sqrt(np.sum(power**2) / max(float(np.sum(power)), 1e-300)))
