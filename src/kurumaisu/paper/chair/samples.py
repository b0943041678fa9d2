# SPDX-License-Identifier: BSD-3-Clause
"""Samples (v, w, V_f, V_s) of a drive, from its reference poses and what the D/A put out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from kurumaisu.critic.values.recording import Run, Series
from kurumaisu.errors import Error
from kurumaisu.paper.options import DriveOptions
from kurumaisu.types import BoolArray, FloatArray, IntArray


@dataclass(frozen=True)
class Samples:
    """One row for each window of a drive, (n,) each.

    t: middle [s]; v [m/s], w [rad/s] by the reference; v_f, v_s [V], mean; side_v, side_w: the sign of the rate that
    the voltages stood for, nan where nobody says; steady: whether the voltages were, in the window and before it;
    block: windows of one block are drawn together, a stretch of steady voltages, or a part of a long one; run: of which
    drive; sd_v, sd_w: what the reference's own error makes of them.
    """

    t: FloatArray
    v: FloatArray
    w: FloatArray
    v_f: FloatArray
    v_s: FloatArray
    side_v: FloatArray
    side_w: FloatArray
    steady: BoolArray
    block: IntArray
    run: IntArray
    sd_v: FloatArray
    sd_w: FloatArray

    def __len__(self) -> int:
        return len(self.t)

    def of(self, chosen: BoolArray) -> Samples:
        """Return the rows that are chosen."""
        return Samples(*(getattr(self, name)[chosen] for name in self.__dataclass_fields__))


def samples_of(runs: Sequence[Run], truth: tuple[float, float] | None, options: DriveOptions) -> Samples:
    """Return the samples of drives.

    truth: sd of position [m] and heading [rad] of the reference, None where unknown: then what the poses scatter about
    each window's motion serves. Raise Error naming the run that has no voltages, no poses, or too few.
    """
    rows = [_windows(run, options) for run in runs]
    blocks = np.cumsum([0, *(1 + max((row.block for row in some), default=0) for some in rows)])
    table = [
        (row, row.block + first, number)
        for number, (some, first) in enumerate(zip(rows, blocks, strict=False))
        for row in some
    ]
    if not table:
        raise Error(f"{', '.join(run.name for run in runs)}: no {options.window:g} s of voltages and poses together")
    sd = truth if truth is not None else _scatter([row for row, _, _ in table])
    return Samples(
        **{name: np.array([getattr(row, name) for row, _, _ in table]) for name in _Row.PLAIN},
        steady=np.array([row.steady for row, _, _ in table]),
        block=np.array([block for _, block, _ in table]),
        run=np.array([number for _, _, number in table]),
        sd_v=np.array([sd[0] * row.gain for row, _, _ in table]),
        sd_w=np.array([sd[1] * row.gain for row, _, _ in table]),
    )


@dataclass(frozen=True)
class _Row:
    """A window; gain: sd of a rate per sd of a pose [1/s]; scatter: of position and heading about the motion."""

    t: float
    v: float
    w: float
    v_f: float
    v_s: float
    side_v: float
    side_w: float
    steady: bool
    block: int
    gain: float
    scatter: tuple[float, float]

    PLAIN = ("t", "v", "w", "v_f", "v_s", "side_v", "side_w")


def _scatter(rows: Sequence[_Row]) -> tuple[float, float]:
    """Return sd of position [m] and heading [rad]: the median, so that windows of changing speed do not count."""
    position, heading = np.median([row.scatter for row in rows], axis=0)
    return float(position), float(heading)


def _windows(run: Run, options: DriveOptions) -> list[_Row]:
    pose, voltage = run.pose, run.voltage
    if pose is None or voltage is None:
        raise Error(
            f"{run.name}: needs voltages and reference poses; it has no {'pose' if pose is None else 'voltage'}"
        )
    first, last = max(pose.t[0], voltage.t[0]), min(pose.t[-1], voltage.t[-1])
    rows = []
    for k in range(int(max(0.0, (last - first) / options.window + 1e-9))):
        begin = first + k * options.window
        inside = slice(*np.searchsorted(pose.t, [begin - 1e-9, begin + options.window + 1e-9]))
        if inside.stop - inside.start >= options.poses:
            rows.append(_row(pose.t[inside], pose.values[inside], voltage, options))
    return _in_blocks(rows, options)


def _in_blocks(rows: Sequence[_Row], options: DriveOptions) -> list[_Row]:
    """Return rows with their blocks: stretches of steady voltages, long ones in parts of options.block."""
    found: list[_Row] = []
    block, begin = 0, -np.inf
    for n, row in enumerate(rows):
        follows = n > 0 and row.steady and rows[n - 1].steady and row.t - rows[n - 1].t < 1.5 * options.window
        if not follows or row.t - begin > options.block - 0.5 * options.window:
            block, begin = block + 1, row.t
        found.append(replace(row, block=block))
    return found


def _row(t: FloatArray, poses: FloatArray, voltage: Series, options: DriveOptions) -> _Row:
    """Return v and w by least squares, and the mean of the voltages with the weights that these give to each moment."""
    about = t - t.mean()
    slope = about / (about @ about)  # slope @ y is the slope of y
    moments = -np.cumsum(slope)[:-1] * np.diff(t)  # slope @ y = the mean of dy/dt with these weights, which sum to 1
    w = float(slope @ poses[:, 2])
    heading = poses[:, 2].mean() + w * about
    v, position = _speed(about, heading, poses[:, :2])
    volts = np.array([held_mean(voltage, name, t) for name in ("v_f", "v_s")])
    before = voltage_between(voltage, max(t[0] - options.settle, voltage.t[0]), t[-1])
    sides = _sides(voltage, t)
    n = len(t)
    return _Row(
        t=float(t.mean()),
        v=v,
        w=w,
        v_f=float(moments @ volts[0]),
        v_s=float(moments @ volts[1]),
        side_v=sides[0],
        side_w=sides[1],
        steady=bool((np.ptp(before, axis=0) < options.steady).all()),
        block=0,
        gain=float(np.sqrt(slope @ slope)),
        scatter=(position, float(np.sqrt(np.sum((poses[:, 2] - heading) ** 2) / (n - 2)))),
    )


def _speed(about: FloatArray, heading: FloatArray, places: FloatArray) -> tuple[float, float]:
    """Return the speed along the arc of a heading, and what the places scatter about it, each axis [m]."""
    w = (heading[-1] - heading[0]) / (about[-1] - about[0])
    middle = heading.mean()
    # the arc of unit speed, equation (3): at w = 0 its limit
    half = 0.5 * w * about
    chord = about * np.sinc(half / np.pi)
    arc = np.column_stack([chord * np.cos(middle + half), chord * np.sin(middle + half)])
    arc, seen = arc - arc.mean(axis=0), places - places.mean(axis=0)
    v = float(np.sum(arc * seen) / np.sum(arc**2))
    rest = np.sum((seen - v * arc) ** 2)
    return v, float(np.sqrt(rest / (2 * len(about) - 3)))


def held_mean(voltage: Series, column: str, t: FloatArray) -> FloatArray:
    """Return the means of a held column over the intervals of t (n,), (n - 1,)."""
    values = voltage.column(column)
    whole = np.concatenate([[0.0], np.cumsum(values[:-1] * np.diff(voltage.t))])
    index = np.clip(np.searchsorted(voltage.t, t, side="right") - 1, 0, len(values) - 1)
    at = whole[index] + values[index] * (t - voltage.t[index])
    return np.asarray(np.diff(at) / np.diff(t))


def voltage_between(voltage: Series, begin: float, end: float) -> FloatArray:
    """Return v_f and v_s that were held at any time of an interval, (n, 2)."""
    first = max(int(np.searchsorted(voltage.t, begin + 1e-9, side="right")) - 1, 0)
    last = max(int(np.searchsorted(voltage.t, end - 1e-9)), first + 1)
    return np.column_stack([voltage.column(name)[first:last] for name in ("v_f", "v_s")])


def _sides(voltage: Series, t: FloatArray) -> tuple[float, float]:
    """Return the signs of the rates that the voltages stood for, nan where they changed or nobody says."""
    if "v" not in voltage.columns:
        return np.nan, np.nan
    inside = slice(
        max(int(np.searchsorted(voltage.t, t[0] + 1e-9, side="right")) - 1, 0),
        int(np.searchsorted(voltage.t, t[-1] - 1e-9)),
    )
    found = []
    for name in ("v", "w"):
        signs = np.unique(np.sign(voltage.column(name)[inside]))
        found.append(float(signs[0]) if len(signs) == 1 else np.nan)
    return found[0], found[1]
