# SPDX-License-Identifier: BSD-3-Clause
"""How strongly causes of the base show in the motions of the drives to fit."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import solve_triangular

from kurumaisu.bench.strangers.scree.basics import STEP, Array, between
from kurumaisu.bench.strangers.scree.driving import activity
from kurumaisu.bench.strangers.scree.plant import Causes, Drive, reference_path
from kurumaisu.bench.strangers.scree.reference import Reference


@dataclass(frozen=True)
class Strength:
    """How long the whitened effect is, and how much of it nothing else explains."""

    z: float
    beside: float


def left_over(effect: Array, others: list[Array]) -> float:
    """The length of an effect after projecting on others."""
    used = [o for o in others if float(o @ o) > 1e-12]
    if not used:
        return float(np.linalg.norm(effect))
    basis, _ = np.linalg.qr(np.stack([o / np.linalg.norm(o) for o in used], axis=1))
    return float(np.linalg.norm(effect - basis @ (basis.T @ effect)))


def worst(effect: Array, others: list[Array], rivals: list[Array]) -> Strength:
    """Strength beside the others and the worst of the rivals."""
    rest = [left_over(effect, [*others, r]) for r in rivals] + [left_over(effect, others)]
    return Strength(float(np.linalg.norm(effect)), min(rest))


def _drifted(sd: float, tau: float, n: int) -> Array:
    """Covariance of increments over 1 s of a slow wander."""
    lag = np.abs(np.subtract.outer(np.arange(n + 1), np.arange(n + 1)))
    c = sd**2 * np.exp(-lag / tau)
    return np.asarray(c[1:, 1:] - c[1:, :-1] - c[:-1, 1:] + c[:-1, :-1])


def _rates(sd: float, tau: float, n: int) -> Array:
    """Covariance of the integrals over seconds of coloured noise."""
    lag = np.abs(np.subtract.outer(np.arange(n), np.arange(n))).astype(float)
    one = 2 * sd**2 * tau * (1 - tau * (1 - np.exp(-1 / tau)))
    far = (sd * tau) ** 2 * np.exp(-(lag - 1) / tau) * (1 - np.exp(-1 / tau)) ** 2
    return np.where(lag == 0, one, far)


def _factors(drive: Drive, r: Reference, motion: Array) -> list[Array]:
    n = len(motion)
    white = 2 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1)
    busy = activity(drive, drive.n)
    share = np.array([np.mean(busy[int((k + 1) / STEP) : int((k + 2) / STEP)]) for k in range(n)])
    both = np.sqrt(np.outer(share, share))
    robot = drive.robot
    forward = _rates(robot.noise_v, robot.tau, n) * both
    yaw = _rates(robot.noise_w, robot.tau, n) * both
    place = r.place**2 * white + _drifted(r.wander, r.tau, n)
    far, side = motion[:, 0], motion[:, 1]
    x = forward + place + np.diag((side * r.heading) ** 2)
    y = place + np.diag((far * r.heading) ** 2) + np.outer(far, far) * yaw / 3
    return [np.linalg.cholesky(c) for c in (x, y, yaw + r.heading**2 * white)]


@dataclass(frozen=True)
class Motions:
    """Whitened motions of some drives."""

    drives: tuple[Drive, ...]
    factors: tuple[list[Array], ...]

    def of(self, causes: Causes) -> Array:
        """The motions that these causes make, whitened, as one vector."""
        parts = []
        for drive, factors in zip(self.drives, self.factors, strict=True):
            motion = seconds(drive, causes)
            parts += [solve_triangular(f, motion[:, k], lower=True) for k, f in enumerate(factors)]
        return np.concatenate(parts)


def seconds(drive: Drive, causes: Causes) -> Array:
    """Motions between reference poses 1 s apart."""
    pose = reference_path(drive, causes, np.arange(1.0, drive.length - 1.0))
    return between(pose[:-1], pose[1:])


def motions(drives: tuple[Drive, ...], causes: Causes, r: Reference) -> Motions:
    """The yardstick for motions of drives with these causes."""
    return Motions(drives, tuple(_factors(d, r, seconds(d, causes)) for d in drives))
