# SPDX-License-Identifier: BSD-3-Clause
"""Stands and pauses, effects beside effects of another form, and sizes refitted where the effect acts."""

from dataclasses import replace

import numpy as np
import pytest
from laser_scene import BEAM_TIME, BEAMS, FIRST, INCREMENT, cast, recording

from kurumaisu import effects
from kurumaisu.bench.hidden import Ask, make
from kurumaisu.critic.judge.scan_verdict import criticise_scans
from kurumaisu.critic.ranges.poses.creeping_stands import creeping_stands, gather_stands
from kurumaisu.critic.ranges.scans.gathering import gather, stands_averaged, with_pause_rows
from kurumaisu.critic.ranges.scans.valid_readings import pose_weights
from kurumaisu.critic.ranges.search.effect_sets import FormSearch
from kurumaisu.critic.ranges.signals.effect_columns import Column, EffectColumns, Form
from kurumaisu.critic.scatter.likelihood import StatisticKinds
from kurumaisu.critic.scatter.scatter_fit import ScatterFit
from kurumaisu.critic.scatter.scatter_search import ScatterSearch
from kurumaisu.critic.values.recording import Series
from kurumaisu.params import EffectSetting, load_model, shipped

MODEL = load_model(shipped("launch/md100.yaml"))


def say(_):
    """Progress that nobody reads."""


def test_a_carried_chair_stands_until_it_is_carried():
    times = np.array([0.0, 0.1, 0.2, 60.0, 60.1, 60.2])
    places = np.repeat([[0.0, 0.0, 0.0], [3.0, 2.0, 1.0]], 3, axis=0)
    t, poses = with_pause_rows(times, places)
    for when, x in ((0.2, 0.0), (1.2, 0.0), (29.0, 0.0), (31.0, 3.0), (59.5, 3.0), (60.2, 3.0)):
        assert np.interp(when, t, poses[:, 0]) == x
    driven = places + np.arange(6)[:, np.newaxis]
    np.testing.assert_array_equal(with_pause_rows(times, driven)[0], times)


def test_stands_are_found_whatever_their_jitter_happens_to_be():
    times = np.concatenate([100 * i + 0.1 * np.arange(20) for i in range(4)])
    for seed in range(40):
        rng = np.random.default_rng(seed)
        places = np.repeat(rng.uniform(-1, 1, (4, 3)), 20, axis=0)
        still = stands_averaged(times, places + 3e-4 * rng.standard_normal(places.shape))
        assert len(np.unique(still, axis=0)) == 4, seed


def test_a_stand_begins_when_the_chair_has_rolled_out():
    """Slowly: from row to row it moves by hardly more than the poses' jitter."""
    times = 0.1 * np.arange(70)
    way = np.interp(times, [0.0, 1.0, 1.24, 5.83, 6.0, 7.0], [-0.5, -0.02, 0.0, 0.0, 0.013, 0.6])
    for seed in range(40):
        poses = np.column_stack([way, 0 * way, 0 * way]) + 1.3e-3 * np.random.default_rng(seed).standard_normal((70, 3))
        same = (np.diff(stands_averaged(times, poses), axis=0) == 0).all(axis=1)
        rows = np.flatnonzero(np.r_[False, same] | np.r_[same, False])
        assert 13 <= rows[0] <= 15, seed
        assert 55 <= rows[-1] <= 58, seed


def standing(data, creep):
    """The recording of a chair that stands in the middle of the room, where it wavers by creep [m, rad], slowly."""
    rng = np.random.default_rng(3)
    run, bearings = data.runs[0], FIRST + INCREMENT * np.arange(BEAMS)

    def pose(t):
        wave = np.stack([np.sin(0.9 * t), np.cos(1.3 * t), np.sin(0.7 * t + 1)], axis=-1)
        return np.array([2.9, 2.3, 0.4]) + creep * wave

    rows = []
    for stamp in run.scan.t.tolist():
        poses = pose(stamp + BEAM_TIME * np.arange(BEAMS))
        c, s = np.cos(poses[:, 2]), np.sin(poses[:, 2])
        r, _, _ = cast(poses[:, :2] + 0.30 * np.stack([c, s], axis=-1), poses[:, 2] + bearings)
        noise = (0.002334 - 0.000488 * r + 0.000199 * r * r) * rng.standard_normal(BEAMS)
        rows.append(np.round(1.004587 * r + 0.058826 + noise, 3))
    poses = pose(run.pose.t) + 0.003 * rng.standard_normal((len(run.pose.t), 3))
    pose_table, scans = replace(run.pose, values=poses), replace(run.scan, values=np.array(rows))
    return replace(data, runs=(replace(run, pose=pose_table, scan=scans),))


@pytest.mark.parametrize(("creep", "stands"), [(0.0, True), (0.002, False)])
def test_a_stand_in_which_scans_see_the_chair_move_is_none(tmp_path, creep, stands):
    """The poses, which err by 3 mm and 3 mrad, see nothing of it; whole scans seemed to be off together."""
    data = standing(recording(tmp_path, None, 0.0, 1, scans=30), creep)
    assert bool(creeping_stands(gather(data, MODEL))) != stands
    shots = gather_stands(data, MODEL)
    assert (np.ptp(shots.tracks[0].poses, axis=0).max() == 0) == stands
    finding = criticise_scans(data, MODEL, lambda _: None)
    assert (finding.causes, finding.confounded, finding.unknown) == ((), (), ())


