# SPDX-License-Identifier: BSD-3-Clause
"""Covariances of motions between reference poses: noise of the rates with its colour, and errors of the reference."""

from __future__ import annotations

import numpy as np

from kurumaisu.bench.strangers.loess.robots import Robot
from kurumaisu.bench.strangers.loess.values import Array


def _driven(n: int, step: float, tau: float) -> Array:
    """Covariance of the integrals of unit noise over n steps in a row."""
    keep = np.exp(-step / tau)
    lag = np.abs(np.subtract.outer(np.arange(n), np.arange(n)))
    same = 2 * tau * (step - tau * (1 - keep))
    return np.asarray(np.where(lag == 0, same, tau**2 * (1 - keep) ** 2 * keep ** np.maximum(lag - 1, 0)))


def _measured(n: int, white: float, slow: float, keep: float) -> Array:
    """Covariance of the differences of n + 1 readings in a row."""
    lag = np.abs(np.subtract.outer(np.arange(n + 1), np.arange(n + 1)))
    full = white**2 * (lag == 0) + slow**2 * keep**lag
    d = np.eye(n, n + 1, 1) - np.eye(n, n + 1)
    return np.asarray(d @ full @ d.T)


def roots(robot: Robot, rates: Array, step: float) -> list[Array]:
    """Cholesky roots for dx, dy and dtheta of motions in a row, given the mean rates of each."""
    n, ref = len(rates), robot.reference
    share = robot.amplitude(rates[:, 0], rates[:, 1])
    both = np.outer(share, share)
    drawn = _driven(n, step, robot.tau)
    keep = float(np.exp(-step / ref.wander_tau))
    place = _measured(n, ref.position, ref.wander, keep)
    along = robot.sd_v**2 * both * drawn + place
    turned = robot.sd_w**2 * both * drawn + _measured(n, ref.heading, ref.wander_heading, keep)
    bent = (rates[:, 0] * step) ** 2 * (ref.totals()[1] ** 2 + robot.sd_w**2 * share**2 * drawn[0, 0] / 3)
    return [np.linalg.cholesky(c) for c in (along, place + np.diag(bent), turned)]


def motion_covariance(robot: Robot, rates: Array, step: float) -> Array:
    """Covariance of dx, dy, dtheta of one motion between two measured poses, of rates by steps."""
    n, ref = len(rates), robot.reference
    share = robot.amplitude(rates[:, 0], rates[:, 1])
    drawn = np.outer(share, share) * _driven(n, step, robot.tau)
    heading = np.concatenate([[0.0], np.cumsum(rates[:, 1]) * step])
    a = heading[:-1] + rates[:, 1] * step / 2
    c, s, v = np.cos(a), np.sin(a), rates[:, 0] * step
    dx, dy = np.cumsum(v * c), np.cumsum(v * s)
    by_turn = np.vstack([-(dy[-1] - dy + v * s / 2), dx[-1] - dx + v * c / 2, np.ones(n)])
    by_speed = np.vstack([c, s, np.zeros(n)])
    total = robot.sd_v**2 * by_speed @ drawn @ by_speed.T + robot.sd_w**2 * by_turn @ drawn @ by_turn.T
    change = 2 * (1 - np.exp(-n * step / ref.wander_tau))
    place = 2 * ref.position**2 + ref.wander**2 * change
    turn = 2 * ref.heading**2 + ref.wander_heading**2 * change
    first = np.array([dy[-1], -dx[-1], 0.0])
    first_sd = ref.totals()[1]
    shared = np.outer(first, first) * first_sd**2
    return np.asarray(total + shared + np.diag([place, place, turn]))
