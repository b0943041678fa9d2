# SPDX-License-Identifier: BSD-3-Clause
"""A set of effects and a curve, fitted together by simulation."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from kurumaisu.critic.base import replay
from kurumaisu.critic.base.drive import Drive
from kurumaisu.critic.engine.catalogue import settings_of
from kurumaisu.critic.engine.evidence import Fit, Problem
from kurumaisu.critic.unknown.bases import root_of
from kurumaisu.critic.unknown.curves import Curve, columns, raw_columns
from kurumaisu.critic.unknown.shapes import DrawnCurve
from kurumaisu.params import EffectSetting
from kurumaisu.types import FloatArray

_ROUNDS = 6  # from columns linearised anew; the curve itself is linear in all but the path it leads to
_ENOUGH = 0.1  # [nat] less to gain ends them
# Shares of a step that are tried: a curve and effects that draw the same by turns overshoot together.
_SHARES = (1.0, 0.5, 0.2, 0.05)


@dataclass(frozen=True)
class FitWithCurve:
    """fit: of the catalogue's effects beside the curve; coefficients of the curve and their covariance.

    prior: covariance of the coefficients before the data.
    """

    fit: Fit
    curve: Curve
    prior: FloatArray
    coefficients: FloatArray
    covariance: FloatArray

    @property
    def drawn(self) -> DrawnCurve:
        """Return the curve alone."""
        return DrawnCurve(self.curve.basis, self.coefficients, self.covariance)

    @property
    def unknown(self) -> EffectSetting:
        """Return the curve as a model file has it."""
        return EffectSetting(self.curve.id, self.curve.basis.parameters(self.coefficients))

    @property
    def settings(self) -> tuple[EffectSetting, ...]:
        """Return all effects as a model file has them."""
        return (*self.fit.settings, self.unknown)


def fit_with_curve(problem: Problem, fit: Fit, curve: Curve, prior: FloatArray) -> FitWithCurve:
    """Return a set's fit and a curve's coefficients, each beside the other."""
    curve = replace(curve, columns=slice(0, curve.basis.size))
    root = root_of(prior)
    extension = FitWithCurve(fit, curve, prior, np.zeros(curve.basis.size), prior)
    density = _log_density(problem, extension, root)
    for _ in range(_ROUNDS):
        whole = _step(problem, extension, root)
        for share in _SHARES:
            moved = whole if share == 1.0 else _part(problem, extension, whole, share)
            gained = _log_density(problem, moved, root) - density
            if gained > 0:
                break
        # Where it is, with the doubts of where it would go.
        doubted = replace(extension, fit=replace(extension.fit, sds=whole.fit.sds), covariance=whole.covariance)
        extension, density = (moved, density + gained) if gained > 0 else (doubted, density)
        if gained < _ENOUGH:
            break
    return extension


def _log_density(problem: Problem, extension: FitWithCurve, root: FloatArray) -> float:
    """Return the log posterior density of a curve's coefficients and the effects beside it, up to a constant."""
    curved = problem.changed(model=replay.extend(problem.model, [extension.unknown]))
    left = curved.residual(extension.fit.terms, extension.fit.values)
    sizes = np.linalg.lstsq(root, extension.coefficients, rcond=None)[0]
    return -0.5 * float(left @ left + sizes @ sizes)


def _part(problem: Problem, extension: FitWithCurve, whole: FitWithCurve, share: float) -> FitWithCurve:
    """Return an extension that is moved by a share of the way to another one."""
    fit = _at(problem, whole.fit, extension.fit.values + share * (whole.fit.values - extension.fit.values))
    coefficients = extension.coefficients + share * (whole.coefficients - extension.coefficients)
    return replace(whole, fit=fit, coefficients=coefficients)


def _at(problem: Problem, fit: Fit, values: FloatArray) -> Fit:
    """Return a fit with other values."""
    settings = replay.completed(problem.model, settings_of(fit.terms, values))
    return replace(fit, values=values, settings=settings)


def refitted(extension: FitWithCurve, drives: Sequence[Drive], problem: Problem) -> FitWithCurve:
    """Return the extension fitted to other drives."""
    other = problem.changed(drives=drives)
    fit = other.fit_candidates(extension.fit.candidates, extension.fit.start)
    return fit_with_curve(other, fit, extension.curve, extension.prior)


def simulated_columns(problem: Problem, drive: Drive, extension: FitWithCurve) -> FloatArray:
    """Return the derivative of a drive's increments by all effects of the catalogue and by the curve, (3 m, k)."""
    own = problem.changed(model=replay.extend(problem.model, [extension.unknown]))
    known = own.simulated_columns(drive, extension.fit)
    return np.hstack([known, raw_columns(drive, problem.model, extension.fit.settings, [extension.curve])])


def _step(problem: Problem, extension: FitWithCurve, root: FloatArray) -> FitWithCurve:
    fit = extension.fit
    beside = problem.changed(model=replay.extend(problem.model, [extension.unknown]))
    y, slopes = beside.linearised(fit.terms, fit.values, fit.terms)
    free = columns(problem, fit.settings, [extension.curve])
    own = free @ root
    k = slopes.shape[1]
    design = np.hstack([slopes, own])
    target = y + free @ extension.coefficients
    precision = design.T @ design + np.diag(np.append(np.full(k, 1e-6), np.ones(own.shape[1])))
    covariance: FloatArray = np.linalg.inv(precision)
    solved = np.asarray(covariance @ (design.T @ target))
    return replace(
        extension,
        fit=_moved(problem, fit, solved[:k], covariance),
        coefficients=root @ solved[k:],
        covariance=root @ covariance[k:, k:] @ root.T,
    )


def _moved(problem: Problem, fit: Fit, steps: FloatArray, covariance: FloatArray) -> Fit:
    """Return the fit with its values moved, within their bounds; steps (k,) and covariance per step of a term."""
    if not fit.terms:
        return fit
    unit = np.array([term.step * term.parameter.scale for term in fit.terms])
    lower, upper = np.array([(term.parameter.lower, term.parameter.upper) for term in fit.terms]).T
    values = np.clip(fit.values + steps * unit, lower, upper)
    return replace(_at(problem, fit, values), sds=np.sqrt(np.diag(covariance)[: len(unit)]) * unit)
