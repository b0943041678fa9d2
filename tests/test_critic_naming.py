# SPDX-License-Identifier: BSD-3-Clause
"""What is said of an effect that is found but not certain: sets, curves that draw it, other forms of it."""

from types import SimpleNamespace

import numpy as np
import pytest

from kurumaisu.bench.hidden import Ask, make
from kurumaisu.bench.hidden.base.catalogue import BASE
from kurumaisu.bench.hidden.base.recordings import run_of
from kurumaisu.bench.hidden.generator.motion import STEP, Setting
from kurumaisu.bench.hidden.generator.motion import drive as hidden_drive
from kurumaisu.bench.hidden.generator.noise import USUAL, draw_rates, draw_reference
from kurumaisu.critic.base import replay
from kurumaisu.critic.base.drive import GRID, Drive, prepare
from kurumaisu.critic.engine.catalogue import Term
from kurumaisu.critic.engine.evidence import Problem
from kurumaisu.critic.judge import explain
from kurumaisu.critic.judge.decide import Decision
from kurumaisu.critic.judge.drive_verdict import confirmed_part, leave_one_out, untested
from kurumaisu.critic.noise.base_noise import Noise, NoiseGrowth, NoiseResiduals, whitener
from kurumaisu.critic.sanity import examination
from kurumaisu.critic.search import search
from kurumaisu.critic.search.posterior import SearchResult, SetPosterior, confounded
from kurumaisu.critic.values.verdict import Gain, LogDensityGain
from kurumaisu.effects import Parameter
from kurumaisu.params import load_model, shipped

MODEL = load_model(shipped("launch/md100.yaml"))
OFFSET = Parameter("offset", "V", null=0.0, scale=0.01, lower=-0.5, upper=0.5)
NOISE = Noise(position_sd=0.005, heading_sd=0.005, sd_v=0.01, sd_lateral=0.003, sd_w=0.02, tau=0.3)


def posterior(*sets, explains=()):
    """Return the posterior of sets given as (weight, names); explains: log likelihood of each, else ever less."""
    explained = explains or [-10.0 * i for i in range(len(sets))]
    ranked = [
        SimpleNamespace(ids=frozenset(names.split()), log_likelihood=nats, sizes=1, terms=())
        for (_, names), nats in zip(sets, explained, strict=True)
    ]
    return SetPosterior(ranked, np.array([weight for weight, _ in sets]))


def test_one_for_one_stand_ins_make_a_set():
    assert confounded(posterior((0.5, "a b"), (0.3, "a c"), (0.2, "a d"))) == (("b", "c", "d"),)


def test_an_effect_that_may_do_what_two_do_is_in_a_set_with_either():
    """Of a load a slower chair is one part and a later one the other: a delay and a gain do both, too."""
    sets = (0.5, "delay load"), (0.1, "delay gain"), (0.2, "delay sag"), (0.2, "load")
    assert confounded(posterior(*sets)) == (("gain", "load", "sag"), ("delay", "load"))


def test_what_needs_others_beside_it_is_in_no_set_where_others_do():
    assert confounded(posterior((0.55, "b"), (0.4, "c"), (0.05, "d e"))) == (("b", "c"),)


@pytest.mark.parametrize(
    ("p", "nats", "told"), [(0.005, 39.0, ("b", "c", "d")), (0.005, 37.0, ("b", "c")), (0.001, 39.0, ("b", "c"))]
)
def test_what_explains_as_much_belongs_to_the_set_unless_it_is_very_unlikely(p, nats, told):
    sets = (0.55, "a b"), (0.44, "a c"), (p, "a d"), (0.01 - p, "a b e")
    assert confounded(posterior(*sets, explains=(40.0, 40.0, nats, 42.0))) == (told,)


@pytest.mark.parametrize(("sd", "told"), [(0.1, ("b", "c", "d")), (0.01, ("b", "c"))])
def test_of_many_sizes_one_explains_as_much_by_chance(sd, told):
    made = posterior((0.55, "b"), (0.44, "c"), (0.01, "d"), (0.0, ""), explains=(50.0, 50.0, 50.0, 0.0))
    made.ranked[2].terms = (Term("d", OFFSET, 0.0),)
    made.ranked[2].values, made.ranked[2].sds = np.array([1.0]), np.array([sd])
    assert confounded(made) == (told,)


