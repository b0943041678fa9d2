# SPDX-License-Identifier: BSD-3-Clause
"""Hidden faults in how the rates follow, in what the floor makes of them, and in what the reference sees."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise

import numpy as np
from scipy.signal import lfilter

from kurumaisu.bench.hidden.generator.motion import STEP, Measured, Rates, Sizes
from kurumaisu.types import FloatArray

_STANDS = 1e-3  # [m/s] below which casters do not roll
_REVERSES = 0.01  # [m/s] below which a chair that turns does not drive one way: its axis may be off by a lever


def _follow(rate: FloatArray, tau: float) -> FloatArray:
    """Return a first-order response from rest, by the trapezoidal rule."""
    if tau <= 0:
        return rate
    k = STEP / (2 * tau + STEP)
    return np.asarray(lfilter([k, k], [1.0, 2 * k - 1], rate))


def _cascade(rate: FloatArray, tau: float) -> FloatArray:
    """Return a second-order response whose mean delay is tau: two lags of 0.85 and 0.15 of it."""
    return _follow(_follow(rate, 0.85 * tau), 0.15 * tau)


def lag_v(r: Rates, s: Sizes) -> Rates:
    """V follows with a time constant `size` [s]."""
    return replace(r, v=_follow(r.v, s["size"]))


def lag_w(r: Rates, s: Sizes) -> Rates:
    """W follows with a time constant `size` [s]."""
    return replace(r, w=_follow(r.w, s["size"]))


def lag2_v(r: Rates, s: Sizes) -> Rates:
    """V follows as a second-order system of the same mean delay `size` [s]."""
    return replace(r, v=_cascade(r.v, s["size"]))


def lag2_w(r: Rates, s: Sizes) -> Rates:
    """W follows as a second-order system of the same mean delay `size` [s]."""
    return replace(r, w=_cascade(r.w, s["size"]))


def _goals(rate: FloatArray) -> tuple[list[float], list[float]]:
    """Return, per cell, the rate asked for at its end, and the share of the cell for which that is asked for.

    A cell whose mean lies between those of its neighbours, which are held, is one in which the command changes.
    """
    before, after = np.roll(rate, 1), np.roll(rate, -1)
    steady = np.isclose(before, np.roll(rate, 2), atol=1e-9) & np.isclose(after, np.roll(rate, -2), atol=1e-9)
    held = steady & ((rate - before) * (after - rate) > 1e-12)
    held[:2] = held[-2:] = False
    goal = np.where(held, after, rate)
    with np.errstate(divide="ignore", invalid="ignore"):
        share = np.where(held, (rate - before) / (after - before), 1.0)
    return goal.tolist(), share.tolist()


def _ramp(rate: FloatArray, slowness: float) -> FloatArray:
    """Return the cells' means of a rate whose slope is limited to 1 / slowness."""
    if slowness <= 0:
        return rate
    at, out = 0.0, []
    for goal, share in zip(*_goals(rate), strict=True):
        needed, given = abs(goal - at) * slowness, STEP * share
        if needed <= given:
            mean, end = goal - (goal - at) * needed / (2 * given), goal
        else:
            way = math.copysign(given / slowness, goal - at)
            mean, end = at + way / 2, at + way
        out.append((1 - share) * at + share * mean)
        at = end
    return np.array(out)


def _soft_ramp(rate: FloatArray, slowness: float) -> FloatArray:
    """Return the cells' means where the slope is tanh(what is missing / 0.05) / slowness, in closed form."""
    if slowness <= 0:
        return rate
    blend = 0.05  # [m/s], [rad/s]
    missing, before, out = 0.0, 0.0, []
    for goal, share in zip(*_goals(rate), strict=True):
        fade = math.exp(-share * STEP / 2 / (blend * slowness))
        at = before - missing
        missing += goal - before
        middle = blend * math.asinh(math.sinh(missing / blend) * fade)
        after = blend * math.asinh(math.sinh(middle / blend) * fade)
        out.append((1 - share) * at + share * (goal - (missing + 4 * middle + after) / 6))
        missing, before = after, goal
    return np.array(out)


def accel_limit(r: Rates, s: Sizes) -> Rates:
    """Both rates on ramps: v at 1 / `size` [m/s^2], w at 1 / (`ratio` size) [rad/s^2]."""
    return replace(r, v=_ramp(r.v, s["size"]), w=_ramp(r.w, s["size"] * s["ratio"]))


def soft_accel_limit(r: Rates, s: Sizes) -> Rates:
    """Ramps that end in a curve."""
    return replace(r, v=_soft_ramp(r.v, s["size"]), w=_soft_ramp(r.w, s["size"] * s["ratio"]))


