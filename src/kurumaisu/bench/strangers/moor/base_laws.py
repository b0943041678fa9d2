# SPDX-License-Identifier: BSD-3-Clause
"""The effects of the base, each by its first law, by another one, and what no sentence describes."""

import numpy as np
from scipy.signal import lfilter

from kurumaisu.bench.strangers.moor.motion import (
    DT,
    DYNAMIC,
    NOISE,
    RATE,
    REFERENCE,
    STEERING,
    TIME,
    VOLTS,
    Law,
    Motion,
)
from kurumaisu.bench.strangers.moor.world import Array


def late(x: Array, tau: float, poles: int = 1) -> Array:
    """A lag of one pole or more, each of the same time constant."""
    a = float(np.exp(-DT / max(tau, 1e-6)))
    for _ in range(poles):
        x = np.asarray(lfilter([1 - a], [1, -a], x, zi=np.array([a * x[0]]))[0])
    return x


def delayed(m: Motion, by: float, cycle: float = 0.0) -> None:
    """Commands that come later, or that wait for the next tick of a slow cycle."""
    t = m.t - by if cycle == 0 else np.floor(m.t / cycle) * cycle
    whole = np.clip((t - m.t[0]) / DT, 0, m.t.size - 1)
    low = np.floor(whole).astype(int)
    high, part = np.minimum(low + 1, m.t.size - 1), whole - low
    m.put(v=(1 - part) * m.v[low] + part * m.v[high], w=(1 - part) * m.w[low] + part * m.w[high])


def ramps(x: Array, up: float, down: float) -> Array:
    """Follow with a limited slope, another one for slowing down."""
    out, y = np.empty_like(x), float(x[0])
    for i, want in enumerate(x.tolist()):
        most = (up if abs(want) > abs(y) else down) * DT
        y += min(max(want - y, -most), most)
        out[i] = y
    return out


def played(x: Array, play: float) -> Array:
    """A gear with play: what it gives stays until its command has crossed the play."""
    out, y = np.empty_like(x), float(x[0])
    for i, want in enumerate(x.tolist()):
        y = min(max(y, want - play), want + play)
        out[i] = y
    return out


def cut(x: Array, by: float) -> Array:
    """A dead zone that takes the same from all rates."""
    return np.asarray(np.sign(x) * np.maximum(abs(x) - by, 0))


def flip(m: Motion) -> None:
    """Steering that has its intercepts with the other sign, as `corrected` has them."""
    (a, b), (c, d) = STEERING
    w = np.where(m.w > 0, np.maximum((m.v_s + b) / a, 0), np.where(m.w < 0, np.minimum((m.v_s + d) / c, 0), 0))
    m.put(v_s=np.where(m.w > 0, a * w + b, np.where(m.w < 0, c * w + d, 0)))


def narrow(x: Array, s: float, soft: bool = False) -> Array:
    """Rates above 1 / s are not reached: sharply, or by a tangent."""
    return np.asarray(np.tanh(x * s) / s if soft else np.clip(x, -1 / s, 1 / s))


def slowed(m: Motion, s: float, poles: int) -> None:
    """A load: less of both rates, and later."""
    m.put(v=late(m.v * (1 - s), 2 * s / poles, poles), w=late(m.w * (1 - s), 2 * s / poles, poles))


def hill(m: Motion, s: float, steep: float = 0.0) -> None:
    """Slower uphill along x, a third of it along y; or by a share of the speed."""
    up = np.cos(m.heading) + np.sin(m.heading) / 3
    m.add(-s * up * (abs(m.ask_v) > 0) * (1 if steep == 0 else (abs(m.ask_v) / steep) ** 0.5))


def swing(m: Motion) -> Array:
    """The way since the last reversal, very long before the first."""
    back = m.reversed()
    return np.where(np.cumsum(back) > 0, m.since(back, way=True), 1e3)


def jerk(m: Motion, x: Array) -> Array:
    """Change of a rate that is asked for, per second, over a quarter of one."""
    return np.asarray(np.gradient(late(x, 0.12), DT))


