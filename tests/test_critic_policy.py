# SPDX-License-Identifier: BSD-3-Clause
"""What is believed of two amplitudes of one cause: usual proportions, against integrals over the whole plane."""

import numpy as np
import pytest
from scipy.integrate import trapezoid

from kurumaisu.bench.hidden import Ask, make
from kurumaisu.bench.hidden.base import recordings
from kurumaisu.bench.hidden.base.catalogue import BASE
from kurumaisu.bench.hidden.generator.noise import USUAL
from kurumaisu.critic.base.drive import prepare
from kurumaisu.critic.engine.evidence import Problem
from kurumaisu.critic.noise.base_noise import Noise
from kurumaisu.critic.search import search
from kurumaisu.critic.values import policy
from kurumaisu.params import load_model, shipped

GRAM = np.array([[900.0, 300.0], [300.0, 2500.0]])  # of columns per usual size
NOISE = Noise(USUAL.position_sd, USUAL.heading_sd, *USUAL.colours[0].sd, USUAL.colours[0].tau)


def by_quadrature(sizes):
    """Return what in_proportion does, by the integrals over size and direction with either prior [nat]."""
    root = np.linalg.cholesky(GRAM).T
    fitted = root @ sizes
    angle = np.linspace(1e-4, np.pi - 1e-4, 4001)  # the second is positive
    log = np.log(np.abs(np.tan(angle)))
    usual = np.exp(-0.5 * (log / np.log(2)) ** 2) / (np.sqrt(2 * np.pi) * np.log(2)) / (np.sin(angle) * np.cos(angle))
    density = 0.9 * np.where(angle < np.pi / 2, usual, 0.0) + 0.1 / np.pi
    ways = root @ np.stack([np.cos(angle), np.sin(angle)])
    ways = ways / np.linalg.norm(ways, axis=0)
    z = np.geomspace(3.0, 200.0, 2001)
    prior_of_z = np.where(z < 50, 0.9 / np.log(50 / 3), 0.1 / np.log(100)) / z
    squares = z[:, None] ** 2 - 2 * z[:, None] * (fitted @ ways) + fitted @ fitted
    mean = trapezoid(np.exp(-0.5 * squares) * density, angle, axis=1)
    return float(np.log(trapezoid(prior_of_z * mean, z))) + float(policy.occam_plane(np.linalg.norm(fitted)))


@pytest.mark.parametrize("sizes", [(0.4, 0.4), (0.6, 0.3), (0.5, 0.05), (0.02, 0.5), (-0.2, 0.4)])
def test_the_proportion_of_two_amplitudes_against_quadrature(sizes):
    told = policy.in_proportion(np.array(sizes), np.linalg.inv(GRAM), GRAM)
    assert told == pytest.approx(by_quadrature(np.array(sizes)), abs=0.25)


def test_what_comes_together_is_cheaper_in_its_usual_proportion_only():
    spread = np.linalg.inv(GRAM)
    usual, tenth, against = (
        policy.in_proportion(np.array(sizes), spread, GRAM) for sizes in ((0.4, 0.4), (0.4, 0.04), (-0.4, 0.4))
    )
    assert usual > 1.0 > -1.0 > tenth
    assert against < -1.0


def problem_of(runs, noise, ids):
    model = load_model(shipped("launch/md100.yaml"))
    return Problem([prepare(run, model) for run in runs], model, noise, ids=ids)


def cost_of(name, sizes):
    """Return what a hidden effect costs when it is fitted, and the norm of its signal."""
    drives = recordings.draw_drives("rich", USUAL, np.random.default_rng(5), seconds=40.0, rate=10.0)
    runs = recordings.recording("one", drives, [BASE[name].fault(sizes, "plain")]).runs
    problem = problem_of(runs, NOISE, frozenset([name]))
    fit = problem.fit([name], {})
    signal = np.linalg.norm(problem.residual((), np.empty(0)) - problem.residual(fit.terms, fit.values))
    return fit.log_likelihood - fit.score, float(signal)


def test_what_lags_but_is_no_slower_is_hardly_a_load():
    load, z = cost_of("base.payload", {"size": 0.05, "ratio": 2.0})
    lag, weak = cost_of("base.payload", {"size": 0.001, "ratio": 100.0})
    assert weak > 0.5 * z
    assert load < float(policy.occam_plane(np.array(z))) - 1.0
    assert lag > float(policy.occam_plane(np.array(weak)))


@pytest.mark.parametrize(
    ("name", "sizes"),
    [("base.slope", {"size": 0.03, "bearing": 2.5}), ("base.accel_limit", {"size": 0.3, "ratio": 1.0})],
)
def test_what_has_a_direction_or_two_peculiarities_has_no_proportion(name, sizes):
    """A slope climbs in any direction, and one axis may be ramped without the other.

    Either or both: three ways. Both are fitted in their other form here, which three in ten have beforehand.
    """
    cost, z = cost_of(name, sizes)
    ways = (1 if name == "base.slope" else 3) / 0.3
    assert cost == pytest.approx(float(policy.occam_plane(np.array(z))) + np.log(ways), abs=0.02)


def test_one_effect_that_does_what_two_do_is_fitted_though_lines_tell_little_of_it():
    """A load that delays by 7 ms: beside a delay, which the search begins from, other pairs look better by lines."""
    case = make(Ask("single", ("base.payload",), form="other"), 30488)
    quiet = Noise(0.0012, 0.00106, 0.00405, 0.00337, 0.0512, 0.408)
    more = ("payload", "delay", "curvature_v", "gain_v", "dead_zone_v", "understeer", "battery_sag", "lag_v")
    ids = frozenset(f"base.{name}" for name in more)
    problem = problem_of(case.recording.runs, quiet, ids)
    found = search.search(problem, lambda _: None, [problem.fit(["base.delay", "base.curvature_v"], {})])
    assert found.best.ids == {"base.payload"}
