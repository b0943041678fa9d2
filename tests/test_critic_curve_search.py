# SPDX-License-Identifier: BSD-3-Clause
"""Curves beside sets: what is in no catalogue is found where it is, and another form of a cause is that cause."""

import numpy as np
import pytest
import unknown_effects as hidden

from kurumaisu.bench.hidden.base import recordings
from kurumaisu.bench.hidden.generator.noise import USUAL
from kurumaisu.bench.hidden.oracle import noise_of
from kurumaisu.critic.base import replay
from kurumaisu.critic.base.drive import prepare
from kurumaisu.critic.engine.evidence import Problem
from kurumaisu.critic.search import search
from kurumaisu.critic.search.curve_search import CurveSearch
from kurumaisu.params import EffectSetting, load_model, shipped

MODEL = load_model(shipped("launch/md100.yaml"))
SEEDS = 1001, 1002


def nothing(problem):
    return problem.fit_candidates((), {})


@pytest.mark.parametrize("name", hidden.KINDS)
def test_each_unknown_kind_is_found_where_it_is(name):
    """With the noise known: channel and covariate first, and far above whatever the catalogue could say."""
    kind = hidden.KINDS[name]
    problem = hidden.problem_of(hidden.make(kind, 20.0, 1001, seconds=40.0, runs=2).recording)
    found = CurveSearch(problem).beside(nothing(problem))
    assert found[0].curve.id == f"smooth.{kind.name}.{kind.covariate}"
    assert found[0].nats > 50
    assert not found[0].form_of
    assert [one.nats for one in found] == sorted((one.nats for one in found), reverse=True)


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("rests", [0.0, 0.3])
def test_noise_alone_has_no_curve(seed, rests):
    """The kinds above share drives and noise, so they have one null, but for those who rest more."""
    name = next(name for name, kind in hidden.KINDS.items() if kind.rests == rests)
    problem = hidden.problem_of(hidden.make(hidden.KINDS[name], 20.0, seed, seconds=40.0, runs=2).null)
    curves, empty = CurveSearch(problem), nothing(problem)
    curves.closer(empty)  # nor one that bends more often, or jumps
    assert all(one.nats < 0 for one in curves.found(empty))


@pytest.mark.parametrize("seed", SEEDS)
def test_what_the_catalogue_explains_is_left_to_it(seed):
    case = hidden.make(hidden.KINDS["gully"], 10.0, seed, seconds=40.0, runs=2, gain_w=0.06)
    problem = hidden.problem_of(case.null, frozenset({"base.gain_w"}))
    curves = CurveSearch(problem)
    # Without the right effect the same drives look as if something unknown changed the yaw rate.
    assert curves.beside(nothing(problem))[0].curve.channel in ("w", "w_gain")
    assert all(one.nats < 0 for one in curves.beside(problem.fit(["base.gain_w"], {})))
    found = search.search(problem, lambda _: None)
    assert found.named == ("base.gain_w",)
    assert sum(found.p_curves.values()) < 0.05


@pytest.mark.parametrize("seed", SEEDS)
def test_a_curve_and_an_effect_are_found_beside_each_other(seed):
    case = hidden.make(hidden.KINDS["corrugated floor"], 30.0, seed, seconds=40.0, runs=2, gain_w=0.1)
    found = search.search(hidden.problem_of(case.recording, frozenset({"base.gain_w", "base.gain_v"})), lambda _: None)
    best = found.curves[0]
    assert found.log_posterior(best) > found.log_posterior(found.best) + 50
    assert (best.curve.id, best.fit.ids) == ("smooth.v.heading", {"base.gain_w"})
    assert found.p["base.gain_w"] > 0.9
    assert found.p["base.gain_v"] < 0.5
    assert found.p_curves["smooth.v.heading"] > 0.9


def driven_by(seed, *settings, ids=("base.battery_sag", "base.gain_v", "base.lag_w")):
    """Return the problem of two drives that effects of a model file make, under a reference with noise."""
    rng = np.random.default_rng(seed)
    drives = recordings.draw_drives("rich", USUAL, rng, seconds=60.0, rate=10.0)
    plain = [prepare(run, MODEL) for run in recordings.recording("made", drives, []).runs[:2]]
    paths = [replay.path(drive, MODEL, settings) for drive in plain]
    seen = [path + 0.005 * rng.standard_normal(path.shape) for path in paths]
    noisy = [drive.seen_at(drive.times, poses) for drive, poses in zip(plain, seen, strict=True)]
    return Problem(noisy, MODEL, noise_of(USUAL), ids=frozenset({*ids, "smooth"}))