# fmt: off
BASE = [
    Law("base.dac_zero_f", VOLTS, 1e-4, 0.3, lambda m, s: m.put(v_f=m.v_f + s), {"offset": 1}, signed=True, volts=True),
    Law("base.dac_zero_s", VOLTS, 1e-4, 0.2, lambda m, s: m.put(v_s=m.v_s + s), {"offset": 1}, signed=True, volts=True),
    Law("base.dac_quantisation", VOLTS, 2e-3, 0.3,
        lambda m, s: m.put(v_f=np.round(m.v_f / s) * s, v_s=np.round(m.v_s / s) * s), {"step": 1}, volts=True),
    Law("base.steering_law", VOLTS, 1, 1.0001, lambda m, s: flip(m), {"flip": 1}, volts=True),
    Law("base.delay", TIME, 1e-3, 1, lambda m, s: delayed(m, s), {"delay": 1}),
    Law("base.dead_zone_v", RATE, 1e-3, 0.5, lambda m, s: m.put(v=cut(m.v, s)), form="other"),
    Law("base.dead_zone_w", RATE, 1e-3, 0.4, lambda m, s: m.put(w=cut(m.w, s)), form="other"),
    Law("base.backlash", DYNAMIC, 1e-3, 0.3, lambda m, s: m.put(w=played(m.w, s)), form="other"),
    Law("base.cross_v_to_w", VOLTS, 1e-4, 0.2, lambda m, s: m.put(v_s=m.v_s + s * m.v_f), {"share": 1}, signed=True,
        volts=True),
    Law("base.gain_v", RATE, 1e-3, 0.5, lambda m, s: m.add(s * m.v), {"gain": 1}, signed=True),
    Law("base.gain_w", RATE, 1e-3, 0.5, lambda m, s: m.add(w=s * m.w), {"gain": 1}, signed=True),
    Law("base.left_right_gain", RATE, 1e-3, 0.5, lambda m, s: m.add(w=s * abs(m.w)), {"asymmetry": 1}, signed=True),
    Law("base.veer", RATE, 1e-3, 0.6, lambda m, s: m.add(w=s * m.v), {"curvature": 1}, signed=True),
    Law("base.reverse_gain", RATE, 1e-3, 0.7, lambda m, s: m.add(s * np.minimum(m.v, 0)), {"gain": 1}, signed=True),
    Law("base.curvature_v", RATE, 1e-3, 0.6, lambda m, s: m.add(-s * abs(m.v) * m.v), {"curvature": 1}),
    Law("base.curvature_w", RATE, 1e-3, 0.6, lambda m, s: m.add(w=-s * abs(m.w) * m.w), {"curvature": 1}),
    Law("base.saturation", RATE, 1.0, 5, lambda m, s: m.put(v=narrow(m.v, s), w=narrow(m.w, s)),
        {"inverse_v": 1, "inverse_w": 1}),
    Law("base.battery_sag", RATE, 1e-5, 3e-3, lambda m, s: m.put(v=m.v * (1 - s * m.t), w=m.w * (1 - s * m.t)),
        {"sag": 1}),
    Law("base.lag_v", DYNAMIC, 5e-3, 1.5, lambda m, s: m.put(v=late(m.v, s)), {"tau": 1}),
    Law("base.lag_w", DYNAMIC, 5e-3, 1.5, lambda m, s: m.put(w=late(m.w, s)), {"tau": 1}),
    Law("base.accel_limit", DYNAMIC, 0.2, 8, lambda m, s: m.put(v=ramps(m.v, 1 / s, 1 / s), w=ramps(m.w, 2 / s, 2 / s)),
        {"slowness_v": 1, "slowness_w": 0.5}),
    Law("base.payload", DYNAMIC, 2e-3, 0.4, lambda m, s: slowed(m, s, 1), {"droop": 1, "tau": 2}),
    Law("base.process_noise", NOISE, 0.2, 20, lambda m, s: m.put(grow=1 + s * np.hypot(m.ask_v, m.ask_w)),
        form="other"),
    Law("base.understeer", RATE, 5e-3, 1.5, lambda m, s: m.put(w=m.w / (1 + s * m.v**2)), {"k": 1}),
    Law("base.caster_reversal", DYNAMIC, 5e-3, 1.5, lambda m, s: m.add(w=s * np.exp(-swing(m) / 0.3) * (m.ask_v != 0)),
        {"kick": 1}, signed=True),
    Law("base.lateral_slip", RATE, 1e-3, 0.3, lambda m, s: m.add(u=-s * m.v * m.w), {"c": 1}),
    Law("base.slope", RATE, 1e-3, 0.2, lambda m, s: hill(m, s), {"climb_x": 1, "climb_y": 1 / 3}, signed=True,
        place=True),
    Law("base.cross_w_to_v", RATE, 1e-3, 0.3, lambda m, s: m.add(s * m.w), {"lever": 1}, signed=True),
    Law("base.marker_x", REFERENCE, 1e-3, 0.5, lambda m, s: m.put(mark_x=m.mark_x + s), {"x": 1}, signed=True,
        scans=False),
    Law("base.marker_y", REFERENCE, 1e-3, 0.5, lambda m, s: m.put(mark_y=m.mark_y + s), {"y": 1}, signed=True,
        scans=False),
    Law("base.marker_yaw", REFERENCE, 1e-3, 0.4, lambda m, s: m.put(mark_yaw=m.mark_yaw + s), {"yaw": 1}, signed=True,
        scans=False),
    Law("base.clock_scale", REFERENCE, 1e-4, 9e-3, lambda m, s: m.put(clock=s), {"scale": 1}, signed=True, scans=False),
]
# fmt: on


