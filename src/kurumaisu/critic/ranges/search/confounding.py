# SPDX-License-Identifier: BSD-3-Clause
"""Effects that explain the readings as well as the one that is likeliest: a sole name would be a guess.

The evidence may prefer one of them for its usual size or its fewer parameters, but the data do not.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from itertools import chain

import numpy as np

from kurumaisu.critic.ranges.search.block_evidence import SetWithBlock, without_own_span
from kurumaisu.critic.ranges.search.effect_sets import FittedForms, FormPosterior
from kurumaisu.critic.ranges.signals.coefficient_blocks import Block
from kurumaisu.critic.unknown.curves import curve_evidence
from kurumaisu.critic.values.policy import odds
from kurumaisu.types import FloatArray

_LOSS = 3.0  # [nat] of log likelihood that a twin may explain less, a half for each parameter more
# [nat] of evidence that a block may lack: one wall that is off imitates a mounting, but it would be a rare chance that
# moved all walls of a room just as a quadratic error of the range does.
_CHANCE = 7.0
_RANK = 1e-6  # share of the largest eigenvalue below which a direction of a block does not show

Groups = tuple[tuple[str, ...], ...]


def confounded(
    found: FormPosterior, winner: SetWithBlock | None, free: Sequence[Block], gram: FloatArray, names: Sequence[str]
) -> Groups:
    """Return for each of the named effects that has twins the set of them all; joined where they share one."""
    blocks = [each for each in free if each.basis is None]
    groups: list[set[str]] = []
    for name in names:
        group = {name}
        for fits in _sets(found, winner, name):
            if winner is not None and name == winner.free.id:
                own = _with_block(winner.fit, winner.free, gram)
            else:
                own = _log_posterior(found.best)
            group |= {other for other, nats in _alternatives(found, fits, blocks, gram) if own - nats < _LOSS}
        groups.append(group)
    return tuple(group for group in merged(groups) if len(group) > 1)


def merged(*groups: Sequence[Collection[str]]) -> Groups:
    """Return all groups, those that share an effect as one."""
    out: list[set[str]] = []
    for group in chain(*groups):
        whole = set(group)
        for known in [known for known in out if known & whole]:
            out.remove(known)
            whole |= known
        out.append(whole)
    return tuple(tuple(sorted(group)) for group in out)


def _sets(found: FormPosterior, winner: SetWithBlock | None, name: str) -> Iterator[frozenset[str]]:
    """Yield what acts beside an effect; nothing where that is an effect beside a block, of which no swap is known."""
    if winner is None:
        yield found.best.ids - {name}
    elif name == winner.free.id:
        yield winner.fit.ids


def _alternatives(
    found: FormPosterior, rest: frozenset[str], blocks: Sequence[Block], gram: FloatArray
) -> Iterator[tuple[str, float]]:
    """Yield effects that may act beside the rest, and what they explain with it."""
    for fit in found.fits:
        if len(fit.ids) == len(rest) + 1 and rest < fit.ids:
            yield next(iter(fit.ids - rest)), _log_posterior(fit)
    base = max((fit for fit in found.fits if fit.ids == rest), key=_log_posterior, default=None)
    for block in blocks:
        if base is not None and block.id not in rest and not _by_chance(found, base, block, gram):
            yield block.id, _with_block(base, block, gram)


def _by_chance(found: FormPosterior, base: FittedForms, block: Block, gram: FloatArray) -> bool:
    """Return whether a block's coefficients, drawn before the data, would hardly ever do what the best set does."""
    evidence = (
        base.score
        + curve_evidence(*without_own_span(base, block, gram), block.priors).nats
        + float(np.log(odds(len(found.p))))
    )
    return found.best.score - evidence > _CHANCE


def _log_posterior(fit: FittedForms) -> float:
    return fit.log_likelihood - 0.5 * len(fit.coefficients)


def _with_block(fit: FittedForms, block: Block, gram: FloatArray) -> float:
    inner, b = without_own_span(fit, block, gram)
    values, vectors = np.linalg.eigh(inner)
    shows = values > _RANK * values[-1]
    along = (vectors.T @ b)[shows]
    return _log_posterior(fit) + 0.5 * float(np.sum(along**2 / values[shows])) - 0.5 * int(shows.sum())
