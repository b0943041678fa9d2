# SPDX-License-Identifier: BSD-3-Clause
"""Curves that bend often, flat spots of wheels and narrow gusts; and one that draws a top speed without a corner."""

import math

import numpy as np
import pytest
import unknown_effects as hidden

from kurumaisu.critic.base.covariates import with_covariates
from kurumaisu.critic.base.drive import prepare
from kurumaisu.critic.engine.evidence import Problem
from kurumaisu.critic.engine.search import SearchResult
from kurumaisu.critic.unknown import sentences
from kurumaisu.critic.unknown.bases import Basis, knots_of
from kurumaisu.critic.unknown.comparison import compare
from kurumaisu.critic.unknown.designs import Designs
from kurumaisu.critic.unknown.effect_likeness import EffectLikeness
from kurumaisu.critic.unknown.periods import wave_period
from kurumaisu.effects import Motion

GIRTH = 1.137  # [m]


def problem_of(recording):
    return Problem(
        [with_covariates(prepare(run, hidden.MODEL), run) for run in recording.runs], hidden.MODEL, hidden.USUAL
    )


def dent(s, a, b):
    turn = s.gone / GIRTH - 0.4
    return -s.v * math.exp(-((turn - round(turn)) ** 2) / (2 * 0.05**2))


@pytest.fixture(scope="module")
def dented():
    """Return a wheel with a flat spot, beside which a gain makes up for the speed that is lost."""
    problem = problem_of(hidden.make(hidden.Kind(0, "distance", dent), 30.0, 1020, seconds=60.0).recording)
    return problem, problem.fit(["base.gain_v"], {}), problem.fit_candidates((), {})


def test_the_period_of_a_flat_spot_is_that_of_a_turn(dented):
    """Of the way as it was made: each overtone is as large, and out of step after some turns."""
    problem, gain, _ = dented
    found, _ = wave_period(problem, gain.settings)
    assert found == pytest.approx(GIRTH, rel=0.008)


def test_waves_come_as_often_beside_an_effect_that_makes_more_of_the_way(dented):
    problem, gain, empty = dented
    designs = Designs(problem, gain)
    curve = next(c for c in designs.about(empty).curves if c.basis.covariate == "distance")
    size = gain.values[0]
    beside = designs.paced(gain, curve).basis.constants["period"]
    assert beside == pytest.approx(designs.paced(empty, curve).basis.constants["period"] * (1 + size), rel=1e-3)


def test_what_a_flat_spot_costs_on_the_mean_is_no_certain_gain_beside_its_waves(dented):
    problem, gain, empty = dented
    rivalry = compare(problem, SearchResult((gain, empty), {"base.gain_v": 1.0}, (), 0.0))
    assert rivalry.winner.curve.id == "smooth.v_gain.distance"
    assert rivalry.p_effects["base.gain_v"] < 0.9
    assert {rival.curve.basis.harmonics for rival in rivalry.rivals if not rival.fit.ids} >= {4, 12}


def test_a_narrow_gust_is_drawn_by_a_curve_that_bends_often():
    gust = hidden.Kind(2, "y", lambda s, a, b: hidden.bump((s.y - 0.3) / 0.12))
    problem = problem_of(hidden.make(gust, 40.0, 1021, seconds=60.0).recording)
    rivalry = compare(problem, SearchResult((problem.fit_candidates((), {}),), {}, (), 1.0))
    usual = max(r.log_posterior for r in rivalry.rivals if len(r.curve.basis.knots) == 8)
    assert (sentences.channel(rivalry.winner.curve), rivalry.winner.curve.basis.covariate) == ("base.w", "y")
    assert len(rivalry.winner.curve.basis.knots) == 22
    assert rivalry.winner.log_posterior > usual + 10


def test_a_top_speed_without_a_corner_is_one_though_a_bent_law_mends_it():
    soft = hidden.Kind(0, "abs_v", lambda s, a, b: s.v * (1 / (1 + (abs(s.v) / 0.5) ** 10) ** 0.1 - 1))
    problem = problem_of(hidden.make(soft, 100.0, 1025, seconds=40.0, runs=2).recording)
    empty = problem.fit_candidates((), {})
    sharp = {one.id: one for one in problem.candidates if one.usual}  # limits with a corner
    mended = problem.fit_candidates([sharp["base.saturation"], sharp["base.curvature_v"]], {})
    designs = Designs(problem, mended)
    rivals = compare(problem, SearchResult((mended, empty), {}, (), 0.0)).rivals
    drawn = [EffectLikeness(problem, mended, designs).drawn_alone(r.fit, r.curve, r.evidence) for r in rivals[:3]]
    assert any("base.saturation" in names for names in drawn)


def test_a_speed_that_is_one_but_for_rounding_is_followed_by_nothing():
    """A few seconds at another speed, and curves had all their knots at one place."""
    speeds = np.full(1000, 0.42110524) + 1e-15 * np.arange(1000)
    speeds[:5] = 0.2
    assert len(knots_of(speeds)) == 0
    assert len(knots_of(np.linspace(0.2, 0.5, 1000))) == 8


def test_speeds_that_an_effect_has_moved_beyond_all_knots_bend_nothing():
    """A single speed, and its curves' prior had no size: the evidence was not a number."""
    at = np.linspace(0.40, 0.41, 1000)
    knots = knots_of(at)
    basis = Basis("v", knots, {}, (), 0.40, 0.41)

    def moving_at(speeds):
        return Motion(0.01, speeds, np.zeros(len(speeds)))

    assert basis.fine([moving_at(at - 0.05)]) is None
    fine = basis.fine([moving_at(at)])
    assert all(np.isfinite(prior).all() for prior in fine.priors)
    assert len(fine.knots) == 22
