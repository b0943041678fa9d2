# SPDX-License-Identifier: BSD-3-Clause
"""Effects of the laser beside one another: two that look alike, one that contains another, what moves few readings."""

import numpy as np
import pytest

from kurumaisu import effects
from kurumaisu.critic.judge.scan_verdict import size_of
from kurumaisu.critic.ranges.noise.scan_noise import CommonMode, NoiseLikelihood, common_mode, estimate
from kurumaisu.critic.ranges.noise.shared_errors import Gram, Grams, Layout, ScanNoise
from kurumaisu.critic.ranges.search.effect_sets import FormSearch
from kurumaisu.critic.ranges.signals.effect_columns import Column, Form
from kurumaisu.critic.scatter.common_offset import beyond_own_offset, own_sd, with_common_offset
from kurumaisu.critic.scatter.likelihood import StatisticKinds, StatisticsLikelihood
from kurumaisu.critic.scatter.scatter_fit import ScatterFit
from kurumaisu.critic.scatter.scatter_search import ScatterEffect, ScatterSearch
from kurumaisu.critic.values.recording import Recording, Run, Series
from kurumaisu.critic.values.verdict import NORMAL90
from kurumaisu.params import EffectSetting


class _Powers:
    """Logs of powers: of readings near to far, and of the beams' means, which offsets of the beams raise most."""

    sd = np.linspace(1.0, 1.5, 10)

    def kinds(self):
        none = np.zeros(11, dtype=bool)
        return StatisticKinds(none, none)

    def null(self, effect):
        return {p.name: p.null for p in effect.parameters}

    def nulls(self, seeds):
        return np.array([self((), seed) for seed in seeds])

    def __call__(self, settings, seed):
        wider, own = 1.0, 0.0
        for setting in settings:
            if setting.id == "laser.range_noise":
                wider = 1 + setting.parameters["share"]
            if setting.id == "laser.beam_bias":
                own = setting.parameters["sd"] / 0.003
        powers = np.append((self.sd * wider) ** 2 + own**2, wider**2 + 100 * own**2)
        return np.log(powers) + 0.03 * np.random.default_rng(seed).standard_normal(11)


def _at(name, **values):
    return EffectSetting(name, {**{p.name: p.null for p in effects.by_id(name).parameters}, **values})


def test_two_effects_act_together_though_each_explains_nearly_all_alone():
    truth = [_at("laser.range_noise", share=0.6), _at("laser.beam_bias", sd=0.002)]
    ids = frozenset({"laser.range_noise", "laser.beam_bias"})
    simulate = _Powers()
    means = ["laser.beam_bias.amplitude", "laser.beam_bias.phase", "laser.range_noise.slope"]
    found = {
        each.setting.id: each for each in ScatterSearch(ScatterFit(simulate, simulate(truth, 5), means, ids)).run()
    }
    assert set(found) == ids
    assert found["laser.range_noise"].setting.parameters["share"] == pytest.approx(0.6, abs=0.1)


def test_numbers_that_nothing_explains_yet_do_not_bend_what_explains_others():
    nulls = np.random.default_rng(1).standard_normal((50, 3))
    likeness = StatisticsLikelihood(
        nulls,
        np.array([80.0, 5.0, 5.0]),
        StatisticKinds(np.zeros(3, dtype=bool), np.zeros(3, dtype=bool)),
        np.ones(3, dtype=bool),
    )
    right, bent = np.array([0.0, 5.0, 5.0]), np.array([2.0, 17.0, 17.0])
    assert likeness.cost(right) < likeness.cost(bent)
    step = likeness.step(right, np.array([[2.0, 12.0, 12.0]]))
    assert abs(step[0]) < 0.4, "the number that is far off would have it all the way"


def test_a_tenth_more_readings_beyond_three_deviations_matters_to_nobody():
    """So many come with a spread that differs by less than anyone minds."""
    nulls = np.array([24.0, 1.2]) + 0.1 * np.random.default_rng(1).standard_normal((50, 2))
    likeness = StatisticsLikelihood(
        nulls,
        np.array([25.2, 1.2]),
        StatisticKinds(np.ones(2, dtype=bool), np.zeros(2, dtype=bool)),
        np.ones(2, dtype=bool),
    )
    many, few = likeness.units(likeness.measured + np.array([0.0, 3.0]))
    assert many < 0.9
    assert few > 2.9


