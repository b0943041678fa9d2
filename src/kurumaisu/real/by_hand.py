# SPDX-License-Identifier: BSD-3-Clause
"""What a careful person computes with numpy alone, to hold against the critic: least squares and correlations.

Nothing here shares code with the critic or the simulator.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kurumaisu.robust import SIGMA_PER_MAD
from kurumaisu.types import FloatArray

_ROUNDS = 8  # of reweighting against outliers


@dataclass(frozen=True)
class Line:
    """Coefficients (k,) and their standard errors (k,), of rows that count as independent; rms of what is left."""

    at: FloatArray
    sd: FloatArray
    rms: float

    def told(self, i: int, digits: int = 4) -> str:
        """Return a coefficient with its error, in words."""
        return f"{self.at[i]:.{digits}f} +- {self.sd[i]:.{digits}f}"


def least_squares(columns: FloatArray, y: FloatArray) -> Line:
    """Return the ordinary least squares of y (n,) over columns (n, k)."""
    at = np.linalg.lstsq(columns, y, rcond=None)[0]
    left = y - columns @ at
    variance = float(left @ left) / max(len(y) - columns.shape[1], 1)
    sd = np.sqrt(variance * np.diag(np.linalg.inv(columns.T @ columns)))
    return Line(at, sd, float(np.sqrt(np.mean(left**2))))


def robust(columns: FloatArray, y: FloatArray) -> FloatArray:
    """Return least squares with weights that give up what is far off (Cauchy), (k,)."""
    weight = np.ones(len(y))
    at = np.zeros(columns.shape[1])
    for _ in range(_ROUNDS):
        at = np.linalg.lstsq(columns * weight[:, None], y * weight, rcond=None)[0]
        left = y - columns @ at
        scale = max(SIGMA_PER_MAD * float(np.median(np.abs(left))), 1e-6)
        weight = 1 / np.sqrt(1 + (left / (2 * scale)) ** 2)
    return at


def lagged(t: FloatArray, asked: FloatArray, gain: float, tau: float, delay: float) -> FloatArray:
    """Return what a first-order lag behind a delay makes of a held input at times t (n,), from rest."""
    fine = np.arange(t[0], t[-1] + 0.005, 0.005)
    u = gain * asked[np.clip(np.searchsorted(t, fine - delay + 1e-9, side="right") - 1, 0, None)]
    u[fine - delay < t[0]] = 0.0
    out = np.zeros(len(fine))
    share = 1 - np.exp(-0.005 / max(tau, 1e-6))
    for i in range(1, len(fine)):
        out[i] = out[i - 1] + share * (u[i - 1] - out[i - 1])
    return np.interp(t, fine, out)


def step_response(t: FloatArray, asked: FloatArray, seen: FloatArray) -> tuple[float, float, float, float]:
    """Return gain, tau [s], delay [s] and rms of the first-order lag behind a delay that fits best (grid search)."""
    best = (np.inf, 1.0, 0.0, 0.0)
    for delay in np.arange(0.0, 0.51, 0.05):
        for tau in np.geomspace(0.02, 4.0, 25):
            shape = lagged(t, asked, 1.0, tau, delay)
            gain = float(shape @ seen / (shape @ shape))
            rms = float(np.sqrt(np.mean((seen - gain * shape) ** 2)))
            best = min(best, (rms, gain, float(tau), float(delay)))
    return best[1], best[2], best[3], best[0]


def best_shift(t: FloatArray, a: FloatArray, b: FloatArray, longest: float) -> tuple[float, float]:
    """Return by how many seconds b comes after a, by the highest correlation, and that; samples are evenly spaced."""
    step = float(np.median(np.diff(t)))
    found = (0.0, -1.0)
    for k in range(-round(longest / step), round(longest / step) + 1):
        x, y = (a[: len(a) - k], b[k:]) if k >= 0 else (a[-k:], b[:k])
        value = float(np.corrcoef(x, y)[0, 1])
        found = max(found, (k * step, value), key=lambda pair: pair[1])
    return found


def range_flow(ranges: FloatArray, angles: FloatArray, lever: float) -> FloatArray:
    """Return how far the robot went ahead and turned between scans, (n - 1, 2) [m, rad], from the scans alone.

    ranges (n, b) [m], nan where there is none; angles (b,) [rad]; lever [m]: laser ahead of the axle. A beam that
    meets a wall r away, which recedes by r' per radian, shortens by (cos + sin r'/r) per metre the laser goes ahead,
    and by (sin - cos r'/r) per metre sideways; and a turn takes the wall's slope past the beam. Unknown are the way
    ahead and the turn; outliers (corners, people) are given up.
    """
    moves = np.full((len(ranges) - 1, 2), np.nan)
    step = angles[1] - angles[0]
    for i in range(len(ranges) - 1):
        middle = 0.5 * (ranges[i] + ranges[i + 1])
        slope = np.full(len(angles), np.nan)
        slope[3:-3] = (middle[6:] - middle[:-6]) / (6 * step)
        level = slope / middle
        bent = np.full(len(angles), np.nan)
        bent[3:-3] = np.abs(middle[6:] + middle[:-6] - 2 * middle[3:-3]) / middle[3:-3]
        use = np.isfinite(level) & (np.abs(level) < 2.0) & (bent < 0.02)
        use &= np.abs(ranges[i + 1] - ranges[i]) < 0.3
        if use.sum() < 40:
            continue
        cos, sin = np.cos(angles), np.sin(angles)
        ahead, aside = -(cos + sin * level), -(sin - cos * level)
        columns = np.column_stack([ahead, slope + lever * aside])[use]
        moves[i] = robust(columns, (ranges[i + 1] - ranges[i])[use])
    return moves
