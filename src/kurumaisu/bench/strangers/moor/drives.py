# SPDX-License-Identifier: BSD-3-Clause
"""Drives as people drive in a laboratory: manoeuvre after manoeuvre, where there is room."""

from dataclasses import dataclass, replace

import numpy as np

from kurumaisu.bench.strangers.moor.motion import DT, Causes, Drive, Motion, simulate
from kurumaisu.bench.strangers.moor.world import Array, Room


@dataclass(frozen=True)
class Style:
    """How somebody drives: speeds, yaw rates, how often what, how hard, and how often a command comes."""

    speeds: tuple[float, ...] = (0.12, 0.2, 0.3, 0.45, 0.6, 0.8)
    turns: tuple[float, ...] = (0.12, 0.2, 0.35, 0.5, 0.7, 0.95)
    weights: tuple[float, ...] = (
        0.12,
        0.22,
        0.14,
        0.24,
        0.14,
        0.14,
    )  # stop, spin, straight, curve, back, back in a curve
    slew: float = 1.5
    rate: float = 20.0
    left_only: bool = False
    spin_only: bool = False
    free_form: float = 0.5


@dataclass(frozen=True)
class Setting:
    """What the drives of one recording have in common."""

    volts: bool
    seconds: tuple[float, ...]
    style: Style
    sd_v: float
    sd_w: float
    tau: float
    contact: bool
    columns: tuple[str, ...]
    unix: float


def columns(rng: np.random.Generator, t: Array, names: tuple[str, ...]) -> dict[str, Array]:
    """Covariates that vary within a drive: slowly, some in steps or swings."""
    out: dict[str, Array] = {}
    for name in names:
        period, phase = rng.uniform(40, 110), rng.uniform(0, 6)
        wave = np.sin(2 * np.pi * t / period + phase)
        out[name] = {
            "battery": 25.4 - 0.0015 * t + 0.05 * wave,
            "temperature": 21.5 + 2.5 * wave,
            "tyre_pressure": 2.4 + 0.02 * wave,
            "lamp": (wave > 0.2) * 1.0,
        }.get(name, wave + 0.3 * np.sin(2 * np.pi * t / 13 + phase))
    return out


def manoeuvre(rng: np.random.Generator, style: Style) -> tuple[float, float, float]:
    """Rates that are aimed at, and for how long."""
    way = 0 if style.spin_only else int(rng.choice(6, p=style.weights))
    side = 1 if style.left_only else int(rng.choice([-1, 1]))
    v, w = float(rng.choice(style.speeds)), side * float(rng.choice(style.turns))
    if rng.random() < style.free_form:
        v, w = v * float(rng.uniform(0.8, 1.15)), w * float(rng.uniform(0.8, 1.05))
    v, w = min(v, 1.0), min(max(w, -1.0), 1.0)
    aims = [(0.0, 0.0), (0.0, w), (v, 0.0), (v, w), (-0.6 * v, 0.0), (-0.6 * v, w)]
    return *aims[way], float(rng.uniform(1.0, 2.5) if way == 0 else rng.uniform(1.5, 5.0))


def ramp(begin: float, end: float, slope: float, n: int) -> Array:
    """From one value to another, not faster than the hand moves the stick."""
    go = np.minimum(np.arange(1, n + 1) * DT * slope, abs(end - begin))
    return np.asarray(begin + np.sign(end - begin) * go)


def plan(rng: np.random.Generator, m: Motion, i: int, style: Style, room: Room) -> tuple[Array, Array]:
    """Rates of the next manoeuvre, so that the chair keeps its distance; on the spot if nothing else does."""
    v0, w0 = float(m.drive.v[i]), float(m.drive.w[i])
    now = float(room.clearance(m.x[i : i + 1], m.y[i : i + 1])[0])
    for _ in range(40):
        v, w, seconds = manoeuvre(rng, style)
        n = round(seconds / DT)
        vs, ws = ramp(v0, v, style.slew, n), ramp(w0, w, 1.5 * style.slew, n)
        tail = np.maximum(abs(v) - np.arange(60) * DT * style.slew, 0) * np.sign(v)
        heading = m.heading[i] + np.cumsum(np.concatenate([ws, 0 * tail])) * DT
        far = np.concatenate([vs, tail])
        gaps = room.clearance(
            m.x[i] + np.cumsum(far * np.cos(heading)) * DT, m.y[i] + np.cumsum(far * np.sin(heading)) * DT
        )
        if gaps.min() > 1.0 or (gaps.min() >= min(now, 0.97) - 0.02 and gaps[-1] > now + 0.1):
            return vs, ws
    n = round(rng.uniform(1, 3) / DT)
    side = 1.0 if style.left_only else float(rng.choice([-1, 1]))
    return ramp(v0, 0, style.slew, n), ramp(w0, side * float(rng.choice(style.turns)), style.slew, n)


