# SPDX-License-Identifier: BSD-3-Clause
"""The chair: voltage laws, the grid on which it moves, and its noise."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.signal import lfilter

Array = npt.NDArray[np.float64]
Shift = Callable[[Array, Array, Array, Array], Array]
DT = 0.005
TRANSLATION = ((1.32402, 0.127906), (2.07369, -0.108783))
STEERING = {
    "published": ((-0.499211, 0.104181), (-0.469278, -0.169476)),
    "corrected": ((-0.499211, -0.104181), (-0.469278, 0.169476)),
}
Law = tuple[tuple[float, float], tuple[float, float]]


@dataclass
class Noise:
    """How the rates fluctuate and the reference errs."""

    sd_v: float
    sd_w: float
    tau: float
    pos: float
    head: float
    drift: float


@dataclass
class Drive:
    """Commands on the grid, and the grid's cells at which a row of commands begins."""

    v: Array
    w: Array
    ticks: npt.NDArray[np.int64]
    start: float
    robot: str
    law: str
    noise_v: Array
    noise_w: Array
    columns: dict[str, Array] = field(default_factory=dict)

    def upto(self, n: int) -> Drive:
        """The first n cells only."""
        columns = {key: value[:n] for key, value in self.columns.items()}
        return Drive(
            self.v[:n],
            self.w[:n],
            self.ticks[self.ticks < n],
            self.start,
            self.robot,
            self.law,
            self.noise_v[:n],
            self.noise_w[:n],
            columns,
        )


@dataclass
class Path:
    """Where base_link is at the borders of the cells."""

    t: Array
    x: Array
    y: Array
    th: Array

    def at(self, t: Array) -> tuple[Array, Array, Array]:
        """The pose at any times."""
        return np.interp(t, self.t, self.x), np.interp(t, self.t, self.y), np.interp(t, self.t, self.th)


@dataclass
class Motion:
    """What becomes of the commands on their way to the reference."""

    drive: Drive
    path: Path
    t: Array
    cv: Array
    cw: Array
    v: Array
    w: Array
    vy: Array
    vf: Array
    vs: Array
    plant: str
    grow: Array
    marker: Array
    clock: float = 0.0
    shift: Shift | None = None


@dataclass(frozen=True)
class Effect:
    """A law at one stage: 0 time, 1 volts, 2 rates, 3 dynamics, 4 place, 5 reference; laser: 10 geometry to 14 gate."""

    id: str
    stage: int
    size: float
    top: float
    name: str
    axes: str
    usual: Callable[..., Any]
    second: Callable[..., Any] | None = None


@dataclass
class Use:
    """An effect with its size, its form and whatever else it was drawn with."""

    effect: Effect
    size: float
    other: bool = False
    aux: dict[str, Any] = field(default_factory=dict)

    @property
    def id(self) -> str:
        """The name by which it goes."""
        return self.effect.id

    def law(self, *given: Any) -> Any:
        """The law in the form that was drawn."""
        return (self.effect.second if self.other and self.effect.second else self.effect.usual)(*given)

    def act(self, m: Any) -> None:
        """Change what it changes."""
        for axis in self.effect.axes.split():
            setattr(m, axis, self.law(getattr(m, axis), m, self, axis))


def ou(rng: np.random.Generator, n: int, sd: float, tau: float, many: int = 1) -> Array:
    """Ornstein-Uhlenbeck rates on the grid, a row per draw."""
    keep = float(np.exp(-DT / tau))
    kicks = rng.normal(size=(many, n)) * sd * np.sqrt(1.0 - keep**2)
    kicks[:, 0] = rng.normal(size=many) * sd
    return np.asarray(lfilter([1.0], [1.0, -keep], kicks, axis=1))


def volts(rate: Array, law: Law) -> Array:
    """Equations (1) and (2)."""
    (kp, bp), (kn, bn) = law
    return np.where(rate > 0, kp * rate + bp, np.where(rate < 0, kn * rate + bn, 0.0))


