# SPDX-License-Identifier: BSD-3-Clause
"""Figure 10: the voltage at the D/A converter against the speed that was commanded."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from kurumaisu._core import AxisLaw
from kurumaisu.bounded_files import MOST_TABLE, read_text
from kurumaisu.critic.values.recording import Series
from kurumaisu.errors import Error, told
from kurumaisu.paper import drawing
from kurumaisu.types import FloatArray

_HOLD = 0.8  # [s] a command must last so long to be a point of the figure
_LAST = 0.3  # [s] of it, in which the voltage must stand


@dataclass(frozen=True)
class Point:
    """A speed [m/s] that was commanded and held, and what the D/A put out [V] above the reference."""

    v: float
    volts: float
    spread: float


def read_log(path: Path, offset: float) -> FloatArray:
    """Return rows t [s], V_f, V_s, V_ref of virtual_dac's log; offset [s]: of ROS' time to its monotonic one.

    Raise Error naming file and line.
    """
    rows = []
    lines = read_text(path, MOST_TABLE, "ascii").splitlines()
    for number, line in enumerate(lines, 1):
        words = line.split()
        if len(words) < 2 or words[1] != "volts":
            continue
        try:
            nanoseconds, *volts = int(words[0]), *(float(word) for word in words[2:5])
        except ValueError as error:
            raise Error(f"{path}:{number}: is not a line of virtual_dac's log: {told(line)}") from error
        rows.append((1e-9 * nanoseconds + offset, *volts))
    if not rows:
        raise Error(f"{path}: the D/A converter got no voltages")
    return np.array(rows)


def points(command: Series, log: FloatArray) -> list[Point]:
    """Return a point for each speed that was held. Raise Error where none was."""
    v = command.column("v")
    edges = np.flatnonzero(np.diff(v) != 0) + 1
    found = []
    for first, end in zip(np.r_[0, edges], np.r_[edges, len(v)], strict=True):
        begin, stop = command.t[first], command.t[min(end, len(v) - 1)]
        if stop - begin < _HOLD:
            continue
        values = _held(log, stop - _LAST, stop - 0.02)
        found.append(Point(float(v[first]), float(np.median(values[:, 1])), float(np.ptp(values[:, 1]))))
    if not found:
        raise Error(f"no speed was held for {_HOLD:g} s")
    return found


def _held(log: FloatArray, begin: float, end: float) -> FloatArray:
    first = max(int(np.searchsorted(log[:, 0], begin, side="right")) - 1, 0)
    return log[first : max(int(np.searchsorted(log[:, 0], end)), first + 1)]


def off(found: Sequence[Point], law: AxisLaw) -> FloatArray:
    """Return measured minus the law's voltages [V]."""
    return np.array([point.volts - law.volts(point.v) for point in found])


def draw(path: Path, series: Sequence[tuple[str, Sequence[Point], AxisLaw]]) -> None:
    """Write figure 10: a panel for each law, points over its line; the data beside it."""
    table: dict[str, list[object]] = {"law": [], "v": [], "volts": [], "by_law": []}
    with drawing.figure(path, 1, len(series), (3.8 * len(series), 3.2)) as axes:
        for axis, (name, found, law) in zip(axes[0], series, strict=True):
            v = np.array([point.v for point in found])
            for side in (np.linspace(1e-6, max(v.max(), 0.1), 50), np.linspace(min(v.min(), -0.1), -1e-6, 50)):
                label = "model" if side[0] > 0 else None
                axis.plot(side, law.volts(side), color=drawing.LINE, linewidth=1.2, label=label)
            axis.plot(v, [point.volts for point in found], "o", color=drawing.MEASURED, label="at the D/A converter")
            axis.set(xlabel="v commanded [m/s]", ylabel="V_f [V]", title=f"Figure 10: {name}")
            axis.legend()
            for point in found:
                cells = (name, point.v, point.volts, float(law.volts(point.v)))
                for column, cell in zip(table.values(), cells, strict=True):
                    column.append(cell)
    drawing.table(path.with_suffix(".csv"), table)