def drive(seed: int, setting: Setting, k: int, room: Room, causes: Causes) -> Drive:
    """One drive, planned from where the chair really is."""
    rng = np.random.default_rng([seed, 7, k])
    n = round(setting.seconds[k] / DT)
    t = np.arange(n) * DT
    style = setting.style
    unit = rng.normal(0, 1, (2, n))
    noise = np.stack([_colour(unit[0], setting.sd_v, setting.tau), _colour(unit[1], setting.sd_w, setting.tau)])
    spots = room_spots(rng, room)
    begin = (*spots, float(rng.uniform(-np.pi, np.pi)))
    steps = np.maximum(rng.normal(1 / style.rate, 0.08 / style.rate, int(2 * n * DT * style.rate)), 0.5 / style.rate)
    ticks = np.unique(np.concatenate([[0], np.round(np.cumsum(steps) / DT).astype(int)]))
    ticks = ticks[ticks < n]
    hold = ticks[np.searchsorted(ticks, np.arange(n), side="right") - 1]
    free = np.ones(n)
    cols = columns(rng, t, setting.columns)
    d = Drive(t, np.zeros(n), np.zeros(n), ticks, begin, noise, free, cols, setting.volts, seed * 10 + k)
    raw_v, raw_w = np.zeros(n), np.zeros(n)
    i = 0 if style.spin_only else round(rng.uniform(1, 3) / DT)
    while i < n:
        at = max(i - 1, 0)
        m = simulate(begun(d, at + 1), causes)
        if style.spin_only:
            vs, ws = np.zeros(n), np.full(n, style.turns[0])
        else:
            vs, ws = plan(rng, m, at, style, room)
        part = min(vs.size, n - i)
        raw_v[i : i + part], raw_w[i : i + part] = vs[:part], ws[:part]
        i += part
        raw_v[i:], raw_w[i:] = raw_v[i - 1], raw_w[i - 1]
        d.v[:], d.w[:] = np.round(raw_v[hold], 4), np.round(raw_w[hold], 4)
    if setting.contact and k == 0:
        fast = np.flatnonzero((abs(d.v) > 0.1) & (t > 10) & (t < t[-1] - 10))
        if fast.size:
            first = int(rng.choice(fast))
            free[first : first + round(rng.uniform(1.0, 1.8) / DT)] = 0
    return d


def begun(d: Drive, n: int) -> Drive:
    """The first rows of a drive."""
    cut = {k: c[:n] for k, c in d.columns.items()}
    return replace(d, t=d.t[:n], v=d.v[:n], w=d.w[:n], noise=d.noise[:, :n], free=d.free[:n], columns=cut)


def safe(room: Room, m: Motion) -> bool:
    """Whether the chair touches nothing on its way."""
    return bool(room.clearance(m.x, m.y).min() > 0.77)


def room_spots(rng: np.random.Generator, room: Room) -> tuple[float, float]:
    """A place with much room about it."""
    x, y = rng.uniform(-2.5, 2.5, (2, 400))
    inside = abs(x - room.boxes[2].x) + abs(x - room.boxes[3].x) < room.boxes[3].x - room.boxes[2].x + 1e-6
    best = np.argsort(-np.where(inside, room.clearance(x, y), -1))[:8]
    one = int(rng.choice(best))
    return float(x[one]), float(y[one])


def _colour(unit: Array, sd: float, tau: float) -> Array:
    """Noise of a standard deviation and a time constant from independent numbers."""
    from scipy.signal import lfilter

    a = float(np.exp(-DT / tau))
    begin = np.array([a * unit[0]])
    return np.asarray(sd * lfilter([np.sqrt(1 - a * a)], [1, -a], unit, zi=begin)[0])
