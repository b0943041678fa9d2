# SPDX-License-Identifier: BSD-3-Clause
"""The base's part of the catalogue: for each cause its plain form and others that its sentence allows, too."""

from types import SimpleNamespace as Signals
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from .chair import DT, TOOLS, table

Array = NDArray[Any]


def lag(x: Array, tau: Array | float, order: int = 1) -> Array:
    """Return x through a first-order lag, repeated; tau may differ from cell to cell."""
    if np.ndim(tau) == 0:
        a = float(np.exp(-DT / max(float(tau), 1e-4) * order))
        for _ in range(order):
            x = lfilter([1 - a], [1, -a], x)
        return x
    out, y = np.empty_like(x), 0.0
    for k, (value, a) in enumerate(zip(x.tolist(), np.exp(-DT / np.maximum(tau, 1e-4)).tolist(), strict=True)):
        out[k] = y = a * y + (1 - a) * value
    return out


def ringing(x: Array, tau: float) -> Array:
    """Return x through a second-order lag that overshoots, with the same area of its step as a lag of tau."""
    p = np.exp(DT / tau * complex(-0.5, np.sqrt(0.75)))
    a = [1.0, -2 * p.real, abs(p) ** 2]
    return np.asarray(lfilter([sum(a)], a, x))


def slew(x: Array, up: float, down: float) -> Array:
    """Return x in ramps: at most `up` away from zero and `down` towards it, per second."""
    out, y = np.empty_like(x), 0.0
    for k, value in enumerate(x.tolist()):
        limit = (up if abs(value) > abs(y) and value * y >= 0 else down) * DT
        out[k] = y = y + min(max(value - y, -limit), limit)
    return out


def play(x: Array, width: float) -> Array:
    """Return x through play, followed only once it has gone through the width; 0 where x is."""
    out, y, half = np.empty_like(x), 0.0, abs(width) / 2
    for k, value in enumerate(x.tolist()):
        out[k] = y = min(max(y, value - half), value + half)
    return np.where(np.abs(x) < 1e-9, 0.0, out)


def last(mask: Array, values: Array, before: float) -> Array:
    """Return the value at the last place so far where mask was true."""
    k = np.maximum.accumulate(np.where(mask, np.arange(len(mask)), -1))
    return np.where(k >= 0, values[np.maximum(k, 0)], before)


def turned(s: Signals, which: int = 0) -> Array:
    """Return distance driven since the last reversal (huge before any); `which` takes one sort only."""
    way = last(s.vc != 0, np.sign(s.vc), 0.0)
    turn, along = np.diff(way, prepend=0) * (np.roll(way, 1) != 0), np.cumsum(np.abs(s.v)) * DT
    return np.asarray(along - last(turn * which > 0 if which else turn != 0, along, -1e3))


