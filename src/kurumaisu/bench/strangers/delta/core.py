# SPDX-License-Identifier: BSD-3-Clause
"""What a recording is made of: causes, noise, fan, drives."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kurumaisu.bench.strangers.delta.room import Room

Array = NDArray[Any]
DT = 0.01
WARM = 500.0  # [s] in which a laser, or what is about it, gets warm where nothing else is said


@dataclass
class Curve:
    """An unknown: which channel follows which quantity, by which shape."""

    channel: str
    covariate: str
    shape: Callable[[Array], Array]
    accepted: list[str]


@dataclass
class Cause:
    """One hidden effect and its size."""

    id: str
    size: float
    other: bool = False
    extra: dict[str, float] = field(default_factory=dict)
    curve: Curve | None = None


@dataclass
class Noise:
    """True noise: of the rates (Ornstein-Uhlenbeck) and of the camera (white, and a slow drift)."""

    sd_v: float
    sd_w: float
    tau: float
    position: float
    heading: float
    drift: float
    drift_tau: float = 80.0


@dataclass
class Fan:
    """The laser's fan, as meta.yaml states it."""

    angle_min: float
    increment: float
    beams: int
    time_increment: float
    x: float = 0.30

    @property
    def angles(self) -> Array:
        """Bearings of the beams."""
        return self.angle_min + self.increment * np.arange(self.beams)


@dataclass
class Path:
    """A motion on the grid: poses at the ends of the cells, rates within them."""

    x: Array
    y: Array
    th: Array
    v: Array
    w: Array

    def at(self, t: Array) -> tuple[Array, Array, Array]:
        """Pose at times of the grid's clock."""
        grid = DT * np.arange(len(self.x))
        return np.interp(t, grid, self.x), np.interp(t, grid, self.y), np.interp(t, grid, self.th)


@dataclass
class Drive:
    """One drive: inputs, true motion, and what was recorded of it; times are relative to its start."""

    name: str
    start: float
    length: float
    session: float
    commands: Array = field(default_factory=lambda: np.zeros((0, 3)))
    noise_v: Array = field(default_factory=lambda: np.zeros(0))
    noise_w: Array = field(default_factory=lambda: np.zeros(0))
    path: Path | None = None
    origin: tuple[float, float, float] = (0.0, 0.0, 0.0)
    rows: Array = field(default_factory=lambda: np.zeros(0))
    poses: Array = field(default_factory=lambda: np.zeros((0, 3)))
    odd: Array = field(default_factory=lambda: np.zeros(0))
    scan_t: Array = field(default_factory=lambda: np.zeros(0))
    scans: Array = field(default_factory=lambda: np.zeros((0, 0)))
    contact: tuple[float, float] = (-1.0, -1.0)
    walker: tuple[float, float, float] = (-1.0, 0.0, 0.0)
    windows: list[float] = field(default_factory=list)
    asked_scans: list[int] = field(default_factory=list)

    def true_path(self) -> Path:
        """The path, once it was driven."""
        assert self.path is not None
        return self.path


@dataclass
class Setup:
    """Everything about a recording but what is hidden in it."""

    rng: np.random.Generator
    volts: bool
    scans: bool
    room: Room
    fan: Fan
    noise: Noise
    style: str
    columns: dict[str, Callable[[Array], Array]]
    drives: list[Drive]
    train: int
    facts: dict[str, Any] = field(default_factory=dict)