def test_two_that_stand_in_for_three_are_a_set_rather_than_nothing():
    """Something acts beside a, for sure: b and c and d, or e and f with neither of them."""
    assert confounded(posterior((0.5, "a b c d"), (0.5, "a e f"))) == (("b", "c", "d", "e", "f"),)


def test_what_may_not_act_at_all_is_in_no_set():
    assert confounded(posterior((0.6, "b"), (0.4, ""))) == ()


def test_what_half_the_catalogue_could_do_is_no_set():
    anything = [(0.098, f"a {name}") for name in "bcdefghijk"]
    assert confounded(posterior(*anything, (0.02, "a"))) == ()
    assert confounded(posterior(*((0.2, names) for _, names in anything[:5]))) == (("b", "c", "d", "e", "f"),)


def test_what_acts_beyond_doubt_is_a_set_however_many_could_do_it():
    """A turn at one rate that is off by a fifth has a dozen explanations, and nothing is none of them."""
    anything = [(0.1, f"a {name}") for name in "bcdefghijk"]
    assert confounded(posterior(*anything)) == (tuple("bcdefghijk"),)


def test_two_pairs_of_twins_are_two_sets():
    """Each of a pair acts beside either of the other: what one of them could be says nothing of the other pair."""
    twins = posterior(*((0.25, f"{one} {other}") for one in "ab" for other in "cd"))
    assert confounded(twins) == (("a", "b"), ("c", "d"))


def test_what_may_act_beside_a_set_is_no_member_of_it():
    """Whether b acts is open, and which of c and d does: b is in no place of theirs, and they are in none of its."""
    beside = posterior((0.35, "b c"), (0.3, "b d"), (0.2, "c"), (0.15, "d"))
    assert confounded(beside) == (("c", "d"),)


def test_what_does_the_same_is_in_a_set_though_two_of_them_act_together_as_often():
    """At one speed any two effects of it explain the drives as well as one."""
    alike = posterior((0.2, "a"), (0.2, "b"), (0.15, "c"), (0.15, "d"), (0.15, "a d"), (0.15, "b c"))
    assert confounded(alike) == (tuple("abcd"),)


def test_a_set_has_what_is_left_out_together_more_often_than_one_time_in_twenty():
    assert confounded(posterior((0.85, "b"), (0.05, "c"), (0.035, "d"), (0.035, "e"), (0.03, "f"))) == (tuple("bcde"),)
    assert confounded(posterior((0.5, "b"), (0.46, "c"), (0.021, "d"), (0.019, "e"))) == (("b", "c"),)


def test_what_only_curves_leave_uncertain_is_in_a_set_with_what_could_stand_in():
    sets = posterior((0.93, "b"), (0.07, "c"))
    assert confounded(sets) == ()
    assert confounded(sets, {"b": 0.88, "c": 0.06}) == (("b", "c"),)


def drive(v, w):
    """Return a drive with rates (n,) held for 0.5 s each and poses at 10 Hz."""
    rates = [np.repeat(np.asarray(rate, dtype=float), 50) for rate in (v, w)]
    times = np.arange(0.0, len(rates[0]) * GRID, 0.1)
    return Drive("made", "command", 0.0, *rates, times, np.zeros((len(times), 3)))


def test_rest_tells_nothing_about_noise_that_grows_with_the_rates():
    """A chair that rolls on has the pace it had; one that rests the mean one: no other noise by any growth."""
    pace = drive([0.8, 0.0, 0.0, 0.4, 0.4, 0.0], np.zeros(6)).pace
    np.testing.assert_allclose(pace[:4], 1.0)
    np.testing.assert_allclose(pace[5], 1.0)  # 0.1 s after the command ended
    np.testing.assert_allclose(pace[16:24], 0.5)
    assert pace[10] == pytest.approx(pace[pace != pace[10]].mean(), rel=0.05)
    one_speed = drive([0.4, 0.0, 0.4, 0.0], np.zeros(4)).pace
    np.testing.assert_allclose(one_speed, 0.5)