def payload(r: Rates, s: Sizes) -> Rates:
    """Both rates slower by a share `size` and late by 2 s times it."""
    v, w = (_follow((1 - s["size"]) * rate, s["ratio"] * s["size"]) for rate in (r.v, r.w))
    return replace(r, v=v, w=w)


def payload2(r: Rates, s: Sizes) -> Rates:
    """The same with a second-order response."""
    v, w = (_cascade((1 - s["size"]) * rate, s["ratio"] * s["size"]) for rate in (r.v, r.w))
    return replace(r, v=v, w=w)


def battery_sag(r: Rates, s: Sizes) -> Rates:
    """Both rates less by `size` [1/s] of the time."""
    left = 1 - s["size"] * r.t
    return replace(r, v=r.v * left, w=r.w * left)


def battery_decay(r: Rates, s: Sizes) -> Rates:
    """Both rates die away exponentially."""
    left = np.exp(-s["size"] * r.t)
    return replace(r, v=r.v * left, w=r.w * left)


def understeer(r: Rates, s: Sizes) -> Rates:
    """W less by `size` [s^2/m^2] of the square of v."""
    return replace(r, w=r.w * (1 - s["size"] * r.v**2))


def characteristic_speed(r: Rates, s: Sizes) -> Rates:
    """W over 1 + (v / v_ch)^2, as of a car."""
    return replace(r, w=r.w / np.maximum(1 + s["size"] * r.v**2, 0.2))


def lateral_slip(r: Rates, s: Sizes) -> Rates:
    """A drift outwards, `size` [s] of the centripetal acceleration."""
    return replace(r, u=r.u - s["size"] * r.v * r.w)


def slope(r: Rates, s: Sizes) -> Rates:
    """V less by `size` [m/s] uphill, which is at `bearing` [rad] in the map; brakes hold a chair at rest."""
    climb = np.cos(r.headings() - s["bearing"])
    return replace(r, v=r.v - s["size"] * r.moving * climb)


def caster_reversal(r: Rates, s: Sizes) -> Rates:
    """A kick `size` [rad/s] after each reversal towards the last turn, gone after some `length` [m]."""
    return replace(r, w=r.w + _kicks(r, s, lambda way: np.exp(-way / s["length"])))


def caster_swing(r: Rates, s: Sizes) -> Rates:
    """The same with a kick that rises within 2 cm and dies as a Gaussian of the same distance."""
    return replace(r, w=r.w + _kicks(r, s, lambda way: np.exp(-(way**2) / (1.27 * s["length"] ** 2))))


def _kicks(r: Rates, s: Sizes, shape: Callable[[FloatArray], FloatArray]) -> FloatArray:
    out = np.zeros_like(r.v)
    way = np.concatenate([[0.0], np.cumsum(np.abs(r.v)) * STEP])
    driving = np.flatnonzero(np.abs(r.v) > _REVERSES)
    turning = np.flatnonzero(r.asked_w != 0)
    turns = driving[1:][np.sign(r.v[driving[1:]]) != np.sign(r.v[driving[:-1]])]
    for start, end in pairwise([*turns, len(out)]):
        # A command may fall into the cell before `start`, whose mean then has part of the new turn.
        last = np.searchsorted(turning, start - 1) - 1
        if last >= 0:
            middle = (way[start:end] + way[start + 1 : end + 1]) / 2 - way[start]
            out[start:end] = s["size"] * np.sign(r.asked_w[turning[last]]) * shape(middle)
    # A chair that lags never quite comes to rest; its casters do not go on turning it there.
    return np.asarray(np.where(np.abs(r.v) > _STANDS, out, 0.0))


def rate_noise(r: Rates, s: Sizes) -> Rates:
    """The noise's amplitude grows with the speeds, by `size` per 0.4 m/s and per 0.4 rad/s."""
    grown = 1 + s["size"] * (np.abs(r.asked_v) + np.abs(r.asked_w)) / 0.4
    return replace(r, noise=r.noise * grown[:, None])


def marker_x(m: Measured, s: Sizes) -> Measured:
    """The marker `size` [m] in front."""
    return replace(m, x=m.x + s["size"])


def marker_y(m: Measured, s: Sizes) -> Measured:
    """The marker `size` [m] to the left."""
    return replace(m, y=m.y + s["size"])


def clock_scale(m: Measured, s: Sizes) -> Measured:
    """The reference's clock fast by a share `size`."""
    return replace(m, pace=m.pace * (1 + s["size"]))
