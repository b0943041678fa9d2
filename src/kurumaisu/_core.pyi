# SPDX-License-Identifier: BSD-3-Clause
"""Types of the C++ module (src/bindings.cpp); its docstrings are there."""

from collections.abc import Sequence
from typing import overload

import numpy as np
from numpy.typing import NDArray

from kurumaisu.types import BoolArray, ByteArray, FloatArray, IntArray

class Branch:
    def __init__(self, slope: float, intercept: float) -> None: ...
    @property
    def slope(self) -> float: ...
    @property
    def intercept(self) -> float: ...

class AxisLaw:
    def __init__(self, positive: Branch, negative: Branch) -> None: ...
    @property
    def positive(self) -> Branch: ...
    @property
    def negative(self) -> Branch: ...
    @overload
    def volts(self, rate: float) -> float: ...
    @overload
    def volts(self, rate: FloatArray) -> FloatArray: ...
    @overload
    def gain(self, rate: float) -> float: ...
    @overload
    def gain(self, rate: FloatArray) -> FloatArray: ...
    @overload
    def ambiguous(self, volts: float) -> bool: ...
    @overload
    def ambiguous(self, volts: FloatArray) -> BoolArray: ...

class AxisInverse:
    def __init__(self, law: AxisLaw) -> None: ...
    def rates(self, volts: FloatArray, sign: FloatArray) -> FloatArray: ...
    @property
    def ambiguous_samples(self) -> int: ...

def integrate(v: FloatArray, w: FloatArray, dt: FloatArray, start: Sequence[float] = ...) -> FloatArray: ...

class LaserError:
    def __init__(
        self,
        *,
        scale: float,
        datum_offset: float,
        sigma: Sequence[float],
        resolution: float,
        range_min: float,
        range_max: float,
    ) -> None: ...
    def mean(self, r: FloatArray) -> FloatArray: ...
    def range(self, reading: FloatArray) -> FloatArray: ...
    def deviation(self, r: FloatArray) -> FloatArray: ...
    def reading(self, r: FloatArray, standard_normal: FloatArray) -> FloatArray: ...

def whiten(
    poses: FloatArray,
    times: FloatArray,
    columns: FloatArray,
    *,
    position_sd: float,
    heading_sd: float,
    process_sd: Sequence[float],
    process_tau: float,
) -> tuple[FloatArray, FloatArray]: ...

class Scene:
    def __init__(self, segments: FloatArray) -> None: ...
    def __len__(self) -> int: ...
    def cast(self, poses: FloatArray, bearings: FloatArray, max_range: float) -> FloatArray: ...

class Panels:
    def __init__(self, walls: FloatArray, colors: ByteArray, prisms: IntArray, bodies: IntArray) -> None: ...
    def __len__(self) -> int: ...

class Camera:
    def __init__(
        self,
        *,
        width: int,
        height: int,
        fov_h: float,
        fov_v: float,
        near: float,
        far: float,
        tilt: float,
    ) -> None: ...
    def render(
        self,
        panels: Panels,
        poses: FloatArray,
        hidden: BoolArray,
        eye: FloatArray,
        ground: ByteArray,
        sky: ByteArray,
    ) -> tuple[ByteArray, NDArray[np.float32]]: ...
