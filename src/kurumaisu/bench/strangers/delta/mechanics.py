# SPDX-License-Identifier: BSD-3-Clause
"""What converters, motors, casters and tyres do to the rates: the effects of the base."""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from scipy.signal import lfilter

from kurumaisu.bench.strangers.delta.core import DT, Array, Cause


@dataclass
class Motion:
    """Rates on the grid on their way from the command to the floor."""

    t: Array
    ask_v: Array
    ask_w: Array
    session: float
    v: Array = field(default_factory=lambda: np.zeros(0))
    w: Array = field(default_factory=lambda: np.zeros(0))
    vy: Array = field(default_factory=lambda: np.zeros(0))
    vf: Array = field(default_factory=lambda: np.zeros(0))
    vs: Array = field(default_factory=lambda: np.zeros(0))


def lag(u: Array, tau: float) -> Array:
    """A pole: motor and inertia."""
    if tau < 1e-4:
        return u
    a = np.exp(-DT / tau)
    return np.asarray(lfilter([1 - a], [1, -a], u))


def uneven_lag(u: Array, rise: float, fall: float) -> Array:
    """A motor that gains speed with one time constant and is braked with another."""
    out, y = np.empty(len(u)), 0.0
    up, down = 1 - np.exp(-DT / max(rise, 1e-4)), 1 - np.exp(-DT / max(fall, 1e-4))
    for i, target in enumerate(u.tolist()):
        y += (target - y) * (up if abs(target) > abs(y) else down)
        out[i] = y
    return out


def ramp(u: Array, rise: float, fall: float, top: float = 1e9) -> Array:
    """A motor of limited torque: rates change by at most `rise`, `fall`; the torque falls with the speed."""
    out, y = np.empty(len(u)), 0.0
    for i, target in enumerate(u.tolist()):
        grows = abs(target) > abs(y)
        most = DT * (rise * max(0.1, 1 - abs(y) / top) if grows else fall)
        y += min(max(target - y, -most), most)
        out[i] = y
    return out


def play(u: Array, width: float) -> Array:
    """A linkage with play of +- width."""
    out, y = np.empty(len(u)), 0.0
    for i, target in enumerate(u.tolist()):
        y = min(max(y, target - width), target + width)
        out[i] = y
    return out


def late(u: Array, delay: float) -> Array:
    """A pure delay."""
    t = DT * np.arange(len(u) + 1)
    total = np.concatenate([[0.0], np.cumsum(u) * DT])
    return np.diff(np.interp(t - delay, t, total, left=0.0)) / DT


def since(step: Array, events: Array) -> Array:
    """Sum of the steps since the last event; infinite before the first."""
    total = np.cumsum(step)
    last = np.maximum.accumulate(np.where(events, np.arange(len(step)), -1))
    return np.where(last >= 0, total - total[np.maximum(last, 0)], np.inf)


def reversals(v: Array) -> Array:
    """Cells in which the chair begins to drive the other way."""
    sign = np.sign(np.where(np.abs(v) > 0.01, v, 0.0))
    index = np.maximum.accumulate(np.where(sign != 0, np.arange(len(v)), 0))
    kept = sign[index]
    return np.append(False, (kept[1:] * kept[:-1]) < 0)


def delay(m: Motion, c: Cause) -> None:
    """Motion after its command; other: one axis later than the other."""
    m.v, m.w = late(m.v, c.size * (0.6 if c.other else 1)), late(m.w, c.size * (1.4 if c.other else 1))


def steps(m: Motion, c: Cause) -> None:
    """Codes of the converter; other: a code changes only when the input is 0.8 of a step away."""
    for name in ("vf", "vs"):
        u = getattr(m, name)
        if c.other:
            out, code = np.empty(len(u)), 0.0
            for i, x in enumerate((u / c.size).tolist()):
                code = float(round(x)) if abs(x - code) > 0.8 else code
                out[i] = code * c.size
            setattr(m, name, out)
        else:
            setattr(m, name, c.size * np.round(u / c.size))


