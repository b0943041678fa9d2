# SPDX-License-Identifier: BSD-3-Clause
"""What is decided: a curve only where it is likelier than the catalogue in any form, each heard with its own noise."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import unknown_effects as hidden

from kurumaisu.bench.hidden.base import recordings
from kurumaisu.bench.hidden.generator.motion import Fault, Form
from kurumaisu.bench.hidden.generator.noise import USUAL
from kurumaisu.critic.base.drive import prepare
from kurumaisu.critic.engine.evidence import Problem
from kurumaisu.critic.judge import decide
from kurumaisu.critic.judge.decide import Decision
from kurumaisu.critic.noise.base_noise import START, NoiseGrowth
from kurumaisu.critic.search.posterior import SearchResult
from kurumaisu.critic.search.search import search
from kurumaisu.params import load_model, shipped

MODEL = load_model(shipped("launch/md100.yaml"))
TRUTH = hidden.USUAL.position_sd, hidden.USUAL.heading_sd


def fit_of(score, *names):
    chosen = frozenset(names)
    return SimpleNamespace(ids=chosen, candidates=chosen, score=score)


def curve_of(nats, form_of=frozenset(), fit=None):
    return SimpleNamespace(fit=fit or fit_of(0.0), curve=SimpleNamespace(id="smooth.w.v"), nats=nats, form_of=form_of)


@pytest.fixture
def found_of(monkeypatch):
    """Return what makes a result of fits and curves that are no more than their evidence."""
    monkeypatch.setattr(SearchResult, "log_posterior", lambda _, one: one.nats if hasattr(one, "nats") else one.score)

    def make(score, *curves, enough=True):
        return SearchResult((fit_of(score, "a"), fit_of(0.0)), curves, {"a": 1.0}, {}, (), enough)

    return make


def test_a_curve_is_told_only_where_it_beats_the_catalogue(found_of):
    curve = curve_of(30.0)
    assert decide.likelier_curve(found_of(20.0, curve, curve_of(25.0))) is curve
    assert decide.likelier_curve(found_of(40.0, curve)) is None
    assert decide.likelier_curve(found_of(20.0)) is None


def test_a_curve_that_is_another_form_of_an_effect_is_no_news(found_of):
    """Nor is the next best one, which draws the same a little worse."""
    assert decide.likelier_curve(found_of(20.0, curve_of(30.0, form_of=frozenset({"a"})), curve_of(29.0))) is None


def test_sets_that_were_near_are_weighed_again_in_another_noise(monkeypatch):
    """One fit of each, the likeliest: of what was far behind, and of other forms, nothing new comes."""
    monkeypatch.setattr(SearchResult, "log_posterior", lambda _, one: one.score)
    fits = fit_of(20.0, "a"), fit_of(19.0, "a"), fit_of(15.0, "b", "c"), fit_of(11.0, "d"), fit_of(0.0)
    assert SearchResult(fits, (), {}, {}, ()).likely == (fits[0], fits[2])


def test_few_data_show_no_curve(found_of):
    assert decide.likelier_curve(found_of(20.0, curve_of(30.0), enough=False)) is None


def test_the_lead_is_that_over_the_best_of_the_catalogue(found_of):
    made = Decision(SimpleNamespace(), found_of(20.0, curve_of(30.0)), NoiseGrowth(0.0, 0.0, START), SimpleNamespace())
    assert made.lead == 10.0
    assert made.something
    assert not Decision(SimpleNamespace(), SearchResult((fit_of(0.0),), (), {}, {}, ()), made.growth).something


def decided(recording, *ids):
    """Return what is decided of drives whose noise nobody knows."""
    problem = hidden.problem_of(recording, frozenset(ids)).changed(noise=START)
    return decide.decide(problem, search(problem, lambda _: None), TRUTH, lambda _: None)


GAINS = "base.gain_v", "base.gain_w"


@pytest.mark.parametrize("seed", [1, 2])
def test_where_nothing_acts_there_is_noise_alone(seed):
    made = decided(hidden.make(hidden.KINDS["gully"], 20.0, seed, seconds=30.0, runs=2).null, *GAINS)
    assert not made.something
    assert made.growth.p < 0.9
    noise = made.problem.noise
    assert noise.sd_v == pytest.approx(hidden.USUAL.sd_v, rel=0.5)
    assert noise.sd_w == pytest.approx(hidden.USUAL.sd_w, rel=0.5)


@pytest.mark.parametrize("seed", [1, 3])
def test_an_effect_and_a_curve_are_found_with_the_noise_about_them(seed):
    """And no other effect, which took up a part of the curve before there was one."""
    case = hidden.make(hidden.KINDS["corrugated floor"], 30.0, seed, seconds=30.0, runs=2, gain_w=0.15)
    made = decided(case.recording, *GAINS)
    assert made.extension is not None
    assert made.extension.curve.id == "smooth.v.heading"
    assert "base.gain_w" in made.extension.fit.ids
    assert made.found.p["base.gain_w"] > 0.9 > made.found.p["base.gain_v"]
    assert made.lead > 20
    assert made.problem.noise.sd_v == pytest.approx(hidden.USUAL.sd_v, rel=0.5)
    again = made.refit(made.problem.drives)
    (gain,) = (setting for setting in again.settings if setting.id == "base.gain_w")
    assert gain.parameters["gain"] == pytest.approx(0.15, abs=0.04)


def test_slow_noise_takes_up_no_curve():
    """Estimated about nothing, it would: so what may act is heard with the noise about it, too."""
    slow = hidden.Kind(2, "heading", lambda s, a, b: np.sin(s.heading + 6 * a))
    made = decided(hidden.make(slow, 25.0, 3, seconds=40.0, runs=2).recording, *GAINS)
    assert made.extension is not None
    assert made.extension.curve.id == "smooth.w.heading"
    assert made.problem.noise.slow_w < 0.02


def test_slow_noise_takes_up_an_offset_until_it_is_looked_for_without():
    """A chair that creeps, at rest as well, drifts as by noise that lasts."""
    creeping = Fault(Form("floor", lambda r, _: replace(r, v=r.v + 0.006)), {})
    drawn = recordings.draw_drives("rich", USUAL, np.random.default_rng(6), seconds=40.0, rate=10.0)
    runs = recordings.recording("creeps", drawn, [creeping]).runs
    ids = frozenset({"base.dac_zero_f", "base.gain_v", "base.gain_w"})
    slow = replace(START, slow_v=0.02, slow_tau=20.0, rest=0.6)
    problem = Problem([prepare(run, MODEL) for run in runs], MODEL, slow, ids=ids)
    found = search(problem, lambda _: None)
    assert found.best.ids == frozenset()
    hint = decide._hinted(problem, found, lambda _: None)
    assert hint is not None
    assert hint.found.best.ids == {"base.dac_zero_f"}
    made = decide.decide(problem, found, None, lambda _: None)
    assert made.found.best.ids == {"base.dac_zero_f"}
    (setting,) = made.found.best.settings
    assert setting.parameters["rests"] == -1.0
    assert setting.parameters["offset"] / MODEL.translation.positive.slope == pytest.approx(0.006, rel=0.3)


def test_quick_noise_is_as_loud_within_a_second_and_lasts_no_longer():
    noise = replace(START, sd_w=0.02, tau=16.0, slow_v=0.01, slow_tau=0.5, lasting=0.7)
    quick = noise.quick
    assert (quick.tau, quick.slow_tau, quick.lasting) == (1.0, 0.5, 0.0)
    assert quick.sd_w**2 / quick.tau == pytest.approx(noise.sd_w**2 / noise.tau)  # how fast it begins to change
    assert quick.slow_v == noise.slow_v
    assert (noise.slowest, quick.slowest, replace(noise, slow_v=0.0, tau=0.2).slowest) == (16.0, 1.0, 0.2)


def test_a_search_ends_where_ever_more_sets_would_be_fitted(monkeypatch):
    """Two gains act. Both are found, unless no more than what acts by itself may be fitted."""
    both = Fault(Form("rates", lambda r, _: replace(r, v=1.15 * r.v, w=1.15 * r.w)), {})
    drawn = recordings.draw_drives("rich", USUAL, np.random.default_rng(6), seconds=40.0, rate=10.0)
    runs = recordings.recording("gains", drawn, [both]).runs
    problem = Problem([prepare(run, MODEL) for run in runs], MODEL, START, ids=frozenset(GAINS))
    assert search(problem, lambda _: None).best.ids == set(GAINS)
    monkeypatch.setattr("kurumaisu.critic.search.search._MOST", 2)
    monkeypatch.setattr("kurumaisu.critic.search.search._AGAIN", 0)
    monkeypatch.setattr("kurumaisu.critic.search.search.nearly_same_rates", lambda *_: True)  # no second look
    fitted = []
    assert len(search(problem, fitted.append).best.ids) == 1
    told = [said.partition(",")[0] for said in fitted]
    assert told == [f"fitting set {k + 1} of at most {most}" for k, most in enumerate((2, 2))]
