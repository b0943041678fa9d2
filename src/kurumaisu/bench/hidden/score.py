# SPDX-License-Identifier: BSD-3-Clause
"""What an answer is worth against the truth of a case."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from kurumaisu.bench.hidden.contradictions import WRONG
from kurumaisu.bench.hidden.generator.case import APART, Truth
from kurumaisu.critic.values.verdict import Verdict

SURE = 0.95  # probability from which an answer is taken for sure
_SEEN = 3.0  # whitened norm below which nobody can tell two effects apart for sure
_TWINS = 0.1  # and below which they do the same


@dataclass(frozen=True)
class Score:
    """One answer: right for its kind, and what else it was; covered: of intervals whose parameter has a truth.

    stated: probability and truth of each cause named; cpu [s]; z, z_rival of the case; words: of the answer, short;
    gain_share: of the oracle's gain on data held out, None where there is no oracle; followed: one of the first three
    curves of what is not in the catalogue is by a covariate that is right.
    """

    right: bool
    misnamed: bool
    confounded: bool
    unknown: bool
    nothing: bool
    covered: tuple[bool, ...]
    stated: tuple[tuple[float, bool], ...]
    cpu: float
    truth: Truth
    words: str
    gain_share: float | None = None
    followed: bool = False


def score(truth: Truth, verdict: Verdict, cpu: float) -> Score:
    """Return the score of a verdict."""
    named = {cause.id for cause in verdict.causes} - set(truth.background)
    wanted = set(truth.ids)
    also = set(WRONG[truth.problem].also) if truth.problem else set()
    return Score(
        right=_right(truth, verdict, named),
        misnamed=bool(named - wanted - also),
        confounded=verdict.verdict == "confounded",
        unknown=bool(verdict.unknown) or verdict.verdict == "unknown",
        nothing=verdict.verdict == "none",
        covered=_covered(truth, verdict),
        stated=tuple((cause.p, cause.id in wanted | also) for cause in verdict.causes if cause.id in named),
        cpu=cpu,
        truth=truth,
        words=_words(verdict),
        followed=_is_followed(truth, verdict),
    )


def scored_names(truth: Truth, named: frozenset[str], cpu: float) -> Score:
    """Return the score of a baseline, which can only name."""
    right = named == set(truth.ids) if truth.kind in ("null", "single", "pair", "triple") else False
    words = " ".join(sorted(named))
    return Score(right, bool(named - set(truth.ids)), False, False, not named, (), (), cpu, truth, words)


def _right(truth: Truth, verdict: Verdict, named: set[str]) -> bool:
    """Return whether an answer is what the kind of case calls for."""
    wanted = set(truth.ids)
    if truth.kind == "wrong":
        also = set(WRONG[truth.problem].also)
        return verdict.verdict == "invalid_data" or (bool(named) and named <= also)
    if truth.kind == "unknown":
        return not named and _is_followed(truth, verdict)
    a_set = any(wanted <= set(group) <= _open(truth) for group in verdict.confounded)
    if truth.kind == "confounded" and len(truth.accepted) > 1:
        return a_set
    clean = verdict.verdict not in ("unknown", "invalid_data", "confounded") and not verdict.unknown
    discrete = truth.ids == ("base.sign",) and verdict.verdict == "invalid_data"
    exact = discrete or (clean and named == wanted)
    if truth.kind == "confounded":
        return a_set or exact  # in these very drives it has no rival that does as well
    if len(truth.ids) == 1 and len(truth.accepted) > 1 and truth.z_rival < _SEEN:
        # The drives hardly tell it from others: the set of them is right, too; of twins it is the only right answer.
        return a_set or (exact and truth.z_rival > _TWINS)
    if len(truth.ids) > 1 and truth.z_rival < APART and verdict.verdict != "unknown":
        # Of several causes one may have a twin: it is right to name the others, and to give the set for that one.
        sets = {name for group in verdict.confounded for name in group}
        return named <= set(truth.ids) <= named | sets
    return exact


def _open(truth: Truth) -> set[str]:
    """Return what a set may have in it: what does the same, and what is not told from it beyond doubt."""
    return {*truth.near, *(name for ids in truth.accepted for name in ids)}


def _is_followed(truth: Truth, verdict: Verdict) -> bool:
    return any(_follows(truth, unknown.channel, unknown.covariate) for unknown in verdict.unknown[:3])


def _follows(truth: Truth, channel: str, covariate: str) -> bool:
    """Return whether an answer's words name the channel and one of the covariates."""
    return truth.channel in channel and any(word == covariate or word in covariate.split() for word in truth.covariates)


def _covered(truth: Truth, verdict: Verdict) -> tuple[bool, ...]:
    out = []
    for cause in verdict.causes:
        for name, value in truth.parameters.get(cause.id, {}).items():
            if name in cause.parameters:
                interval = cause.parameters[name]
                out.append(interval.lo90 <= value <= interval.hi90)
    return tuple(out)


def _words(verdict: Verdict) -> str:
    parts = [f"{cause.id} {cause.p:.2f}" for cause in verdict.causes]
    parts += ["{" + ", ".join(group) + "}" for group in verdict.confounded]
    parts += [f"{unknown.channel} by {unknown.covariate}" for unknown in verdict.unknown]
    parts += [problem[:60] for problem in verdict.problems[:1]]
    return f"{verdict.verdict}: {'; '.join(parts)}".rstrip(": ")


def calibration_error(stated: Sequence[tuple[float, bool]]) -> float:
    """Return the mean distance of stated probabilities from the shares that were right, in bins, by number."""
    if not stated:
        return float("nan")
    p, right = np.array([pair[0] for pair in stated]), np.array([pair[1] for pair in stated], dtype=float)
    bins = np.digitize(p, [0.5, 0.8, 0.9, 0.95, 0.99])
    return float(sum(np.abs((p - right)[bins == i].sum()) for i in np.unique(bins)) / len(p))
