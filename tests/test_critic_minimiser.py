# SPDX-License-Identifier: BSD-3-Clause
"""The search for the noise: where scipy's ends, without the trials that lead back to where they began."""

import numpy as np
import pytest
from scipy.optimize import minimize

from kurumaisu.critic.noise.base_noise import minimise

OPTIONS = {"eps": 0.01, "ftol": 3e-6, "maxiter": 60}


class Counted:
    """A cost that remembers how often it was asked for."""

    def __init__(self, cost):
        self.cost, self.count = cost, 0

    def __call__(self, at):
        self.count += 1
        return float(self.cost(at))


def likelihood(at):
    """Return minus the log likelihood of thousands of numbers, by logs of two deviations: steep, and bent."""
    return 4000 * (2 * at[0] + np.exp(-2 * at[0]) + at[1] + np.exp(-2 * (at[1] - 0.4 * at[0]))) - 80000


@pytest.mark.parametrize("begin", [[2.0, 1.0], [-1.0, 0.3], [0.5, -1.5]])
def test_it_ends_where_the_differences_lead(begin):
    bounds = np.array([[-3.0, 3.0], [-3.0, 3.0]])
    ours, theirs = Counted(likelihood), Counted(likelihood)
    where, least = minimise(ours, np.array(begin), bounds)
    wanted = minimize(theirs, np.array(begin), method="L-BFGS-B", bounds=bounds, options=OPTIONS)
    np.testing.assert_allclose(where, wanted.x, atol=1e-5)
    assert least == pytest.approx(wanted.fun, abs=1e-2)
    assert ours.count <= theirs.count


def test_it_keeps_within_its_bounds():
    where, _ = minimise(likelihood, np.array([2.0, 1.0]), np.array([[0.7, 3.0], [-3.0, -0.2]]))
    np.testing.assert_allclose(where, [0.7, -0.2])


def valley(seed):
    """Return a narrow, bent valley of five numbers, as deep as a likelihood of thousands, and a place in it."""
    rng = np.random.default_rng(seed)
    root = rng.standard_normal((5, 5))
    ways = root @ root.T + 0.3 * np.eye(5)
    return (lambda at: 4000 * (np.sum(np.cosh(ways @ at / 3)) - 25)), rng.uniform(-1, 1, 5)


@pytest.mark.parametrize("seed", [8, 9, 11])
def test_trials_that_lead_back_are_left_out_and_nothing_else(seed):
    """In the second, it has to begin anew where it is stuck."""
    cost, begin = valley(seed)
    bounds = np.array([[-3.0, 3.0]] * 5)
    ours, theirs = Counted(cost), Counted(cost)
    where, least = minimise(ours, begin, bounds)
    wanted = minimize(theirs, begin, method="L-BFGS-B", bounds=bounds, options=OPTIONS)
    assert least == cost(where)
    assert least <= wanted.fun + 1e-6
    assert ours.count < 0.8 * theirs.count
