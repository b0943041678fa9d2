# SPDX-License-Identifier: BSD-3-Clause
"""Effects on the base once more, from the formulas of docs/effects.md: plain loops, no code of the package.

Each function takes parameters and a drive and returns what the drive becomes. Laws are read from the model file.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import yaml

_FILE = yaml.safe_load((Path(__file__).resolve().parents[1] / "launch/md100.yaml").read_text())
_LAWS = _FILE["voltage_laws"][_FILE["voltage_law"]]


@dataclass
class Drive:
    """Rates of steps of dt [s]: v [m/s], w [rad/s]; heading [rad] at the start."""

    dt: float
    v: list[float]
    w: list[float]
    heading: float


Rates = tuple[list[float], list[float], list[float]]  # v, u, w
RATES: dict[str, Callable[[dict[str, float], Drive], Rates]] = {}
VOLTS: dict[str, Callable[[dict[str, float], list[float], list[float], list[float]], tuple[list, list]]] = {}


def _rates(name):
    def register(function):
        RATES[name] = function
        return function

    return register


def _volts(name):
    def register(function):
        VOLTS[name] = function
        return function

    return register


def branch(axis: str, rate: float) -> tuple[float, float]:
    """Return slope and intercept of the side of a law that a rate is on."""
    side = _LAWS[axis]["negative" if rate < 0 else "positive"]
    return side["slope"], side["intercept"]


def volts(axis: str, rate: float) -> float:
    slope, intercept = branch(axis, rate)
    return 0.0 if rate == 0 else slope * rate + intercept


def _still(n: int) -> list[float]:
    return [0.0] * n


def _each(rule):
    """A rule for one step: v, w -> v, u, w."""

    def all_steps(p, drive):
        rows = [rule(p, v, w) for v, w in zip(drive.v, drive.w, strict=True)]
        return tuple(list(column) for column in zip(*rows, strict=True))

    return all_steps


def wheels_off(curvature, half, v, w):
    """Each wheel's speed times its own radius: the right one larger, the left one smaller."""
    if half == 0:
        return v, 0.0, w + curvature * v
    right, left = (v + side * w * half for side in (1, -1))
    right, left = right * (1 + curvature * half), left * (1 - curvature * half)
    return (right + left) / 2, 0.0, (right - left) / (2 * half)


def _bent(p, rate):
    """Less by the curvature times a power of the rate, until nothing is left of it."""
    lost = p["curvature"] * abs(rate) ** p["power"]
    return 0.0 if lost > 1 else rate - lost * rate


for _name, _rule in {
    "base.gain_v": lambda p, v, w: (v + p["gain"] * v, 0.0, w),
    "base.gain_w": lambda p, v, w: (v, 0.0, w + p["gain"] * w),
    "base.left_right_gain": lambda p, v, w: (v, 0.0, w + p["asymmetry"] * abs(w) * (p["side"] * w >= 0)),
    "base.veer": lambda p, v, w: wheels_off(p["curvature"], p["apart"] / 2, v, w),
    "base.reverse_gain": lambda p, v, w: (v * (1 + p["gain"]) if v < 0 else v, 0.0, w),
    "base.curvature_v": lambda p, v, w: (_bent(p, v), 0, w),
    "base.curvature_w": lambda p, v, w: (v, 0, _bent(p, w)),
    "base.cross_w_to_v": lambda p, v, w: (v + p["lever"] * (abs(w) if p["even"] >= 0.5 else w), 0.0, w),
    "base.understeer": lambda p, v, w: (v, 0.0, 0.0 if p["k"] * v * v > 1 else w - p["k"] * v * v * w),
    "base.lateral_slip": lambda p, v, w: (v, -p["c"] * v * w, w),
}.items():
    RATES[_name] = _each(_rule)


@_rates("base.saturation")
@_each
def saturation(p, v, w):
    def limit(rate, inverse):
        if rate == 0 or inverse == 0:
            return rate
        if p["knee"]:
            order = 1 / p["knee"]
            return rate * math.exp(-p["knee"] * math.log1p((abs(rate) * inverse) ** order))
        return math.copysign(min(abs(rate), 1 / inverse), rate)

    return limit(v, p["inverse_v"]), 0.0, limit(w, p["inverse_w"])


@_rates("base.sign")
@_each
def sign(p, v, w):
    s = p["swap"]
    return p["factor_v"] * (v - s * v + s * w), 0.0, p["factor_w"] * (w - s * w + s * v)


@_rates("base.cross_v_to_w")
@_each
def cross_v_to_w(p, v, w):
    """A leak [V] beside V_s turns the chair by its slope; with rests, not one that is to go straight, nor back."""
    slope, _ = branch("steering", w)
    turned = w + p["share"] * volts("translation", v) / slope
    return v, 0.0, 0.0 if p["rests"] >= 0.5 and turned * w <= 0 else turned


