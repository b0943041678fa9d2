# SPDX-License-Identifier: BSD-3-Clause
"""From commands to rates, path and reference, by the MD-100's equations and by what is hidden in them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.signal import lfilter

from kurumaisu.bench.strangers.moor.world import Array

DT = 0.01
FORWARD = ((1.32402, 0.127906), (2.07369, -0.108783))
STEERING = ((-0.499211, 0.104181), (-0.469278, -0.169476))
TIME, VOLTS, RATE, DYNAMIC, NOISE, REFERENCE = range(6)


@dataclass
class Drive:
    """A drive as it is asked for, with the fluctuations and covariates that belong to it."""

    t: Array
    v: Array
    w: Array
    ticks: Array
    start: tuple[float, float, float]
    noise: Array
    free: Array
    columns: dict[str, Array]
    volts: bool
    luck: int


@dataclass(frozen=True)
class Law:
    """How one effect of the base acts: its stage, its smallest and largest size, the names of its parameters."""

    name: str
    stage: int
    low: float
    high: float
    act: Callable[[Motion, float], None]
    parameters: dict[str, float] = field(default_factory=dict)
    form: str = "same"
    signed: bool = False
    volts: bool = False
    place: bool = False
    scans: bool = True
    channel: str = ""
    covariates: tuple[str, ...] = ()


Causes = Sequence[tuple[Law, float]]


class Motion:
    """What the chair does in one drive, on a grid of 10 ms."""

    def __init__(self, drive: Drive) -> None:
        """Begin with the rates that are asked for."""
        zero = np.zeros_like(drive.t)
        self.drive, self.t, self.columns = drive, drive.t, drive.columns
        self.ask_v, self.ask_w, self.v, self.w, self.u = drive.v, drive.w, drive.v.copy(), drive.w.copy(), zero.copy()
        self.v_f, self.v_s = zero.copy(), zero.copy()
        self.x, self.y, self.heading = zero + drive.start[0], zero + drive.start[1], zero + drive.start[2]
        self.grow = zero + 1
        self.mark_x, self.mark_y, self.mark_yaw = zero.copy(), zero.copy(), zero.copy()
        self.ref_x, self.ref_y, self.clock = zero.copy(), zero.copy(), 0.0

    def add(self, v: Array | float = 0.0, w: Array | float = 0.0, u: Array | float = 0.0) -> None:
        """Add to the rates forward, of yaw and sideways."""
        self.v, self.w, self.u = self.v + v, self.w + w, self.u + u

    def put(self, **arrays: Array | float) -> None:
        """Put arrays in place of those that are."""
        self.__dict__.update(arrays)

    def since(self, event: Array, way: bool = False) -> Array:
        """Time, or way driven, since an event was last true; since the beginning before the first."""
        run = np.cumsum(abs(self.ask_v)) * DT if way else self.t
        return np.asarray(run - np.maximum.accumulate(np.where(event, run, run[0])))

    def changed(self) -> Array:
        """Where the command begins to change, or ends to."""
        moving = abs(np.diff(self.ask_v, prepend=0)) + abs(np.diff(self.ask_w, prepend=0)) > 1e-9
        return np.asarray(moving)

    def reversed(self) -> Array:
        """Where the chair sets off in the direction opposite to that of before."""
        sign = np.sign(self.ask_v)
        last = np.maximum.accumulate(np.where(sign != 0, np.arange(sign.size), 0))
        return np.asarray(np.diff(sign[last], prepend=sign[last][0]) * sign[last] > 1)

    def at(self, values: Array, t: Array) -> Array:
        """Values at other times than the grid's."""
        return np.interp(t, self.t, values)

    def reference(self, stamps: Array) -> Array:
        """The pose that a reference without noise has at the stamps: rows of x, y, heading."""
        t = stamps / (1 + self.clock)
        h, mx, my = self.at(self.heading, t), self.at(self.mark_x, t), self.at(self.mark_y, t)
        x = self.at(self.x, t) + np.cos(h) * mx - np.sin(h) * my + self.at(self.ref_x, t)
        y = self.at(self.y, t) + np.sin(h) * mx + np.cos(h) * my + self.at(self.ref_y, t)
        return np.stack([x, y, h + self.at(self.mark_yaw, t)], axis=1)


