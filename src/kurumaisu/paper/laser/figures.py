# SPDX-License-Identifier: BSD-3-Clause
"""Figures 7, 8, 9, 11 and 12: scans of a wall, their mean and their standard deviation against distance."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from kurumaisu._core import LaserError
from kurumaisu.paper import drawing
from kurumaisu.paper.laser.law import NAMES, Agreement, LaserLaw
from kurumaisu.paper.laser.wall import Ahead, WallScans
from kurumaisu.types import FloatArray


def scan(path: Path, place: WallScans) -> None:
    """Write figure 7: one scan in Cartesian coordinates; its data beside it."""
    points = place.points[0]
    there = np.isfinite(points).all(axis=1)
    drawing.table(
        path.with_suffix(".csv"),
        {
            "bearing": place.bearings[there],
            "range": place.ranges[0][there],
            "x": points[there, 0],
            "y": points[there, 1],
        },
    )
    with drawing.figure(path, 1, 1, (4.6, 3.6)) as axes:
        axis = axes[0][0]
        axis.axvline(place.distance, color=drawing.PAPER, linestyle="--", linewidth=1.0, label="the wall, as taped")
        axis.plot(*points[there].T, "o", color=drawing.MEASURED, markersize=2.0, label="one scan")
        axis.plot(0, 0, "^", color=drawing.LINE, label="laser")
        axis.set(xlabel="x [m]", ylabel="y [m]", title=f"Figure 7: a flat wall at {place.distance:g} m")
        axis.set_aspect("equal", adjustable="datalim")
        axis.legend()


def against_distance(path: Path, places: Sequence[Ahead], law: LaserLaw, paper: LaserError) -> None:
    """Write figures 8 and 9 side by side; paper: (4)."""
    r = np.array([place.distance for place in places])
    fine = np.linspace(0.0, 1.05 * r.max(), 200)
    with drawing.figure(path, 1, 2, (7.6, 3.2)) as axes:
        mean, sd = axes[0]
        mean.plot(fine, paper.mean(fine), "--", color=drawing.PAPER, linewidth=1.0, label="equation (4)")
        mean.plot(fine, law.mean(fine), color=drawing.LINE, linewidth=1.2, label="found")
        mean.plot(r, [place.mean for place in places], "o", color=drawing.MEASURED, label="beams ahead")
        mean.set(xlabel="distance [m]", ylabel="mean reading [m]", title="Figure 8")
        sd.plot(fine, 1e3 * paper.deviation(fine), "--", color=drawing.PAPER, linewidth=1.0, label="equation (4)")
        sd.plot(fine, 1e3 * law.deviation(fine), color=drawing.LINE, linewidth=1.2, label="found")
        sd.plot(r, [1e3 * place.sd for place in places], "o", color=drawing.MEASURED, label="beams ahead")
        sd.set(xlabel="distance [m]", ylabel="standard deviation [mm]", title="Figure 9", ylim=(0, None))
        for axis in axes[0]:
            axis.legend()


def setting(path: Path, places: Sequence[WallScans], walls: FloatArray) -> None:
    """Write figure 11: the simulated wall and the laser at each distance; beside it one scan from each, x stretched.

    walls: (m, 4) [m], x, y of both ends, seen from the middle of the wall's face. The scans' data go beside the file.
    """
    rows: dict[str, list[float]] = {"distance": [], "x": [], "y": []}
    with drawing.figure(path, 1, 2, (7.6, 3.2)) as axes:
        whole, close = axes[0]
        for n, (x0, y0, x1, y1) in enumerate(walls):
            for axis in axes[0]:
                label = None if n or axis is close else "wall"
                axis.plot([x0, x1], [y0, y1], color=drawing.PAPER, linewidth=1.4, label=label)
        for n, place in enumerate(places):
            points = place.points[0]
            met = points[np.isfinite(points).all(axis=1)] - [place.distance, 0.0]
            for end in met[[0, -1]]:
                whole.plot([-place.distance, end[0]], [0, end[1]], color=drawing.FAINT, linewidth=0.7, zorder=1)
            whole.plot(-place.distance, 0, "^", color=drawing.LINE, label=None if n else "laser")
            shade = 0.9 - 0.7 * n / max(len(places) - 1, 1)
            close.plot(
                *met.T, "o", color=drawing.MEASURED, alpha=shade, markersize=2.0, label=f"from {place.distance:g} m"
            )
            for column, values in zip(rows.values(), (np.full(len(met), place.distance), *met.T), strict=True):
                column.extend(values.tolist())
        whole.set(xlabel="x [m] from the wall", ylabel="y [m]", title="Figure 11: the simulated wall")
        whole.set_aspect("equal", adjustable="datalim")
        whole.legend(loc="upper left")
        close.set(xlabel="x [m] from the wall", title="a scan from each place, x stretched")
        left, right = close.get_xlim()
        close.set_xlim(left, right + 0.35 * (right - left))  # room for the legend
        close.legend(loc="center right")
    drawing.table(path.with_suffix(".csv"), rows)


def simulated(path: Path, places: Sequence[Ahead], told: Sequence[Agreement], paper: LaserError, agree: float) -> None:
    """Write figure 12: means of the simulated wall against distance over (4), and what is left, in standard errors.

    agree: within how many of them a mean must lie.
    """
    r = np.array([place.distance for place in places])
    fine = np.linspace(0.0, 1.05 * r.max(), 200)
    with drawing.figure(path, 1, 2, (7.6, 3.2)) as axes:
        mean, off = axes[0]
        mean.plot(fine, paper.mean(fine), "--", color=drawing.PAPER, linewidth=1.0, label="equation (4)")
        mean.plot(r, [place.mean for place in places], "o", color=drawing.MEASURED, label="simulated wall")
        mean.set(xlabel="distance [m]", ylabel="mean reading [m]", title="Figure 12")
        mean.legend()
        off.axhspan(-agree, agree, color="#eef2f4", label="agrees")
        off.plot(r, [one.off for one in told], "o", color=drawing.MEASURED)
        off.legend(loc="upper right")
        off.set(xlabel="distance [m]", ylabel="mean - (4) [standard errors]", title="what is left")
        most = max(agree, *(abs(one.off) for one in told))
        off.set_ylim(-1.5 * most, 1.5 * most)


def data(path: Path, places: Sequence[Ahead], told: Sequence[Agreement]) -> None:
    """Write mean and standard deviation at each distance, beside (4)'s."""
    drawing.table(
        path,
        {
            "distance": [place.distance for place in places],
            "scans": [len(place.readings) for place in places],
            "beams": [place.readings.shape[1] for place in places],
            "mean": [place.mean for place in places],
            "expected_mean": [one.expected_mean for one in told],
            "off_in_standard_errors": [one.off for one in told],
            "sd": [place.sd for place in places],
            "expected_sd": [one.expected_sd for one in told],
            "p_of_variance": [one.p for one in told],
            "flat_mean": [place.flat_mean for place in places],
            "flat_sd": [place.flat_sd for place in places],
        },
    )


def coefficients(path: Path, law: LaserLaw, paper: Sequence[float]) -> None:
    """Write what was found beside (4), a row for each coefficient."""
    drawing.table(
        path,
        {
            "coefficient": NAMES,
            "found": [c.value for c in law.coefficients],
            "low": [c.low for c in law.coefficients],
            "high": [c.high for c in law.coefficients],
            "model": list(paper),
        },
        digits=8,
    )