def unvolt(u: Array, law: Law, asked: Array) -> Array:
    """The rate that a voltage makes; where two would do, that of the sign asked for."""
    (kp, bp), (kn, bn) = law
    up, down = (u - bp) / kp, (u - bn) / kn
    is_up, is_down = up > 0, down < 0
    both = np.where(asked > 0, up, np.where(asked < 0, down, 0.0))
    return np.where(is_up & is_down, both, np.where(is_up, up, np.where(is_down, down, 0.0)))


def begin(drive: Drive, path: Path | None) -> Motion:
    """The motion as asked for, before anything happens to it."""
    n = len(drive.v)
    t = np.arange(n) * DT
    zero = np.zeros(n)
    where = path or Path(np.arange(n + 1) * DT, np.zeros(n + 1), np.zeros(n + 1), np.zeros(n + 1))
    return Motion(
        drive,
        where,
        t,
        drive.v.copy(),
        drive.w.copy(),
        drive.v.copy(),
        drive.w.copy(),
        zero.copy(),
        zero,
        zero,
        drive.law,
        np.ones(n),
        np.zeros(3),
    )


def rates(drive: Drive, uses: list[Use], path: Path | None = None) -> Motion:
    """Send the commands through all effects, in the order of their stages."""
    m = begin(drive, path)
    base = sorted([use for use in uses if use.effect.stage < 10], key=lambda use: use.effect.stage)
    for use in [u for u in base if u.effect.stage == 0]:
        use.act(m)
    m.v, m.w = m.cv.copy(), m.cw.copy()
    electric = [u for u in base if u.effect.stage == 1]
    if electric:
        m.vf, m.vs = volts(m.cv, TRANSLATION), volts(m.cw, STEERING[drive.law])
        for use in electric:
            use.act(m)
        m.v, m.w = unvolt(m.vf, TRANSLATION, m.cv), unvolt(m.vs, STEERING[m.plant], m.cw)
    for use in [u for u in base if u.effect.stage > 1]:
        use.act(m)
    return m


def integrate(m: Motion, pose: tuple[float, float, float], nv: Array, nw: Array) -> Path:
    """Equation (3), with rates held in each cell."""
    turn = np.concatenate([[0.0], np.cumsum((m.w + nw) * DT)]) + pose[2]
    mid = 0.5 * (turn[1:] + turn[:-1])
    v = m.v + nv
    x = np.concatenate([[0.0], np.cumsum((v * np.cos(mid) - m.vy * np.sin(mid)) * DT)]) + pose[0]
    y = np.concatenate([[0.0], np.cumsum((v * np.sin(mid) + m.vy * np.cos(mid)) * DT)]) + pose[1]
    return Path(np.arange(len(turn)) * DT, x, y, turn)


def simulate(drive: Drive, uses: list[Use], pose: tuple[float, float, float]) -> tuple[Motion, Path]:
    """The true motion with its noise; laws that need the place are iterated."""
    path: Path | None = None
    for _ in range(max([use.aux.get("loops", 2) if use.effect.stage == 4 else 1 for use in uses], default=1)):
        m = rates(drive, uses, path)
        path = integrate(m, pose, drive.noise_v * m.grow, drive.noise_w * m.grow)
    assert path is not None
    return m, path


def reference(m: Motion, path: Path, stamps: Array) -> Array:
    """What a reference without error reads at its stamps: x, y, theta in columns."""
    x, y, th = path.at(stamps / (1.0 + m.clock))
    mx, my, yaw = m.marker
    out = np.stack([x + mx * np.cos(th) - my * np.sin(th), y + mx * np.sin(th) + my * np.cos(th), th + yaw], axis=1)
    if m.shift is not None:
        out += m.shift(stamps, x, y, th)
    return np.asarray(out)


def increments(rows: Array) -> Array:
    """Motion between neighbouring rows in the body frame of the first."""
    d = np.diff(rows, axis=0)
    c, s = np.cos(rows[:-1, 2]), np.sin(rows[:-1, 2])
    return np.stack([c * d[:, 0] + s * d[:, 1], -s * d[:, 0] + c * d[:, 1], d[:, 2]], axis=1)
