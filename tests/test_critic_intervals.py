# SPDX-License-Identifier: BSD-3-Clause
"""The interval of a size: a Gaussian's where the likelihood is one, wider where it is skewed or the form in doubt."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from kurumaisu.bench.hidden.base import recordings
from kurumaisu.bench.hidden.base.catalogue import BASE
from kurumaisu.bench.hidden.generator.noise import USUAL
from kurumaisu.critic.base.drive import prepare
from kurumaisu.critic.engine.catalogue import Term
from kurumaisu.critic.engine.evidence import Problem
from kurumaisu.critic.judge import intervals
from kurumaisu.critic.noise.base_noise import Noise
from kurumaisu.critic.values.verdict import NORMAL90
from kurumaisu.effects import Parameter, by_id
from kurumaisu.params import load_model, shipped

MODEL = load_model(shipped("launch/md100.yaml"))
NOISE = Noise(position_sd=0.005, heading_sd=0.005, sd_v=0.01, sd_lateral=0.003, sd_w=0.02, tau=0.3)


def fitted(names, hidden, form="plain", seed=1):
    """Return the problem of drives with hidden sizes, by id, and the fit of some names."""
    drives = recordings.draw_drives("rich", USUAL, np.random.default_rng(seed), seconds=40.0, rate=10.0)
    data = recordings.recording("sizes", drives, [BASE[name].fault(size, form) for name, size in hidden.items()])
    problem = Problem([prepare(run, MODEL) for run in data.runs], MODEL, NOISE, ids=frozenset(names))
    return problem, problem.fit(names, {})


def halves(estimate):
    return estimate.estimate - estimate.lo90, estimate.hi90 - estimate.estimate


def test_a_size_in_proportion_has_a_gaussians_interval():
    problem, fit = fitted(["base.gain_v"], {"base.gain_v": {"size": 0.1}})
    gain = intervals.estimates(problem, fit, "base.gain_v")["gain"]
    assert halves(gain) == pytest.approx((NORMAL90 * fit.sds[0],) * 2, rel=0.02)
    assert gain.lo90 < 0.1 < gain.hi90


def test_where_the_likelihood_is_skewed_so_is_the_interval():
    """A likelihood that is Gaussian in the logarithm, sd 0.5, about 1: its curvature says 1 +- 0.82."""
    term = Term("base.lag_v", Parameter("tau", "s", null=0.0, scale=1.0, lower=0.0, upper=10.0), null=0.0)
    fit = SimpleNamespace(terms=(term,), values=np.array([1.0]))
    problem = SimpleNamespace(residual=lambda _, values: np.array([3.0, np.log(max(values[0], 1e-9)) / 0.5]))
    low, high = intervals.ends_of(problem, fit, 0, np.array([1.0]), 0.5)
    assert low == pytest.approx(np.exp(-0.5 * NORMAL90), rel=0.06)
    assert high == pytest.approx(np.exp(0.5 * NORMAL90), rel=0.06)


def test_what_another_form_may_do_is_in_the_interval_of_a_curve(monkeypatch):
    """Truth: the turn dies away with the speed as that of a car; the best parabola is always a share less."""
    problem, fit = fitted(["base.understeer"], {"base.understeer": {"size": 0.5}}, "other", seed=4)
    told = intervals.estimates(problem, fit, "base.understeer")["k"]
    assert told.lo90 < 0.5 < told.hi90
    monkeypatch.setattr(by_id("base.understeer"), "empirical", False)
    assert intervals.estimates(problem, fit, "base.understeer")["k"].hi90 < 0.5


def test_the_form_of_one_cause_is_in_doubt_for_what_looks_like_it_only():
    hidden = {"base.curvature_w": {"size": 0.3}}
    problem, fit = fitted(["base.curvature_w", "base.gain_w", "base.gain_v"], hidden)
    sds = {term.id: sd for term, sd in zip(fit.terms, fit.sds, strict=True)}

    def wider(name):
        return sum(halves(intervals.estimates(problem, fit, name)["gain"])) / (2 * NORMAL90 * sds[name])

    assert wider("base.gain_w") > 1.3
    assert wider("base.gain_v") == pytest.approx(1.0, abs=0.05)


def test_the_steps_of_a_converter_may_be_those_of_another_peak():
    """The likelihood has many peaks: one is told by its curvature to parts per million, and its neighbour fits, too."""
    name = "base.dac_quantisation"
    problem, _ = fitted([name], {name: {"size": 0.012, "cut": 0.0}}, "other", seed=5)
    fit = max((problem.fit_candidates([c], {}) for c in problem.candidates), key=lambda fit: fit.score)
    told = intervals.estimates(problem, fit, name)
    assert told["step"].lo90 < 0.012 < told["step"].hi90
    assert told["phase"].lo90 == told["phase"].estimate == told["phase"].hi90


def test_an_interval_ends_at_the_bound():
    problem, fit = fitted(["base.lag_v"], {"base.lag_v": {"size": 0.004}})
    values = np.zeros_like(fit.values)
    tau = intervals.estimates(problem, replace(fit, values=values), "base.lag_v")["tau"]
    assert tau.lo90 == 0.0 < tau.hi90


def test_beside_the_steps_of_a_converter_a_size_has_room_on_both_sides():
    """Where its step goes with another size, it goes off its peak at once: that is no end of the other's interval."""
    hidden = {
        "base.dac_quantisation": {"size": 0.045, "cut": 0.0},
        "base.slope": {"size": 0.024, "bearing": 2.5},
        "base.delay": {"size": 0.12},
    }
    problem, _ = fitted([*hidden], hidden, seed=3)
    usual = [candidate for candidate in problem.candidates if candidate.usual]
    fit = problem.fit_candidates(usual, {("base.dac_quantisation", "step"): 0.045})
    sds = {term.key: sd for term, sd in zip(fit.terms, fit.sds, strict=True)}
    for key in (("base.slope", "climb_x"), ("base.slope", "climb_y"), ("base.delay", "delay")):
        assert min(halves(intervals.estimates(problem, fit, key[0])[key[1]])) > 0.8 * NORMAL90 * sds[key]