def zero(m: Motion, c: Cause) -> None:
    """Offset of a voltage; other: it appears as the amplifier warms."""
    name = "vf" if c.id == "base.dac_zero_f" else "vs"
    u = getattr(m, name)
    setattr(m, name, u + c.size * (1 - np.exp(-m.t / 40) if c.other else 1))


def leak(m: Motion, c: Cause) -> None:
    """Leak of one channel into the other; other: through a common ground, so that the sign is lost."""
    m.vs = m.vs + c.size * (np.abs(m.vf) if c.other else m.vf)


def zone(u: Array, width: float, soft: bool) -> Array:
    """A dead zone that takes its width from each rate; soft: stiction that lets go gradually."""
    if soft:
        return np.asarray(u * (1 - np.exp(-((u / (2.0 * abs(width) + 1e-9)) ** 2))))
    return np.asarray(np.sign(u) * np.maximum(np.abs(u) - width, 0) * (np.abs(u) > 1e-6))


def zone_v(m: Motion, c: Cause) -> None:
    """Dead zone of the translation: in volts where there are any."""
    slope = np.where(m.v > 0, 1.32402, 2.07369) if len(m.vf) else 1.0
    m.v = zone(m.v * slope, c.size, c.other) / slope


def zone_w(m: Motion, c: Cause) -> None:
    """Dead zone of the steering."""
    slope = np.where(m.w > 0, 0.499211, 0.469278) if len(m.vf) else 1.0
    m.w = zone(m.w * slope, c.size, c.other) / slope


def saturate(m: Motion, c: Cause) -> None:
    """Largest rates; other: the largest speed of a wheel, so turning leaves less for driving."""
    if c.other:
        top = 1 / c.size
        fast = np.maximum(np.abs(m.v + 0.27 * m.w), np.abs(m.v - 0.27 * m.w))
        factor = np.minimum(1, top / np.maximum(fast, 1e-6))
        m.v, m.w = m.v * factor, m.w * factor
    else:
        m.v = np.clip(m.v, -1 / c.size, 1 / c.size)
        m.w = np.clip(m.w, -1 / (0.6 * c.size), 1 / (0.6 * c.size))


def sag(m: Motion, c: Cause) -> None:
    """A battery that runs down with time; other: with the charge that was taken, ever faster."""
    used = np.cumsum(np.abs(m.v) + 0.3 * np.abs(m.w)) * DT
    factor = 1 - c.size * (used**2 / 15 if c.other else m.t)
    m.v, m.w = m.v * factor, m.w * factor


def load(m: Motion, c: Cause) -> None:
    """A load; other: its yaw inertia counts more than its mass, and it is braked faster than it gains speed."""
    tau, v, w = c.extra["tau"], m.v * (1 - c.size), m.w * (1 - c.size)
    if c.other:
        m.v, m.w = uneven_lag(v, 1.3 * tau, 0.5 * tau), uneven_lag(w, 2 * tau, tau)
    else:
        m.v, m.w = lag(v, tau), lag(w, tau)


def swing(m: Motion, c: Cause) -> None:
    """Casters that turn round after a reversal; other: by their equation of motion, dphi/ds = -sin(phi)/L."""
    gone = since(np.abs(m.v) * DT, reversals(m.v))
    if c.other:
        kick = np.abs(m.v) / 0.3 / np.cosh((gone - 2 * c.extra["length"]) / c.extra["length"])
    else:
        kick = np.exp(-gone / c.extra["length"]) * np.clip(np.abs(m.v) / 0.05, 0, 1)
    m.w = m.w + c.size * kick


def slip(m: Motion, c: Cause) -> None:
    """Drift outwards in curves; other: the tyres build it up over a relaxation length of time."""
    side = -m.v * m.w
    m.vy = m.vy + c.size * (lag(side * (0.5 + 4 * np.abs(side)), 0.3) if c.other else side)


