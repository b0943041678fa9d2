# SPDX-License-Identifier: BSD-3-Clause
"""What a signal in measured poses is worth against known noise: its whitened norm z.

A small change of a drive is a deviation of poses from a nominal path. The known noise makes deviations, too: errors of
the reference, white ones and such that last, and the integral of Ornstein-Uhlenbeck rates along the path. All are
linear, so a Kalman filter that knows the noise turns any deviation into unit white noise; z is the norm of what it
makes of a noise-free signal.
z squared is twice the expected log likelihood ratio of somebody who knows everything but the signal's presence.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kurumaisu.bench.hidden.generator.noise import Regime
from kurumaisu.types import FloatArray

_VAGUE = 1e3  # [m], [rad] sd of the first pose's deviation: a drive begins where it begins


@dataclass(frozen=True)
class Path:
    """Nominal runs of equal length: times (n,), poses (runs, n, 3), and gate (runs, n - 1) of the noise's amplitude.

    gate: root mean square of the amplitude between two poses, 1 where the chair moves all the time.
    """

    times: FloatArray
    poses: FloatArray
    gate: FloatArray


class Whitener:
    """The filter of one set of runs under one regime of noise; its gains are worked out once."""

    def __init__(self, path: Path, regime: Regime) -> None:
        """Work out gains for all runs at once."""
        runs, n, _ = path.poses.shape
        size = _size(regime)
        observed = np.diag((1 - regime.lasting) * regime.reference_variance)
        lasting = regime.lasting * regime.reference_variance
        state = np.zeros((runs, size, size))
        state[:] = np.diag([_VAGUE**2] * 3 + [sd**2 for colour in regime.colours for sd in colour.sd] + [*lasting])
        self._see = see = np.zeros((3, size))
        see[:, :3] = see[:, -3:] = np.eye(3)
        self._moves: list[FloatArray] = []
        self._gains: list[FloatArray] = []
        self._roots: list[FloatArray] = []
        self.log_determinant = 0.0
        for k in range(n):
            if k:
                move, added = _transition(path, regime, k)
                state = move @ state @ move.transpose(0, 2, 1) + added
                self._moves.append(move)
            innovation = see @ state @ see.T + observed
            root = np.linalg.inv(np.linalg.cholesky(innovation))
            gain = state @ see.T @ (root.transpose(0, 2, 1) @ root)
            state = state - gain @ see @ state
            state = (state + state.transpose(0, 2, 1)) / 2
            self._gains.append(gain)
            self._roots.append(root)
            self.log_determinant += -2 * float(np.log(np.diagonal(root, axis1=1, axis2=2)).sum()) if k else 0.0

    def whiten(self, deviations: FloatArray) -> FloatArray:
        """Return whitened columns (runs * (n - 1) * 3, columns) of deviations (runs, n, 3, columns)."""
        runs, n, _, columns = deviations.shape
        out = np.empty((n, runs, 3, columns))
        state = np.zeros((runs, self._gains[0].shape[1], columns))
        for k in range(n):
            if k:
                state = self._moves[k - 1] @ state
            surprise = deviations[:, k] - self._see @ state
            out[k] = self._roots[k] @ surprise
            state = state + self._gains[k] @ surprise
        return out[1:].reshape(-1, columns)

    def colour(self, white: FloatArray) -> FloatArray:
        """Return deviations (runs, n, 3, columns) that `whiten` turns into these white ones, of the same shape."""
        out = np.empty_like(white)
        state = np.zeros((len(white), self._gains[0].shape[1], white.shape[3]))
        for k in range(white.shape[1]):
            if k:
                state = self._moves[k - 1] @ state
                surprise = np.linalg.solve(self._roots[k], white[:, k])
            else:
                surprise = np.zeros_like(white[:, 0])
            out[:, k] = self._see @ state + surprise
            state = state + self._gains[k] @ surprise
        return out


def deviation(nominal: FloatArray, changed: FloatArray) -> FloatArray:
    """Return the linear deviation (n, 3) along a nominal path whose steps differ as those of a changed one do.

    Steps are compared in the frame of the pose that they start from, so a turn far back does not count for ever.
    """
    steps = _body_steps(changed) - _body_steps(nominal)
    c, s = np.cos(nominal[:-1, 2]), np.sin(nominal[:-1, 2])
    turned = np.concatenate([[0.0], np.cumsum(steps[:, 2])])
    across = np.diff(nominal[:, :2], axis=0)
    x = np.cumsum(c * steps[:, 0] - s * steps[:, 1] - turned[:-1] * across[:, 1])
    y = np.cumsum(s * steps[:, 0] + c * steps[:, 1] + turned[:-1] * across[:, 0])
    return np.stack([np.concatenate([[0.0], x]), np.concatenate([[0.0], y]), turned], axis=1)


def _body_steps(poses: FloatArray) -> FloatArray:
    d = np.diff(poses, axis=0)
    c, s = np.cos(poses[:-1, 2]), np.sin(poses[:-1, 2])
    return np.stack([c * d[:, 0] + s * d[:, 1], c * d[:, 1] - s * d[:, 0], d[:, 2]], axis=1)


def _transition(path: Path, regime: Regime, k: int) -> tuple[FloatArray, FloatArray]:
    """Return what happens to the state from pose k - 1 to pose k, and the covariance that noise adds, per run.

    The state: deviation of x, y, heading; then v, u, w of each colour; then the reference's errors that last.
    """
    before, after = path.poses[:, k - 1], path.poses[:, k]
    t = path.times[k] - path.times[k - 1]
    runs, size = len(before), _size(regime)
    across = after[:, :2] - before[:, :2]
    middle = (before[:, 2] + after[:, 2]) / 2
    spread = np.zeros((runs, 3, 3))  # from the integrals of v, u, w over the step to the deviation
    spread[:, 0, 0] = spread[:, 1, 1] = np.cos(middle)
    spread[:, 1, 0], spread[:, 0, 1] = np.sin(middle), -np.sin(middle)
    spread[:, 0, 2], spread[:, 1, 2], spread[:, 2, 2] = -across[:, 1] / 2, across[:, 0] / 2, 1.0
    spread *= path.gate[:, k - 1, None, None]
    move = np.zeros((runs, size, size))
    move[:] = np.eye(size)
    move[:, 0, 2], move[:, 1, 2] = -across[:, 1], across[:, 0]
    added = np.zeros((runs, size, size))
    for i, colour in enumerate(regime.colours):
        at = slice(3 + 3 * i, 6 + 3 * i)
        keep = np.exp(-t / colour.tau)
        variance = np.diag(np.square(colour.sd))
        move[:, at, at] = keep * np.eye(3)
        move[:, :3, at] = colour.tau * (1 - keep) * spread
        integral = 2 * colour.tau * t - colour.tau**2 * (3 - 4 * keep + keep**2)
        added[:, at, at] = (1 - keep**2) * variance
        added[:, :3, at] = colour.tau * (1 - keep) ** 2 * spread @ variance
        added[:, at, :3] = added[:, :3, at].transpose(0, 2, 1)
        added[:, :3, :3] += integral * spread @ variance @ spread.transpose(0, 2, 1)
    kept = np.exp(-t / regime.lasting_tau)
    move[:, -3:, -3:] = kept * np.eye(3)
    added[:, -3:, -3:] = (1 - kept**2) * np.diag(regime.lasting * regime.reference_variance)
    return move, added


def _size(regime: Regime) -> int:
    return 3 + 3 * len(regime.colours) + 3
