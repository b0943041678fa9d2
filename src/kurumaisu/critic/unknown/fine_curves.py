# SPDX-License-Identifier: BSD-3-Clause
"""Curves that bend more often: eight knots draw a narrow gust badly, four waves a flat spot of a wheel.

What they leave passes for noise that wanders or grows, or for an effect beside the curve.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from kurumaisu.critic.base import replay
from kurumaisu.critic.engine.evidence import Fit, Problem
from kurumaisu.critic.unknown.curves import Curve, CurveEvidence, columns, curve_evidence


def fine_curves(problem: Problem, fit: Fit, curves: Sequence[Curve]) -> Iterator[tuple[Curve, CurveEvidence]]:
    """Yield, for each of the curves beside a fit that can bend, the one that does so more often, and its evidence."""
    motions = [replay.motion(drive, problem.model, fit.settings) for drive in problem.drives]
    fine = [(curve, curve.basis.fine(motions)) for curve in curves if curve.basis.size > 1]
    finer = [replace(curve, basis=basis) for curve, basis in fine if basis is not None]
    y = fit.beside.covariance.whiten(fit.beside.residual)
    free = fit.beside.white(columns(problem, fit.settings, finer))
    ends = np.cumsum([curve.basis.size for curve in finer])
    for curve, end in zip(finer, ends, strict=True):
        here = slice(end - curve.basis.size, end)
        part = free[:, here]
        found = curve_evidence(part.T @ part, part.T @ y, curve.basis.priors)
        nats = found.nats - float(np.log(curve.basis.ways))
        yield replace(curve, columns=slice(0, curve.basis.size)), replace(found, nats=nats)
