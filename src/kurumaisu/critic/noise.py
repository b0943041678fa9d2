# SPDX-License-Identifier: BSD-3-Clause
"""Noise first: how the reference and the motion fluctuate, estimated on every data set.

Taking it from a table, or treating increments as independent, makes a critic name effects that are not there.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize

from kurumaisu._core import whiten
from kurumaisu.critic.drive import Drive
from kurumaisu.types import FloatArray


@dataclass(frozen=True)
class Noise:
    """Of the reference pose and of the rates.

    position_sd [m], heading_sd [rad]: white; sd_v [m/s], sd_lateral [m/s], sd_w [rad/s]: stationary sd of
    Ornstein-Uhlenbeck processes of time constant tau [s].
    """

    position_sd: float
    heading_sd: float
    sd_v: float
    sd_lateral: float
    sd_w: float
    tau: float


# Where the search for the noise starts, and how far from there a value remains plausible (natural log, 1 sd).
START = Noise(position_sd=0.01, heading_sd=0.005, sd_v=0.02, sd_lateral=0.005, sd_w=0.03, tau=0.3)
_SPREAD = np.array([2.0, 2.0, 2.0, 2.0, 2.0, 1.0])
_FLOOR = np.array([1e-5, 1e-5, 1e-5, 1e-5, 1e-5, 0.02])
_CEILING = np.array([1.0, 1.0, 3.0, 3.0, 10.0, 20.0])


def whitened(drive: Drive, columns: FloatArray, noise: Noise) -> tuple[FloatArray, FloatArray]:
    """Return L^-1 X for columns X (3 m, k) of increment residuals, L L' their covariance; its log det in m parts."""
    return whiten(
        drive.poses,
        drive.times,
        columns,
        position_sd=noise.position_sd,
        heading_sd=noise.heading_sd,
        process_sd=[noise.sd_v, noise.sd_lateral, noise.sd_w],
        process_tau=noise.tau,
    )


def estimate(
    drives: Sequence[Drive],
    residuals: Sequence[FloatArray],
    columns: Sequence[FloatArray],
    truth: tuple[float, float] | None,
) -> Noise:
    """Return the noise by restricted maximum likelihood.

    residuals: (m, 3) per drive, measured minus simulated; columns: (3 m, k) per drive, effects to project out, so
    that a real effect does not pass for noise; truth: known sd of the reference, else it is estimated too.
    """
    start = np.array(list(vars(START).values()))
    if truth is not None:
        start[:2] = np.maximum(truth, _FLOOR[:2])
    free = np.arange(0 if truth is None else 2, 6)
    stacked = [np.column_stack([r.ravel(), c]) for r, c in zip(residuals, columns, strict=True)]

    def noise_at(log_values: FloatArray) -> Noise:
        values = start.copy()
        values[free] = np.clip(np.exp(log_values), _FLOOR[free], _CEILING[free])
        return Noise(*(float(value) for value in values))

    def cost(log_values: FloatArray) -> float:
        distance = (log_values - np.log(start[free])) / _SPREAD[free]
        noise = noise_at(log_values)
        return _restricted_cost(drives, stacked, noise) + 0.5 * float(distance @ distance)

    at = np.log(start[free])
    for _ in range(2):  # a second start from the end of the first: Nelder-Mead may stop early on a ridge
        at = minimize(cost, at, method="Nelder-Mead", options={"xatol": 0.01, "fatol": 0.02, "maxfev": 600}).x
    return noise_at(at)


def _restricted_cost(drives: Sequence[Drive], stacked: Sequence[FloatArray], noise: Noise) -> float:
    """Return minus the restricted log likelihood, up to a constant."""
    parts = [whitened(drive, columns, noise) for drive, columns in zip(drives, stacked, strict=True)]
    log_determinant = sum(float(part[1].sum()) for part in parts)
    y = np.concatenate([part[0][:, 0] for part in parts])
    x = np.concatenate([part[0][:, 1:] for part in parts])
    gram = x.T @ x + 1e-6 * np.eye(x.shape[1])
    rest = float(y @ y - (x.T @ y) @ np.linalg.solve(gram, x.T @ y))
    return 0.5 * (log_determinant + rest + float(np.linalg.slogdet(gram)[1]))
