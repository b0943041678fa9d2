# SPDX-License-Identifier: BSD-3-Clause
"""One table of what makes sense, for C++ and Python: numbers, quaternions, covariances, frames."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from kurumaisu import _core
from kurumaisu.errors import Error
from kurumaisu.plausible import require, yaw_of

QUANTITIES = {
    "position": 1e7,
    "angle": 1e4,
    "variance": 1e6,
    "speed": 100.0,
    "yaw rate": 100.0,
    "voltage": 30.0,
    "stamp": 4e9,
    "range": 1000.0,
}


@pytest.mark.parametrize(("quantity", "most"), QUANTITIES.items())
def test_a_number_is_in_its_range_or_refused_with_both(quantity, most):
    assert require(quantity, "key", most) == most
    for value in (1.01 * most, 1e300, math.inf, -math.inf, math.nan):
        with pytest.raises(Error, match=f"key: must be a number from .* to .*: {value:g}".replace("+", r"\+")):
            require(quantity, "key", value)


def test_variances_stamps_and_ranges_are_not_negative():
    for quantity in ("variance", "stamp", "range"):
        assert require(quantity, "key", 0.0) == 0.0
        with pytest.raises(Error, match="-1e-09"):
            require(quantity, "key", -1e-9)


def test_an_unknown_quantity_is_a_mistake():
    with pytest.raises(Error, match="there is no quantity length"):
        require("length", "key", 1.0)


@given(
    yaw=st.floats(-3.1, 3.1),
    pitch=st.floats(-0.7, 0.7),
    roll=st.floats(-0.7, 0.7),
    length=st.floats(0.01, 100.0),
    sign=st.sampled_from([-1, 1]),
)
def test_the_yaw_of_a_quaternion_of_any_length_is_that_of_its_rotation(yaw, pitch, roll, length, sign):
    q = length * sign * Rotation.from_euler("ZYX", [yaw, pitch, roll]).as_quat()
    assert yaw_of(*q.tolist()) == pytest.approx(yaw, abs=1e-9)


def test_a_person_types_ones():
    assert yaw_of(0, 0, 1, 1) == pytest.approx(math.pi / 2)
    assert yaw_of(0, 0, -2, 2) == pytest.approx(-math.pi / 2)


@pytest.mark.parametrize(
    "q",
    [
        (0, 0, 0, 0),
        (0, 0, 0, math.nan),
        (0, math.inf, 0, 1),
        (0, 0, 1e300, 0),
        (1, 0, 0, 0),  # upside down
        (0, math.sqrt(0.5), 0, math.sqrt(0.5)),  # looks down
    ],
)
def test_a_quaternion_without_a_yaw_is_refused(q):
    with pytest.raises(Error, match=r"orientation: must be a quaternion .*: x .*, y .*, z .*, w "):
        yaw_of(*q)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({(1, 1): -1.0}, "variance of y: must be a number from 0 to .*: -1"),
        ({(0, 0): 1e300}, "variance of x: must be"),
        ({(2, 2): math.nan}, "variance of yaw: must be"),
        ({(0, 1): 1.0, (1, 0): 1.0}, "covariance of x, y, yaw: must be positive semi-definite"),
        ({(0, 1): 0.001}, "covariance of x and y: must be the same number twice: 0.001 and 0|0 and 0.001"),
        ({(0, 2): math.nan, (2, 0): math.nan}, "covariance of x and yaw: must be the same number twice"),
    ],
)
def test_a_matrix_that_is_no_covariance_is_refused(change, words):
    matrix = 0.01 * np.eye(3)
    _core.require_covariance(matrix)
    for place, value in change.items():
        matrix[place] = value
    with pytest.raises(ValueError, match=words):
        _core.require_covariance(matrix)


@given(st.lists(st.floats(-10, 10), min_size=9, max_size=9))
def test_whatever_is_a_covariance_is_taken(values):
    root = np.reshape(values, (3, 3))
    covariance = root @ root.T
    _core.require_covariance(0.5 * (covariance + covariance.T))


def test_nothing_known_and_all_known_are_covariances():
    _core.require_covariance(np.zeros((3, 3)))
    _core.require_covariance(1e6 * np.eye(3))


def test_a_frame_loses_its_slash():
    assert [_core.frame_of(name) for name in ("/map", "map", "//robot_0/laser", "robot_0/laser", "/", "")] == [
        *("map", "map", "robot_0/laser", "robot_0/laser"),
        *("", ""),
    ]
