# SPDX-License-Identifier: BSD-3-Clause
"""What base_node's odometry says of its own error, against drives with the noise that the simulator makes."""

import numpy as np
import pytest

from kurumaisu.bench.accuracy.odometry import NOISES, bounds, ends, main, measured, nees, white

DRIVES = 400


@pytest.mark.parametrize("rates", NOISES)
def test_measured_noise_gives_the_covariance_of_the_simulators_drives(rates):
    truth = ends(rates, DRIVES)
    pose, covariance = measured(rates)
    low, high = bounds(DRIVES)
    mean = nees(truth, pose, covariance).mean()
    assert low < mean < high, f"{mean:.2f}, not {low:.2f} to {high:.2f}"
    sampled = np.cov(truth.T)
    scale = np.sqrt(np.outer(np.diag(sampled), np.diag(sampled)))
    assert np.abs((covariance - sampled) / scale).max() < 0.25


@pytest.mark.parametrize("rates", NOISES)
def test_noise_taken_for_white_is_told_from_the_truth(rates):
    assert nees(ends(rates, DRIVES), *white(rates)).mean() > 1.5 * bounds(DRIVES)[1]


def test_the_bench_prints_a_table(capsys):
    assert main(["--drives", "60"]) == 0
    assert "0.01 0.02 0.3 0" in capsys.readouterr().out
