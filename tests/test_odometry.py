# SPDX-License-Identifier: BSD-3-Clause
"""What base_node's odometry says of its own error, against drives with the noise that the simulator makes."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

from kurumaisu._core import dead_reckoning
from kurumaisu.params import EffectSetting, load_model, shipped
from kurumaisu.sim.plant import Plant, path

DRIVES, STEP, TICK = 400, 0.01, 0.02  # [s] of the simulator and of base_node
# v [m/s], w [rad/s], seconds: a wait, in which the simulator's noise comes to its usual size; then straight, a bend,
# a stop, a turn on the spot, backwards in a bend
PHASES = ((0.0, 0.0, 20.0), (0.6, 0.0, 8.0), (0.5, 0.4, 10.0), (0.0, 0.0, 2.0), (0.0, 0.7, 5.0), (-0.3, -0.3, 8.0))
NO_GROWTH = (0.0,) * 5
# {sd_v, sd_w, tau, growth}: the catalogue's, a slow one, a quick one that grows with the rates
NOISES = ((0.01, 0.02, 0.3, 0.0), (0.03, 0.01, 6.0, 0.0), (0.02, 0.03, 0.05, 2.0))


def held(step):
    """Return v, w (n,) of PHASES in steps of so many seconds."""
    counts = [round(seconds / step) for _, _, seconds in PHASES]
    return (np.repeat([phase[i] for phase in PHASES], counts) for i in (0, 1))


def ends(rates):
    """Return where the simulator's chair is after each of many drives, (DRIVES, 3)."""
    model = load_model(shipped("launch/md100.yaml"))
    names = ("sd_v", "sd_w", "tau", "growth")
    noise = EffectSetting("base.process_noise", dict(zip(names, rates, strict=True)))
    noisy = replace(model, effects=(noise,))
    v, w = held(STEP)
    return np.array(
        [path(Plant(noisy, STEP, np.random.default_rng(n)).from_rates(v, w), np.zeros(3))[-1] for n in range(DRIVES)]
    )


def nees(truth, pose, covariance):
    """Return the normalised squared error of the odometry in each drive, (DRIVES,)."""
    error = truth - pose
    return np.einsum("ni,ij,nj->n", error, np.linalg.inv(covariance), error)


def bounds(share=0.998):
    """Return between which numbers the mean of DRIVES squared errors of three lies, if the covariance is right."""
    return tuple(chi2.ppf([(1 - share) / 2, (1 + share) / 2], 3 * DRIVES) / DRIVES)


@pytest.mark.parametrize("rates", NOISES)
def test_measured_noise_gives_the_covariance_of_the_simulators_drives(rates):
    truth = ends(rates)
    poses, covariances = dead_reckoning(*held(TICK), TICK, NO_GROWTH, rates)
    low, high = bounds()
    mean = nees(truth, poses[-1], covariances[-1]).mean()
    assert low < mean < high, f"{mean:.2f}, not {low:.2f} to {high:.2f}"
    sampled = np.cov(truth.T)
    scale = np.sqrt(np.outer(np.diag(sampled), np.diag(sampled)))
    assert np.abs((covariances[-1] - sampled) / scale).max() < 0.25


def naive(rates):
    """Return the covariance if each tick's noise were independent of the one before: it forgets tau."""
    sd_v, sd_w, _, growth = rates
    return dead_reckoning(*held(TICK), TICK, NO_GROWTH, (sd_v, sd_w, TICK / 2, growth))


@pytest.mark.parametrize("rates", NOISES)
def test_noise_taken_for_white_is_told_from_the_truth(rates):
    poses, covariances = naive(rates)
    assert nees(ends(rates), poses[-1], covariances[-1]).mean() > 1.5 * bounds()[1]
