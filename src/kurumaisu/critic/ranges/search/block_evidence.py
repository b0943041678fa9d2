# SPDX-License-Identifier: BSD-3-Clause
"""Blocks of many coefficients against sets of few, on the same normal equations."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import block_diag
from scipy.special import logsumexp

from kurumaisu import effects
from kurumaisu.critic.engine.form_error import SHARES
from kurumaisu.critic.ranges.search.effect_sets import LINE_ERROR, WEAK_PRIOR, FittedForms, FormPosterior, confusion
from kurumaisu.critic.ranges.signals.coefficient_blocks import Block
from kurumaisu.critic.ranges.signals.form_error import FormFamily, Shares, integrated_out, over_shares, priors_in
from kurumaisu.critic.unknown.bases import root_of
from kurumaisu.critic.unknown.curves import ALIKE, AS_ALIKE, CurveEvidence, curve_evidence
from kurumaisu.critic.values.policy import UNKNOWN_ODDS, odds
from kurumaisu.types import FloatArray, IntArray

BEYOND = 3.0  # [nat] by which a curve must beat the best set of the catalogue, where nothing may act at all
CERTAIN = 12.0  # [nat] over nothing, from which something acts
LEFT = 0.05  # share of a curve's evidence that the curve itself may leave to other effects
_FITS = 10  # best sets beside which blocks are tried
_SINGLES = 12  # best single effects likewise
_PRUNED = 3  # best sets with a block that are pruned
_FARTHEST = 3.0  # sds of a block's coefficients, beyond which hardly one lies
_NEAR = 30.0  # [nat] behind the likeliest, beyond which nobody asks what a curve draws
_ALIKE_OVER = float(np.sqrt(0.5))  # as ALIKE, where both follow the same: half of what it does
_SIZES = np.geomspace(1e-3, 1e2, 400)  # of the sd of a block's coefficients, in units of its scale

Families = Mapping[str, tuple[slice, FormFamily]]  # by effect: what its equation may miss, and where its columns are


@dataclass(frozen=True)
class SetWithBlock:
    """A set of forms with a block beside it: log posterior, not normalised.

    form_of: the effect that its curve draws, in another form than the catalogue's.
    """

    fit: FittedForms
    free: Block
    evidence: CurveEvidence
    log_posterior: float
    form_of: str | None = None

    @property
    def unknown(self) -> bool:
        """Whether the block is a curve that draws no effect of the catalogue."""
        return self.free.basis is not None and self.form_of is None

    @property
    def ids(self) -> frozenset[str]:
        """The effects of the catalogue that act in it."""
        drawn = self.free.id if self.free.basis is None else self.form_of
        return self.fit.ids if drawn is None else self.fit.ids | {drawn}


@dataclass(frozen=True)
class BlockComparison:
    """found: with blocks in the running; rivals: best first; lead: of the best curve over all without one [nat].

    p: posterior of each curve.
    """

    found: FormPosterior
    rivals: tuple[SetWithBlock, ...]
    lead: float
    p: dict[str, float]

    @property
    def least(self) -> float:
        """Lead that a curve needs [nat]: none where something acts for sure, but for what a line misses of geometry."""
        nothing = max((fit.score for fit in self.found.fits if not fit.forms), default=0.0)
        curve = next((rival for rival in self.rivals if rival.unknown), None)
        over = 0.0 if curve is None else curve.log_posterior - nothing
        geometry = any(not issubclass(effects.by_id(name), effects.ReadingEffect) for name in self.found.best.ids)
        if geometry and curve is not None and curve.free.pose is None:
            return max(BEYOND, LEFT * over)
        return BEYOND if over < CERTAIN else 0.0

    @property
    def fit(self) -> FittedForms:
        """The effects that act where no block does: of which one may have another form, which a curve drew."""
        drawn = next((rival for rival in self.rivals if rival.form_of in rival.fit.ids), None)
        best = self.found.best
        return best if drawn is None or drawn.log_posterior <= best.score else drawn.fit

    @property
    def winner(self) -> SetWithBlock | None:
        """The block that acts, if any: a curve only if it is far better than the catalogue."""
        curve = next((rival for rival in self.rivals if rival.unknown), None)
        if curve is not None and self.lead > self.least:
            return self._plainest(curve)
        walls = next((rival for rival in self.rivals if rival.free.basis is None), None)
        known = max([self.found.best.score, *(r.log_posterior for r in self.rivals if r.form_of is not None)])
        return walls if walls is not None and walls.log_posterior > known else None

    def _plainest(self, best: SetWithBlock) -> SetWithBlock:
        """Return the curve of the best rival beside as few effects as explain much of what it explains.

        Straight lines between knots miss a step, say, by a little, which then looks like one more effect.
        """
        least = LEFT * best.evidence.nats
        same = [rival for rival in self.rivals if rival.free.id == best.free.id and rival.fit.ids <= best.fit.ids]
        return max(same, key=lambda rival: rival.log_posterior - least * len(rival.fit.ids))


def compare_blocks(
    found: FormPosterior, free: Sequence[Block], gram: FloatArray, families: Families
) -> BlockComparison:
    """Try every block beside the best sets, beside single effects, and beside none.

    families: what equations may miss, whose columns are in the gram, too.
    """
    doubted = _Doubted(gram, families)
    tried = [doubted.made(fit)[0] for fit in _tried(found.fits)]
    other = [fit for fit in found.fits if all(fit.forms != one.forms for one in tried)]
    found = replace(found, fits=tuple(sorted([*tried, *other], key=lambda fit: -fit.score)))
    ids = tuple(dict.fromkeys([*found.p, *(each.id for each in free if each.basis is None)]))
    count = len(ids)
    curves = sum(each.basis is not None for each in free)
    shares = {e.id: float(np.log(odds(count) if e.basis is None else UNKNOWN_ODDS / curves)) for e in free}
    known = {fit.ids: fit for fit in reversed(found.fits)}
    rivals = []
    for fit in tried:
        own = doubted.made(fit)[1]
        rivals += [_with_block(fit, each, own, shares[each.id]) for each in free if each.id not in fit.ids]
    rivals.sort(key=lambda rival: -rival.log_posterior)
    rivals = [*_pruned(rivals[:_PRUNED], known, doubted, shares), *rivals]
    rivals.sort(key=lambda rival: -rival.log_posterior)
    singles = [fit for fit in found.fits if len(fit.forms) == 1]
    near = rivals[0].log_posterior - _NEAR if rivals else 0.0
    rivals = [replace(r, form_of=_form_of(r, singles, gram, families)) if r.log_posterior > near else r for r in rivals]
    plain = [(fit.ids, fit.score) for fit in found.fits]
    plain += [(rival.ids, rival.log_posterior) for rival in rivals if not rival.unknown]
    curved = [rival for rival in rivals if rival.unknown]
    total = logsumexp([*(score for _, score in plain), *(rival.log_posterior for rival in curved)])
    sets = [*plain, *((rival.fit.ids, rival.log_posterior) for rival in curved)]
    best = max(plain, key=lambda each: each[1])

    def weighed(sets: Sequence[tuple[frozenset[str], float]], total: float) -> FormPosterior:
        p, confounded = confusion([(names, float(np.exp(score - total))) for names, score in sets], best[0], ids)
        return replace(found, p=p, confounded=confounded)

    lead = curved[0].log_posterior - best[1] if curved else -np.inf
    by_curve = {each.id: 0.0 for each in free if each.basis is not None}
    for rival in curved:
        by_curve[rival.free.id] += float(np.exp(rival.log_posterior - total))
    made = BlockComparison(weighed(sets, total), tuple(rivals), lead, by_curve)
    if lead > made.least:
        return made
    # A curve that does not lead by enough takes nothing from the effects that it imitates.
    return replace(made, found=weighed(plain, logsumexp([score for _, score in plain])))


class _Doubted:
    """Sets with what the equations of their effects may miss, as a part of the noise, by one gram."""

    def __init__(self, gram: FloatArray, families: Families) -> None:
        self._gram, self._families = gram, families
        self._known: dict[tuple[int, ...], tuple[FittedForms, FloatArray]] = {}

    def made(self, fit: FittedForms) -> tuple[FittedForms, FloatArray]:
        """Return a fit with the evidence that it has then, and the normal equations in the likeliest of these noises.

        Of which share of a signal is missed, each is as likely.
        """
        key = tuple(form.start for form in fit.forms)
        if key not in self._known:
            self._known[key] = self._weighed(fit)
        return self._known[key]

    def _weighed(self, fit: FittedForms) -> tuple[FittedForms, FloatArray]:
        drawn = []
        for form, size in fit.parts():
            if form.id in self._families:
                drawn.append((*self._families[form.id], float(size @ self._gram[form.span, form.span] @ size)))
        if not drawn:
            return fit, self._gram
        free = np.concatenate([np.arange(span.start, span.stop) for span, _, _ in drawn])
        use = np.concatenate([_use(fit), free, [len(self._gram) - 1]])
        some, own = self._gram[np.ix_(use, use)], np.arange(len(use) - 1 - len(free), len(use) - 1)

        def prior(shares: Shares) -> FloatArray:
            return np.asarray(block_diag(*priors_in(self._gram, drawn, shares)))

        nats = over_shares(lambda shares: _marginal(some, own, prior(shares)))
        best = max(nats, key=lambda shares: nats[shares])
        more = float(logsumexp(list(nats.values()))) - nats[0.0, 0.0] - 2 * float(np.log(1 + len(SHARES)))
        made = self._gram if best == (0.0, 0.0) else integrated_out(self._gram, free, prior(best))
        return replace(fit, score=fit.score + more, log_likelihood=fit.log_likelihood + more), made


def _marginal(gram: FloatArray, own: IntArray, prior: FloatArray) -> float:
    """Return the log evidence [nat], but for a constant, of columns fitted beside own ones, normal with a prior."""
    inner = np.eye(len(own)) + gram[np.ix_(own, own)] @ prior
    rest = integrated_out(gram, own, prior)
    fixed = np.setdiff1d(np.arange(len(gram) - 1), own)
    a, b = rest[np.ix_(fixed, fixed)] + WEAK_PRIOR * np.eye(len(fixed)), rest[fixed, -1]
    return 0.5 * float(b @ np.linalg.solve(a, b) - rest[-1, -1] - np.linalg.slogdet(inner)[1])


def _with_block(fit: FittedForms, free: Block, gram: FloatArray, share: float) -> SetWithBlock:
    seen = curve_evidence(*without_own_span(fit, free, gram), free.priors)
    # Walls that are each where they like have no equation that could be wrong by a share; curves have few knots.
    doubted = fit.log_likelihood + (seen.nats if free.basis is not None else 0.0)
    left = LINE_ERROR * doubted if fit.forms else 0.0
    return SetWithBlock(fit, free, seen, fit.score + seen.nats + share - left)


def _pruned(
    rivals: Sequence[SetWithBlock],
    known: Mapping[frozenset[str], FittedForms],
    doubted: _Doubted,
    shares: Mapping[str, float],
) -> Iterator[SetWithBlock]:
    """Yield the rivals with as few effects beside the block as are worth it."""
    done: set[tuple[frozenset[str], str]] = set()
    for rival in rivals:
        best = rival
        while True:
            fewer = [best.fit.ids - {name} for name in best.fit.ids]
            made = [doubted.made(known[ids]) for ids in fewer if ids in known and (ids, best.free.id) not in done]
            done |= {(fit.ids, best.free.id) for fit, _ in made}
            tried = [_with_block(fit, best.free, own, shares[best.free.id]) for fit, own in made]
            yield from tried
            top = max(tried, key=lambda each: each.log_posterior, default=best)
            if top.log_posterior <= best.log_posterior:
                break
            best = top


def fit_with_block(rival: SetWithBlock, gram: FloatArray) -> tuple[FittedForms, FloatArray, FloatArray]:
    """Return the forms fitted beside the block, and the block's coefficients (m,) and their covariance (m, m)."""
    root = root_of(rival.evidence.prior)
    fixed, own = _use(rival.fit), np.arange(rival.free.span.start, rival.free.span.stop)
    use = np.concatenate([fixed, own])
    turn = np.eye(len(use))
    turn[len(fixed) :, len(fixed) :] = root
    inner = turn.T @ gram[np.ix_(use, use)] @ turn
    inverse = np.linalg.inv(inner + np.diag(np.r_[np.full(len(fixed), WEAK_PRIOR), np.ones(len(own))]))
    at = turn @ (inverse @ (turn.T @ gram[use, -1]))
    covariance = turn @ inverse @ turn.T
    n = len(fixed)
    fit = replace(rival.fit, coefficients=at[:n], sds=np.sqrt(np.diag(covariance)[:n]))
    return fit, at[n:], covariance[n:, n:]