def _swallowed(axis, rate, p):
    """The voltage is moved by the width towards the branch's threshold, which it does not pass; or jumps there."""
    if rate == 0 or (round(p["side"]) and (rate > 0) != (p["side"] > 0)):
        return rate
    slope, intercept = branch(axis, rate)
    width = p["width"] * (abs(slope / branch(axis, 1.0)[0]) if p["even"] >= 0.5 else 1.0)
    above = volts(axis, rate) - intercept
    left = abs(above) - width
    return math.copysign(abs(above) if p["whole"] >= 0.5 else left, above) / slope if left > 0 else 0.0


RATES["base.dead_zone_v"] = _each(lambda p, v, w: (_swallowed("translation", v, p), 0.0, w))
RATES["base.dead_zone_w"] = _each(lambda p, v, w: (v, 0.0, _swallowed("steering", w, p)))


@_rates("base.backlash")
def backlash(p, drive):
    """A peg in a slot as wide as the play; with onset, a slot for each side that ends where no turn is.

    With onset = 1 that is a string as long as the play, which pulls a turn up and does not push it.
    """
    half, peg, out = p["play"] / 2, 0.0, []
    for v, w in zip(drive.v, drive.w, strict=True):
        if p["onset"] >= 0.5:
            held = abs(peg) if peg * w > 0 else 0.0
            near = abs(w) - p["onset"] * p["play"]
            far = abs(w) + (1 - p["onset"]) * p["play"]
            peg = math.copysign(min(far, max(held, near)), w) if w else 0.0
            out.append(peg)
            continue
        if w - half > peg:
            peg = w - half
        elif w + half < peg:
            peg = w + half
        out.append(0.0 if v == 0 and w == 0 else peg)
    return drive.v, _still(len(out)), out


@_rates("base.battery_sag")
def battery_sag(p, drive):
    """The mean over a step of 1 - sag t, which is 0 once it has come there: by the parts of a thousand.

    A drive by itself is its own recording: through changes nothing.
    """
    v, w, parts = [], [], 1000
    for k in range(len(drive.v)):
        times = [drive.dt * (k + (j + 0.5) / parts) for j in range(parts)] if k % 50 == 0 else [drive.dt * (k + 0.5)]
        left = sum(max(0.0, 1 - p["sag"] * t) for t in times) / len(times)
        v.append(drive.v[k] * left)
        w.append(drive.w[k] * left)
    return v, _still(len(v)), w


def _lagged(targets, tau, dt):
    """Means of y over steps, tau y' = target - y, from 0: Runge-Kutta of fourth order in 20 parts of a step."""
    if tau == 0:
        return list(targets)
    parts, y, means = 20, 0.0, []
    h = dt / parts
    for target in targets:
        area = 0.0
        for _ in range(parts):
            k1 = (target - y) / tau
            k2 = (target - y - h / 2 * k1) / tau
            k3 = (target - y - h / 2 * k2) / tau
            k4 = (target - y - h * k3) / tau
            area += h * y + h * h / 6 * (k1 + k2 + k3)  # of the same method, for area' = y
            y += h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        means.append(area / dt)
    return means


@_rates("base.lag_v")
def lag_v(p, drive):
    return _lagged(drive.v, p["tau"], drive.dt), _still(len(drive.v)), drive.w


@_rates("base.lag_w")
def lag_w(p, drive):
    return drive.v, _still(len(drive.v)), _lagged(drive.w, p["tau"], drive.dt)


@_rates("base.payload")
def payload(p, drive):
    left = 1 - p["droop"]
    v, w = (_lagged([left * rate for rate in rates], p["tau"], drive.dt) for rates in (drive.v, drive.w))
    return v, _still(len(v)), w


@_rates("base.delay")
def delay(p, drive):
    """What was asked for, held, over the time from t - delay to t + dt - delay: by the overlaps of all steps."""

    def late(rates):
        out, dt = [], drive.dt
        for k in range(len(rates)):
            start = k * dt - p["delay"]
            overlaps = [max(0.0, min(start + dt, (j + 1) * dt) - max(start, j * dt)) for j in range(len(rates))]
            out.append(sum(o * rate for o, rate in zip(overlaps, rates, strict=True)) / dt)
        return out

    return late(drive.v), _still(len(drive.v)), late(drive.w)


@_rates("base.accel_limit")
def accel_limit(p, drive):
    def ramp(targets, slowness):
        if slowness == 0:
            return list(targets)
        parts, y, means = 1000, 0.0, []
        most = drive.dt / parts / slowness
        for target in targets:
            area = 0.0
            for _ in range(parts):
                before, gap = y, target - y
                y += math.copysign(min(abs(gap), most), gap)
                area += (before + y) / 2
            means.append(area / parts)
        return means

    v, w = (
        _lagged(ramp(rates, slowness), p["round"] * slowness, drive.dt)
        for rates, slowness in ((drive.v, p["slowness_v"]), (drive.w, p["slowness_w"]))
    )
    return v, _still(len(v)), w


@_rates("base.slope")
def slope(p, drive):
    heading, v = drive.heading, []
    for speed, w in zip(drive.v, drive.w, strict=True):
        middle = heading + w * drive.dt / 2
        uphill = p["climb_x"] * math.cos(middle) + p["climb_y"] * math.sin(middle)
        twice = 2 * math.sqrt((50 * speed) ** 2 + (1 - p["driving"]) * (25 * w) ** 2)
        v.append(speed - uphill * (1 - 2 / (math.exp(min(twice, 700)) + 1)))
        heading += w * drive.dt
    return v, _still(len(v)), drive.w