def noise_of_a_drive(growth, seed):
    """Return how likely growth is in 40 s of a drive whose whitened increments are drawn under noise that grows."""
    made = drive([0.2, 0.0, 0.7, 0.4, -0.3, 0.0, 0.1, 0.6] * 10, [0.3, 0.0, -0.5, 0.0, 0.4, 0.7, 0.0, -0.2] * 10)
    made = made.seen_at(made.times, replay.path(made, MODEL, ()))
    truth = Noise(**{**vars(NOISE), "growth": growth})
    size = 3 * (len(made.times) - 1)
    inverse = whitener(made, truth).whiten(np.eye(size))
    left = np.linalg.solve(inverse, np.random.default_rng(seed).standard_normal(size)).reshape(-1, 3)
    scatter = NoiseResiduals([made], [left], [np.empty((size, 0))], (NOISE.position_sd, NOISE.heading_sd))
    return scatter.growth(scatter.estimate(NOISE), 0.02)


def test_how_much_noise_grows_is_found_from_noise_that_does_not():
    found = noise_of_a_drive(3.0, 1)
    assert found.p > 0.99
    assert 1.5 < found.noise.growth < 6.0
    assert noise_of_a_drive(0.0, 1).p < 0.1


def fit_of(names, score):
    ids = frozenset(names.split())
    return SimpleNamespace(ids=ids, candidates=ids, score=score, settings=())


def found_of(p, *fits, curves=()):
    return SearchResult((*fits, fit_of("", 0.0)), curves, p, {}, ())


def gain(value):
    density = LogDensityGain(1.0, 1.0 + value, value, value - 0.05, value + 0.05)
    return Gain(density)


def decision(p, *fits, **more):
    return Decision(SimpleNamespace(), found_of(p, *fits), NoiseGrowth(0.0, 0.0, NOISE), **more)


def test_an_uncertain_effect_that_held_out_data_refuse_is_left_out():
    made = decision({"a": 1.0, "b": 0.7}, fit_of("a b", 50.0), fit_of("a c", 49.5), fit_of("a", 49.0))
    other, worth = confirmed_part(made, gain(-0.1), lambda one: gain(0.2 if one.found.best.ids == {"a"} else -0.1))
    assert other.found.best.ids == {"a"}
    assert worth == gain(0.2)


def test_what_is_certain_or_confirmed_is_kept():
    certain = decision({"a": 1.0, "b": 0.95}, fit_of("a b", 40.0), fit_of("a", 35.0))
    assert confirmed_part(certain, gain(-0.1), lambda _: gain(0.2)) == (certain, gain(-0.1))
    confirmed = decision({"a": 1.0, "b": 0.7}, fit_of("a b", 50.0), fit_of("a", 49.0))
    assert confirmed_part(confirmed, gain(0.2), lambda _: gain(0.3)) == (confirmed, gain(0.2))


@pytest.mark.parametrize(
    ("nats", "without", "left"),
    [(60.0, {"a": 0.2, "b": 0.3}, {"b"}), (60.0, {"a": -0.1, "b": -0.2}, {"a", "b"}), (40.0, {"a": 0.2}, {"a", "b"})],
)
def test_what_is_beyond_doubt_is_not_hidden_by_one_that_held_out_data_refuse(nats, without, left):
    """All effects are certain, and together they do not hold: the one goes without which most is gained."""
    made = decision(
        {"a": 1.0, "b": 1.0}, *(fit_of(names, nats - 5.0 * (len(names) < 2)) for names in ("a b", "a", "b"))
    )
    other, _ = confirmed_part(made, gain(-0.1), lambda one: gain(without[next(iter(one.found.best.ids))]))
    assert other.found.best.ids == left


@pytest.mark.parametrize(
    ("held", "nats", "turned", "kept"),
    [(-0.01, 50.0, 0.2, 0.2), (-0.01, 50.0, -0.02, -0.01), (-0.01, 11.0, 0.2, -0.01), (-0.1, 50.0, 0.2, -0.1)],
)
def test_where_drives_held_out_decide_nothing_each_is_left_out_in_turn(held, nats, turned, kept):
    made = decision({"a": 1.0}, fit_of("a", nats))
    assert leave_one_out(made, gain(held), lambda: gain(turned)) == gain(kept)


@pytest.mark.parametrize(
    ("held", "nats", "seen", "silent"),
    [(-0.01, 50.0, 1.0, True), (-0.1, 50.0, 1.0, False), (-0.01, 11.0, 1.0, False), (-0.01, 50.0, 9.0, False)],
)
def test_drives_held_out_that_do_not_meet_what_is_certain_say_nothing(monkeypatch, held, nats, seen, silent):
    """Whatever they gain, if it is no loss beyond chance."""
    monkeypatch.setattr("kurumaisu.critic.judge.drive_verdict.expected_nats", lambda *_: seen)
    made = decision({"a": 1.0}, fit_of("a", nats))
    assert untested(made, gain(held), ()) is silent
    assert not untested(made, None, ())