def limit(m: Motion, c: Cause) -> None:
    """Limited acceleration; other: by a torque that falls with the speed, and brakes that are stronger."""
    a, b = 1 / c.size, 2 / c.size
    if c.other:
        m.v, m.w = ramp(m.v, a, 2 * a, 1.2), ramp(m.w, b, 2 * b, 2.0)
    else:
        m.v, m.w = ramp(m.v, a, a), ramp(m.w, b, b)


Act = Callable[[Motion, Cause], None]


def law_v(law: Callable[[Motion, float, bool], Array], name: str = "v") -> Act:
    """An effect that gives a new forward speed (or yaw rate)."""
    return lambda m, c: setattr(m, name, law(m, c.size, c.other))


def backlash(m: Motion, s: float, o: bool) -> Array:
    """Play in the steering; other: two linkages in parallel, one with three times the play."""
    moving = (np.abs(m.w) > 1e-6) | (np.abs(m.v) > 1e-6)
    return np.where(moving, 0.5 * (play(m.w, 0.5 * s) + play(m.w, 1.5 * s)) if o else play(m.w, s), 0.0)


VOLTS: dict[str, Act] = {
    "base.cross_v_to_w": leak,
    "base.dac_zero_f": zero,
    "base.dac_zero_s": zero,
    "base.dac_quantisation": steps,
}
RATES: dict[str, Act] = {
    "base.delay": delay,
    "base.dead_zone_v": zone_v,
    "base.dead_zone_w": zone_w,
    "base.backlash": law_v(backlash, "w"),
    "base.gain_v": law_v(lambda m, s, o: m.v * (1 + s)),
    "base.gain_w": law_v(lambda m, s, o: m.w * (1 + s), "w"),
    "base.left_right_gain": law_v(lambda m, s, o: m.w * (1 + s * (np.tanh(m.w / 0.3) if o else np.sign(m.w))), "w"),
    "base.reverse_gain": law_v(lambda m, s, o: m.v * (1 + s * (m.v < 0) * (np.tanh(-m.v / 0.15) if o else 1))),
    "base.curvature_v": law_v(lambda m, s, o: m.v * (1 - s * (1.6 * m.v**2 if o else np.abs(m.v)))),
    "base.curvature_w": law_v(lambda m, s, o: m.w * (1 - s * (1.4 * m.w**2 if o else np.abs(m.w))), "w"),
    "base.understeer": law_v(lambda m, s, o: m.w / (1 + s * (1.5 * np.abs(m.v * m.w) if o else m.v**2)), "w"),
    "base.saturation": saturate,
    "base.battery_sag": sag,
    "base.lag_v": law_v(lambda m, s, o: lag(lag(m.v, s / 2), s / 2) if o else lag(m.v, s)),
    "base.lag_w": law_v(lambda m, s, o: uneven_lag(m.w, 1.5 * s, 0.4 * s) if o else lag(m.w, s), "w"),
    "base.accel_limit": limit,
    "base.payload": load,
    "base.veer": law_v(lambda m, s, o: m.w + s * (np.abs(m.v) if o else m.v), "w"),
    "base.cross_w_to_v": law_v(lambda m, s, o: m.v + s * (m.w * np.abs(m.w) * 1.5 if o else m.w)),
    "base.caster_reversal": swing,
    "base.lateral_slip": slip,
}


def slope(m: Motion, c: Cause) -> Callable[..., tuple[Array, Array]]:
    """Gravity along the heading slows the chair while it drives; other: a share of its speed, by the motor's droop."""

    def add(x: Array, y: Array, th: Array, cell: slice = slice(None)) -> tuple[Array, Array]:
        """Rates added in some cells."""
        v = m.v[cell]
        climb = c.size * np.cos(th - c.extra["direction"])
        return -climb * (np.abs(v) * 3 if c.other else (np.abs(v) > 0.01)), 0 * v

    return add


PLACED: dict[str, Callable[[Motion, Cause], Callable[..., tuple[Array, Array]]]] = {"base.slope": slope}
