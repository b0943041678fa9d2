# SPDX-License-Identifier: BSD-3-Clause
"""A coarse grid of readings, found though their messages round to a millimetre."""

import numpy as np
import pytest

from kurumaisu.critic.ranges.scans.valid_readings import unrounded

RANGES = np.random.default_rng(1).uniform(0.3, 3.8, (20, 300))
RANGES[(RANGES > 1.5) & (RANGES < 2.4)] = 0.7  # no wall is there
RANGES[0, 0] = np.nan


@pytest.mark.parametrize(("step", "shift"), [(0.009973, 0.5), (0.006, 0.0), (0.0123, 0.3)])
def test_what_a_message_rounds_is_where_a_coarse_grid_has_it(step, shift):
    read = step * (np.floor(RANGES / step) + shift)
    np.testing.assert_allclose(unrounded(np.round(read, 3)), read, atol=1e-4)


@pytest.mark.parametrize("fine", [1e-3, 2e-3])
def test_readings_without_such_a_grid_are_left_as_they_are(fine):
    read = np.round(fine * np.rint(RANGES / fine), 3)
    assert unrounded(read) is read


def test_coarse_values_that_no_one_grid_explains_are_left_as_they_are():
    read = np.round(0.01 * np.rint(RANGES / 0.01), 3)
    read[RANGES > 2.4] += 0.003
    assert unrounded(read) is read
