# SPDX-License-Identifier: BSD-3-Clause
"""What acts on the mean readings: found by its line, refitted by simulation, cleared of what only seemed to act."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from kurumaisu.critic.ranges.search import block_evidence
from kurumaisu.critic.ranges.search.block_evidence import Rival, Weighed
from kurumaisu.critic.ranges.search.dominant_effect import taken_back
from kurumaisu.critic.ranges.search.effect_sets import Fitted, Found
from kurumaisu.critic.ranges.search.effect_settings import settings_of
from kurumaisu.critic.ranges.search.false_seconds import company, forms_beside
from kurumaisu.critic.ranges.search.further_effects import Besides, besides
from kurumaisu.critic.ranges.search.misfits import Part
from kurumaisu.critic.ranges.search.normal_equations import Assembly, Normal
from kurumaisu.critic.ranges.search.parameter_fit import Pinned, pinned
from kurumaisu.critic.ranges.signals.form_error import OtherForm
from kurumaisu.types import FloatArray


@dataclass(frozen=True)
class Acting:
    """What acts on the mean: the forms' fit; winner: a block beside it, if any, its coefficients and covariance.

    others: curves that what acts may follow instead; more: what of the fit was found when the rest of it was in place.
    """

    weighed: Weighed
    fit: Fitted
    winner: Rival | None
    coefficients: FloatArray
    covariance: FloatArray
    others: Mapping[str, OtherForm] = field(default_factory=dict)
    more: Besides | None = None

    @property
    def found(self) -> Found:
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

    def beside(self, assembly: Assembly, normal: Normal) -> Acting:
        """Return the same without effects that others of another form explain; of a curve, which is unlike any, all."""
        made = replace(self, others=forms_beside(assembly, normal, self.fit))
        if self.curve:
            return made
        fit, winner = company(assembly, normal, self.found, (self.fit, self.winner), made.others)
        if fit is self.fit and winner is self.winner:
            return made
        if winner is None:
            return replace(made, fit=fit, winner=None, coefficients=np.empty(0), covariance=np.empty((0, 0)))
        fit, winner, coefficients, covariance = _with(winner, normal)
        return replace(made, fit=fit, winner=winner, coefficients=coefficients, covariance=covariance)

    def and_more(self, assembly: Assembly, normal: Normal, more: Besides) -> Acting:
        """Return the same with what acts beside it."""
        fit = more.added_to(self.fit)
        return replace(self, fit=fit, others=forms_beside(assembly, normal, fit), more=more)

    def parts(self) -> list[Part]:
        """Return what acts, one by one."""
        out, start = [], 0
        for form in self.fit.forms:
            stop = start + len(form.columns)
            out.append(Part(form.id, form.span, self.fit.coefficients[start:stop]))
            start = stop
        return [*out, Part(self.winner.free.id, self.winner.free.span, self.coefficients)] if self.winner else out


def acting(assembly: Assembly, normal: Normal, found: Found) -> Acting:
    """Return what acts by a search, with blocks in the running."""
    weighed = block_evidence.weigh(found, assembly.free, normal.gram)
    winner = weighed.winner
    if winner is None:
        return Acting(weighed, found.best, None, np.empty(0), np.empty((0, 0)))
    return Acting(weighed, *_with(winner, normal))


def _with(winner: Rival, normal: Normal) -> tuple[Fitted, Rival, FloatArray, FloatArray]:
    fit, coefficients, covariance = block_evidence.joint(winner, normal.gram)
    return fit, winner, coefficients, covariance


def refitted(assembly: Assembly, normal: Normal, made: Acting, truth: tuple[float, float] | None) -> Pinned:
    """Return what acts, refitted by simulation; truth: known sd of the reference [m, rad]."""
    settings = settings_of(assembly, made.fit)
    return pinned(assembly, normal, made.fit.forms, settings, made.winner, made.others, truth)


def cleared(
    assembly: Assembly, normal: Normal, made: Acting, fit: Pinned, truth: tuple[float, float] | None
) -> tuple[Acting, Pinned]:
    """Return what acts without what its refit takes back, and with what acts beside it, refitted."""
    while made.winner is None:
        gone = taken_back(assembly, made.fit, fit)
        if gone:
            made = replace(made, fit=made.fit.without(gone))
        elif made.more is None and (more := besides(assembly, normal, made.found, made.fit, fit, made.others)):
            made = made.and_more(assembly, normal, more)
        else:
            break
        fit = refitted(assembly, normal, made, truth)
    return made, fit


def gain_of(made: Acting, name: str) -> float:
    """Return the log evidence of the best set over the best one without an effect [nat]."""
    more = made.more.found if made.more is not None else None
    if more is not None and name in more.best.ids:
        sets = [(fit.ids, fit.score) for fit in more.fits]
    else:
        # A curve that does not lead by enough is out of the running here, too, as it is where p comes from.
        running = [rival for rival in made.weighed.rivals if made.curve or rival.free.basis is None]
        sets = [(fit.ids, fit.score) for fit in made.found.fits]
        sets += [(rival.fit.ids | {rival.free.id}, rival.worth) for rival in running]
    own = max((worth for ids, worth in sets if name in ids), default=-np.inf)
    return float(own - max((worth for ids, worth in sets if name not in ids), default=-np.inf))