def _form_of(rival: SetWithBlock, singles: Sequence[FittedForms], gram: FloatArray, families: Families) -> str | None:
    """Return the effect whose signal a curve draws beside its set, None of none; singles: effects alone, fitted.

    A cause that follows another equation than the catalogue's is still that cause.
    """
    if rival.free.basis is None or rival.evidence.nats <= 0:
        return None
    if rival.free.pose is not None and (name := _grown(rival, gram)) is not None:
        return name
    drawn, own = fit_with_block(rival, gram)[1], np.arange(rival.free.span.start, rival.free.span.stop)
    alike = []
    for fit in singles:
        (form,) = fit.forms
        if form.id in rival.fit.ids:
            continue
        follows = families[form.id][1].follows if form.id in families else None
        both = np.concatenate([own, np.arange(form.span.start, form.span.stop)])
        inner = without_span(gram, both, _use(rival.fit))[0]
        pair = block_diag(drawn[:, np.newaxis], fit.coefficients[:, np.newaxis])
        (one, across), (_, other) = pair.T @ inner @ pair
        least = _ALIKE_OVER if follows == rival.free.basis.covariate else ALIKE
        least = least if effects.by_id(form.id).empirical else 1 - AS_ALIKE  # it has no other form
        share = float(across / np.sqrt(one * other)) if min(one, other) > 0 else 0.0
        if share >= least:
            alike.append((share, fit.score, form.id))
    nearest = max(alike, default=(0.0, 0.0, ""))[0]
    # Of two that a curve draws alike the likelier one: most of an offset is a warm-up over a long time, too.
    return max(((score, name) for share, score, name in alike if share >= nearest - AS_ALIKE), default=(0.0, None))[1]


