# SPDX-License-Identifier: BSD-3-Clause
"""Curves against the catalogue on the same data: the posterior over sets of effects with and without a curve."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import expit, logsumexp

from kurumaisu.critic.engine import coarsened_posterior
from kurumaisu.critic.engine.catalogue import Candidate
from kurumaisu.critic.engine.evidence import Fit, Problem
from kurumaisu.critic.engine.search import SearchResult
from kurumaisu.critic.unknown.curves import Curve, CurveEvidence, Design, curve_evidence, own_span
from kurumaisu.critic.unknown.designs import Designs
from kurumaisu.critic.unknown.effect_likeness import EffectLikeness
from kurumaisu.critic.unknown.fine_curves import fine_curves
from kurumaisu.critic.unknown.step_curves import gains_over_own_rate, step_curves
from kurumaisu.critic.values.prior import UNKNOWN_ODDS
from kurumaisu.types import FloatArray

# [nat] by which a curve must beat the best set of the catalogue, as many times more as evidence beside that is doubted
_BEYOND = 3.0
# The same where the catalogue has nothing: what effects of other forms leave is no danger then, and draws of noise are
# asked besides.
_OVER_NOTHING = 1.0
_BEHIND = 10.0  # [nat] behind the best set from which a curve that draws several of its effects speaks for them
_SHARE = 0.002  # posterior, as far as it is believed, from which it is asked which effect a curve draws
_FITS = 10  # sets of the catalogue beside which curves are tried
_JUMPING = 0.2  # share of what is outside the catalogue that jumps
_BENDING = 0.2  # share of it that bends more often than a usual curve can
_ROUNDED = 1e-9  # share of what a curve does that may be left beside a set by rounding, or less than nothing be
_HINTS = 3  # curves beside a set that are tried so: most of a jump shows in a curve that cannot jump


@dataclass(frozen=True)
class SetWithCurve:
    """A set of effects with a curve beside it: log posterior, not normalised."""

    fit: Fit
    curve: Curve
    evidence: CurveEvidence
    log_posterior: float


@dataclass(frozen=True)
class CurveComparison:
    """Result of the comparison.

    rivals: best first, but for those that draw an effect of the catalogue in another form, and so speak for that;
    lead: of the best one over the best set without a curve, or with one that so speaks for an effect [nat];
    p: posterior of each curve by the id of its effect; odds: log odds that each effect of the catalogue acts, with
    curves in the running, which a probability near 1 cannot say; p_nothing: that there is neither; least: lead of a
    curve that beats the catalogue [nat].
    """

    rivals: tuple[SetWithCurve, ...]
    lead: float
    p: dict[str, float]
    odds: dict[str, float]
    p_nothing: float
    least: float = _BEYOND

    @property
    def p_effects(self) -> dict[str, float]:
        """Return the posterior of each effect of the catalogue, with curves in the running."""
        return {name: float(expit(odds)) for name, odds in self.odds.items()}

    @property
    def winner(self) -> SetWithCurve | None:
        """Return the best set with a curve, if it beats the catalogue."""
        return self.rivals[0] if self.rivals and self.lead > self.least else None


def no_curves(found: SearchResult) -> CurveComparison:
    """Return the result where no curve can act: the catalogue's own."""
    sets = [(coarsened_posterior.of_set(found, fit), fit.ids) for fit in found.fits]
    return CurveComparison((), -np.inf, {}, _odds(sets, found.p), 1.0 - max(found.p.values(), default=0.0))