SLOW = EffectSetting(  # forward, by a fifth, for a while half a minute after the start
    "smooth.v_gain.time",
    {"knot_0": 20.0, "knot_1": 30.0, "knot_2": 40.0, "value_0": 0.0, "value_1": -0.2, "value_2": 0.0},
)


def test_a_curve_over_time_beside_a_battery_that_sags_is_another_form_of_that():
    problem = driven_by(0, EffectSetting("base.battery_sag", {"sag": 0.004, "through": 1.0}), SLOW)
    beside = CurveSearch(problem).beside(problem.fit(["base.battery_sag"], {}))
    assert {one.curve.id: one.form_of for one in beside}["smooth.v_gain.time"] == {"base.battery_sag"}
    found = search.search(problem, lambda _: None)
    assert "base.battery_sag" in found.named
    assert found.p_curves.get("smooth.v_gain.time", 0.0) < 0.1  # nothing is outside the catalogue


@pytest.mark.parametrize("seed", range(2))
def test_a_curve_over_time_beside_a_lag_is_no_other_form_of_it(seed):
    problem = driven_by(seed, EffectSetting("base.lag_w", {"tau": 0.2}), SLOW)
    best = CurveSearch(problem).beside(problem.fit(["base.lag_w"], {}))[0]
    assert (best.curve.id, best.form_of) == ("smooth.v_gain.time", frozenset())
    assert best.nats > 50


def test_a_curve_of_the_turns_gain_over_the_speed_is_another_form_of_a_gain_with_understeer():
    ids = ("base.gain_w", "base.understeer", "base.lag_w")
    gain, slip = EffectSetting("base.gain_w", {"gain": 0.1}), EffectSetting("base.understeer", {"k": 0.3})
    problem = driven_by(0, gain, slip, ids=ids)
    curves = CurveSearch(problem)
    one = next(each for each in curves.beside(nothing(problem)) if each.curve.id == "smooth.w_gain.abs_v")
    both, other = problem.fit(ids[:2], {}), problem.fit(["base.lag_w"], {})
    assert curves.as_form(one, [other, both]).form_of == set(ids[:2])
    assert not curves.as_form(one, [other, problem.fit(ids[2:], {})]).form_of
    found = search.search(problem, lambda _: None)
    assert set(found.named) == set(ids[:2])
    assert sum(found.p_curves.values()) < 0.1


def test_columns_of_a_curve_have_its_size_before_the_data_and_move_no_size_of_the_set():
    case = hidden.make(hidden.KINDS["gully"], 20.0, 1003, seconds=40.0, runs=2, gain_w=0.1)
    problem = hidden.problem_of(case.recording, frozenset({"base.gain_w"}))
    curves = CurveSearch(problem)
    for fit in (nothing(problem), problem.fit(["base.gain_w"], {})):
        best = curves.beside(fit)[0]
        columns = curves.columns(fit, best)
        assert columns.shape == (len(fit.beside.residual), best.curve.basis.size)
        np.testing.assert_allclose(fit.beside.own.T @ columns, 0.0, atol=1e-6 * np.abs(columns).max())
        # About as loud as what was hidden: the prior is that at the likeliest size.
        assert 10.0 < np.linalg.norm(columns) < 100.0


def test_a_chair_that_never_moves_follows_nothing():
    case = hidden.make(hidden.KINDS["gully"], 20.0, 1004, seconds=20.0, runs=1)
    (drive,) = hidden.problem_of(case.null).drives
    resting = Problem([type(drive)(**{**vars(drive), "v": 0 * drive.v, "w": 0 * drive.w})], hidden.MODEL, hidden.USUAL)
    assert CurveSearch(resting).beside(nothing(resting)) == []


def test_sets_are_sought_to_the_end_whatever_a_curve_beside_nothing_draws(monkeypatch):
    """Of two effects that act on one rate neither comes near the curve that draws both."""
    law = hidden.Kind(2, "v", lambda s, *_: -s.w * s.v**2)
    made = hidden.make(law, 13.0, 31, seconds=60.0, gain_w=0.07).recording
    problem = hidden.problem_of(made, frozenset({"base.gain_w", "base.understeer"}))
    score = search._Search.score
    monkeypatch.setattr(search._Search, "score", lambda self, fit: score(self, fit) + 1000.0 * (not fit.candidates))
    found = search.search(problem, lambda _: None)
    assert {"base.gain_w", "base.understeer"} in [fit.ids for fit in found.fits]
