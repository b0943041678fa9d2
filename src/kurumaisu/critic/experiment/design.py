# SPDX-License-Identifier: BSD-3-Clause
"""What to drive next: the scripted experiment that tells most, per second, between the explanations that remain.

The drive is simulated under each of two explanations; what both predict is Gaussian: the mean that the fitted
parameters give, the noise that was estimated, and the doubt about the parameters that is left. The Kullback-Leibler
divergence of two such predictions is the log evidence that the drive is expected to bring for the one that holds. With
parameters of the rival that are free, it is z^2 (1 - rho^2) / 2 of Hunter and Reiner.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import logsumexp

from kurumaisu import effects
from kurumaisu.critic.base import replay
from kurumaisu.critic.base.drive import Drive, prepare
from kurumaisu.critic.engine.catalogue import Term
from kurumaisu.critic.engine.evidence import Fit, Problem, log_posterior
from kurumaisu.critic.search.posterior import SearchResult
from kurumaisu.critic.values.digits import odds
from kurumaisu.critic.values.policy import RIVAL
from kurumaisu.critic.values.recording import Run, Series
from kurumaisu.critic.values.verdict import NextExperiment
from kurumaisu.effects import ReferenceEffect
from kurumaisu.experiments import Script, names, nominal_path, samples, shipped_script
from kurumaisu.experiments.timeline import PERIOD
from kurumaisu.params import EffectSetting, Model
from kurumaisu.types import FloatArray

NOTHING = 0.25  # [nat] less than that is no information: thirty runs would not decide
PRIOR = 3.0  # sd of a parameter about its null before any data, in units of its scale
DECIDED = 12.0  # [nat] more than that between two explanations decides nothing more
LISTED_IDS = 4  # ids in a sentence; the verdict has them all
_RIVALS = 6  # explanations that are compared, at most


@dataclass(frozen=True)
class DrivePrediction:
    """Of a drive, whitened: mean (n,), its slopes (n, k) by parameters of covariance (k, k)."""

    mean: FloatArray
    slopes: FloatArray
    covariance: FloatArray


def possible(script: Script, model: Model) -> bool:
    """Return False for voltages where a robot has none, and for rates that it cannot be asked for."""
    if script.kind != "drive":
        return script.kind != "sweep" or model.robot.voltages
    fastest = model.robot.fastest
    return fastest is None or all(
        abs(v) <= fastest[0] and abs(w) <= fastest[1] for v, w in (phase.target for phase in script.phases)
    )


def planned(script: Script, model: Model, settings: Sequence[EffectSetting]) -> Drive:
    """Return the drive of a script as a chair with these effects would drive it, without noise."""
    rows = samples(script.phases, PERIOD)
    t = rows[:, 0]
    if script.kind == "sweep":
        voltage = Series.of_table(np.column_stack([t, np.zeros(len(t)), rows[:, 1]]), "v_f", "v_s")
        path = np.zeros((len(t), 3))
    else:
        volts = np.column_stack([t, model.translation.volts(rows[:, 1]), model.steering.volts(rows[:, 2]), rows[:, 1:]])
        voltage = Series.of_table(volts, "v_f", "v_s", "v", "w")
        path = nominal_path(script.phases)
    poses = Series(t, path, ("x", "y", "theta"))
    drive = prepare(Run(script.name, voltage=voltage, pose=poses), model)
    return replace(drive, poses=replay.path(drive, model, settings))


def doubt(problem: Problem, terms: Sequence[Term], values: FloatArray) -> FloatArray:
    """Return the covariance (k, k), per step, that the drives of a problem leave of the terms that are not fixed."""
    slopes = problem.columns(terms, values, free(terms))
    return np.asarray(np.linalg.inv(slopes.T @ slopes + prior(free(terms))))


def free(terms: Sequence[Term]) -> tuple[Term, ...]:
    """Return the terms whose values can be fitted."""
    return tuple(term for term in terms if not term.fixed)


def prior(terms: Sequence[Term]) -> FloatArray:
    """Return the inverse covariance (k, k) of terms before any data, per step."""
    return np.diag([(term.step / PRIOR) ** 2 for term in terms])


def divergence(a: DrivePrediction, b: DrivePrediction) -> float:
    """Return the log evidence [nat] for a over b that the drive is expected to bring where a holds."""
    apart = a.mean - b.mean
    # All that differs lies in the span of these few columns: the rest of the drive cancels.
    basis = np.linalg.qr(np.column_stack([apart, a.slopes, b.slopes]))[0]
    d = basis.T @ apart
    one, other = (_spread(basis.T @ p.slopes, p.covariance) for p in (a, b))
    solved = np.linalg.solve(other, np.column_stack([one, d]))
    logs = np.linalg.slogdet(other)[1] - np.linalg.slogdet(one)[1]
    nats = 0.5 * float(np.trace(solved[:, :-1]) - len(d) + d @ solved[:, -1] + logs)
    return max(nats, 0.0)


def left_over(signal: FloatArray, slopes: FloatArray, known: FloatArray) -> float:
    """Return z^2 (1 - rho^2) / 2 [nat] of a whitened signal (n,): what parameters of slopes (n, k) cannot imitate.

    known (k, k): inverse covariance of the parameters before.
    """
    b = slopes.T @ signal
    nats = 0.5 * float(signal @ signal - b @ np.linalg.solve(slopes.T @ slopes + known, b))
    return max(nats, 0.0)


def _spread(slopes: FloatArray, covariance: FloatArray) -> FloatArray:
    return np.asarray(np.eye(len(slopes)) + slopes @ covariance @ slopes.T)


@dataclass(frozen=True)
class Proposal:
    """The experiment to run next, None where nothing is to be separated or nothing would; a sentence for the report."""

    experiment: NextExperiment | None = None
    sentence: str = ""


def drives() -> tuple[Script, ...]:
    """Return the package's experiments that tell of the base."""
    return tuple(script for script in map(shipped_script, names()) if script.kind != "places")