@pytest.mark.parametrize(("without", "kept"), [(0.15, True), (0.25, False), (-0.1, True)])
def test_a_curve_does_not_live_on_what_the_effects_beside_it_are_worth(monkeypatch, without, kept):
    monkeypatch.setattr("kurumaisu.critic.judge.explain_unknown.is_reported", lambda *_: True)
    curve = SimpleNamespace(fit=fit_of("a", 40.0))
    made = decision({"a": 1.0}, fit_of("a", 40.0), extension=curve)
    other, worth = confirmed_part(made, gain(0.2), lambda _: gain(without))
    assert (other.extension is curve) is kept
    assert worth == gain(0.2 if kept else without)


@pytest.mark.parametrize(("told", "without", "kept"), [(True, 0.2, True), (False, 0.2, False), (False, -0.1, True)])
def test_a_curve_that_does_not_hold_hides_no_effects_that_do(monkeypatch, told, without, kept):
    """Where nobody would be told of it, what acts without it is told, if that is confirmed."""
    monkeypatch.setattr("kurumaisu.critic.judge.explain_unknown.is_reported", lambda *_: told)
    made = decision({"a": 1.0}, fit_of("a", 40.0), extension=SimpleNamespace(fit=fit_of("", 0.0)))
    other, worth = confirmed_part(made, gain(-0.1), lambda one: gain(without if one.extension is None else -0.1))
    assert (other is made) is kept
    assert worth == gain(-0.1 if kept else 0.2)
    assert other.found is made.found
    alone = decision({"a": 0.0}, fit_of("", 40.0), extension=SimpleNamespace(fit=fit_of("", 0.0)))
    assert confirmed_part(alone, gain(-0.1), lambda _: gain(0.2)) == (alone, gain(-0.1))  # there is nothing else


@pytest.mark.parametrize("seed", [2, 17])
def test_another_steering_law_is_neither_a_unit_nor_a_sign(seed):
    """By the other law of V_s the chair hardly turns, and more like the volts' steps than like the rates asked for."""
    case = make(Ask("single", ("base.steering_law",), form="other", family="base"), seed)
    assert examination.examine(case.recording, MODEL).invalid == []


def test_what_clips_does_not_hide_what_else_it_may_be():
    """At one speed a top speed, a gain and a dead zone do the same; beside a top speed the others show no columns."""
    rng = np.random.default_rng(1)
    command = np.array([[2.0 * i, 0.4 * (i % 2), 0.0] for i in range(15)])
    stamps = np.arange(0.0, 30.0, 0.1)
    noise = draw_rates(USUAL, round((stamps[-1] + 3.0) / STEP), rng)
    setting = Setting(command, np.zeros(3), stamps, noise)
    poses, _ = hidden_drive(setting, [BASE["base.dead_zone_v"].fault({"size": 0.05}, "plain")])
    run = run_of("one speed", setting, poses + draw_reference(USUAL, stamps, rng))
    ids = frozenset({"base.saturation", "base.dead_zone_v", "base.gain_v"})
    problem = Problem([prepare(run, MODEL)], MODEL, NOISE, ids=ids)
    top = problem.fit(["base.saturation"], {})
    found = search.search(problem, lambda _: None, [top])
    best = {next(iter(fit.ids)): fit for fit in reversed(found.fits) if len(fit.ids) == 1}
    assert {"base.dead_zone_v", "base.gain_v"} <= set(found.confounded[0])
    # That the top speed lies just below the one that was driven would be chance.
    assert abs(best["base.saturation"].log_likelihood - best["base.gain_v"].log_likelihood) < 0.5
    assert best["base.saturation"].score < best["base.gain_v"].score - 1.0


@pytest.mark.parametrize(("best", "told"), [("a b", ("a", "b")), ("a", ("a", "c"))])
def test_what_acts_for_sure_is_told_as_a_set_where_no_effect_is_certain(best, told):
    found = found_of({"a": 0.86, "b": 0.02, "c": 0.05}, fit_of(best, 200.0))
    assert explain._open(found) == told
