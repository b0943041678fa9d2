# SPDX-License-Identifier: BSD-3-Clause
"""Effects on the scatter: rivals weighed in the company that is found last, far outliers, scans that may speak."""

from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np
import pytest
from laser_scene import recording

from kurumaisu import effects
from kurumaisu.critic.judge.scan_verdict import criticise_scans
from kurumaisu.critic.ranges.noise.reading_noise import BeamNoise, _repeated, estimate_reading_noise
from kurumaisu.critic.ranges.noise.shared_errors import Layout, ScanNoise
from kurumaisu.critic.ranges.scans.beams import hits_of
from kurumaisu.critic.ranges.scans.gathering import gather
from kurumaisu.critic.ranges.scans.valid_readings import grid_step
from kurumaisu.critic.ranges.search.normal_equations import Assembly
from kurumaisu.critic.scatter.likelihood import StatisticKinds
from kurumaisu.critic.scatter.scatter_fit import ScatterFit, ScatterPiece
from kurumaisu.critic.scatter.scatter_search import ScatterSearch
from kurumaisu.critic.scatter.simulation import ScatterSimulator
from kurumaisu.critic.scatter.statistics import Statistics, _Edges, _once, _spacing
from kurumaisu.params import EffectSetting, load_model, shipped

MODEL = load_model(shipped("launch/md100.yaml"))
EVERYWHERE = (-np.inf, np.inf)  # readings that are cut off nowhere


@dataclass(frozen=True)
class _Linear:
    """Numbers that follow effects in proportion: marks by id.name, for a parameter at its scale."""

    marks: dict[str, tuple[float, ...]]

    def kinds(self):
        none = np.zeros(5, dtype=bool)
        return StatisticKinds(none, none)

    def null(self, effect):
        return {p.name: p.null for p in effect.parameters}

    def nulls(self, seeds):
        return np.array([self((), seed) for seed in seeds])

    def __call__(self, settings, seed):
        out = 0.02 * np.random.default_rng(seed).standard_normal(5)
        for setting in settings:
            for p in effects.by_id(setting.id).parameters:
                mark = np.array(self.marks.get(f"{setting.id}.{p.name}", (0.0,) * 5))
                out = out + mark * (setting.parameters[p.name] - p.null) / p.scale
        return out


def at(name, **values):
    """A setting of an effect with these values, the others as of none."""
    return EffectSetting(name, {**{p.name: p.null for p in effects.by_id(name).parameters}, **values})


def test_what_is_likeliest_alone_is_weighed_again_in_company():
    simulate = _Linear(
        {
            "laser.quantisation.step": (3.0, 3.0, 3.0, 3.0, 0.0),
            "laser.beam_correlation.rho": (0.0, 0.0, 0.6, 0.6, 4.0),
            "laser.incidence_noise.gain": (3.0, 3.0, 3.6, 3.6, 0.0),
        }
    )
    truth = [at("laser.quantisation", step=0.01), at("laser.beam_correlation", rho=0.3)]
    ids = frozenset({"laser.quantisation", "laser.beam_correlation", "laser.incidence_noise"})
    found = ScatterSearch(ScatterFit(simulate, simulate(truth, 5), (), ids)).run()
    assert {each.setting.id for each in found} == {setting.id for setting in truth}


class _Tails(_Linear):
    """As tails do: how wide the core is shows only where there are tails."""

    def __call__(self, settings, seed):
        return super().__call__(
            [
                EffectSetting(
                    one.id, {**one.parameters, "core": one.parameters["core"] * (one.parameters["inverse_nu"] > 0)}
                )
                if "core" in one.parameters
                else one
                for one in settings
            ],
            seed,
        )


def test_tails_that_widen_the_noise_are_no_wider_noise_besides():
    """Wider noise is taken first, for it explains most; the tails are then of another form beside it than alone."""
    simulate = _Tails(
        {
            "laser.range_noise.share": (3.0, 3.0, 3.0, 3.0, 3.0),
            "laser.heavy_tails.inverse_nu": (0.0, 0.0, 0.0, 0.0, 3.0),
            "laser.heavy_tails.core": (3.0, 3.0, 3.0, 3.0, 3.0),
        }
    )
    truth = [at("laser.heavy_tails", inverse_nu=0.2, core=0.5)]
    ids = frozenset({"laser.heavy_tails", "laser.range_noise"})
    found = ScatterSearch(ScatterFit(simulate, simulate(truth, 5), (), ids)).run()
    assert [each.setting.id for each in found] == ["laser.heavy_tails"]
    assert found[0].setting.parameters["core"] == pytest.approx(0.5, rel=0.2)


