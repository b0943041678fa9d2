# SPDX-License-Identifier: BSD-3-Clause
"""What is said of an effect that is found but not certain: sets, curves that draw it, other forms of it."""

from dataclasses import replace
from types import SimpleNamespace

import hidden_effect
import numpy as np
import pytest
from hidden_effect import recording_of
from scipy.special import logit

from kurumaisu.bench.hidden import Ask, make
from kurumaisu.bench.hidden.base.catalogue import BASE
from kurumaisu.bench.hidden.base.recordings import run_of
from kurumaisu.bench.hidden.generator.motion import STEP, Setting
from kurumaisu.bench.hidden.generator.motion import drive as hidden_drive
from kurumaisu.bench.hidden.generator.noise import USUAL, draw_rates, draw_reference
from kurumaisu.critic.base import replay
from kurumaisu.critic.base.drive import GRID, Drive, prepare
from kurumaisu.critic.engine import neighbouring_sets, refit, search
from kurumaisu.critic.engine.catalogue import Candidate, Term
from kurumaisu.critic.engine.confounding import SetPosterior, confounded
from kurumaisu.critic.engine.evidence import Problem
from kurumaisu.critic.engine.linear_screening import Screen
from kurumaisu.critic.engine.search import SearchResult
from kurumaisu.critic.judge import explain
from kurumaisu.critic.judge.decide import Decision
from kurumaisu.critic.judge.held_out_pruning import confirmed_part, leave_one_out, untested
from kurumaisu.critic.noise.base_noise import Noise, NoiseGrowth, NoiseResiduals, whitener
from kurumaisu.critic.sanity import examination
from kurumaisu.critic.unknown.beyond_catalogue import Beyond, undecided
from kurumaisu.critic.unknown.comparison import CurveComparison
from kurumaisu.critic.unknown.curves import CurveEvidence
from kurumaisu.critic.unknown.designs import Designs
from kurumaisu.critic.unknown.effect_likeness import EffectLikeness
from kurumaisu.critic.values.policy import FORM_ERROR
from kurumaisu.critic.values.verdict import Gain, LogDensityGain
from kurumaisu.effects import Parameter
from kurumaisu.params import EffectSetting, load_model, shipped

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


def test_where_a_law_swallows_commands_nothing_shakes_and_nothing_tells_of_growth():
    """Told to turn slowly a chair rests: as still as one told to rest, and no slow turn of little noise."""
    asked = drive(np.zeros(6), [0.8, 0.0, 0.0, 0.0, 0.1, 0.1])
    swallowed = replace(asked, still=np.repeat([False, False, False, False, True, True], 50))
    rests = drive(np.zeros(6), [0.8, 0.0, 0.0, 0.0, 0.0, 0.0])
    np.testing.assert_array_equal(swallowed.activity, rests.activity)
    np.testing.assert_allclose(swallowed.pace, rests.pace)
    assert asked.activity[-1] > 5 * swallowed.activity[-1]


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


@pytest.fixture(scope="module")
def understeering():
    """Return a problem of chairs that understeer, without noise, the fit of that, and of nothing."""
    effect = EffectSetting("base.understeer", {"k": 0.5})
    drives = []
    for seed in range(2):
        run = hidden_effect.make_run(None, 0.0, seed, 40.0, hidden_effect.USUAL)
        made = prepare(recording_of("made", [run]).runs[0], MODEL)
        drives.append(made.seen_at(made.times, replay.path(made, MODEL, [effect])))
    problem = Problem(drives, MODEL, NOISE, ids=frozenset({"base.understeer"}))
    return problem, problem.fit(["base.understeer"], {}), problem.fit([], {})


@pytest.mark.parametrize(("channel", "covariate", "drawn"), [("w_gain", "abs_v", True), ("v_gain", "time", False)])
def test_a_curve_speaks_for_the_effect_that_it_draws(understeering, channel, covariate, drawn):
    problem, best, nothing = understeering
    designs = Designs(problem, nothing)
    (curve,) = (c for c in designs.about(nothing).curves if (c.channel, c.basis.covariate) == (channel, covariate))
    belief = CurveEvidence(0.0, 0.04 * np.eye(curve.basis.size))
    found = EffectLikeness(problem, best, designs).drawn(nothing, curve, belief)
    assert set(found) == ({"base.understeer"} if drawn else set())
    if drawn:  # the larger the effect, the more its equation may be off
        assert 3.0 < found["base.understeer"] < 0.05 * best.log_likelihood - 0.05 * nothing.log_likelihood