def test_scans_in_a_gap_of_the_poses_are_left_out(tmp_path):
    """Nobody knows where the chair was; where it stood, there is no gap."""
    data = recording(tmp_path, None, 0.0, 1, scans=30)
    run = data.runs[0]
    keep = (run.pose.t < 4.0) | (run.pose.t > 5.2)
    gone = replace(run.pose, t=run.pose.t[keep], values=run.pose.values[keep])
    shots = gather(replace(data, runs=(replace(run, pose=gone),)), MODEL)
    missing = sorted(set(run.scan.t.tolist()) - set(shots.stamps.tolist()))
    assert missing == [t for t in run.scan.t.tolist() if 3.9 < t < 5.2]
    still = replace(gone, values=np.repeat(gone.values[:1], len(gone.t), axis=0))
    assert len(gather(replace(data, runs=(replace(run, pose=still),)), MODEL).stamps) == len(run.scan.t)


def test_a_scan_rests_on_the_poses_of_when_its_beams_leave(tmp_path):
    shots = gather(recording(tmp_path, None, 0.0, 1, scans=10), MODEL)
    for delay in (0.0, 0.3):
        late = replace(shots, own=(EffectSetting("laser.latency", {"delay": delay}),))
        for scan in (3, 8):
            hat = pose_weights(late, scan)
            times = shots.stamps[scan] - delay + shots.said
            knots = shots.tracks[shots.run[scan]].times[hat.rows]
            assert knots[0] <= times[0]
            assert knots[-1] >= times[-1]
            np.testing.assert_allclose(hat.weights @ knots, times, atol=1e-9)


@pytest.mark.parametrize(
    ("coefficient", "offset", "named"), [(4e-4, 0.0, "laser.temperature"), (0, 1e-3, "laser.offset")]
)
def test_the_temperature_at_which_a_laser_reads_right_is_free_within_bounds(tmp_path, coefficient, offset, named):
    data = recording(tmp_path, None, 0.0, 1, scans=20)
    run = data.runs[0]
    warmth = 21.5 + 4 * np.sin(run.scan.t)[:, np.newaxis]
    known = {"temperature": Series(run.scan.t, warmth, ("temperature",))}
    shots = gather(replace(data, runs=(replace(run, covariates=known),)), MODEL)
    forms, columns = EffectColumns(shots).forms(frozenset({"laser.temperature", "laser.offset"}))
    error = coefficient * (warmth - 22.3) + offset + np.zeros_like(shots.measured)
    flat = np.concatenate([columns, error[:, :, np.newaxis]], axis=2)[np.isfinite(columns).all(axis=2)] / 0.01
    assert FormSearch(forms, flat.T.astype(float) @ flat).run().best.ids == {named}


def _two(z, other):
    """The search among two effects that have nothing in common, of so many deviations each."""
    forms = [
        Form(name, {}, (Column(effects.by_id(name).parameters[0], squared=False, beside={}),), i)
        for i, name in enumerate(("laser.offset", "laser.scale"))
    ]
    gram = np.diag([1e4, 1e4, 0.0])
    gram[:2, 2] = gram[2, :2] = 100 * np.array([z, other])
    return FormSearch(forms, gram).run()


def test_what_a_form_leaves_is_not_one_more_effect():
    assert set(_two(20.0, 7.0).named) == {"laser.offset", "laser.scale"}
    assert _two(80.0, 7.0).named == ("laser.offset",)


def test_a_delay_is_measured_where_it_acts(tmp_path, monkeypatch):
    monkeypatch.setattr("kurumaisu.critic.ranges.scans.gathering.MOST_SCANS", 120)
    case = make(Ask("single", ("laser.latency",), None, family="laser"), 121, tmp_path)
    finding = criticise_scans(case.recording, MODEL, say)
    assert [cause.id for cause in finding.causes] == ["laser.latency"]
    truth = case.truth.parameters["laser.latency"]["delay"]
    assert finding.causes[0].parameters["delay"].estimate == pytest.approx(truth, rel=0.12)


class _Three:
    """Numbers that follow two effects: a spread that both raise, and one number each."""

    def kinds(self):
        none = np.zeros(3, dtype=bool)
        return StatisticKinds(none, none)

    def null(self, effect):
        return {p.name: p.null for p in effect.parameters}

    def nulls(self, seeds):
        return np.array([self((), seed) for seed in seeds])

    def __call__(self, settings, seed):
        at = {f"{setting.id}.{name}": value for setting in settings for name, value in setting.parameters.items()}
        step, own = at.get("laser.quantisation.step", 0.001), at.get("laser.beam_bias.sd", 0.0)
        numbers = [np.log(4e-6 + step**2 / 12 + own**2), 0.3 * np.log(step / 0.001), np.log(1e-7 + own**2)]
        return np.array(numbers) + 0.02 * np.random.default_rng(seed).standard_normal(3)


def test_effects_on_the_same_numbers_are_fitted_together():
    simulate = _Three()
    truth = [
        effects_at("laser.quantisation", step=0.006),
        effects_at("laser.beam_bias", sd=0.0015),
    ]
    ids = frozenset({"laser.quantisation", "laser.beam_bias", "laser.range_noise"})
    found = ScatterSearch(ScatterFit(simulate, simulate(truth, 5), (), ids)).run()
    sizes = {each.setting.id: each.setting.parameters for each in found}
    assert set(sizes) == {"laser.quantisation", "laser.beam_bias"}
    assert sizes["laser.quantisation"]["step"] == pytest.approx(0.006, rel=0.1)
    assert sizes["laser.beam_bias"]["sd"] == pytest.approx(0.0015, rel=0.1)


def effects_at(name, **values):
    """A setting of an effect with these values, the others as of none."""
    return EffectSetting(name, {**{p.name: p.null for p in effects.by_id(name).parameters}, **values})
