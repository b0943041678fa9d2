# SPDX-License-Identifier: BSD-3-Clause
"""Effects that stand in for one another, exchanged in all likely sets: each has the same company to be likely in.

A search goes on from the best set only. What may act beside it has been tried, but not beside the set in which a twin
takes the place of one of its effects: then the twin's share of the posterior would be too small for no reason.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from kurumaisu.critic.engine.catalogue import Candidate, Key
from kurumaisu.critic.engine.evidence import Fit, log_posterior
from kurumaisu.critic.values.policy import MEMBER

_MOST = 8  # sets that are tried, the likeliest first: of a long recording, each takes a second


def swapped_sets(ranked: Sequence[Fit], of: int) -> list[tuple[frozenset[Candidate], Mapping[Key, float]]]:
    """Return sets that are likely but for such exchanges, with first values; ranked: the fits there are, best first.

    of: effects that could show.
    """
    likely = [fit for fit in ranked if log_posterior(fit, of) > log_posterior(ranked[0], of) + np.log(MEMBER)]
    known = {fit.candidates for fit in ranked}
    found: dict[frozenset[Candidate], Mapping[Key, float]] = {}
    for fit in likely:
        for gone, new, start in _swaps(ranked[0], likely):
            own = next((each for each in fit.candidates if each.id == gone), None)
            if own is None or new.id in fit.ids:
                continue
            chosen = fit.candidates - {own} | {new}
            if chosen not in known:
                kept = {key: value for key, value in fit.start.items() if key[0] != gone}
                found.setdefault(chosen, {**start, **kept})
    return list(found.items())[:_MOST]


def _swaps(best: Fit, likely: Sequence[Fit]) -> Iterator[tuple[str, Candidate, Mapping[Key, float]]]:
    """Yield ids with what may stand in for each and its values there, either way."""
    for other in likely:
        mine, its = best.candidates - other.candidates, other.candidates - best.candidates
        if len(mine) == len(its) == 1 and (one := next(iter(mine))).id != (two := next(iter(its))).id:
            yield one.id, two, _values(other, two.id)
            yield two.id, one, _values(best, one.id)


def _values(fit: Fit, name: str) -> Mapping[Key, float]:
    return {key: value for key, value in fit.start.items() if key[0] == name}