def other(name: str, **more: object) -> Law:
    """The law of that name, with another act."""
    first = next(law for law in BASE if law.name == name)
    fields = {**first.__dict__, "form": "other", "parameters": {}, **more}
    return Law(**fields)


# fmt: off
FORMS = [
    other("base.dac_quantisation", act=lambda m, s: m.put(v_f=np.trunc(m.v_f / s) * s, v_s=np.trunc(m.v_s / s) * s)),
    other("base.delay", low=0.02, act=lambda m, s: delayed(m, 0, 2 * s)),
    other("base.dead_zone_v", stage=RATE, act=lambda m, s: m.put(v=m.v * (1 - np.exp(-((m.v / s) ** 2))))),
    other("base.dead_zone_w", stage=RATE, act=lambda m, s: m.put(w=m.w * (1 - np.exp(-((m.w / s) ** 2))))),
    other("base.backlash", act=lambda m, s: m.put(w=late(played(m.w, s), 0.1))),
    other("base.cross_v_to_w", act=lambda m, s: m.put(v_s=m.v_s + s * m.v_f * abs(m.v_f))),
    other("base.gain_v", act=lambda m, s: m.add(s * m.v * np.tanh(abs(m.v) / 0.25))),
    other("base.gain_w", act=lambda m, s: m.add(w=s * np.sign(m.w) * abs(m.w) ** 0.8)),
    other("base.left_right_gain", act=lambda m, s: m.add(w=s * np.maximum(m.w, 0) ** 1.4)),
    other("base.veer", act=lambda m, s: m.add(w=s * np.sign(m.v) * abs(m.v) ** 0.7)),
    other("base.reverse_gain", act=lambda m, s: m.add(s * np.minimum(m.v, 0) * (1 - np.exp(-abs(m.v) / 0.2)))),
    other("base.curvature_v", act=lambda m, s: m.add(-s * 2 * m.v * np.maximum(abs(m.v) - 0.2, 0))),
    other("base.curvature_w", act=lambda m, s: m.add(w=-s * m.w**3)),
    other("base.saturation", low=0.1, high=4, act=lambda m, s: m.put(v=narrow(m.v, s, True), w=narrow(m.w, s, True))),
    other("base.battery_sag", act=lambda m, s: m.put(v=m.v * (1 - s * 60 * (1 - np.exp(-m.t / 60))),
                                                    w=m.w * (1 - s * 60 * (1 - np.exp(-m.t / 60))))),
    other("base.lag_v", act=lambda m, s: m.put(v=late(m.v, s / 2, 2))),
    other("base.lag_w", act=lambda m, s: m.put(w=late(m.w, s / 2, 2))),
    other("base.accel_limit", act=lambda m, s: m.put(v=ramps(m.v, 1 / s, 3 / s), w=ramps(m.w, 2 / s, 6 / s))),
    other("base.payload", act=lambda m, s: slowed(m, s, 2)),
    other("base.understeer", act=lambda m, s: m.add(w=-s * m.w * np.maximum(abs(m.v) - 0.15, 0))),
    other("base.caster_reversal", act=lambda m, s: m.add(w=s * np.cos(np.clip(swing(m) / 0.5, 0, 1) * np.pi / 2)
                                                         * (m.ask_v != 0))),
    other("base.lateral_slip", act=lambda m, s: m.add(u=-s * 2 * m.v * abs(m.v) * m.w)),
    other("base.slope", act=lambda m, s: hill(m, s, 0.3)),
    other("base.cross_w_to_v", act=lambda m, s: m.add(s * 1.5 * m.w * abs(m.w))),
    other("base.process_noise", low=0.2, high=20, act=lambda m, s: m.put(grow=1 + s * (abs(m.ask_v) > 0.25))),
]
# fmt: on

