# SPDX-License-Identifier: BSD-3-Clause
"""Types of the C++ module (src/slam/bindings.cpp); its docstrings are there."""

from collections.abc import Mapping, Sequence
from typing import TypedDict

import numpy as np
from numpy.typing import NDArray

from kurumaisu._core import LaserError
from kurumaisu.types import FloatArray

Floats = NDArray[np.float32] | FloatArray

class Fan:
    def __init__(
        self,
        *,
        angle_min: float,
        angle_increment: float,
        time_increment: float,
        range_max: float,
        base_from_laser: Sequence[float],
    ) -> None: ...
    @property
    def angle_min(self) -> float: ...
    @property
    def angle_increment(self) -> float: ...
    @property
    def time_increment(self) -> float: ...
    @property
    def range_max(self) -> float: ...
    @property
    def base_from_laser(self) -> list[float]: ...

def setting_names() -> list[str]: ...
def check_settings(settings: Mapping[str, float]) -> None: ...

class Mapper:
    def __init__(self, settings: Mapping[str, float], seed: int) -> None: ...
    def add(
        self, stamp: float, ranges: Floats, fan: Fan, start: Sequence[float], end: Sequence[float]
    ) -> tuple[list[float], FloatArray, bool]: ...
    def trajectory(self) -> FloatArray: ...
    def grid(self) -> tuple[NDArray[np.int8], float, list[float]]: ...
    def nodes(self) -> FloatArray: ...
    def write_simplemap(self, path: str) -> None: ...
    def resume(
        self, path: str, settings: Mapping[str, float], pose: Sequence[float], deviations: Sequence[float]
    ) -> None: ...

def write_rawlog(
    path: str,
    times: FloatArray,
    odom: FloatArray,
    odom_end: FloatArray,
    ranges: NDArray[np.float32],
    fan: Fan,
) -> None: ...
def read_rawlog(path: str) -> tuple[FloatArray, FloatArray, NDArray[np.float32], Fan]: ...

class Estimate(TypedDict):
    pose: list[float]
    covariance: FloatArray
    knowledge: str
    fit: float
    fit_usual: float
    particles: int
    updated: bool

def localizer_setting_names() -> list[str]: ...
def check_localizer_settings(settings: Mapping[str, float]) -> None: ...

class Localizer:
    def __init__(
        self,
        *,
        settings: Mapping[str, float],
        laser: LaserError,
        process: Sequence[float],
        seed: int,
        cells: NDArray[np.int8],
        resolution: float,
        origin: Sequence[float],
    ) -> None: ...
    def set_pose(self, pose: Sequence[float], covariance: FloatArray) -> None: ...
    def forget(self) -> None: ...
    def update_once(self) -> None: ...
    def add(
        self,
        stamp: float,
        ranges: Floats,
        fan: Fan,
        start: Sequence[float],
        end: Sequence[float],
        covariance: FloatArray | None = None,
    ) -> Estimate: ...
    def particles(self) -> FloatArray: ...
