# SPDX-License-Identifier: BSD-3-Clause
"""What truthful models buy in mapping: the shipped one with one part after the other made naive, on recordings."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from kurumaisu import slam, slam_score
from kurumaisu.bench.slam.models import without_mean_error
from kurumaisu.bench.slam.sharpness import sharpness
from kurumaisu.bench.table import Table
from kurumaisu.params import load_model, shipped
from kurumaisu.slam import MapperSettings, ScanLog
from kurumaisu.types import FloatArray

_INDEPENDENT = {"likelihood_power": 1.0}
_NO_SLIP = {"slip_gain": 0.0}


def mapping_models(recordings: Sequence[tuple[str, ScanLog, FloatArray | None]], seeds: int) -> None:
    """Print, for name, log and true poses (n, 3) if there are any, how sharp the map is and how far the path is off."""
    columns = ("walls [m]    ", "double walls [%]", "position [m] ", "heading [deg]  ")
    for name, log, truth in recordings:
        table = Table(f"mapping {name}, {seeds} seeds: median (worst)", "models" + " " * 30, *columns, page=False)
        for models, changed, changes in _variants(log):
            settings = {**slam.load_mapping_settings(shipped("launch/mapping_node.yaml")), **changes}
            figures = np.array([_judged(changed, truth, settings, seed) for seed in range(1, seeds + 1)])
            cells = (f"{np.median(c):.3f} ({c.max():.3f})" if np.isfinite(c).all() else "-" for c in figures.T)
            table.row(models, *cells)


def _variants(log: ScanLog) -> Iterator[tuple[str, ScanLog, MapperSettings]]:
    at_once = replace(log, odom_end=log.odom)
    yield "as shipped", log, {}
    yield "readings independent", log, _INDEPENDENT
    yield "slip not learnt", log, _NO_SLIP
    if not np.array_equal(log.odom, log.odom_end):
        yield "scans taken at once", at_once, {}
    yield "all of these: naive", at_once, {**_INDEPENDENT, **_NO_SLIP}
    laser = load_model(shipped("launch/md100.yaml")).laser
    if np.isclose(log.fan.angle_increment, laser.angle_increment, rtol=1e-3):  # a URG-04LX, too
        yield "equation (4)'s mean error taken out", without_mean_error(log, laser.error), {}


def _judged(
    log: ScanLog, truth: FloatArray | None, settings: MapperSettings, seed: int
) -> tuple[float, float, float, float]:
    """Return thickness [m] and share of double walls [%], errors of position [m] and heading [deg], NaN if untold."""
    result = slam.map_scans(settings, log, seed)
    sharp = sharpness(result.grid)
    position = heading = float("nan")
    if truth is not None:
        position, heading = slam_score.trajectory_error(result.trajectory[:, 1:], truth)
    return sharp.thickness, 100 * sharp.double, position, float(np.degrees(heading))