def test_what_grows_with_the_range_otherwise_than_its_law_is_one_doubt_not_many():
    """Four numbers are off by as much as a form may do to each, all together from near to far."""
    nulls = 0.01 * np.random.default_rng(1).standard_normal((50, 4))
    none, along = np.zeros(4, dtype=bool), np.linspace(-1.0, 1.0, 4)
    measured = 2.0 * (1 + 0.15 * along)
    costs = []
    for trends in (np.empty((0, 0)), along[np.newaxis]):
        likeness = StatisticsLikelihood(nulls, measured, StatisticKinds(none, none, trends), ~none)
        costs.append(likeness.cost(np.full(4, 2.0)) - likeness.cost(measured))
    assert costs[0] > 2.0
    assert costs[1] < 1.0


def test_noise_of_a_footprint_is_noise_by_obliqueness_and_not_by_the_range_as_well():
    """It grows with the square of the range; the law is alike at any."""
    ranges = np.array([0.8, 1.4, 1.9, 2.6])
    nulls = 0.03 * np.random.default_rng(1).standard_normal((50, 4))
    none, folds = np.zeros(4, dtype=bool), np.log(ranges) - np.mean(np.log(ranges))
    footprint = np.log1p(0.8 * ranges**2 / np.mean(ranges**2))
    law = np.full(4, np.mean(footprint))
    costs = []
    for known in (folds, np.zeros(4)):
        likeness = StatisticsLikelihood(nulls, footprint, StatisticKinds(none, none, folds=known), ~none)
        costs.append(likeness.cost(law) - likeness.cost(footprint))
    assert costs[0] < 8.0
    assert costs[1] > 50.0


def _forms():
    offset = effects.by_id("laser.offset").parameters[0]
    warmth = effects.by_id("laser.temperature").parameters[0]
    one = Form("laser.offset", {}, (Column(offset, squared=False, beside={}),), 0)
    sides = tuple(Column(warmth, squared=False, beside={"reference": at}) for at in (10.0, 40.0))
    return [one, Form("laser.temperature", {"reference": 10.0}, sides, 1, between=False)]


@pytest.mark.parametrize(("slope", "named"), [(0.0, "laser.offset"), (8.0, "laser.temperature")])
def test_what_hardly_varies_with_the_temperature_is_an_offset(slope, named):
    temperature = np.linspace(20.0, 21.0, 400)
    x = np.stack([np.ones(400), temperature - 10.0, temperature - 40.0], axis=1)
    y = 0.2 + slope * (temperature - 20.5) + 0.5 * np.random.default_rng(2).standard_normal(400)
    rows = np.column_stack([x, y]) / 0.5
    found = FormSearch(_forms(), rows.T @ rows).run()
    assert found.best.ids == {named}
    assert found.p[named] > 0.95
    assert found.confounded == ()


def test_what_an_effect_does_to_few_readings_is_not_divided_by_all():
    dark = np.zeros(1000)
    dark[:50] = 1e-3
    assert size_of(dark) == pytest.approx(1e-3)
    assert size_of(np.full(1000, -2e-4)) == pytest.approx(2e-4)
    assert size_of(np.zeros(1000)) == 0.0


def _scans(common, seed, scans=250, readings=400, sd=0.004):
    """Grams of scans whose only columns are the common mode and the residual, and their layout."""
    rng = np.random.default_rng(seed)
    mode = np.zeros(scans)
    for k in range(scans):
        mode[k] = 0.8 * mode[k - 1] + 0.6 * rng.standard_normal() if k else rng.standard_normal()
    grams = []
    for k in range(scans):
        rows = np.column_stack([np.ones(readings), common * mode[k] + sd * rng.standard_normal(readings)]) / sd
        grams.append(Gram(rows.T @ rows, 0, 1))
    nowhere = np.full(scans, -1)
    return Grams.summed(grams), Layout(0.1 * np.arange(scans), np.zeros(scans, dtype=int), nowhere)