def compare(problem: Problem, found: SearchResult, also: frozenset[Candidate] = frozenset()) -> CurveComparison:
    """Try every curve beside the best sets of the catalogue, beside none, and beside one more."""
    designs = Designs(problem, found.best)
    bare = [(fit, coarsened_posterior.of_set(found, fit)) for fit in found.fits]
    rivals = sorted(_with_curves(problem, designs, _tried(bare, also)), key=lambda rival: -rival.log_posterior)
    if not rivals:
        return no_curves(found)
    plain = np.array([score + np.log1p(-UNKNOWN_ODDS) for _, score in bare])
    total = logsumexp(np.concatenate([plain, [rival.log_posterior for rival in rivals]]))
    acting = [(float(w), fit.ids) for (fit, _), w in zip(bare, plain, strict=True)]
    likeness, ceiling = EffectLikeness(problem, found.best, designs), float(plain.max())
    beyond: list[SetWithCurve] = []
    own = ceiling  # of the catalogue, its effects in other forms included
    doubt = coarsened_posterior.variance(found)
    for rival in rivals:
        share = float(np.exp(rival.log_posterior - total))
        asked = (rival.log_posterior - total) / doubt > np.log(_SHARE)
        draws = likeness.drawn(rival.fit, rival.curve, rival.evidence) if asked else {}
        if asked and rival.log_posterior - ceiling > _BEYOND:  # else it is no news, and nobody asks whose form it mends
            draws = draws or likeness.mended(rival.fit, rival.curve)
            draws = draws or likeness.drawn_alone(rival.fit, rival.curve, rival.evidence)
        if asked and rival.log_posterior < ceiling - _BEHIND:
            draws = draws or likeness.drawn_together(rival.fit, rival.curve, rival.evidence)
        drawn = {name for name, nats in draws.items() if rival.log_posterior - ceiling < _BEYOND + nats}
        wins = not drawn and rival.log_posterior - ceiling > _BEYOND and share > _SHARE
        part = likeness.part_of(rival.fit, rival.curve) if wins else set()
        acting.append((rival.log_posterior, (rival.fit.ids - part) | drawn))
        beyond += [] if drawn else [rival]
        own = max(own, rival.log_posterior) if drawn else own
    curves: dict[str, float] = {}
    for rival in beyond:
        curves[rival.curve.id] = curves.get(rival.curve.id, 0.0) + float(np.exp(rival.log_posterior - total))
    lead = beyond[0].log_posterior - own if beyond else -np.inf
    nothing = float(sum(np.exp(w - total) for (fit, _), w in zip(bare, plain, strict=True) if not fit.ids))
    least = _BEYOND * doubt if found.best.ids else _OVER_NOTHING
    return CurveComparison(tuple(beyond), lead, curves, _odds(acting, found.p), nothing, least)


def _odds(acting: Sequence[tuple[float, frozenset[str]]], names: Iterable[str]) -> dict[str, float]:
    """Return the log odds of effects from log weights, of any sum, and the effects that act at each."""
    weights = np.array([weight for weight, _ in acting])
    out = {}
    for name in names:
        there = np.array([name in ids for _, ids in acting], dtype=np.bool_)
        sides = (weights[there], weights[~there])
        log, against = (float(logsumexp(side)) if len(side) else -np.inf for side in sides)
        out[name] = log - against
    return out


def _tried(bare: Sequence[tuple[Fit, float]], also: frozenset[Candidate]) -> list[tuple[Fit, float]]:
    """Return the best sets, the best one without each of its effects, the empty one, and one more."""
    ranked = sorted(bare, key=lambda pair: -pair[1])
    wanted: set[frozenset[Candidate]] = {frozenset(), also}
    wanted |= {ranked[0][0].candidates - {one} for one in ranked[0][0].candidates}
    return ranked[:_FITS] + [pair for pair in ranked[_FITS:] if pair[0].candidates in wanted]


def _with_curves(problem: Problem, designs: Designs, fits: Sequence[tuple[Fit, float]]) -> Iterator[SetWithCurve]:
    grams: dict[Design, list[FloatArray]] = {}
    plain = float(np.log1p(-_JUMPING - _BENDING))
    for fit, score in fits:
        design = designs.about(fit)
        if design not in grams:
            grams[design] = [_gram(design.columns[:, curve.columns]) for curve in design.curves]
        share = float(np.log(UNKNOWN_ODDS / max(len(design.curves), 1)))
        y, own = own_span(problem, fit)
        beside: list[SetWithCurve] = []
        # Of columns without what the fit can take up: normal equations, of which only a little changes with the fit.
        products = np.column_stack([own, y]).T @ design.columns
        cross, b = products[:-1], products[-1]
        for curve, gram in zip(design.curves, grams[design], strict=True):
            part = cross[:, curve.columns]
            left = gram - part.T @ part + _ROUNDED * np.diag(np.diag(gram))
            found = curve_evidence(left, b[curve.columns], curve.basis.priors)
            # All curves of a kind that the data chose from share what one has.
            chosen = replace(found, nats=found.nats - float(np.log(curve.basis.ways)))
            beside.append(SetWithCurve(fit, designs.paced(fit, curve), chosen, score + chosen.nats + share + plain))
        yield from beside
        if fit.ids <= fits[0][0].ids:  # in its place an effect may have taken up the jump
            hints = [rival.curve for rival in sorted(beside, key=lambda rival: -rival.log_posterior)[:_HINTS]]
            for curve, found in fine_curves(problem, fit, hints):
                yield SetWithCurve(fit, curve, found, score + found.nats + share + float(np.log(_BENDING)))
            for curve, found in step_curves(
                problem, fit, [*hints, *(c for c in gains_over_own_rate(design.curves) if c not in hints)]
            ):
                yield SetWithCurve(fit, curve, found, score + found.nats + share + float(np.log(_JUMPING)))


def _gram(columns: FloatArray) -> FloatArray:
    return np.asarray(columns.T @ columns)
