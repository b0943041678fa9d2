# SPDX-License-Identifier: BSD-3-Clause
"""What the other modules hand to each other: arrays, what is hidden, motions, sights."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]
STEP = 0.02


@dataclass(frozen=True)
class Hidden:
    """One thing that is hidden: which, how large, whether in another form, and a free number for its details."""

    id: str
    size: float
    other: bool = False
    extra: float = 0.5


@dataclass
class Rates:
    """Commands, voltages and rates of a drive on a grid of STEP, with the poses that rates may depend on."""

    t: Array
    v: Array
    w: Array
    cmd_v: Array
    cmd_w: Array
    pose: Array
    side: Array
    columns: dict[str, Array]
    f: Array | None = None
    s: Array | None = None
    law: str = ""


@dataclass
class Sight:
    """What the beams of scans meet: arrays of scans by beams, or of scans."""

    range: Array
    incidence: Array
    bright: Array
    hit_x: Array
    hit_y: Array
    direction: Array
    bearing: Array
    t: Array
    clock: Array
    speed: Array
    columns: dict[str, Array]
    edge: Array
    resolution: float = 0.0


@dataclass
class Spread:
    """How readings scatter: the sd of each, and what is shared."""

    sd: Array
    common: float = 0.0
    rho: float = 0.0
    beams: float = 0.0
    pairs: bool = False


@dataclass(frozen=True)
class Effect:
    """An effect: its sizes, whether it has a sign, what it needs, and which parameter its usual form has."""

    act: Callable[..., None]
    stage: str
    low: float
    high: float
    signed: bool = True
    parameter: str = ""
    voltages: bool = False
    covariates: tuple[str, ...] = ()
    channel: str = ""


@dataclass
class Truth:
    """What truth.json says of one cause, and the vector that shows it."""

    hidden: Hidden
    z: float = 0.0
    beside: float = 0.0
    vector: Array = field(default_factory=lambda: np.zeros(0))


def ordered(hidden: list[Hidden], catalogue: dict[str, Effect], stage: str) -> list[tuple[Effect, Hidden]]:
    """What of the hidden acts at a stage, in the order of the catalogue."""
    return [(e, h) for name, e in catalogue.items() if e.stage == stage for h in hidden if h.id == name]