def test_it_is_not_certain_which_of_two_alike_acts():
    simulate = _Linear({"laser.quantisation.step": (1.0,) * 5, "laser.incidence_noise.gain": (1.0,) * 5})
    ids = frozenset({"laser.quantisation", "laser.incidence_noise"})
    (found,) = ScatterSearch(ScatterFit(simulate, simulate([at("laser.quantisation", step=0.01)], 5), (), ids)).run()
    assert found.p < 0.9
    assert sum(found.rivals.values()) + found.p == pytest.approx(1.0, abs=1e-6)


def test_odds_between_effects_of_which_none_fits_are_worth_less():
    """As long as something makes numbers what neither of both makes them."""
    simulate = _Linear(
        {
            "laser.quantisation.step": (1.0, 1.0, 1.0, 1.0, 0.0),
            "laser.incidence_noise.gain": (1.0, 1.0, 1.0, 0.6, 0.0),
        }
    )
    ids = frozenset({"laser.quantisation", "laser.incidence_noise"})
    doubts = []
    for strange in (0.0, 2.0):
        measured = simulate([at("laser.quantisation", step=0.01)], 5) + np.array([0.0, 0.0, 0.0, 0.0, strange])
        (found,) = ScatterSearch(ScatterFit(simulate, measured, (), ids)).run()
        assert found.setting.id == "laser.quantisation"
        assert found.p + sum(found.rivals.values()) == pytest.approx(1.0, abs=1e-3)
        doubts.append(1 - found.p)
    assert doubts[1] > 3 * doubts[0]


def test_what_may_have_either_sign_crosses_zero_though_it_was_taken_for_next_to_nothing():
    simulate = _Linear(
        {
            "laser.range_noise.share": (6.0, 6.0, 6.0, 6.0, 6.0),
            "laser.range_noise.slope": (-4.0, -2.0, 0.0, 3.0, 6.0),
        }
    )
    ids = frozenset({"laser.range_noise"})
    fit = ScatterFit(simulate, simulate([at("laser.range_noise", share=0.3, slope=0.0013)], 5), (), ids)
    start = at("laser.range_noise", share=0.6, slope=-5e-5)
    (found,), _ = fit.together([ScatterPiece(effects.by_id(start.id), start, ("share", "slope"))], ())
    assert found.setting.parameters["slope"] == pytest.approx(0.0013, rel=0.2)


@pytest.mark.parametrize(
    ("name", "parameter", "size", "least", "most"),
    [
        ("laser.heavy_tails", "outliers", 0.1, 0.025, 0.035),
        ("laser.quantisation", "step", 0.01, 0.0, 0.001),
    ],
)
def test_another_form_may_pass_for_another_size_however_many_numbers_follow_it(name, parameter, size, least, most):
    """A grid is a grid, but outliers come in many ways."""
    simulate = _Linear({f"{name}.{parameter}": (9.0, 9.0, 9.0, 9.0, 9.0)})
    truth = [at(name, **{parameter: size})]
    (found,) = ScatterSearch(ScatterFit(simulate, simulate(truth, 5), (), frozenset({name}))).run()
    below, above = found.sds[parameter]
    assert least < below < most
    assert above > 1.5 * below or name == "laser.quantisation", "a factor of two either way"


def _assembly(tmp_path):
    return Assembly(gather(recording(tmp_path, None, 0.0, 1, scans=12), MODEL), frozenset())


