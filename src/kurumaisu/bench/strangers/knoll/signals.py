# SPDX-License-Identifier: BSD-3-Clause
"""Signals on the grid: laws, lags, dead times, backlash and noise."""

from __future__ import annotations

import numpy as np
from scipy.signal import lfilter

from kurumaisu.bench.strangers.knoll.things import DT, Rng
from kurumaisu.types import BoolArray, FloatArray

_V = ((1.32402, 0.127906), (2.07369, -0.108783))
_W = {
    "corrected": ((-0.499211, -0.104181), (-0.469278, 0.169476)),
    "published": ((-0.499211, 0.104181), (-0.469278, -0.169476)),
}


def volts(law: str, v: FloatArray, w: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the voltages of rates."""
    ((a, b), (c, d)), ((e, f), (g, h)) = _V, _W[law]
    return (
        np.where(v > 0, a * v + b, np.where(v < 0, c * v + d, 0.0)),
        np.where(w > 0, e * w + f, np.where(w < 0, g * w + h, 0.0)),
    )


def rates(law: str, vf: FloatArray, vs: FloatArray, wc: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the rates of voltages; where a law has two, the one with the sign that was meant."""
    ((a, b), (c, d)), ((e, f), (g, h)) = _V, _W[law]
    v = np.where(vf > b, (vf - b) / a, np.where(vf < d, (vf - d) / c, 0.0))
    if law == "corrected":
        return v, np.where(vs < f, (vs - f) / e, np.where(vs > h, (vs - h) / g, 0.0))
    return v, np.where(wc > 0, np.maximum((vs - f) / e, 0), np.where(wc < 0, np.minimum((vs - h) / g, 0), 0.0))


def lag(x: FloatArray, tau: float, two: bool = False) -> FloatArray:
    """Return x after a lag of first order from rest, or after a mean of two such lags."""

    def one(tau: float) -> FloatArray:
        a = 1 - np.exp(-DT / max(tau, 1e-4))
        return np.asarray(lfilter([a], [1, a - 1], x))

    return 0.6 * one(0.5 * tau) + 0.4 * one(1.75 * tau) if two else one(tau)


def shift(x: FloatArray, delay: float) -> FloatArray:
    """Return x after a pure delay."""
    t = np.arange(x.size)
    k = delay / DT
    low = int(np.floor(k))
    f = k - low
    early, late = (np.where(t >= n, x[np.maximum(t - n, 0)], 0.0) for n in (low, low + 1))
    return (1 - f) * early + f * late


def play(w: FloatArray, width: float) -> FloatArray:
    """Return w after backlash of half a width; none at rest."""
    out, last, y = np.zeros_like(w), 0, 0.0
    for k in np.flatnonzero(np.diff(w, prepend=0.0)):
        out[last:k] = y
        y = min(max(y, w[k] - width), w[k] + width)
        last = k
    out[last:] = y
    return np.where(w == 0, 0.0, out)


def ramp(x: FloatArray, slow: float, soft: bool) -> FloatArray:
    """Return x with limited acceleration; soft: less of it near the goal."""
    out, y, most = np.empty_like(x), 0.0, DT / slow
    for k, goal in enumerate(x.tolist()):
        d = goal - y
        y += min(max(d * DT / 0.12 if soft else d, -most), most)
        out[k] = y
    return out


def since_reversal(v: FloatArray) -> FloatArray:
    """Return the distance since the last reversal."""
    s = np.sign(v)
    moving = np.flatnonzero(s)
    d, far, m = np.full(v.size, 1e9), np.cumsum(np.abs(v)) * DT, s[moving]
    for k in moving[1:][m[1:] != m[:-1]]:
        d[k:] = far[k:] - far[k]
    return d


def since(flag: BoolArray) -> FloatArray:
    """Return the time since the flag last held."""
    t = np.arange(flag.size) * DT
    last = np.maximum.accumulate(np.where(flag, t, -1e9))
    return np.asarray(np.minimum(t - last, 1e3))


def wandering(rng: Rng, n: int, sd: float, tau: float, dt: float = DT) -> FloatArray:
    """Draw stationary Ornstein-Uhlenbeck noise."""
    a = np.exp(-dt / tau)
    e = rng.normal(0, sd * np.sqrt(1 - a * a), n)
    e[0] = rng.normal(0, sd)
    return np.asarray(lfilter([1], [1, -a], e))


def normal(x: FloatArray, mean: FloatArray, sd: FloatArray) -> FloatArray:
    """Return the normal density."""
    return np.asarray(np.exp(-0.5 * ((x - mean) / sd) ** 2) / (sd * 2.5066283))