def _grown(rival: SetWithBlock, gram: FloatArray) -> str | None:
    """Return the effect beside a curve that does what the curve does where it is one everywhere: its size varies."""
    one = gram[rival.free.span, rival.free.span].sum()
    for form, size in rival.fit.parts():
        across = float(gram[rival.free.span, form.span].sum(axis=0) @ size)
        own = float(size @ gram[form.span, form.span] @ size)
        if abs(across) >= ALIKE * np.sqrt(one * own):
            return form.id
    return None


def block_size(rival: SetWithBlock, gram: FloatArray) -> tuple[float, float, float]:
    """Return the sd of a block's coefficients in units of its scale, with its 90 % interval."""
    inner, b = without_own_span(rival.fit, rival.free, gram)
    values, vectors = np.linalg.eigh(inner)
    c, values = vectors.T @ b, np.maximum(values, 0.0)
    square = _SIZES[:, np.newaxis] ** 2
    nats = 0.5 * ((c**2 * square / (1 + square * values)) - np.log1p(square * values)).sum(axis=1)
    cumulated = np.cumsum(np.exp(nats - logsumexp(nats)))
    low, middle, high = (float(np.interp(q, cumulated, _SIZES)) for q in (0.05, 0.5, 0.95))
    return middle, low, high


def wall_error(rival: SetWithBlock, gram: FloatArray) -> float:
    """Return how far [m] a block may have put any wall of the map; of a curve, 0."""
    p = rival.free.parameter
    return 0.0 if p is None else _FARTHEST * p.scale * block_size(rival, gram)[0]


