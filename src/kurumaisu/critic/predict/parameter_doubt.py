# SPDX-License-Identifier: BSD-3-Clause
"""How uncertain what was fitted is, as models that lie one standard deviation away, independently of each other."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from kurumaisu.critic.base import replay
from kurumaisu.critic.base.drive import Drive
from kurumaisu.critic.engine.catalogue import settings_of
from kurumaisu.critic.engine.evidence import Fit, Problem
from kurumaisu.critic.engine.least_squares import covariance
from kurumaisu.critic.unknown.joint_fit import FitWithCurve
from kurumaisu.critic.values.settings import Settings
from kurumaisu.params import EffectSetting
from kurumaisu.types import FloatArray

_SLIGHT = 1e-3  # share of the largest direction's whitened size below which one does not count


def about_fit(problem: Problem, fit: Fit) -> tuple[Settings, ...]:
    """Return settings that differ from a fit to the problem's drives by one standard deviation each."""
    free = [i for i, term in enumerate(fit.terms) if not term.fixed]
    if not free:
        return ()
    slopes = problem.linearised(fit.terms, fit.values, [fit.terms[i] for i in free])[1]
    tight = np.array([fit.terms[i].step if fit.terms[i].shape else 0.0 for i in free])
    unit = np.array([fit.terms[i].step * fit.terms[i].parameter.scale for i in free])
    root = np.linalg.cholesky(covariance(slopes.T @ slopes + np.diag(tight**2)))
    lower = np.array([term.parameter.lower for term in fit.terms])
    upper = np.array([term.parameter.upper for term in fit.terms])
    others = []
    for direction in root.T:
        moved = fit.values.copy()
        moved[free] += unit * direction
        inside = np.clip(moved, lower, upper)
        others.append(replay.completed(problem.model, settings_of(fit.terms, inside)))
    return tuple(others)


def about_curve(extension: FitWithCurve) -> tuple[Settings, ...]:
    """Return settings that differ from an extension's by one standard deviation of its curve each."""
    values, vectors = np.linalg.eigh(extension.covariance)
    sizes = np.sqrt(np.maximum(values, 0.0))
    basis = extension.curve.basis
    return tuple(
        (
            *extension.fit.settings,
            EffectSetting(extension.curve.id, basis.parameters(extension.coefficients + size * vector)),
        )
        for size, vector in zip(sizes, vectors.T, strict=True)
        if size > _SLIGHT * sizes.max()
    )


def doubt(problem: Problem, settings: Settings, others: Sequence[Settings]) -> Callable[[Drive], FloatArray] | None:
    """Return the change of a drive's increments (3 m, k) from settings to each other ones; None without any."""
    if not others:
        return None

    def columns(drive: Drive) -> FloatArray:
        here = problem.simulated(drive, settings)
        return np.column_stack([(problem.simulated(drive, other) - here).ravel() for other in others])

    return columns