def test_noise_of_heavy_tails_hardly_goes_as_far_as_readings_of_something_else(tmp_path):
    assembly = _assembly(tmp_path)
    statistics = Statistics(assembly, ScanNoise(0.002, 0.001, 1e-4, 1.0))
    missed = np.empty((*assembly.residual.shape, 0))
    simulate, names = ScatterSimulator(assembly.shots, assembly.marks, statistics, missed), statistics.names()
    far = next(i for i, name in enumerate(names) if name.startswith("readings more than 25"))
    plain, tails, bursts = (
        simulate(settings, 3)[far]
        for settings in ((), [at("laser.heavy_tails", inverse_nu=0.3)], [at("laser.crosstalk", probability=0.1)])
    )
    assert tails - plain < 4.0
    assert bursts - plain > 10.0


@pytest.mark.parametrize("seed", [3, 4, 5])
def test_outliers_that_come_together_are_more_than_chance_however_few_they_are(tmp_path, seed):
    assembly = _assembly(tmp_path)
    statistics = Statistics(assembly, ScanNoise(0.002, 0.001, 1e-4, 1.0))
    missed = np.empty((*assembly.residual.shape, 0))
    simulate, names = ScatterSimulator(assembly.shots, assembly.marks, statistics, missed), statistics.names()
    many, crowded = (names.index(n) for n in names if n.startswith(("readings more than 6 sd", "more than chance")))
    even = at("laser.heavy_tails", outliers=0.03, anywhere=1.0)
    few, bursts = (at("laser.crosstalk", probability=p, width=w) for p, w in ((0.03, 6.3), (0.3, 0.3)))
    for one, least, most in ((even, -3.0, 3.0), (few, -3.0, 3.0), (bursts, 5.0, 30.0)):
        numbers = simulate([one], seed)
        assert numbers[many] > 10.0
        assert least < numbers[crowded] < most


@pytest.mark.parametrize("probability", [0.001, 0.02])
def test_a_few_lost_readings_are_told_as_too_few_to_matter(tmp_path, probability):
    """Half a percent of anything is where it begins to."""
    data = recording(tmp_path, "laser.dropout", probability, 1, scans=60)
    found = criticise_scans(data, MODEL, lambda _: None)
    if probability < 0.005:
        assert not found.causes
        assert found.small == ("laser.dropout",)
        assert any(line.startswith("laser.dropout: detectable, but too small") for line in found.details)
    else:
        assert [cause.id for cause in found.causes] == ["laser.dropout"]
        assert not found.small


@pytest.mark.parametrize("share", [1.5e-4, 0.004])
def test_a_reading_now_and_then_that_is_elsewhere_matters_to_nobody(tmp_path, share):
    data = recording(tmp_path, "laser.heavy_tails", share, 1, scans=120)
    found = criticise_scans(data, MODEL, lambda _: None)
    if share < 0.001:
        assert not found.causes
        assert not found.confounded
        assert len(found.small) == 1
    else:
        assert [cause.id for cause in found.causes] == ["laser.heavy_tails"]
        assert not found.small


def test_it_is_told_how_many_readings_an_effect_takes_away_and_makes_others(tmp_path):
    assembly = _assembly(tmp_path)
    statistics = Statistics(assembly, ScanNoise(0.002, 0.001, 1e-4, 1.0))
    missed = np.empty((*assembly.residual.shape, 0))
    simulate = ScatterSimulator(assembly.shots, assembly.marks, statistics, missed)
    assert simulate.touched(at("laser.dropout", probability=0.02)) == (pytest.approx(0.02, abs=0.005), 0.0)
    assert simulate.touched(at("laser.heavy_tails", outliers=0.01)) == (0.0, pytest.approx(0.01, abs=0.003))
    assert simulate.touched(at("laser.range_noise", share=0.1))[1] > 0.1


def test_readings_of_something_else_pull_no_scan_away(tmp_path):
    """What is metres off is off by no error of a pose; the first fit of a scan must not give way to it."""
    assembly = _assembly(tmp_path)
    statistics = Statistics(assembly, ScanNoise(0.002, 0.001, 1e-4, 1.0))
    error = 0.001 * np.random.default_rng(2).standard_normal(assembly.residual.shape)
    wild = error.copy()
    wild[:, 300:340] += 2.0
    left = statistics._leftover(wild, EVERYWHERE)[0]
    assert np.nanmedian(np.abs(np.delete(left, np.s_[300:340], axis=1))) < 1.0
    every = assembly.first.valid
    assembly.residual = np.where(every, wild, np.nan)
    settled = assembly.settle((0.002, 0.001))
    assert settled.beam_noise.valid.sum() > 0.9 * np.delete(every, np.s_[300:340], axis=1).sum()