def _tried(fits: Sequence[FittedForms]) -> Iterator[FittedForms]:
    """Yield the best sets, the best single effects, and none."""
    yield from fits[:_FITS]
    rest = [fit for fit in fits[_FITS:] if len(fit.forms) <= 1]
    yield from [fit for fit in rest if fit.forms][:_SINGLES]
    yield from [fit for fit in rest if not fit.forms]


def _use(fit: FittedForms) -> IntArray:
    return np.concatenate([np.arange(0), *(np.arange(form.span.start, form.span.stop) for form in fit.forms)])


def without_own_span(fit: FittedForms, free: Block, gram: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return gram and target of a block, without what a set's own columns could take up."""
    return without_span(gram, np.arange(free.span.start, free.span.stop), _use(fit))


def without_span(gram: FloatArray, own: IntArray, rest: IntArray) -> tuple[FloatArray, FloatArray]:
    """Return gram and target of some columns without what others could take up."""
    inner, b = gram[np.ix_(own, own)], gram[own, -1]
    if not len(rest):
        return inner, b
    cross = gram[np.ix_(rest, own)]
    solved = np.linalg.solve(
        gram[np.ix_(rest, rest)] + WEAK_PRIOR * np.eye(len(rest)), np.column_stack([cross, gram[rest, -1]])
    )
    return inner - cross.T @ solved[:, :-1], b - cross.T @ solved[:, -1]
