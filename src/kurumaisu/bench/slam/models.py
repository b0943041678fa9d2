# SPDX-License-Identifier: BSD-3-Clause
"""What truthful models buy: naive ones, the shipped ones, those with the critic's process noise, on the same drives."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from kurumaisu._core import LaserError
from kurumaisu.bench.table import Table
from kurumaisu.geometry import compose, wrap
from kurumaisu.localization import NO_PROCESS_NOISE, LocalizerSettings, localize_scans, make_localizer
from kurumaisu.map_file import MapFile
from kurumaisu.slam import ScanLog
from kurumaisu.types import FloatArray

START_SD = np.array([0.1, 0.1, 0.05])  # [m, m, rad] deviation of the first pose from the truth
_SETTLED = 20  # scans after which errors count
_SURE = "tracking"

Noise = tuple[float, float, float, float]
# Readings independent of each other, all noise a share of the motion: amcl's defaults.
_NAIVE = {
    "laser_correlation": 0.0,
    "laser_power": 1.0,
    "odom_alpha1": 0.2,
    "odom_alpha2": 0.2,
    "odom_alpha3": 0.2,
    "odom_alpha4": 0.2,
}
# All noise is the floor's.
_FLOOR = {"odom_alpha1": 0.0, "odom_alpha2": 0.0, "odom_alpha3": 0.0, "odom_alpha4": 0.0}


def models(
    title: str,
    drives: Sequence[tuple[ScanLog, FloatArray]],
    grid: MapFile,
    settings: LocalizerSettings,
    error: LaserError,
    process: Noise,
) -> None:
    """Print a row per model: errors against the truth, and the error normalised by the covariance that is told."""
    table = Table(
        title,
        "models",
        "position [m]     ",
        "heading [deg]    ",
        "normalised error^2 (right: 3)",
        "sure [%]",
        page=False,
    )
    raw = list(drives)
    corrected = [(without_mean_error(log, error), truth) for log, truth in raw]
    for name, logs, changes, noise in (
        ("naive", raw, _NAIVE, NO_PROCESS_NOISE),
        ("naive, mean error taken out", corrected, _NAIVE, NO_PROCESS_NOISE),
        ("as shipped, mean error left in", raw, {}, NO_PROCESS_NOISE),
        ("as shipped", corrected, {}, NO_PROCESS_NOISE),
        ("motion noise of the critic", corrected, _FLOOR, process),
    ):
        results = [
            _followed(log, truth, grid, {**settings, **changes}, error, noise, seed)
            for seed, (log, truth) in enumerate(logs, start=1)
        ]
        columns = np.array(results).T
        cells = [f"{np.median(column):.3f} ({column.max():.3f})" for column in columns[:2]]
        table.row(name, *cells, f"{np.median(columns[2]):.2f} ({columns[2].max():.2f})", f"{columns[3].min():.0f}")


def without_mean_error(log: ScanLog, error: LaserError) -> ScanLog:
    """Take equation (4)'s mean error out of the readings."""
    return replace(log, ranges=error.range(log.ranges.astype(np.float64)).astype(np.float32))


def _followed(
    log: ScanLog,
    truth: FloatArray,
    grid: MapFile,
    settings: LocalizerSettings,
    error: LaserError,
    process: Noise,
    seed: int,
) -> tuple[float, float, float, float]:
    """Return errors of position [m] and heading [deg], the mean normalised error squared while sure, its share [%]."""
    localizer = make_localizer(settings, error, grid, seed, process)
    start = compose(truth[0], np.random.default_rng(seed).normal(0, START_SD))
    localizer.set_pose(start.tolist(), np.diag(START_SD**2))
    found = localize_scans(localizer, log)
    off = found.poses - truth
    off[:, 2] = wrap(off[:, 2])
    off, covariances = off[_SETTLED:], found.covariances[_SETTLED:]
    sure = found.knowledge[_SETTLED:] == _SURE
    normalised = np.einsum("ni,ni->n", off, np.linalg.solve(covariances, off[..., None])[..., 0])
    position = np.sqrt(np.mean(np.sum(off[:, :2] ** 2, axis=1)))
    heading = np.degrees(np.sqrt(np.mean(off[:, 2] ** 2)))
    return float(position), float(heading), float(np.mean(normalised[sure])), float(100 * np.mean(sure))