@pytest.mark.parametrize(
    ("channel", "covariate", "mends"), [("w_gain", "abs_v", True), ("w_gain", "time", False), ("v", "time", False)]
)
def test_a_curve_beside_an_effect_may_be_what_its_equation_lacks(understeering, channel, covariate, mends):
    """Over what the effect follows it is no more than the same curve in the place of the effect would be."""
    problem, best, nothing = understeering
    designs = Designs(problem, best)
    (curve,) = (c for c in designs.about(best).curves if (c.channel, c.basis.covariate) == (channel, covariate))
    found = EffectLikeness(problem, best, designs).mended(best, curve)
    assert set(found) == ({"base.understeer"} if mends else set())
    assert EffectLikeness(problem, best, designs).mended(nothing, curve) == {}
    if mends:
        signal = 2 * (best.log_likelihood - nothing.log_likelihood)
        assert found["base.understeer"] == pytest.approx(0.5 * FORM_ERROR**2 * signal, rel=0.05)


def fit_of(names, score):
    ids = frozenset(names.split())
    return SimpleNamespace(ids=ids, candidates=ids, score=score, settings=())


def found_of(p, *fits):
    return SearchResult((*fits, fit_of("", 0.0)), p, (), 0.0)


@pytest.mark.parametrize(
    ("p_effect", "p_curve", "p_nothing", "said"),
    [(0.55, 0.44, 0.01, True), (0.95, 0.04, 0.01, False), (0.5, 0.2, 0.3, False), (0.55, 0.1, 0.0, False)],
)
def test_an_effect_or_a_curve_for_sure_is_not_nothing(p_effect, p_curve, p_nothing, said):
    found = found_of({"a": p_effect}, fit_of("a", 40.0))
    rivalry = CurveComparison((SimpleNamespace(),), 0.0, {"smooth.w.v": p_curve}, {"a": logit(p_effect)}, p_nothing)
    assert undecided(found, rivalry) is said


def gain(value):
    density = LogDensityGain(1.0, 1.0 + value, value, value - 0.05, value + 0.05)
    return Gain(density)


def decision(p, *fits):
    nothing = Beyond(CurveComparison((), -np.inf, {}, {}, 0.0), None, 1.0)
    return Decision(SimpleNamespace(), found_of(p, *fits), NoiseGrowth(0.0, 0.0, NOISE), nothing)


def test_an_uncertain_effect_that_held_out_data_refuse_is_left_out():
    made = decision({"a": 1.0, "b": 0.7}, fit_of("a b", 50.0), fit_of("a c", 49.5), fit_of("a", 49.0))
    other, worth = confirmed_part(made, gain(-0.1), lambda one: gain(0.2 if one.found.best.ids == {"a"} else -0.1))
    assert other.found.best.ids == {"a"}
    assert worth == gain(0.2)


def test_what_is_certain_or_confirmed_is_kept():
    certain = decision({"a": 1.0, "b": 0.95}, fit_of("a b", 50.0), fit_of("a", 45.0))
    assert confirmed_part(certain, gain(-0.1), lambda _: gain(0.2)) == (certain, gain(-0.1))
    confirmed = decision({"a": 1.0, "b": 0.7}, fit_of("a b", 50.0), fit_of("a", 49.0))
    assert confirmed_part(confirmed, gain(0.2), lambda _: gain(0.3)) == (confirmed, gain(0.2))


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
    monkeypatch.setattr("kurumaisu.critic.judge.held_out_pruning.expected_nats", lambda *_: seen)
    made = decision({"a": 1.0}, fit_of("a", nats))
    assert untested(made, gain(held), ()) is silent
    assert not untested(made, None, ())


@pytest.mark.parametrize(("told", "without", "best"), [(True, 0.2, ""), (False, 0.2, "a"), (False, -0.1, "")])
def test_a_curve_that_does_not_hold_hides_no_effects_that_do(monkeypatch, told, without, best):
    """It took all their probability; where nobody would be told of it, they are weighed by themselves."""
    monkeypatch.setattr("kurumaisu.critic.judge.explain_unknown.is_reported", lambda *_: told)
    twins = [SimpleNamespace(**vars(fit_of(name, 40.0)), log_likelihood=44.0, sizes=1, terms=()) for name in "ab"]
    nothing = SimpleNamespace(**vars(fit_of("", 0.0)), log_likelihood=0.0, sizes=0, terms=())
    found = SearchResult((*twins, nothing), {"a": 0.0, "b": 0.0}, (), 0.0)
    curved = Beyond(CurveComparison((), 5.0, {}, {}, 0.0), SimpleNamespace(), 0.0)
    made = Decision(SimpleNamespace(), found, NoiseGrowth(0.0, 0.0, NOISE), curved)
    other, worth = confirmed_part(made, gain(-0.1), lambda one: gain(without if one.beyond.extension is None else -0.1))
    assert (other is made) is (best == "")
    assert worth == gain(0.2 if best else -0.1)
    if best:
        assert other.found.confounded == (("a", "b"),)
        assert other.found.p["a"] == pytest.approx(0.5, abs=0.01)