# fmt: off
UNKNOWN = [
    Law("rate v", RATE, 1e-3, 1, lambda m, s: m.add(s * m.v * m.columns["drive_current"]), channel="rate of v",
        covariates=("drive_current",), signed=True),
    Law("rate w", RATE, 1e-3, 1, lambda m, s: m.add(w=s * m.columns["tyre_difference"] * m.v),
        channel="rate of w (path)",
        covariates=("tyre_difference",), signed=True),
    Law("rate w", DYNAMIC, 1e-3, 1, lambda m, s: m.add(w=s * jerk(m, m.ask_v)), channel="rate of w",
        covariates=("acceleration",), signed=True),
    Law("rate v", DYNAMIC, 1e-3, 1, lambda m, s: m.add(-s * abs(jerk(m, m.ask_w))), channel="rate of v",
        covariates=("yaw_acceleration",)),
    Law("rate v", RATE, 5e-3, 0.9, lambda m,
        s: m.add(-s * m.v * np.exp(-m.since((m.ask_v == 0) & (m.ask_w == 0)) / 2.5)),
        channel="rate of v", covariates=("time_since_rest", "distance_since_rest")),
    Law("rate v", RATE, 5e-3, 0.9, lambda m, s: m.add(-s * m.v * np.exp(-swing(m) / 0.6)), channel="rate of v",
        covariates=("distance_since_reversal", "time_since_reversal")),
    Law("rate v", RATE, 5e-3, 0.7, lambda m, s: m.add(-s * m.v / (1 + np.exp(-(m.x - m.drive.start[0]) / 0.15))),
        channel="rate of v", covariates=("x",), place=True),
    Law("rate w", RATE, 5e-3, 0.7, lambda m, s: m.add(w=s * m.v * np.sin(2.2 * m.y)), channel="rate of w (path)",
        covariates=("y",), place=True),
    Law("path", RATE, 1e-3, 0.3, lambda m, s: m.add(u=s * np.sin(m.heading + 0.5) * (m.ask_v != 0)),
        channel="path (sideways)", covariates=("heading",), place=True),
    Law("path", RATE, 1e-3, 0.3, lambda m, s: m.add(u=s * m.columns["wind"] * (m.ask_v != 0)),
        channel="path (sideways)", covariates=("wind",), signed=True),
    Law("rate w", RATE, 1e-3, 0.3, lambda m, s: m.add(w=s * np.sin(m.t / 7) * (m.ask_v != 0)), channel="rate of w",
        covariates=("time",), signed=True),
    Law("reference.x", REFERENCE, 1e-3, 0.2, lambda m, s: m.put(ref_x=s * np.sin(2 * m.y)), channel="reference.x",
        covariates=("y",), scans=False, signed=True),
    Law("reference.y", REFERENCE, 1e-3, 0.2, lambda m, s: m.put(ref_y=s * np.sin(1.7 * m.x)), channel="reference.y",
        covariates=("x",), scans=False, signed=True),
    Law("reference.heading", REFERENCE, 1e-3, 0.2, lambda m, s: m.put(mark_yaw=s * np.sin(2 * m.heading)),
        channel="reference.heading", covariates=("heading",), scans=False, signed=True),
]
# fmt: on
