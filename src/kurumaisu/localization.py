# SPDX-License-Identifier: BSD-3-Clause
"""Localisation of a whole log in a known map."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from kurumaisu import _slam, settings
from kurumaisu._core import LaserError
from kurumaisu._slam import Localizer as Localizer
from kurumaisu.errors import Error
from kurumaisu.map_file import MapFile
from kurumaisu.slam import ScanLog
from kurumaisu.types import FloatArray

LocalizerSettings = dict[str, float]
NO_PROCESS_NOISE = (0.0, 0.0, 1.0, 0.0)  # sd_v [m/s], sd_w [rad/s], tau [s], growth


@dataclass(frozen=True)
class Localization:
    """What localisation says at every scan.

    poses: map_from_base (n, 3); covariances: (n, 3, 3); knowledge: "tracking", "ambiguous" or "lost"; fit: share of
    readings that the map explains, lately; particles: (n,), 0 where the filter did not run.
    """

    poses: FloatArray
    covariances: FloatArray
    knowledge: NDArray[np.str_]
    fit: FloatArray
    particles: NDArray[np.int64]


def load_localizer_settings(path: Path) -> LocalizerSettings:
    """Read the localiser's settings from a settings file of localization_node; the node's own keys are the node's.

    Raise Error naming file and key for anything missing or senseless.
    """
    top = settings.load(path)
    values = {name: top.number(name) for name in _slam.localizer_setting_names()}
    try:
        _slam.check_localizer_settings(values)
    except ValueError as error:
        raise Error(f"{path}: {error}") from error
    return values


def make_localizer(
    values: LocalizerSettings,
    laser: LaserError,
    grid: MapFile,
    seed: int,
    process: tuple[float, float, float, float] = NO_PROCESS_NOISE,
) -> Localizer:
    """Return a localiser that does not know yet where it is. Raise Error for what makes no sense."""
    try:
        return Localizer(
            settings=values,
            laser=laser,
            process=process,
            seed=seed,
            cells=grid.cells,
            resolution=grid.resolution,
            origin=grid.origin,
        )
    except ValueError as problem:
        raise Error(f"localizer: {problem}") from problem


def localize_scans(localizer: Localizer, log: ScanLog) -> Localization:
    """Localise a log, whose readings have their mean error taken out. Raise Error naming the scan that is senseless."""
    said = []
    for i in range(len(log.times)):
        try:
            said.append(
                localizer.add(log.times[i], log.ranges[i], log.fan, log.odom[i].tolist(), log.odom_end[i].tolist())
            )
        except ValueError as error:
            raise Error(f"{log.name}: scan {i}: {error}") from error
    return Localization(
        poses=np.array([each["pose"] for each in said]),
        covariances=np.array([each["covariance"] for each in said]),
        knowledge=np.array([each["knowledge"] for each in said]),
        fit=np.array([each["fit"] for each in said]),
        particles=np.array([each["particles"] for each in said]),
    )
