# SPDX-License-Identifier: BSD-3-Clause
"""When is a set fitted again? Where other first values show that its fit stuck, or lie where no fit gets from there."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from kurumaisu.critic.engine.catalogue import Candidate, Key
from kurumaisu.critic.engine.evidence import Fit, Problem

_OTHER_SIZE = 0.05  # share by which sizes of something rough differ that are on peaks far apart
_BETTER = 0.5  # [nat] by which a fit must be beaten by mere first values to be made again


def start_is_better(problem: Problem, fit: Fit, start: Mapping[Key, float]) -> bool:
    """Tell whether other first values of a set, or of a part of it, explain more than its fit, which stuck half way.

    Else what is needless seems to act, and what stands in for what acts seems not to.
    """
    own = fit.start if fit.terms else {}
    if not any(key in start for key in own):
        return False
    values = np.array(
        [term.parameter.lower if term.fixed else start.get(term.key, own[term.key]) for term in fit.terms]
    )
    left = problem.residual(fit.terms, values)
    return -0.5 * float(left @ left) > fit.log_likelihood + _BETTER


def other_step_size(fit: Fit, start: Mapping[Key, float], begun: set[tuple[frozenset[Candidate], float]]) -> bool:
    """Tell whether first values have another size of something rough than its fit; once for each that has begun.

    No fit goes from there to here, and by mere first values the better peak may look the worse.
    """
    for term, value in zip(fit.terms, fit.values, strict=True):
        size = start.get(term.key, value)
        if term.rough and not term.fixed and abs(size - value) > _OTHER_SIZE * abs(value):
            begin = fit.candidates, float(f"{size:.1e}")
            if begin not in begun:
                begun.add(begin)
                return True
    return False
