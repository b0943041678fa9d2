# SPDX-License-Identifier: BSD-3-Clause
"""Curves that bend often, flat spots of wheels and narrow gusts; and one that draws a top speed without a corner."""

import math

import numpy as np
import pytest
import unknown_effects as hidden

from kurumaisu.critic.search import search
from kurumaisu.critic.search.curve_search import CurveSearch
from kurumaisu.critic.unknown import sentences
from kurumaisu.critic.unknown.bases import Basis, knots_of
from kurumaisu.critic.unknown.curves import wave_periods
from kurumaisu.effects import Motion

GIRTH = 1.137  # [m]


def dent(s, a, b):
    turn = s.gone / GIRTH - 0.4
    return -s.v * math.exp(-((turn - round(turn)) ** 2) / (2 * 0.05**2))


@pytest.fixture(scope="module")
def dented():
    """Return a wheel with a flat spot, beside which a gain makes up for the speed that is lost."""
    recording = hidden.make(hidden.Kind(0, "distance", dent), 30.0, 1020, seconds=60.0).recording
    return hidden.problem_of(recording, frozenset({"base.gain_v", "base.reverse_gain"}))


def test_the_period_of_a_flat_spot_is_that_of_a_turn(dented):
    """Of the way as it was made: each overtone is as large, and out of step after some turns."""
    found, _ = wave_periods(dented, dented.fit(["base.gain_v"], {}).settings)["distance"]
    assert found == pytest.approx(GIRTH, rel=0.008)


def test_a_short_wave_is_found_over_a_long_way():
    """In 200 s the chair drives so far that periods of the whole way are too many to be tried."""
    wave = hidden.Kind(0, "distance", lambda s, a, b: 0.04 * math.sin(2 * math.pi * s.gone / 0.47))
    problem = hidden.problem_of(hidden.make(wave, 30.0, 1020, seconds=200.0).recording)
    assert wave_periods(problem, ())["distance"][0] == pytest.approx(0.47, rel=0.01)


def test_what_a_flat_spot_costs_on_the_mean_is_no_certain_gain_beside_its_waves(dented):
    found = search.search(dented, lambda _: None)
    assert found.curves[0].curve.id == "smooth.v_gain.distance"
    assert found.log_posterior(found.curves[0]) > found.log_posterior(found.best) + 20
    assert found.p_curves["smooth.v_gain.distance"] > 0.9
    assert found.p["base.gain_v"] < 0.9
    assert {one.curve.basis.harmonics for one in found.curves} >= {4, 12}


@pytest.mark.parametrize(
    ("covariate", "period", "channel", "error"),
    [
        ("x", 0.7, 2, lambda s, *_: s.v * math.sin(2 * math.pi * s.x / 0.7)),
        ("time", 12.0, 2, lambda s, *_: math.sin(2 * math.pi * s.time / 12.0)),
    ],
)
def test_tiles_and_people_who_sway_come_again_and_again(covariate, period, channel, error):
    """Too often for a curve with few knots over the place or the time."""
    made = hidden.make(hidden.Kind(channel, covariate, error), 40.0, 1023, seconds=60.0).recording
    problem = hidden.problem_of(made)
    best = CurveSearch(problem).beside(problem.fit_candidates((), {}))[0]
    assert best.curve.basis.covariate == covariate
    assert best.curve.basis.constants["period"] == pytest.approx(period, rel=0.03)
    assert best.nats > 100


@pytest.mark.parametrize("seed", [1021, 1022])
def test_a_narrow_gust_is_drawn_by_a_curve_that_bends_often(seed):
    gust = hidden.Kind(2, "y", lambda s, a, b: hidden.bump((s.y - 0.3) / 0.12))
    problem = hidden.problem_of(hidden.make(gust, 40.0, seed, seconds=60.0).recording)
    curves, empty = CurveSearch(problem), problem.fit_candidates((), {})
    usual = max(one.nats for one in curves.beside(empty))
    curves.closer(empty)
    best = curves.found(empty)[0]
    assert (sentences.channel(best.curve), best.curve.basis.covariate) == ("base.w", "y")
    assert len(best.curve.basis.knots) == 22
    assert best.nats > usual + 10


@pytest.mark.parametrize("seed", [1025, 1026])
def test_a_top_speed_without_a_corner_is_one_and_no_bent_law(seed):
    soft = hidden.Kind(0, "abs_v", lambda s, a, b: s.v * (1 / (1 + (abs(s.v) / 0.5) ** 10) ** 0.1 - 1))
    recording = hidden.make(soft, 60.0, seed, seconds=40.0, runs=2).recording
    ids = frozenset({"base.saturation", "base.curvature_v"})
    found = search.search(hidden.problem_of(recording, ids), lambda _: None)
    assert found.named == ("base.saturation",)


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
