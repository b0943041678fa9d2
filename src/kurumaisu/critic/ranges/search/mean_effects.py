# SPDX-License-Identifier: BSD-3-Clause
"""What acts on the mean readings: found by its line, refitted by simulation, cleared of what only seemed to act."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from kurumaisu import effects
from kurumaisu.critic.ranges.search import block_evidence
from kurumaisu.critic.ranges.search.block_evidence import BlockComparison, Families, SetWithBlock
from kurumaisu.critic.ranges.search.dominant_effect import vanished_effects
from kurumaisu.critic.ranges.search.effect_sets import FittedForms, FormPosterior
from kurumaisu.critic.ranges.search.effect_settings import settings_of
from kurumaisu.critic.ranges.search.further_effects import FurtherEffects, further_effects
from kurumaisu.critic.ranges.search.misfits import Part
from kurumaisu.critic.ranges.search.normal_equations import Assembly, NormalEquations
from kurumaisu.critic.ranges.search.parameter_fit import ParameterFit, fit_parameters
from kurumaisu.critic.ranges.signals.form_error import FormFamily, form_family
from kurumaisu.types import FloatArray

_SETS, _DOUBTED = 60, 8  # likeliest sets, and effects of theirs, whose equations are doubted


@dataclass(frozen=True)
class MeanEffects:
    """What acts on the mean: the forms' fit; winner: a block beside it, if any, its coefficients and covariance.

    others: curves that what acts may follow instead; more: what of the fit was found when the rest of it was in place.
    """

    weighed: BlockComparison
    fit: FittedForms
    winner: SetWithBlock | None
    coefficients: FloatArray
    covariance: FloatArray
    others: Mapping[str, FormFamily] = field(default_factory=dict)
    more: FurtherEffects | None = None

    @property
    def found(self) -> FormPosterior:
        """The search's result with blocks in the running, before more was found."""
        return self.weighed.found

    @property
    def p(self) -> dict[str, float]:
        """The posterior of each effect."""
        return self.found.p if self.more is None else {**self.found.p, **self.more.found.p}

    @property
    def curve(self) -> bool:
        """Whether a curve acts, which is in no catalogue."""
        return self.winner is not None and self.winner.free.basis is not None

    def with_further(self, assembly: Assembly, normal: NormalEquations, more: FurtherEffects) -> MeanEffects:
        """Return the same with what acts beside it."""
        fit = more.added_to(self.fit)
        return replace(self, fit=fit, others=form_families(assembly, normal, [fit]), more=more)

    def parts(self) -> list[Part]:
        """Return what acts, one by one."""
        out = [Part(form.id, form.span, size) for form, size in self.fit.parts()]
        return [*out, Part(self.winner.free.id, self.winner.free.span, self.coefficients)] if self.winner else out


def form_families(
    assembly: Assembly, normal: NormalEquations, fits: Sequence[FittedForms], most: int | None = None
) -> dict[str, FormFamily]:
    """Return what the equations of the effects of some fits may miss, of the first ones if these are many.

    Of those on readings: geometry has one form, and what moves a laser on the robot is sought as curves of its pose.
    """
    out: dict[str, FormFamily] = {}
    for fit in fits:
        for form, size in fit.parts():
            if form.id not in out and _on_readings(form.id) and (most is None or len(out) < most):
                change = assembly.columns[:, :, form.span] @ size
                found = form_family(change, assembly.shots, assembly.marks.seen, normal.beam_noise.valid)
                if found is not None:
                    out[form.id] = found
    return out


def _on_readings(name: str) -> bool:
    return issubclass(effects.by_id(name), effects.ReadingEffect)


def with_doubt(assembly: Assembly, normal: NormalEquations, found: FormPosterior) -> tuple[NormalEquations, Families]:
    """Return the normal equations of all columns, and last of what the equations of the likeliest effects may miss."""
    families = form_families(assembly, normal, found.fits[:_SETS], _DOUBTED)
    spans, start = {}, assembly.columns.shape[2]
    for name, family in families.items():
        spans[name] = slice(start, start + family.size), family
        start += family.size
    return assembly.with_families(list(families.values())).full(normal), spans


def mean_effects(
    assembly: Assembly, normal: NormalEquations, found: FormPosterior, families: Families, *, posed: bool
) -> MeanEffects:
    """Return what acts by a search, with blocks in the running.

    families: what equations may miss, by effect; posed: whether curves of the laser's pose are in the running.
    """
    free = [each for each in assembly.free if posed or each.pose is None]
    weighed = block_evidence.compare_blocks(found, free, normal.gram, families)
    winner = weighed.winner
    if winner is None:
        others = form_families(assembly, normal, [weighed.fit])
        return MeanEffects(weighed, weighed.fit, None, np.empty(0), np.empty((0, 0)), others)
    fit, coefficients, covariance = block_evidence.fit_with_block(winner, normal.gram)
    return MeanEffects(weighed, fit, winner, coefficients, covariance, form_families(assembly, normal, [fit]))


def refitted(
    assembly: Assembly, normal: NormalEquations, made: MeanEffects, truth: tuple[float, float] | None
) -> ParameterFit:
    """Return what acts, refitted by simulation; truth: known sd of the reference [m, rad]."""
    settings = settings_of(assembly, made.fit)
    return fit_parameters(assembly, normal, made.fit.forms, settings, made.winner, made.others, truth)


def settled(
    assembly: Assembly, normal: NormalEquations, made: MeanEffects, fit: ParameterFit, truth: tuple[float, float] | None
) -> tuple[MeanEffects, ParameterFit]:
    """Return what acts without what its refit takes back, and with what acts beside it, refitted."""
    while made.winner is None:
        gone = vanished_effects(assembly, made.fit, fit)
        if gone:
            made = replace(made, fit=made.fit.without(gone))
        elif made.more is None and (more := further_effects(assembly, normal, made.found, made.fit, fit, made.others)):
            made = made.with_further(assembly, normal, more)
        else:
            break
        fit = refitted(assembly, normal, made, truth)
    return made, fit


def gain_of(made: MeanEffects, name: str) -> float:
    """Return the log evidence of the best set over the best one without an effect [nat]."""
    more = made.more.found if made.more is not None else None
    if more is not None and name in more.best.ids:
        sets = [(fit.ids, fit.score) for fit in more.fits]
    else:
        # A curve that does not lead by enough is out of the running here, too, as it is where p comes from.
        running = [rival for rival in made.weighed.rivals if made.curve or rival.free.basis is None]
        sets = [(fit.ids, fit.score) for fit in made.found.fits]
        sets += [(rival.fit.ids | {rival.free.id}, rival.log_posterior) for rival in running]
    own = max((score for ids, score in sets if name in ids), default=-np.inf)
    return float(own - max((score for ids, score in sets if name not in ids), default=-np.inf))