def propose(problem: Problem, found: SearchResult, scripts: Sequence[Script]) -> Proposal:
    """Return the script with the highest expected information per second between the rivals of a search."""
    fits, weights = remaining(found)
    if len(fits) < 2:
        return Proposal()
    open_ids = sorted(frozenset.union(*(f.ids for f in fits)) - frozenset.intersection(*(f.ids for f in fits)))
    doubts = [doubt(problem, fit.terms, fit.values) for fit in fits]
    able = [script for script in scripts if possible(script, problem.model)]
    worth = [_expected(problem, script, fits, doubts, weights) for script in able]
    listed = _listed(open_ids)
    if max((nats for nats, _ in worth), default=0.0) < NOTHING:
        asked = any(issubclass(effects.by_id(name), ReferenceEffect) for name in open_ids)
        other = "scans of a known map tell what the reference measures" if asked else "measure it in another way"
        return Proposal(None, f"No scripted drive can decide whether {listed} acts: {other}.")
    i = max(range(len(able)), key=lambda i: worth[i][1] / able[i].seconds)
    best, nats = able[i], worth[i][0]
    sentence = (
        f"critic experiment {best.name} ({best.seconds:.0f} s). It should make the true explanation {odds(nats)} times "
        f"as probable as a false one; in question: {listed}."
    )
    return Proposal(NextExperiment(best.name, best.seconds, nats, tuple(open_ids)), sentence)


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


def _expected(
    problem: Problem, script: Script, rivals: Sequence[Fit], doubts: Sequence[FloatArray], weights: FloatArray
) -> tuple[float, float]:
    """Return the expected log evidence [nat] of a script for the truth over its rivals, whole, and what of it decides.

    rivals: the likeliest first; doubts: of each, as doubt has it. Beyond DECIDED nothing more is decided between two.
    """
    drive = planned(script, problem.model, rivals[0].settings)
    ahead, said = Problem([drive], problem.model, problem.noise, ()), []
    for rival, covariance in zip(rivals, doubts, strict=True):
        residual, slopes = ahead.linearised(rival.terms, rival.values, free(rival.terms))
        said.append(DrivePrediction(-residual, slopes, covariance))
    pairs = np.array([[divergence(a, b) if a is not b else 0.0 for b in said] for a in said])
    # The truth is each of them with its posterior; the rival it has to beat is each other one, likewise.
    chance = np.outer(weights, weights) * (1 - np.eye(len(weights)))
    chance /= chance.sum()
    return float((chance * pairs).sum()), float((chance * np.minimum(pairs, DECIDED)).sum())
