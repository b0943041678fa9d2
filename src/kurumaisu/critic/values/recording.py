# SPDX-License-Identifier: BSD-3-Clause
"""A recording in memory: what was measured, whatever file it came from. SI units, radians, seconds."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from kurumaisu.params import Robot
from kurumaisu.types import BoolArray, FloatArray, IntArray


@dataclass(frozen=True)
class Series:
    """Samples over time: t (n,) strictly increasing [s]; values (n, m), one named column each."""

    t: FloatArray
    values: FloatArray
    columns: tuple[str, ...]

    @classmethod
    def of_table(cls, table: FloatArray, *columns: str) -> Series:
        """Return the series of a table (n, 1 + m) whose first column is t."""
        return cls(table[:, 0], table[:, 1:], columns)

    def rows(self, keep: BoolArray | IntArray) -> Series:
        """Return some of its samples."""
        return Series(self.t[keep], self.values[keep], self.columns)

    def column(self, name: str) -> FloatArray:
        """Return one column, (n,)."""
        return self.values[:, self.columns.index(name)]


@dataclass(frozen=True)
class Fan:
    """The fan as the scans themselves state it [rad, s]; known in a bag, not in CSV."""

    angle_min: float
    angle_increment: float
    beams: int
    time_increment: float
    scan_time: float


# Parts of a run that have a type of their own; any other quantity is a covariate.
PARTS = ("command", "voltage", "pose", "odom", "imu", "scan")
# An input is held, but not for longer than this beyond its table [s].
LONGEST_HOLD = 60.0


@dataclass(frozen=True)
class Run:
    """One drive. Any part may be missing.

    command: v, w (held); voltage: v_f, v_s (held) and, where known, v, w that they stand for;
    pose: x, y, theta in the map frame, theta unwrapped; odom: x, y, theta, v, w, theta unwrapped;
    imu: w, the robot's yaw rate by a gyro, without its bias; before that is known, wx, wy, wz about the sensor's axes,
    and ax, ay, az;
    scan: r0, r1, ... at the time of the first beam, nan = no valid reading, inf = no return;
    covariates: one Series of one column per name, finite values;
    queries: (q, 2) of t0, t1 in a test run; source of the pose: 'measured' or how it was estimated;
    courses: whether the headings of the pose are directions of its way;
    aside: spans of time [s] that tell nothing of how the chair drives: it was held, or its wheels began to count anew.
    """

    name: str
    command: Series | None = None
    voltage: Series | None = None
    pose: Series | None = None
    odom: Series | None = None
    scan: Series | None = None
    covariates: dict[str, Series] = field(default_factory=dict)
    queries: FloatArray | None = None
    pose_source: str = "measured"
    fan: Fan | None = None
    aside: tuple[tuple[float, float], ...] = ()
    imu: Series | None = None
    courses: bool = False

    def parts(self, *names: str) -> dict[str, Series]:
        """Return those of some parts that it has, by name; of all, where none is named."""
        return {name: part for name in names or PARTS if (part := getattr(self, name)) is not None}


def run_of_parts(name: str, parts: Mapping[str, Any], covariates: dict[str, Series]) -> Run:
    """Return the run that its tables make; those that are not among parts are missing."""
    return Run(name, covariates=covariates, **{part: parts[part] for part in PARTS if part in parts})


@dataclass(frozen=True)
class LaserMount:
    """Nominal mounting base_from_laser [m, rad], the fan [rad], and the time between its beams [s], if known."""

    x: float
    y: float
    yaw: float
    angle_min: float
    angle_increment: float
    beams: int
    time_increment: float | None = None

    @property
    def known(self) -> dict[str, float | int]:
        """Return what is known of it, as meta.yaml has it."""
        return {name: value for name, value in vars(self).items() if value is not None}


@dataclass(frozen=True)
class Recording:
    """Runs of one robot, split into those to fit and those to judge by.

    train, test: names of runs; test is empty when gain is measured by leaving one run out.
    truth: sd of the reference pose, position [m] and heading [rad]; None = the critic estimates it.
    problems: all that the reader found wrong and mended or dropped, in words;
    invalid: those of the problems that forbid a verdict on causes; robot: what is said of it, None where nothing is;
    turning: whether only an imu says how the robot turned; placed: whether the places of the poses say anything.
    """

    name: str
    runs: tuple[Run, ...]
    train: tuple[str, ...]
    test: tuple[str, ...] = ()
    model: Path | None = None
    world: Path | None = None
    laser: LaserMount | None = None
    truth: tuple[float, float] | None = None
    problems: tuple[str, ...] = ()
    invalid: tuple[str, ...] = ()
    robot: Robot | None = None
    turning: bool = False
    placed: bool = True