@_rates("base.caster_reversal")
def caster_reversal(p, drive):
    """Somebody who watches: which way did it last drive, which way last turn, how far is the last reversal ago."""
    last_way = kicked_to = 0.0
    sides = [0.0] * max(round(0.03 / drive.dt), 1)  # of the last turn, the oldest first: casters take that long
    since, out = 0.0, []
    for v, w in zip(drive.v, drive.w, strict=True):
        way = (v >= 0.02) - (v <= -0.02)
        if way != 0:
            if last_way not in (0, way):
                kicked_to, since = sides[0], 0.0
            last_way = way
        travelled = abs(v) * drive.dt
        kick = p["kick"] * math.exp(-(since + travelled / 2) / p["length"]) if abs(v) > 1e-3 else 0.0
        backwards = round(p["by"]) in (1, 3) and last_way < 0
        out.append(w - kicked_to * kick if backwards else w + kicked_to * kick)
        since += travelled
        turned = math.copysign(1.0, w) if abs(w) >= 0.05 else sides[-1]
        sides = [*sides[1:], 1.0 if round(p["by"]) in (2, 3) else turned]
    return drive.v, _still(len(out)), out


@_volts("base.dac_zero_f")
def dac_zero_f(p, v_f, v_s, _signs):
    """Nobody drives a chair that creeps at rest: its brakes hold it; with rests = -1 it has none, and no dead zone."""
    side = _LAWS["translation"]["positive" if p["offset"] > 0 else "negative"]
    at_rest = side["intercept"] + p["offset"] if round(p.get("rests", 0.0)) < 0 and p["offset"] else 0.0
    return [v + p["offset"] if v else at_rest for v in v_f], v_s


@_volts("base.dac_zero_s")
def dac_zero_s(p, v_f, v_s, signs):
    """With rests, nobody turns who is told to go straight, or to one side by volts that stand for the other.

    With rests = -1 who drives straight turns by the offset alone.
    """

    def shifted(forward, v, sign):
        v += p["offset"]
        if round(p["rests"]) == 0 or math.isnan(sign):
            return v
        if sign == 0:
            to_the_left = p["offset"] / _LAWS["steering"]["positive"]["slope"] > 0
            end = _LAWS["steering"]["positive" if to_the_left else "negative"]["intercept"]
            return end + p["offset"] if p["rests"] < 0 and forward != 0 else 0.0
        side = _LAWS["steering"]["positive" if sign > 0 else "negative"]
        return 0.0 if (v - side["intercept"]) / side["slope"] * sign < 0 else v

    return v_f, [shifted(*each) for each in zip(v_f, v_s, signs, strict=True)]


@_volts("base.dac_quantisation")
def dac_quantisation(p, v_f, v_s, signs):
    """Climb from level to level, half a step below 0 on, while the next one is not farther than what is asked for."""

    def reached(size):
        level = (p["phase"] - 3) * p["step"]
        while level + p["step"] / 2 <= size:
            level += p["step"]
        return max(level - p["cut"] * p["step"] / 2, 0.0)

    if p["step"] == 0:
        return v_f, v_s
    v_f, v_s = ([math.copysign(reached(abs(v)), v) if v else 0.0 for v in volts] for volts in (v_f, v_s))
    if round(p["rests"]) < 0:  # nobody turns to the other side than was meant
        sides = {1: _LAWS["steering"]["positive"], -1: _LAWS["steering"]["negative"]}
        other = [
            sign in sides and (v - sides[sign]["intercept"]) / sides[sign]["slope"] * sign < 0
            for v, sign in zip(v_s, signs, strict=True)
        ]
        v_s = [0.0 if it else (v or 1e-12 * sign) for v, sign, it in zip(v_s, signs, other, strict=True)]
    elif p["rests"] < 0.5:  # a turn is never just 0 V
        v_s = [1e-12 if v == 0 and sign in (-1, 1) else v for v, sign in zip(v_s, signs, strict=True)]
    return v_f, v_s


@_volts("base.steering_law")
def steering_law(p, v_f, v_s, signs):
    """What the other law makes of V_s, as the voltage that the model's law has for it."""
    sides = _LAWS["steering"]
    factor = 1 - 2 * p["flip"]
    out = []
    for v, meant in zip(v_s, signs, strict=True):
        if p["flip"] == 0 or v == 0:
            out.append(v)
            continue
        left = (v - factor * sides["positive"]["intercept"]) / sides["positive"]["slope"]
        right = (v - factor * sides["negative"]["intercept"]) / sides["negative"]["slope"]
        answers = [w for w in (left, right) if (w > 0) == (w is left) and w != 0]
        if len(answers) == 2:
            answers = [w for w in answers if w * meant > 0]
        if p["meant"] == 1:  # it would rather rest
            answers = [w for w in answers if w * meant >= 0]
        out.append(volts("steering", answers[0]) if answers else 0.0)
    return v_f, out