def _weighed(common, seed, own=0.0):
    grams, layout = _scans(common, seed)
    none = np.arange(0)
    likelihood = NoiseLikelihood(grams, layout, none)
    noise = estimate(likelihood, (0.005, 0.005))
    return common_mode(likelihood, (0.005, 0.005), noise, own), noise


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_all_scans_tell_whether_they_have_a_common_mode(seed):
    seen, noise = _weighed(3e-4, seed)
    assert seen.nats > 10
    assert abs(np.log(noise.common_sd / 3e-4)) < 3 * seen.log_sd
    assert _weighed(0.0, seed)[0].nats < 2


@pytest.mark.parametrize(("common", "own", "news"), [(3e-4, 3e-4, False), (9e-4, 3e-4, True), (0.0, 3e-4, True)])
def test_scans_that_are_off_together_as_in_the_model_are_no_news(common, own, news):
    seen, noise = _weighed(common, 2, own)
    found = with_common_offset([], seen, noise, _recording(), None)
    assert [each.setting.id for each in beyond_own_offset(found, 2e-4, own)] == (["laser.common_mode"] if news else [])
    assert own_sd([_at("laser.common_mode", sd=own, rho=0.7), _at("laser.dropout", probability=0.1)]) == own


def test_scans_that_are_off_by_as_much_as_they_may_have_something_else_that_is_wrong():
    """Walls that stand elsewhere had a common mode of 0.1 m beside them."""
    seen, noise = _weighed(0.3, 1)
    assert noise.common_sd == pytest.approx(0.1)
    assert with_common_offset([], seen, noise, _recording(), None) == []


def _recording():
    stamps = 0.1 * np.arange(50)
    scan = Series(stamps, np.ones((50, 2)), ("r0", "r1"))
    return Recording("scans", (Run("a", scan=scan),), train=("a",))


def test_what_is_known_by_its_log_has_the_interval_of_its_log():
    noise, vague = ScanNoise(0.005, 0.005, 4e-4, 0.05), CommonMode(20.0, 0.3, 1.5)
    (found,) = with_common_offset([], vague, noise, _recording(), None)
    for name, ends in (
        ("sd", 4e-4 * np.exp(NORMAL90 * 0.3 * np.array([-1, 1]))),
        ("rho", np.exp(-0.1 / (0.05 * np.exp(NORMAL90 * 1.5 * np.array([-1, 1]))))),
    ):
        below, above = found.sds[name]
        value = found.setting.parameters[name]
        np.testing.assert_allclose([value - NORMAL90 * below, value + NORMAL90 * above], ends, rtol=1e-6)


def test_a_common_mode_that_all_scans_show_is_named_unless_something_may_stand_in_for_it():
    noise, sure = ScanNoise(0.005, 0.005, 4e-4, 0.45), CommonMode(20.0, 0.1, 0.2)
    (found,) = with_common_offset([], sure, noise, _recording(), None)
    assert found.setting.id == "laser.common_mode"
    assert found.p > 0.99
    assert found.setting.parameters["sd"] == pytest.approx(4e-4)
    assert found.setting.parameters["rho"] == pytest.approx(np.exp(-0.1 / 0.45))
    assert with_common_offset([], CommonMode(3.0, 0.5, 0.9), noise, _recording(), None) == []
    taken = ScatterEffect(_at("laser.heavy_tails", inverse_nu=0.2), 0.6, 9.0, {}, {"laser.common_mode": 0.4})
    assert with_common_offset([taken], sure, noise, _recording(), None) == [taken]


def test_a_common_mode_as_small_as_what_equations_miss_is_none():
    seen = [
        ScatterEffect(_at("laser.common_mode", sd=4e-4, rho=0.5), 1.0, 20.0, {}, {}),
        ScatterEffect(_at("laser.dropout"), 1.0, 20.0, {}, {}),
    ]
    assert beyond_own_offset(seen, 3e-4) == seen
    assert beyond_own_offset(seen, 5e-4) == seen[1:]