def test_what_errors_of_the_poses_move_is_no_reading_of_something_else(tmp_path):
    """A heading that errs moves what an oblique beam reads by a hundred deviations, and all of it can be fitted."""
    assembly = _assembly(tmp_path)
    statistics = Statistics(assembly, ScanNoise(0.002, 0.005, 1e-4, 1.0))
    turned = 0.015 * np.nan_to_num(assembly.poses[:, :, 2])
    assert np.abs(turned / assembly.first.sd)[assembly.geometry].max() > 30
    left = statistics._leftover(turned, EVERYWHERE)[0]
    assert np.nanmax(np.abs(left)) < 1.5


def test_how_few_steep_readings_scatter_is_known_for_them():
    """Noise of a footprint grows with the tangent; walls are seen steeply by one beam in fifty."""
    rng = np.random.default_rng(6)
    steep = np.radians(np.where(rng.random((200, 300)) < 0.02, rng.uniform(65, 75, (200, 300)), 40.0))
    steep = np.where(steep < np.radians(60), np.radians(rng.uniform(0, 50, steep.shape)), steep)
    ranges = rng.uniform(1.0, 2.5, steep.shape)
    sd = np.hypot(0.002, 0.0007 * ranges * np.tan(steep))
    first = BeamNoise(np.full(steep.shape, 0.002), 0.0, np.ones(steep.shape, dtype=bool))
    seen = SimpleNamespace(ranges=ranges, incidence=steep)
    left = sd * rng.standard_normal(sd.shape)
    layout = Layout(np.arange(200.0), np.zeros(200, dtype=int), np.full(200, -1))
    found = estimate_reading_noise(first, first, lambda _: left, seen, layout, 0.001).sd
    assert np.sqrt(np.mean((sd / found)[steep > np.radians(65)] ** 2)) == pytest.approx(1.0, abs=0.1)


