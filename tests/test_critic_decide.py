# SPDX-License-Identifier: BSD-3-Clause
"""What is decided after the search: which sets stay open, and when all is judged anew."""

from collections import defaultdict
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from kurumaisu.bench.hidden import Ask, make
from kurumaisu.bench.hidden.base import recordings
from kurumaisu.bench.hidden.generator.noise import Colour, Regime
from kurumaisu.bench.hidden.oracle import noise_of
from kurumaisu.critic.base.drive import prepare
from kurumaisu.critic.engine import refit, search
from kurumaisu.critic.engine.catalogue import Term
from kurumaisu.critic.engine.evidence import Problem
from kurumaisu.critic.engine.search import SearchResult
from kurumaisu.critic.judge import decide
from kurumaisu.critic.judge.decide import Decision
from kurumaisu.critic.noise.base_noise import START, NoiseGrowth
from kurumaisu.critic.pipeline import criticise
from kurumaisu.critic.unknown.beyond_catalogue import Beyond
from kurumaisu.critic.unknown.comparison import CurveComparison
from kurumaisu.effects import Parameter
from kurumaisu.params import load_model, shipped


def fit_of(names):
    return SimpleNamespace(ids=frozenset(names.split()), candidates=frozenset(names.split()), score=0.0)


def found_of(*sets, confounded=()):
    return SearchResult((*map(fit_of, sets), fit_of("")), defaultdict(lambda: 1.0), confounded, 0.0)


def undriven():
    """Return a problem of which nothing is asked."""
    problem = SimpleNamespace(missed=None)
    problem.changed = lambda **_: problem
    return problem


def decision(found, better=None):
    beyond = Beyond(CurveComparison((), -np.inf, {}, {}, 0.0), None, 1.0, better)
    return Decision(undriven(), found, NoiseGrowth(0.0, 0.0, START), beyond)


def test_what_is_named_is_in_no_set():
    """A curve that draws b speaks for it: it is named then, and not one of two that cannot be told apart."""
    found = found_of("a b", confounded=(("b", "c"), ("d", "e")))
    p = {"a": 1.0, "b": 0.95, "c": 0.05, "d": 0.6, "e": 0.4}
    again = decide.with_curve_odds(found, p)
    assert again.confounded == (("d", "e"),)
    assert again.named == ("a", "b")


@pytest.fixture
def judged(monkeypatch):
    """Return the sets about which all was judged, and what each of them led to, to be filled."""
    asked, answers = [], {}

    def judge(_first, found, *_):
        asked.append(" ".join(sorted(found.best.ids)))
        return answers[asked[-1]]

    monkeypatch.setattr(search, "search", lambda *_: found_of("wrong"))
    monkeypatch.setattr(decide.beyond_catalogue, "hinted_curve", lambda *_: None)
    monkeypatch.setattr(decide, "_judged", judge)
    return asked, answers


def decided():
    return decide.decide(undriven(), None, lambda _: None)


def test_noise_taken_about_a_set_that_is_not_the_best_is_taken_again(judged):
    asked, answers = judged
    answers |= {"wrong": decision(found_of("right")), "right": decision(found_of("right"))}
    assert decided() is answers["right"]
    assert asked == ["wrong", "right"]


def test_a_better_set_that_a_curve_led_to_is_where_the_search_goes_on(judged):
    _asked, answers = judged
    answers |= {"wrong": decision(found_of("wrong"), fit_of("better")), "better": decision(found_of("better"))}
    assert decided() is answers["better"]


def test_two_sets_that_lead_to_each_other_come_to_an_end(judged):
    asked, answers = judged
    answers |= {"wrong": decision(found_of("other")), "other": decision(found_of("wrong"))}
    assert decided().found.best.ids in ({"wrong"}, {"other"})
    assert len(asked) == 2