def to_volts(rate: Array, law: tuple[tuple[float, float], tuple[float, float]]) -> Array:
    """Equation (1) or (2)."""
    (a, b), (c, d) = law
    return np.where(rate > 0, a * rate + b, np.where(rate < 0, c * rate + d, 0.0))


def from_volts(volts: Array, meant: Array, law: tuple[tuple[float, float], tuple[float, float]]) -> Array:
    """The rate that answers a voltage, on the branch of the rate that is meant; a chair at rest stays so."""
    (a, b), (c, d) = law
    ahead, back = np.maximum((volts - b) / a, 0), np.minimum((volts - d) / c, 0)
    return np.where(meant > 0, ahead, np.where(meant < 0, back, 0.0))


def path(m: Motion, v: Array, w: Array, first: int = 0) -> None:
    """Integrate the rates, from row `first` on, where the pose is kept."""
    turned = np.concatenate([[0.0], np.cumsum(w[first:-1]) * DT])
    heading = m.heading[first] + turned
    mid = heading + w[first:] * DT / 2
    dx = (v[first:] * np.cos(mid) - m.u[first:] * np.sin(mid)) * DT
    dy = (v[first:] * np.sin(mid) + m.u[first:] * np.cos(mid)) * DT
    new = {"x": m.x.copy(), "y": m.y.copy(), "heading": m.heading.copy()}
    new["heading"][first:] = heading
    new["x"][first:] = m.x[first] + np.concatenate([[0.0], np.cumsum(dx[:-1])])
    new["y"][first:] = m.y[first] + np.concatenate([[0.0], np.cumsum(dy[:-1])])
    m.put(**new)


def simulate(
    drive: Drive,
    causes: Causes,
    noise: float = 1.0,
    begin: tuple[int, Motion, tuple[float, float, float]] | None = None,
) -> Motion:
    """Drive it; or go on from a row of another motion, at a given pose."""
    ordered = sorted(causes, key=lambda c: c[0].stage)
    before: Motion | None = None
    for _ in range(4 if any(law.place for law, _ in causes) else 1):
        m = Motion(drive)
        first = 0
        if before is not None:
            m.put(x=before.x, y=before.y, heading=before.heading)
        if begin is not None:
            first, source, pose = begin
            rows = np.arange(m.t.size)
            ready = before if before is not None else source
            for name, value in zip(("x", "y", "heading"), pose, strict=True):
                kept = np.where(rows < first, getattr(source, name), getattr(ready, name))
                kept[first] = value
                m.put(**{name: kept})
        run_stages(m, ordered)
        m.put(v=m.v * drive.free, w=m.w * drive.free, u=m.u * drive.free)
        share = noise * m.grow * drive.free
        path(m, m.v + share * drive.noise[0], m.w + share * drive.noise[1], first)
        before = m
    for law, size in ordered:
        if law.stage == REFERENCE:
            law.act(m, size)
    return m


def run_stages(m: Motion, ordered: Causes) -> None:
    """Let all causes but those of the reference act, in their order."""
    turned = False
    for law, size in ordered:
        if law.stage >= VOLTS and m.drive.volts and not turned:
            m.put(v_f=to_volts(m.v, FORWARD), v_s=to_volts(m.w, STEERING))
            turned = True
        if law.stage > VOLTS and law.stage < REFERENCE and turned:
            settle(m)
        if law.stage < REFERENCE:
            law.act(m, size)
    settle(m)


def settle(m: Motion) -> None:
    """Turn voltages that were changed into rates, once."""
    if m.v_f.any() or m.v_s.any():
        m.put(v=from_volts(m.v_f, m.v, FORWARD), w=from_volts(m.v_s, m.w, STEERING))
        m.put(v_f=np.zeros_like(m.t), v_s=np.zeros_like(m.t))


def coloured(rng: np.random.Generator, n: int, sd: float, tau: float, dt: float = DT) -> Array:
    """Noise of a standard deviation and a time constant."""
    a = float(np.exp(-dt / tau))
    start = np.array([a * rng.normal(0, sd)])
    return np.asarray(lfilter([np.sqrt(1 - a * a)], [1, -a], rng.normal(0, sd, n), zi=start)[0])
