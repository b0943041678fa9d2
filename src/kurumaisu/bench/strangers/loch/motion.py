# SPDX-License-Identifier: BSD-3-Clause
"""The chair as a chain of stages from commands to the path that the reference sees; the law of equations (1), (2)."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np
import yaml
from numpy.typing import NDArray

from kurumaisu.params import shipped

Array = NDArray[np.float64]
MODEL = yaml.safe_load(shipped("launch/md100.yaml").read_text())
State = SimpleNamespace
DT = 0.01
STAGES = ("command", "volt", "rate", "lag", "plane")


@dataclass(frozen=True)
class Branch:
    """One axis: slope and intercept for positive and for negative rates."""

    up: tuple[float, float]
    down: tuple[float, float]

    def volts(self, rate: Array) -> Array:
        """Voltage that stands for a rate."""
        up, down = self.up[0] * rate + self.up[1], self.down[0] * rate + self.down[1]
        return np.where(rate > 0, up, np.where(rate < 0, down, 0.0))

    def rates(self, volts: Array, asked: Array) -> Array:
        """Rate of a voltage, by the branch of the sign that was asked for."""
        up = np.maximum((volts - self.up[1]) / self.up[0], 0.0)
        down = np.minimum((volts - self.down[1]) / self.down[0], 0.0)
        return np.where(asked > 0, up, np.where(asked < 0, down, 0.0))

    def slope(self, rate: Array) -> Array:
        """Volts per rate on the side of the rate, without sign."""
        return np.where(rate >= 0, abs(self.up[0]), abs(self.down[0]))


class Law(NamedTuple):
    """Both axes of a chair; a robot without voltages has none of it."""

    name: str
    translation: Branch
    steering: Branch


def law(name: str) -> Law:
    """The law of that name in the model's file."""
    entry = MODEL["voltage_laws"][name]
    pairs = [
        [(entry[a][s]["slope"], entry[a][s]["intercept"]) for s in ("positive", "negative")]
        for a in ("translation", "steering")
    ]
    return Law(name, Branch(*pairs[0]), Branch(*pairs[1]))


@dataclass
class Path:
    """Where the chair was, and how fast, on the grid of a drive."""

    t: Array
    x: Array
    y: Array
    th: Array
    v: Array
    w: Array

    def at(self, t: Array) -> Array:
        """Poses at given times, a row each."""
        return np.stack([np.interp(t, self.t, a) for a in (self.x, self.y, self.th)], axis=-1)


@dataclass
class Drive:
    """What was asked for in one drive, and what the floor made of it."""

    name: str
    start: float
    t: Array
    cv: Array
    cw: Array
    nv: Array
    nw: Array
    pose: tuple[float, float, float]
    law: Law | None
    columns: dict[str, Array]
    rows: list[tuple[float, float, float]] = field(default_factory=list)
    seed: int = 0

    def cut(self, n: int) -> "Drive":
        """The first n steps of it."""
        columns = {k: a[:n] for k, a in self.columns.items()}
        return replace(self, columns=columns, **{k: getattr(self, k)[:n] for k in ("t", "cv", "cw", "nv", "nw")})


class Hidden(NamedTuple):
    """An effect with its size, form and the numbers that shape it."""

    id: str
    size: float
    form: int
    u: tuple[float, ...]


@dataclass(frozen=True)
class Effect:
    """Where it acts, its law in each form, sizes to start from, its parameter; + has no sign, v volts, p by place."""

    stage: str
    law: Callable[[Any, float, Hidden], dict[str, Any]]
    sizes: tuple[float, ...]
    key: str
    words: str
    flags: str = ""
    largest: float = 1e9

    def act(self, target: object, h: Hidden) -> None:
        """Changes signals, a path or scans."""
        for name, value in self.law(target, h.size, h).items():
            setattr(target, name, value)


CATALOGUE: dict[str, Effect] = {}


def _after(stage: str, s: State) -> None:
    """What the model itself does after a stage: the law, forth and back."""
    if stage == "command":
        s.v, s.w, s.moving = s.cv, s.cw, ((s.cv != 0) | (s.cw != 0)).astype(np.float64)
        if s.drive.law is not None:
            s.fv, s.fs = s.drive.law.translation.volts(s.cv), s.drive.law.steering.volts(s.cw)
    if stage == "volt" and s.law is not None:
        s.v, s.w = s.law.translation.rates(s.fv, s.cv), s.law.steering.rates(s.fs, s.cw)


def rates(d: Drive, hidden: Sequence[Hidden], guide: Path | None = None) -> State:
    """Rates without noise."""
    z = np.zeros_like(d.t)
    s = State(drive=d, guide=guide, t=d.t, cv=d.cv, cw=d.cw, nv=d.nv, nw=d.nw, law=d.law, vy=z, v=z, w=z, fv=z, fs=z)
    for stage in STAGES:
        for h in hidden:
            effect = CATALOGUE[h.id]
            if effect.stage == stage and (guide is not None or "p" not in effect.flags):
                effect.act(s, h)
        _after(stage, s)
    return s


def integrate(drive: Drive, v: Array, w: Array, vy: Array) -> Path:
    """The path of rates that hold for one step each."""

    def total(start: float, rate: Array) -> Array:
        """Sum of a rate from a start on."""
        return np.asarray(start + np.concatenate([[0.0], np.cumsum(rate[:-1]) * DT]))

    th = total(drive.pose[2], w)
    c, s = np.cos(th + w * DT / 2), np.sin(th + w * DT / 2)
    return Path(drive.t, total(drive.pose[0], v * c - vy * s), total(drive.pose[1], v * s + vy * c), th, v, w)


def truth(drive: Drive, hidden: Sequence[Hidden]) -> Path:
    """The path with noise; what depends on the place is found by going round."""
    guide: Path | None = None
    for _ in range(5 if any("p" in CATALOGUE[h.id].flags for h in hidden) else 1):
        s = rates(drive, hidden, guide)
        guide = integrate(drive, s.v + s.nv, s.w + s.nw, s.vy)
    assert guide is not None
    return guide


def seen(path: Path, hidden: Sequence[Hidden], place: Path) -> Path:
    """The path as the reference sees it, without its errors; what goes by the place takes it from where it was."""
    out = replace(path)
    for h in hidden:
        effect = CATALOGUE[h.id]
        if effect.stage == "reference":
            moved = replace(place) if "p" in effect.flags else out
            effect.act(moved, h)
            if moved is not out:
                dx, dy, turn = moved.x - place.x, moved.y - place.y, moved.th - place.th
                c, s = np.cos(out.th - place.th), np.sin(out.th - place.th)
                out = replace(out, x=out.x + c * dx - s * dy, y=out.y + s * dx + c * dy, th=out.th + turn)
    return out