@pytest.mark.parametrize("seed", [2, 17])
def test_another_steering_law_is_neither_a_unit_nor_a_sign(seed):
    """By the other law of V_s the chair hardly turns, and more like the volts' steps than like the rates asked for."""
    case = make(Ask("single", ("base.steering_law",), form="other", family="base"), seed)
    assert examination.examine(case.recording, MODEL).invalid == []


def test_another_form_is_tried_without_what_stood_in_for_it():
    """From a wrong form beside needless effects to the right form alone: no step alone is better."""
    zero, other = (Candidate("zero", (Term("zero", OFFSET, 0.0, rough=rough),), 2.0) for rough in (False, True))
    ahead, turning, also = (
        Candidate(name, (Term(name, OFFSET, 0.0),), 1.0) for name in ("base.gain_v", "base.gain_w", "base.lag_w")
    )
    problem = SimpleNamespace(candidates=(zero, other))
    screen = SimpleNamespace(fixed=(), parts=list, related=lambda *_: True, mends=lambda *_: True)

    def tried(*needless):
        chosen = frozenset({zero, *needless})
        start = {("zero", "offset"): 0.4}
        fit = SimpleNamespace(candidates=chosen, ids=frozenset(one.id for one in chosen), start=start)
        sets = list(neighbouring_sets.neighbouring_sets(problem, screen, screen, fit))
        # From its own size, and from that of the wrong form.
        assert {len(begin) for chosen, begin in sets if chosen == {other}} in (set(), {0, 1})
        return {chosen for chosen, _ in sets}

    assert frozenset({other}) in tried(ahead)
    assert frozenset({other}) in tried(ahead, turning)  # one in each rate
    assert frozenset({other}) not in tried(turning, also)
    assert frozenset({other, also}) in tried(turning, also)


@pytest.mark.parametrize(
    ("rough", "start", "again"),
    [
        (True, {"a": 0.0358}, True),
        (True, {"a": 0.0186}, False),
        (True, {"b": 1.0}, False),
        (False, {"a": 0.0358}, False),
    ],
)
def test_a_step_is_fitted_once_from_each_peak_it_may_be_on(rough, start, again):
    """No fit goes from a step of 18.4 mV to one of 35.8 mV, and before one it may look worse."""
    terms = Term("a", OFFSET, 0.0, rough=rough), Term("b", OFFSET, 0.0)
    fit = SimpleNamespace(candidates=frozenset("a"), terms=terms, values=[0.0184, 0.1])
    begun = set()
    told = [
        refit.other_step_size(fit, {(name, "offset"): size for name, size in start.items()}, begun) for _ in range(2)
    ]
    assert told == [again, False]


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
    found = search.search(problem, lambda _: None, top)
    best = {next(iter(fit.ids)): fit for fit in reversed(found.fits) if len(fit.ids) == 1}
    assert {"base.dead_zone_v", "base.gain_v"} <= set(found.confounded[0])
    # That the top speed lies just below the one that was driven would be chance.
    assert abs(best["base.saturation"].log_likelihood - best["base.gain_v"].log_likelihood) < 0.5
    assert best["base.saturation"].score < best["base.gain_v"].score - 1.0


def test_no_dozen_of_effects_is_pieced_together():
    """What is strong and in no catalogue would be followed a little by every effect: for minutes, and to no end."""
    screen = Screen.__new__(Screen)
    screen.alike = lambda *_: False
    some = [Candidate(f"effect {i}", (), 1.0) for i in range(7)]
    assert screen._allowed(frozenset(some[:6]))
    assert not screen._allowed(frozenset(some))


@pytest.mark.parametrize(("best", "told"), [("a b", ("a", "b")), ("a", ("a", "c"))])
def test_what_acts_for_sure_is_told_as_a_set_where_no_effect_is_certain(best, told):
    found = found_of({"a": 0.86, "b": 0.02, "c": 0.05}, fit_of(best, 200.0))
    assert explain._open(found) == told
