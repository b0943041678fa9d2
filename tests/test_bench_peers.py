# SPDX-License-Identifier: BSD-3-Clause
"""What stands beside the critic does what it should: UMBmark's formulas, and least squares, on known wheels."""

import numpy as np
import pytest

from kurumaisu.bench.critic import least_squares, peers
from kurumaisu.bench.critic.squares import NOMINAL, Wheels, closes, drive, umbmark

ROBOTS = [Wheels(1.0, 1.0, 1.03), Wheels(0.997, 1.003, 1.0), Wheels(1.002, 0.998, 0.98)]


def ends(robot, side):
    return drive(robot, NOMINAL, side).poses[-1:, :2]


@pytest.mark.parametrize("robot", ROBOTS)
def test_umbmarks_formulas_find_the_wheels(robot):
    found = umbmark(ends(robot, 1.0), ends(robot, -1.0))
    assert found.track == pytest.approx(robot.track, abs=0.004)
    assert found.right / found.left == pytest.approx(robot.right / robot.left, abs=0.0007)
    assert closes(robot, found) < 0.2 * closes(robot, NOMINAL)


def test_a_square_of_wheels_as_the_software_has_them_closes():
    assert closes(NOMINAL, NOMINAL) < 1e-6
    for robot in ROBOTS:
        assert closes(robot, robot) < 1e-6


def test_least_squares_find_gains_lags_and_delay():
    rng = np.random.default_rng(3)
    held = rng.uniform(-0.5, 0.5, (40, 2))
    v, w = np.repeat(held, 150, axis=0).T
    truth = np.array([1.05, 0.92, 0.02, 0.25, 0.15, 0.08])
    times = np.arange(1.0, 59.0, 0.1)
    nothing = least_squares.Inputs(0.0, 0.01, v, w, times, np.zeros((len(times), 3)))
    poses = least_squares.path(nothing, truth)
    found = least_squares.fitted([least_squares.Inputs(0.0, 0.01, v, w, times, poses)])
    assert np.abs(found - truth).max() < 0.01


def test_what_is_not_there_is_said(capsys, tmp_path):
    assert peers.main(["--recordings", str(tmp_path), "--draws", "0"]) == 0
    told = capsys.readouterr().out
    assert all(f"{name}: skipped" in told for name in ("create_r5", "create_r3", "lego_camera"))