@pytest.mark.parametrize(
    ("start", "better"),
    [
        ({"a": 0.0, "b": 0.2}, False),
        ({"a": 0.9, "b": 0.2}, True),
        ({"a": 0.9, "b": 3.0}, False),
        ({"a": 0.9}, True),
        ({"b": 0.2}, False),
        ({"c": 1.0}, False),
    ],
)
def test_a_fit_that_first_values_beat_is_stuck(start, better):
    """The best values are 1 and 0.2; the fit stuck at 0.5 and 0.2, as on a wrong peak.

    Where first values are those of a part of the set, the rest stays as it was fitted.
    """
    parameter = Parameter("offset", "V", null=0.0, scale=1.0, lower=-5.0, upper=5.0)
    problem = SimpleNamespace(residual=lambda _, values: 4.0 * (values - [1.0, 0.2]))
    terms, own = (Term("a", parameter, 0.0), Term("b", parameter, 0.0)), (0.5, 0.2)
    at = {term.key: value for term, value in zip(terms, own, strict=True)}
    fit = SimpleNamespace(terms=terms, start=at, log_likelihood=-2.0)
    assert refit.start_is_better(problem, fit, {(name, "offset"): value for name, value in start.items()}) is better
    assert not refit.start_is_better(problem, SimpleNamespace(terms=()), {("a", "offset"): 0.9})


@pytest.mark.parametrize(("by_noise", "least", "curved"), [(0.0, 3.0, True), (3.5, 3.0, False), (3.5, 1.0, True)])
def test_a_curve_has_to_beat_the_noise_that_would_take_it_up(judged, monkeypatch, by_noise, least, curved):
    curve = SimpleNamespace()
    won = decision(found_of("a"))
    won = replace(won, beyond=Beyond(CurveComparison((curve,), 5.0, {}, {}, 0.0, least), curve, 0.0))
    monkeypatch.setattr(decide.beyond_catalogue, "hinted_curve", lambda *_: curve)
    monkeypatch.setattr(decide, "_by_noise", lambda *_: by_noise)
    plain = decision(found_of("a"))
    monkeypatch.setattr(decide, "_judged", lambda _first, _found, hint, *_: plain if hint is None else won)
    assert decided() is (won if curved else plain)


def test_noise_about_nothing_hides_no_weak_turn_by_the_heading():
    """Its slow part has taken the turn up: about nothing the curve is behind, about itself 4 nats ahead."""
    case = make(Ask("unknown", ("heading_veer",), form="other", family="base"), 37103)
    verdict = criticise(case.recording, shipped("launch/md100.yaml"), lambda _: None).verdict
    assert [(one.channel, one.covariate) for one in verdict.unknown] == [("base.w", "heading")]
    assert verdict.verdict == "unknown"
    assert not verdict.causes


def test_slow_noise_is_heard_where_noise_about_a_curve_lacks_it():
    regime = Regime((Colour((0.01, 0.002, 0.01), 0.2), Colour((0.01, 0.001, 0.03), 3.0)), 0.002, 0.002)
    data = recordings.recording("null", recordings.draw_drives("rich", regime, np.random.default_rng(1), rate=5.0), ())
    model, own = load_model(shipped("launch/md100.yaml")), noise_of(regime)
    problem = Problem([prepare(run, model) for run in data.runs], model, own, ids=frozenset({"base.gain_v"}))
    nothing = problem.fit_candidates((), {})

    def by_noise(lacking):
        about = problem.changed(noise=replace(own, slow_w=lacking * own.slow_w))
        made = SimpleNamespace(problem=about, found=SimpleNamespace(best=nothing))
        return decide._by_noise(problem, made, (0.002, 0.002))

    assert by_noise(0.3) > 10
    assert by_noise(1.0) < 5  # what fits better than the truth by chance, with seven parameters


def test_a_chair_that_never_turns_has_no_one_cause():
    """Whatever swallows all of it may be of any size beyond some, so none is worth less than what has no size."""
    case = make(Ask("confounded", ("base.dac_zero_s",), None, "other"), 54088)
    found = criticise(case.recording, shipped("launch/md100.yaml"), lambda _: None).verdict
    assert found.causes == ()
    assert any({"base.dac_zero_s", "base.dead_zone_w", "base.steering_law"} <= set(group) for group in found.confounded)