def test_scans_at_a_jump_of_the_rates_say_nothing_about_the_scatter(tmp_path):
    assembly = _assembly(tmp_path)
    before = assembly.smooth_rows()
    jumped = before[len(before) // 2]
    assembly.kinked[assembly.shots.run[jumped]][assembly.hats[jumped].rows] = True
    left = assembly.smooth_rows()
    assert jumped not in left
    assert len(left) >= len(before) - 3, "its neighbours rest on some of its poses, and no others do"
    assert len(assembly.thinned(left).shots.stamps) == len(left)


def test_readings_of_no_surface_about_a_beam_are_told(tmp_path):
    """Between both sides of an edge, clear of them: not what another pose sees, a nearer thing, or a longer scale."""
    assembly = _assembly(tmp_path)
    still = np.zeros(assembly.residual.shape)
    edges = _Edges(assembly, still + 0.002, still + 0.01)
    base = assembly.marks.base
    assert not edges.mixed(base).any()
    assert not edges.mixed(1.006 * base).any()
    turned = hits_of(assembly.shots, (), 0, shift=np.array([0.0, 0.0, 0.003]), like=assembly.marks.seen).ranges
    other = base + turned - assembly.marks.seen.ranges
    assert (np.abs(other - base) > 0.15).any()
    assert not edges.mixed(other).any()
    at, (near, far) = edges._at, edges._ends
    middle, nearer = base.copy(), base.copy()
    middle[at] = 0.5 * (near + far)
    assert edges.mixed(middle)[at].mean() > 0.5
    nearer[at] = near - 0.5
    assert not edges.mixed(nearer).any()
    assert not edges.mixed(np.full_like(base, np.nan)).any()


def test_what_is_read_scan_by_scan_from_one_place_counts_once():
    mask = np.array([[1, 0], [1, 1], [0, 1], [1, 1], [1, 0], [1, 0]], dtype=bool)
    stand = np.array([0, 0, 0, 1, -1, -1])
    assert _once(mask, stand).astype(int).tolist() == [[1, 0], [0, 1], [0, 0], [1, 1], [1, 0], [1, 0]]


def test_two_effects_may_do_together_what_another_one_does_alone():
    """The one is far likelier than each of both, and hides them; together they fit better."""
    simulate = _Linear(
        {
            "laser.crosstalk.probability": (3.0, 3.0, 2.5, 3.5, 0.4),
            "laser.heavy_tails.outliers": (3.0, 3.0, 0.0, 0.0, 0.0),
            "laser.dropout.probability": (0.0, 0.0, 3.0, 3.0, 0.0),
        }
    )
    truth = [at("laser.heavy_tails", outliers=0.02), at("laser.dropout", probability=0.05)]
    ids = frozenset({"laser.crosstalk", *(each.id for each in truth)})
    found = ScatterSearch(ScatterFit(simulate, simulate(truth, 5), (), ids)).run()
    assert {each.setting.id for each in found} == {each.id for each in truth}
    assert all(each.p > 0.95 for each in found)


def test_what_bent_before_its_company_was_known_begins_anew():
    """Lost oblique beams do what noise does: beside the noise they are lost anywhere."""
    simulate = _Linear(
        {
            "laser.dropout.probability": (9.0, 9.0, 0.0, 0.0, 0.0),
            "laser.dropout.oblique": (0.0, -2.0, 4.0, 4.0, 3.0),
            "laser.incidence_noise.gain": (0.0, 0.0, 4.0, 4.0, 0.0),
        }
    )
    truth = [at("laser.dropout", probability=0.05), at("laser.incidence_noise", gain=0.5)]
    found = ScatterSearch(ScatterFit(simulate, simulate(truth, 5), (), frozenset(each.id for each in truth))).run()
    (lost,) = (each.setting for each in found if each.setting.id == "laser.dropout")
    assert {each.setting.id for each in found} == {each.id for each in truth}
    assert lost.parameters["oblique"] == pytest.approx(0.0, abs=0.01)
    assert lost.parameters["probability"] == pytest.approx(0.05, rel=0.1)


@pytest.mark.parametrize("grid", [0.001, 0.012])
def test_scans_of_one_stand_on_a_coarse_grid_say_less_than_as_many_independent_ones(grid):
    scans, beams, noise = 20, 4000, 0.0025
    rng = np.random.default_rng(3)
    walls = rng.uniform(1.0, 2.0, beams)
    readings = grid * np.rint((walls + noise * rng.standard_normal((scans, beams))) / grid)
    error = readings - walls
    sd = np.full((scans, 1), error.std())
    one, other = (
        Layout(np.arange(scans) * 0.1, np.zeros(scans, dtype=int), np.full(scans, stand)) for stand in (0, -1)
    )
    factor = _repeated(grid_step(readings), np.full((scans, 1), noise), sd, one)
    assert np.sqrt(scans) * error.mean(axis=0).std() / error.std() == pytest.approx(float(factor[0, 0]), rel=0.08)
    assert (factor[0, 0] > 1.3) == (grid > 0.01)
    assert (_repeated(grid, np.full((scans, 1), noise), sd, other) == 1.0).all(), "under way every scan is rounded anew"


@pytest.mark.parametrize("step", [0.001, 0.0118])
def test_the_step_of_a_grid_is_known_whatever_is_read_of_something_else(step):
    rng = np.random.default_rng(4)
    walls = rng.uniform(1.0, 3.0, 20000)
    walls[::50] = rng.uniform(0.1, 3.9, 400)
    readings = np.round(step * np.rint(walls / step), 3)
    readings[::77] = np.nan
    assert _spacing(readings) == pytest.approx(step, rel=0.01)
    assert _spacing(np.full(3, np.nan)) == 0.001


@pytest.mark.parametrize(("rho", "told"), [(0.07, ["laser.beam_correlation"]), (0.0, [])])
def test_neighbours_that_share_little_are_told_where_readings_are_many(tmp_path, rho, told):
    """Of a fourteenth that each beam shares with the next, sums of readings scatter by a seventh more."""
    finding = criticise_scans(recording(tmp_path, "laser.beam_correlation", rho, 5, scans=40), MODEL, lambda _: None)
    assert [cause.id for cause in finding.causes] == told
    assert not finding.confounded
    if told:
        rho_told = finding.causes[0].parameters["rho"]
        assert rho_told.lo90 < rho < rho_told.hi90
