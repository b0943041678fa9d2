# SPDX-License-Identifier: BSD-3-Clause
"""What a drive that is yet to be driven would tell: rival explanations predict it, and differ or do not.

The drive is simulated under each of two explanations; what both predict is Gaussian: the mean that the fitted
parameters give, the noise that was estimated, and the doubt about the parameters that is left. The Kullback-Leibler
divergence of two such predictions is the log evidence that the drive is expected to bring for the one that holds. With
parameters of the rival that are free, it is z^2 (1 - rho^2) / 2 of Hunter and Reiner.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from kurumaisu.critic.base import replay
from kurumaisu.critic.base.drive import Drive, prepare
from kurumaisu.critic.engine.catalogue import Term
from kurumaisu.critic.engine.evidence import Problem
from kurumaisu.critic.noise.base_noise import Noise
from kurumaisu.critic.values.recording import Run, Series
from kurumaisu.experiments import Script, nominal_path, samples
from kurumaisu.experiments.timeline import PERIOD
from kurumaisu.params import EffectSetting, Model
from kurumaisu.types import FloatArray

NOTHING = 0.25  # [nat] less than that is no information: thirty runs would not decide
PRIOR = 3.0  # sd of a parameter about its null before any data, in units of its scale


@dataclass(frozen=True)
class Explanation:
    """Terms with values, and the covariance (k, k) of those that are not fixed, per step: what is in doubt."""

    terms: tuple[Term, ...]
    values: FloatArray
    covariance: FloatArray

    @property
    def ids(self) -> frozenset[str]:
        """Return the effects that it blames."""
        return frozenset(term.id for term in self.terms)


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


def predict(drive: Drive, model: Model, noise: Noise, explanation: Explanation) -> DrivePrediction:
    """Return what an explanation says of a drive."""
    terms, values = explanation.terms, explanation.values
    residual, slopes = Problem([drive], model, noise, ()).linearised(terms, values, free(terms))
    return DrivePrediction(-residual, slopes, explanation.covariance)


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
