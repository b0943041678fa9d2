# SPDX-License-Identifier: BSD-3-Clause
"""Where all readings jump while the chair stands, a curve over the time jumps; what wanders has it do so nowhere."""

import numpy as np
import pytest

from kurumaisu.bench.hidden.laser.forms import ar1
from kurumaisu.critic.ranges.signals.coefficient_blocks import knots_parted, level_jumps

STAND = np.repeat([-1, 0, 1, 2], 20)


def scans(level):
    """Readings of scans (k, b) [m] off by these levels (k,) [m], what beams keep, and noise; some are lost."""
    rng = np.random.default_rng(3)
    off = level[:, np.newaxis] + 0.02 * rng.standard_normal(200) + 0.003 * rng.standard_normal((len(level), 200))
    off[rng.random(off.shape) < 0.1] = np.nan
    off[:, 7] = np.nan
    return off


@pytest.mark.parametrize(("size", "found"), [(0.002, [47]), (-0.002, [47]), (0.0002, [])])
def test_a_stand_is_split_where_all_readings_jump(size, found):
    level = np.where(np.arange(80) > 47, size, 0.0)  # stays so, which is no jump of the next stand
    assert level_jumps(scans(level), STAND).tolist() == found


def test_one_scan_may_be_off_alone_and_stands_that_differ_are_no_jump():
    level = 0.01 * STAND.astype(float)
    level[20] += 0.004
    assert level_jumps(scans(level), STAND).tolist() == [20]


def test_what_wanders_in_all_stands_jumps_in_none():
    rng = np.random.default_rng(5)
    level = ar1(80, 0.8, rng) * 0.001
    assert not len(level_jumps(scans(level), STAND))


def test_what_is_not_known_jumps_nowhere():
    assert not len(level_jumps(np.full((80, 5), np.nan), STAND))
    assert not len(level_jumps(np.zeros((80, 5)), np.full(80, -1)))


def test_a_curve_is_as_free_across_a_jump_as_from_stand_to_stand():
    at = np.arange(80) * 0.1 + 100.0 * np.arange(4).repeat(20)
    knots = np.array([at[one == STAND].mean() for one in (-1, 0, 1, 2)])
    new, places = knots_parted(knots, at, STAND, np.array([47]))
    np.testing.assert_allclose(new, [*knots[:2], at[47], at[48], knots[3]])
    assert np.diff(places)[2] == pytest.approx(np.median(np.diff(knots)))
    np.testing.assert_allclose(np.diff(places)[[0, 1, 3]], np.diff(new)[[0, 1, 3]])
    heading = np.array([0.3, 1.0, 2.0, 3.0])[np.arange(4).repeat(20)]
    np.testing.assert_array_equal(
        knots_parted(np.unique(heading), heading, STAND, np.array([47]))[0], np.unique(heading)
    )
