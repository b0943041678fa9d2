# SPDX-License-Identifier: BSD-3-Clause
"""From commands to measured poses: the generator's own chair, in steps of 5 ms.

What the controller does with a command is worked out once per command; its rates are then averaged over the cells of
the grid, so times of commands and delays need not fit the grid.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from kurumaisu.types import FloatArray

STEP = 0.005  # [s]
Sizes = dict[str, float]  # what a form has drawn: main size and whatever else it needs


@dataclass(frozen=True)
class Events:
    """What is asked for from each time on: t (n,) [s], v [m/s], w [rad/s], as the controller understands it by now."""

    t: FloatArray
    v: FloatArray
    w: FloatArray


@dataclass(frozen=True)
class Rates:
    """Rates in the middle of each cell: v, u, w (n,); asked_v, asked_w before any response; moving: share of time.

    start (3,): pose at time 0; noise (n, 3): of v, u, w, which acts while the chair is asked to move.
    """

    t: FloatArray
    v: FloatArray
    u: FloatArray
    w: FloatArray
    asked_v: FloatArray
    asked_w: FloatArray
    moving: FloatArray
    start: FloatArray
    noise: FloatArray

    def headings(self) -> FloatArray:
        """Return the heading in the middle of each cell, (n,)."""
        turn = self.w + self.moving * self.noise[:, 2]
        return np.asarray(self.start[2] + STEP * (np.cumsum(turn) - turn / 2))


@dataclass(frozen=True)
class Measured:
    """What the reference does with the truth: its lever on the chair [m], and the pace of its clock."""

    x: float = 0.0
    y: float = 0.0
    pace: float = 1.0


@dataclass(frozen=True)
class Form:
    """One way of being wrong: a function of what it acts on and of its sizes.

    stage: 'volts' and then 'events', which act on the same, 'rates', 'floor', 'spread' (the noise's amplitude) or
    'reference'.
    """

    stage: str
    act: Callable[[Any, Sizes], Any]


@dataclass(frozen=True)
class Fault:
    """A form with its sizes."""

    form: Form
    sizes: Sizes


@dataclass(frozen=True)
class Setting:
    """One drive: commands (n, 3), start pose (3,), times of the reference (m,) and unit noise of the rates (n, 3).

    noise: what the floor adds to v, u, w on the grid, before it is gated by motion; None for a drive without.
    """

    command: FloatArray
    start: FloatArray
    stamps: FloatArray
    noise: FloatArray | None = field(default=None, repr=False)


def drive(setting: Setting, faults: Sequence[Fault]) -> tuple[FloatArray, Rates]:
    """Return true poses of the marker at the reference's stamps (m, 3), headings unwrapped, and the final rates."""
    command = setting.command
    events = Events(command[:, 0], command[:, 1], command[:, 2])
    for fault in (*_of(faults, "volts"), *_of(faults, "events")):
        events = fault.form.act(events, fault.sizes)
    rates = _sampled(events, setting)
    for stage in ("rates", "floor", "spread"):
        for fault in _of(faults, stage):
            rates = fault.form.act(rates, fault.sizes)
    measured = Measured()
    for fault in _of(faults, "reference"):
        measured = fault.form.act(measured, fault.sizes)
    return observe(integrate(rates), setting.stamps, measured), rates


def integrate(rates: Rates) -> FloatArray:
    """Return poses (n + 1, 3) at the edges of the grid by the midpoint rule."""
    heading = rates.headings()
    c, s = np.cos(heading), np.sin(heading)
    v, u, w = (np.stack([rates.v, rates.u, rates.w], axis=1) + rates.moving[:, None] * rates.noise).T
    steps = STEP * np.stack([c * v - s * u, s * v + c * u, w], axis=1)
    return np.asarray(np.concatenate([rates.start[None], rates.start + np.cumsum(steps, axis=0)]))


def observe(path: FloatArray, stamps: FloatArray, measured: Measured) -> FloatArray:
    """Return the marker's poses at times on the reference's clock."""
    at = np.minimum(stamps / measured.pace / STEP, len(path) - 1.001)
    low = at.astype(int)
    part = (at - low)[:, None]
    poses = (1 - part) * path[low] + part * path[low + 1]
    c, s = np.cos(poses[:, 2]), np.sin(poses[:, 2])
    poses[:, 0] += c * measured.x - s * measured.y
    poses[:, 1] += s * measured.x + c * measured.y
    return np.asarray(poses)


def _of(faults: Sequence[Fault], stage: str) -> list[Fault]:
    return [fault for fault in faults if fault.form.stage == stage]


def _sampled(events: Events, setting: Setting) -> Rates:
    """Return the events' means over the cells."""
    n = int(np.ceil((max(setting.stamps[-1], setting.command[-1, 0]) + 0.5) / STEP))
    edges = STEP * np.arange(n + 1)
    moving = ((events.v != 0) | (events.w != 0)).astype(float)
    v, w, moving = (_means(events.t, values, edges) for values in (events.v, events.w, moving))
    noise = np.zeros((n, 3)) if setting.noise is None else setting.noise[:n]
    return Rates(edges[:-1] + STEP / 2, v, np.zeros(n), w, v, w, moving, setting.start, noise)


def _means(t: FloatArray, values: FloatArray, edges: FloatArray) -> FloatArray:
    knots = np.append(t, max(edges[-1], t[-1]) + 1.0)
    sums = np.concatenate([[0.0], np.cumsum(values * np.diff(knots))])
    means = np.diff(np.interp(edges, knots, sums)) / np.diff(edges)
    return np.asarray(np.where(np.abs(means) < 1e-9, 0.0, means))  # rounding is neither driving nor turning
