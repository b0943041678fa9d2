# SPDX-License-Identifier: BSD-3-Clause
"""What is said of an effect that is found but not certain: sets, curves that draw it, other forms of it."""

from types import SimpleNamespace

import numpy as np
import pytest

from kurumaisu.bench import hidden_effect
from kurumaisu.critic import replay
from kurumaisu.critic.drive import GRID, Drive, prepare
from kurumaisu.critic.evidence import Fit, Problem
from kurumaisu.critic.noise import Noise
from kurumaisu.critic.smooth import Belief, Design
from kurumaisu.critic.smooth_alike import Likeness
from kurumaisu.critic.stand_ins import Posterior, confounded
from kurumaisu.params import EffectSetting, load_model, shipped

MODEL = load_model(shipped("launch/md100.yaml"))
NOISE = Noise(position_sd=0.005, heading_sd=0.005, sd_v=0.01, sd_lateral=0.003, sd_w=0.02, tau=0.3)


def posterior(*sets):
    """Return the posterior of sets given as (weight, names)."""
    ranked = [SimpleNamespace(ids=frozenset(names.split())) for _, names in sets]
    return Posterior(ranked, np.array([weight for weight, _ in sets]))


def test_one_for_one_stand_ins_make_a_set():
    assert confounded(posterior((0.5, "a b"), (0.3, "a c"), (0.2, "a d"))) == (("b", "c", "d"),)


def test_what_needs_others_beside_it_is_in_no_set_where_others_do():
    assert confounded(posterior((0.55, "b"), (0.4, "c"), (0.05, "d e"))) == (("b", "c"),)


def test_two_that_stand_in_for_three_are_a_set_rather_than_nothing():
    """Something acts beside a, for sure: b and c and d, or e and f with neither of them."""
    assert confounded(posterior((0.5, "a b c d"), (0.5, "a e f"))) == (("b", "c", "d", "e", "f"),)


def test_what_may_not_act_at_all_is_in_no_set():
    assert confounded(posterior((0.6, "b"), (0.4, ""))) == ()


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


@pytest.fixture(scope="module")
def understeering():
    """Return a problem of chairs that understeer, without noise, the fit of that, and of nothing."""
    effect = EffectSetting("base.understeer", {"k": 0.5})
    drives = []
    for seed in range(2):
        run = hidden_effect.make_run(None, 0.0, seed, 40.0, hidden_effect.USUAL)
        made = prepare(recorded(run), MODEL)
        drives.append(made.seen_at(made.times, replay.path(made, MODEL, [effect])))
    problem = Problem(drives, MODEL, NOISE, ids=frozenset({"base.understeer"}))
    return problem, problem.fit(["base.understeer"], {}), problem.fit([], {})


def recorded(tables):
    from kurumaisu.bench.critic import recording_of

    return recording_of("made", [tables]).runs[0]


@pytest.mark.parametrize(("channel", "covariate", "drawn"), [("w_gain", "abs_v", True), ("v_gain", "time", False)])
def test_a_curve_speaks_for_the_effect_that_it_draws(understeering, channel, covariate, drawn):
    problem, best, nothing = understeering
    design = Design(problem, ())
    (curve,) = (c for c in design.curves if (c.channel, c.basis.covariate) == (channel, covariate))
    belief = Belief(0.0, 0.04 * np.eye(curve.basis.size))
    found = Likeness(problem, best, design).drawn(nothing, curve, belief)
    assert set(found) == ({"base.understeer"} if drawn else set())
    assert isinstance(best, Fit)
    if drawn:  # the larger the effect, the more its equation may be off
        assert 3.0 < found["base.understeer"] < 0.05 * best.log_likelihood - 0.05 * nothing.log_likelihood
        assert Likeness(problem, best, design).drawn(best, curve, belief) == {}