TOOLS |= {f.__name__: f for f in (lag, ringing, slew, play, last, turned)}
TOOLS |= {  # volts beyond the dead zone; a dead zone that is wider by volts; values a while ago; how long since
    "volted": lambda rate, law: np.abs(rate) * np.where(rate > 0, abs(law[0]), abs(law[2])),
    "shrunk": lambda x, law, by: x * np.maximum(1 - by / np.maximum(TOOLS["volted"](x, law), 1e-9), 0),
    "shifted": lambda x, delay: np.interp(np.arange(len(x)) - delay / DT, np.arange(len(x)), x, left=0.0),
    "since": lambda mask, along: along - last(mask, along, -1e3),
    "grown": lambda x: np.diff(np.abs(x), prepend=0.0),
    "starting": lambda x: last(np.abs(TOOLS["grown"](x)) > 1e-6, TOOLS["grown"](x), 1.0) > 0,
    "steps": lambda x, q: np.round(x / q) * q,
    "boxed": lambda x, wide: lfilter(np.ones(round(wide / DT)) / round(wide / DT), [1.0], x),
}
BASE = table(
    """
dac_zero_f | volt offset 0.006 0.04 ± | vf += a | rises in a minute: vf += 1.4 * a * (1 - exp(-t / 30))
dac_zero_s | volt offset 0.006 0.04 ± | vs += a | rises in a minute: vs += 1.4 * a * (1 - exp(-t / 30))
dac_quantisation | volt step 0.02 0.2 + | vf = steps(vf, a); vs = steps(vs, a) | cut off: vf = fix(vf / a) * a; vs =
  fix(vs / a) * a | coarser far out: vf = sign(vf) * steps(sqrt(abs(vf)), a)**2; vs = sign(vs) * steps(sqrt(abs(vs)),
  a)**2
steering_law | volt flip 1 1 + | deep = where(vs < -0.104181, (vs + 0.104181) / -0.499211, where(vs > 0.169476, (vs -
  0.169476) / -0.469278, 0.0))
delay | cmd delay 0.03 0.4 + | vc = shifted(vc, a); wc = shifted(wc, a) | longer when starting: vc = shifted(vc, a *
  where(starting(vc), 1.6, 0.3)); wc = shifted(wc, 0.5 * a) | comes and goes: vc = shifted(vc, a * (1 + 0.9 * sin(all /
  3))); wc = shifted(wc, a * (1 + 0.9 * sin(all / 3)))
dead_zone_v | rate width 0.01 0.2 + | v = shrunk(v, LAW_V, a) | hard: v *= volted(v, LAW_V) > 1.5 * a | soft: v *= 1 -
  exp(-(volted(v, LAW_V) / 1.5 / a)**2)
dead_zone_w | rate width 0.01 0.15 + | w = shrunk(w, LAW_W, a) | hard: w *= volted(w, LAW_W) > 1.5 * a | soft: w *= 1 -
  exp(-(volted(w, LAW_W) / 1.5 / a)**2)
backlash | dyn play 0.03 0.4 + | w = play(w, a) | closes while turning: w += lag(play(w, a) - w, 0.7) | behind a lag: w
  = play(lag(w, 0.05), 1.5 * a)
cross_v_to_w | volt share 0.008 0.08 ± | vs += a * vf | with the square: vs += a * vf * abs(vf) | above half a volt: vs
  += 2 * a * sign(vf) * max(abs(vf) - 0.5, 0)
gain_v | rate gain 0.03 0.25 ± each | v *= 1 + a
gain_w | rate gain 0.03 0.25 ± each | w *= 1 + a
left_right_gain | rate asymmetry 0.03 0.2 ± | w += a * abs(w) | in quick turns: w += a * abs(w) * tanh(4 * w**2)
veer | rate curvature 0.01 0.1 ± each | w += a * v | forward only: w += a * max(v, 0) | more when fast: w += a * v *
  (0.5 + 2 * abs(v))
reverse_gain | rate gain 0.03 0.25 ± | v *= 1 + a * (v < 0) | limits softly: v = v / (1 + 4 * abs(a) * max(-v, 0)) |
  comes in a second: v *= 1 + 1.5 * a * (v < 0) * (1 - exp(-since(v >= 0, t)))
curvature_v | rate curvature 0.04 0.4 ± | v *= 1 - a * abs(v) | cubic: v *= 1 - 1.5 * a * v**2 | a power: v = sign(v) *
  abs(v)**(1 - 0.5 * a)
curvature_w | rate curvature 0.04 0.3 ± | w *= 1 - a * abs(w) | cubic: w *= 1 - a * w**2 | a power: w = sign(w) *
  abs(w)**(1 - a)
saturation | rate inverse_v 1.2 4 + | v = clip(v, -1 / a, 1 / a) | soft knee: v = v / (1 + (v * a)**4)**0.25 | less
  steep above: v = 0.3 * v + 0.7 * clip(v, -1 / a, 1 / a)
battery_sag | rate sag 0.0005 0.004 + | v *= 1 - a * t; w *= 1 - a * t | by the charge used: v *= 1 - 2 * a *
  cumsum(abs(v) + 0.4 * abs(w)) * DT; w *= 1 - 2 * a * cumsum(abs(v) + 0.4 * abs(w)) * DT | by the square of the time:
  v *= 1 - a * t**2 / 60; w *= 1 - a * t**2 / 60
cross_w_to_v | rate lever 0.02 0.15 ± | v += a * w | either way: v += a * abs(w) | with the square: v += 1.5 * a * w**2
lag_v | dyn tau 0.05 0.6 + | v = lag(v, a) | second order: v = lag(v, a, 2) | overshoots: v = ringing(v, a) | only when
  starting: v = lag(v, where(starting(vc), a, 0.02))
lag_w | dyn tau 0.05 0.5 + | w = lag(w, a) | second order: w = lag(w, a, 2) | overshoots: w = ringing(w, a) | slower on
  the spot: w = lag(w, where(abs(v) < 0.05, 1.5 * a, 0.6 * a))
accel_limit | dyn slowness_v 0.7 5 + slowness_w:0.3:1.5 | v = slew(v, 1 / a, 1 / a); w = slew(w, 1 / slowness_w, 1 /
  slowness_w) | rounded ramps: v = boxed(slew(v, 1 / a, 1 / a), 0.4) | brakes twice as hard: v = slew(v, 0.7 / a, 1.4 /
  a)
payload | dyn droop 0.03 0.2 + tau:0.08:0.25 | v = lag(v * (1 - a), tau); w = lag(w * (1 - a), tau) | second order: v =
  lag(v * (1 - a), tau, 2); w = lag(w * (1 - a), tau, 2) | droops when slow: v = lag(v - 2 * a * v / (1 + 2 * abs(v)),
  tau); w = lag(w - 2 * a * w / (1 + 2 * abs(w)), tau)
understeer | rate k 0.06 0.8 + | w = w / (1 + a * v**2) | by the side force: w = w / (1 + 0.6 * a * abs(v * w)) | above
  a threshold: w = w / (1 + 2 * a * max(abs(v) - 0.25, 0))
caster_reversal | dyn kick 0.06 0.5 ± length:0.15:0.5 | w += a * exp(-turned(s) / length) * (abs(v) > 1e-9) | half a
  turn: w += a * sin(pi * min(turned(s) / 2.5 / length, 1)) * (abs(v) > 1e-9) | into reverse only: w += a *
  exp(-turned(s, -1) / length) * (abs(v) > 1e-9)
lateral_slip | kin c 0.02 0.3 + | vy -= a * v * w | with the square: vy -= 6 * a * v * w * abs(v * w) | above a
  threshold: vy -= 2 * a * sign(v * w) * max(abs(v * w) - 0.05, 0)
slope | kin climb 0.01 0.06 + way:-3.1:3.1 | v -= a * cos(theta - way) * (abs(v) > 1e-6) | by share: v -= 2.5 * a *
  cos(theta - way) * abs(v) | uphill only: v -= 1.5 * a * max(cos(theta - way) * sign(v), 0) * sign(v) * (abs(v) >
  1e-6)
marker_x | ref x 0.015 0.15 ± each | x += a * cos(theta); y += a * sin(theta)
marker_y | ref y 0.015 0.12 ± each | x -= a * sin(theta); y += a * cos(theta)
marker_yaw | ref yaw 0.01 0.06 ± each | theta += a
clock_scale | clock scale 0.0005 0.006 ± | taken = t / (1 + a) | faster and faster: taken = t - a * t**2 / 120 | set
  right in steps: taken = t - a * (t - 14 * floor(t / 20))
""",
    "base.",
)
