# SPDX-License-Identifier: BSD-3-Clause
"""Two models on a drive that neither was fitted to: rates, and where dead reckoning ends up."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from kurumaisu import _core, geometry
from kurumaisu._core import AxisInverse
from kurumaisu.critic.values.recording import Run, Series
from kurumaisu.errors import Error
from kurumaisu.paper.chair.samples import Samples
from kurumaisu.params import Model
from kurumaisu.types import FloatArray

STRETCH = 10.0  # [s] of dead reckoning


@dataclass(frozen=True)
class Errors:
    """Of a model: rms of v [m/s] and w [rad/s] over steady samples; of place [m] and heading [rad] after STRETCH."""

    v: float
    w: float
    place: float
    heading: float

    def better_than(self, other: Errors, share: float) -> bool:
        """Return whether one rate's error is below that share of the other's, and none is as much worse."""
        mine, theirs = np.array([self.v, self.w]), np.array([other.v, other.w])
        return bool((share * mine <= theirs).all() and (mine < share * theirs).any())


def errors(model: Model, samples: Samples, runs: Sequence[Run]) -> Errors:
    """Return what a model gets wrong about drives. Raise Error where nothing is steady, or all is too short."""
    steady = samples.of(samples.steady)
    if not len(steady):
        raise Error("the held-out drive has no steady samples")
    v = _rates(model, "translation", steady.v_f, steady.side_v) - steady.v
    w = _rates(model, "steering", steady.v_s, steady.side_w) - steady.w
    ends = np.concatenate([_ends(model, run) for run in runs])
    if not len(ends):
        raise Error(f"the held-out drive is shorter than {STRETCH:g} s")
    place = np.hypot(ends[:, 0], ends[:, 1])
    return Errors(_rms(v), _rms(w), _rms(place), _rms(ends[:, 2]))


def _rms(x: FloatArray) -> float:
    return float(np.sqrt(np.mean(x**2)))


def _rates(model: Model, axis: str, volts: FloatArray, side: FloatArray) -> FloatArray:
    return AxisInverse(getattr(model, axis)).rates(np.ascontiguousarray(volts), np.ascontiguousarray(side))


def _ends(model: Model, run: Run) -> FloatArray:
    """Return the error of the pose (k, 3) after each stretch, in the frame of its true end."""
    pose, voltage = run.pose, run.voltage
    assert pose is not None
    assert voltage is not None
    rates = _held_rates(model, voltage)
    first, last = max(pose.t[0], voltage.t[0]), min(pose.t[-1], voltage.t[-1])
    found = []
    for begin in np.arange(first, last - STRETCH + 1e-9, STRETCH):
        edges = np.unique(np.r_[begin, voltage.t[(voltage.t > begin) & (voltage.t < begin + STRETCH)], begin + STRETCH])
        held = np.clip(np.searchsorted(voltage.t, edges[:-1], side="right") - 1, 0, len(voltage.t) - 1)
        start, end = geometry.interpolate(pose.t, pose.values, np.array([begin, begin + STRETCH]))
        path = _core.integrate(rates[held, 0], rates[held, 1], np.diff(edges), start.tolist())
        found.append(geometry.between(end, path[-1]))
    return np.array(found).reshape(-1, 3)


def _held_rates(model: Model, voltage: Series) -> FloatArray:
    unknown = np.full(len(voltage.t), np.nan)
    columns = []
    for axis, volts, rate in (("translation", "v_f", "v"), ("steering", "v_s", "w")):
        side = np.sign(voltage.column(rate)) if rate in voltage.columns else unknown
        columns.append(_rates(model, axis, voltage.column(volts), side))
    return np.column_stack(columns)


def lines(before: Errors, after: Errors) -> list[str]:
    """Return both as text."""
    rows = [f"{'on the held-out drive':34s}{'before':>10s}{'after':>10s}"]
    for name, key, scale, unit in (
        ("speed, rms", "v", 1e3, "mm/s"),
        ("yaw rate, rms", "w", 1e3, "mrad/s"),
        (f"place after {STRETCH:.0f} s, rms", "place", 1.0, "m"),
        (f"heading after {STRETCH:.0f} s, rms", "heading", 180 / np.pi, "deg"),
    ):
        values = [scale * getattr(one, key) for one in (before, after)]
        rows.append(f"{f'{name} [{unit}]':34s}{values[0]:10.3f}{values[1]:10.3f}")
    return rows
