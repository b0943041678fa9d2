# SPDX-License-Identifier: BSD-3-Clause
"""What to drive next: the scripted experiment that tells most, per second, between the explanations that remain."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import logsumexp

from kurumaisu import effects
from kurumaisu.critic.engine.evidence import Fit, Problem, log_posterior
from kurumaisu.critic.experiment import design
from kurumaisu.critic.experiment.design import Explanation
from kurumaisu.critic.search.posterior import SearchResult
from kurumaisu.critic.values.digits import odds
from kurumaisu.critic.values.policy import RIVAL
from kurumaisu.critic.values.verdict import NextExperiment
from kurumaisu.effects import ReferenceEffect
from kurumaisu.experiments import Script, names, shipped_script
from kurumaisu.types import FloatArray

DECIDED = 12.0  # [nat] more than that between two explanations decides nothing more
LISTED_IDS = 4  # ids in a sentence; the verdict has them all
_RIVALS = 6  # explanations that are compared, at most


@dataclass(frozen=True)
class Option:
    """An experiment with its expected log evidence [nat] for the truth over its rivals, all and per pair (h, h)."""

    script: Script
    nats: float
    expected_nats: float
    pairs: FloatArray


@dataclass(frozen=True)
class Proposal:
    """The experiment to run next, None where nothing is to be separated or nothing would; a sentence for the report.

    options: all that were weighed, best first.
    """

    experiment: NextExperiment | None = None
    sentence: str = ""
    options: tuple[Option, ...] = ()


def drives() -> tuple[Script, ...]:
    """Return the package's experiments that tell of the base."""
    return tuple(script for script in map(shipped_script, names()) if script.kind != "places")


def propose(problem: Problem, found: SearchResult, scripts: Sequence[Script]) -> Proposal:
    """Return the script with the highest expected information per second between the rivals of a search."""
    fits, weights = remaining(found)
    if len(fits) < 2:
        return Proposal()
    open_ids = sorted(frozenset.union(*(f.ids for f in fits)) - frozenset.intersection(*(f.ids for f in fits)))
    rivals = [Explanation(f.terms, f.values, design.doubt(problem, f.terms, f.values)) for f in fits]
    possible = [script for script in scripts if design.possible(script, problem.model)]
    options = [_option(problem, script, fits[0], rivals, weights) for script in possible]
    options.sort(key=lambda option: -option.expected_nats / option.script.seconds)
    listed = _listed(open_ids)
    if not options or max(option.nats for option in options) < design.NOTHING:
        asked = any(issubclass(effects.by_id(name), ReferenceEffect) for name in open_ids)
        other = "scans of a known map tell what the reference measures" if asked else "measure it in another way"
        return Proposal(None, f"No scripted drive can decide whether {listed} acts: {other}.", ())
    best = options[0]
    experiment = NextExperiment(best.script.name, best.script.seconds, best.nats, tuple(open_ids))
    sentence = (
        f"critic experiment {best.script.name} ({best.script.seconds:.0f} s). It should make the true explanation "
        f"{odds(best.nats)} times as probable as a false one; in question: {listed}."
    )
    return Proposal(experiment, sentence, tuple(options))


def remaining(found: SearchResult) -> tuple[list[Fit], FloatArray]:
    """Return the explanations that are not much less probable than the best one, and their posterior, (h,).

    Of the ways in which the same effects may act, the most probable one stands for all.
    """
    best: dict[frozenset[str], tuple[float, Fit]] = {}
    for fit in found.fits:
        log = log_posterior(fit, len(found.p))
        if fit.ids not in best or log > best[fit.ids][0]:
            best[fit.ids] = (log, fit)
    ranked = sorted(best.values(), key=lambda pair: -pair[0])[:_RIVALS]
    kept = [(log, fit) for log, fit in ranked if log >= ranked[0][0] + np.log(RIVAL)]
    logs = np.array([log for log, _ in kept])
    return [fit for _, fit in kept], np.exp(logs - logsumexp(logs))


def _listed(ids: Sequence[str]) -> str:
    told = [*ids[:LISTED_IDS], f"{len(ids) - LISTED_IDS} more"] if len(ids) > LISTED_IDS + 1 else list(ids)
    return " or ".join([", ".join(told[:-1]), told[-1]] if len(told) > 1 else told)


def _option(
    problem: Problem, script: Script, likeliest: Fit, rivals: Sequence[Explanation], weights: FloatArray
) -> Option:
    drive = design.planned(script, problem.model, likeliest.settings)
    said = [design.predict(drive, problem.model, problem.noise, rival) for rival in rivals]
    pairs = np.array([[design.divergence(a, b) if a is not b else 0.0 for b in said] for a in said])
    # The truth is each of them with its posterior; the rival it has to beat is each other one, likewise.
    chance = np.outer(weights, weights) * (1 - np.eye(len(weights)))
    chance /= chance.sum()
    return Option(script, float((chance * pairs).sum()), float((chance * np.minimum(pairs, DECIDED)).sum()), pairs)
