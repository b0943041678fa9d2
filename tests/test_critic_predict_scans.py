# SPDX-License-Identifier: BSD-3-Clause
"""Predictions of withheld scans, against scans that share no code with the effects or the ray caster."""

from dataclasses import replace

import numpy as np
import pytest
from laser_scene import recording

from kurumaisu.bench.hidden import Ask, make
from kurumaisu.critic.predict import predictions
from kurumaisu.critic.predict.scan import Expected, log_density
from kurumaisu.critic.values.recording import Recording, Series
from kurumaisu.params import EffectSetting, load_model, shipped

MODEL = load_model(shipped("launch/md100.yaml"))
NORMAL90 = 1.6449


def withheld(data, every=4):
    """Return the recording with a second run whose scans are asked for, and those scans; its poses are given."""
    run = data.runs[0]
    held = np.arange(2, len(run.scan.t), every)

    def some(at):
        return Series(run.scan.t[at], run.scan.values[at], run.scan.columns)

    rest = np.setdiff1d(np.arange(len(run.scan.t)), held)
    train = replace(run, name="train", scan=some(rest))
    test = replace(run, name="test", scan=None, queries=np.repeat(run.scan.t[held, None], 2, axis=1))
    return replace(data, runs=(train, test), train=("train",), test=("test",)), run.scan.values[held]


def predicted(data, settings=()):
    made = list(predictions.ranges(data, MODEL, None, settings))
    assert all(one.is_scan for one in made)
    return np.array([one.means for one in made]), np.array([one.sds for one in made])


@pytest.mark.parametrize("told", [True, False])
def test_intervals_cover(tmp_path, told):
    data, truth = withheld(recording(tmp_path, None, 0.0, 1, scans=28, rho=0.3, common=0.0005, told=told))
    means, sds = predicted(data)
    z = (truth - means) / sds
    seen = np.isfinite(z)
    assert seen.mean() > 0.7
    assert (np.abs(z[seen]) < NORMAL90).mean() == pytest.approx(0.9, abs=0.07)


def test_effects_and_their_scatter_are_in_the_prediction(tmp_path):
    data, truth = withheld(recording(tmp_path, "laser.scale", 0.02, 2, scans=28))
    known, sds = predicted(data, (EffectSetting("laser.scale", {"scale": 0.02}),))
    plain, wide = predicted(data)
    seen = np.isfinite(truth + known + plain)
    assert np.median(np.abs(truth - known)[seen]) < 0.3 * np.median(np.abs(truth - plain)[seen])
    assert np.median(wide[seen]) > 1.5 * np.median(sds[seen])  # a model that is wrong does not know it well
    loud, _ = withheld(recording(tmp_path, "laser.range_noise", 8.0, 3, scans=28))
    assert np.nanmedian(predicted(loud)[1]) > 1.2 * np.nanmedian(sds)


def test_where_no_return_is_expected_nothing_is_predicted(tmp_path):
    data, truth = withheld(recording(tmp_path, None, 0.0, 4, scans=28))
    means, sds = predicted(data)
    np.testing.assert_array_equal(np.isnan(means), np.isnan(sds))
    assert np.isinf(truth).any()
    assert np.isnan(means[np.isinf(truth)]).mean() > 0.9
    assert np.isnan(means[np.isfinite(truth)]).mean() < 0.05


def test_without_a_map_nothing_is_predicted(tmp_path):
    data, truth = withheld(recording(tmp_path, None, 0.0, 5, scans=12))
    means, sds = predicted(replace(data, world=None))
    assert means.shape == truth.shape
    assert np.isnan(means).all()
    assert np.isnan(sds).all()


def test_rows_are_in_the_order_of_the_queries(tmp_path):
    data, _ = withheld(recording(tmp_path, None, 0.0, 6, scans=12))
    run = data.runs[1]
    mixed = np.array([run.queries[1], [1.0, 2.0], run.queries[0]])
    asked = Recording(**{**vars(data), "runs": (data.runs[0], replace(run, queries=mixed))})
    made = list(predictions.predictions(asked, None, list(predictions.ranges(asked, MODEL, None, ()))))
    assert [(one.t0, one.t1) for one in made] == [tuple(row) for row in mixed.tolist()]
    assert [len(one.means) for one in made] == [682, 3, 682]
    lines = predictions.prediction_table(made).splitlines()
    assert len(lines) == 1 + 682 + 3 + 682
    assert lines[1].split(",")[:2] == ["test", "range"]
    assert [line.split(",")[4] for line in lines[1:683]] == [str(i) for i in range(682)]
    assert lines[683].split(",")[5] == "nan"  # nothing drove it


def test_where_the_pose_decides_which_wall_a_beam_meets_either_is_expected(tmp_path):
    """Beside edges: readings of the wall that the map alone would not tell are within the deviation."""
    data, truth = withheld(recording(tmp_path, None, 0.0, 5, scans=48), every=2)
    rng = np.random.default_rng(5)
    moved = []
    for run in data.runs:  # a reference that knows places to 2 cm
        values = run.pose.values + np.array([0.02, 0.02, 0.01]) * rng.standard_normal(run.pose.values.shape)
        moved.append(replace(run, pose=replace(run.pose, values=values)))
    means, sds = predicted(replace(data, runs=tuple(moved), truth=(0.02, 0.01)))
    z = (truth - means) / sds
    other = np.isfinite(z) & (np.abs(truth - means) > 0.15)  # m: of another wall
    assert 20 < np.count_nonzero(other) < 0.05 * other.size
    assert (np.abs(z[other]) < 6).mean() > 0.97


def test_at_a_stop_the_scans_before_tell_how_far_the_pose_is_off(tmp_path):
    """Of scans after t0 nothing is used: of a stop's first scan nobody knows more than its pose."""
    data = make(Ask("null", design="room", family="laser", regime="usual"), 2, tmp_path).null
    last = data.runs[-1]
    held = np.arange(0, 80, 10)  # each stop has 20 scans: its first one, and one in the middle
    rest = np.setdiff1d(np.arange(80), held)
    scan = Series(last.scan.t[rest], last.scan.values[rest], last.scan.columns)
    run = replace(last, scan=scan, queries=np.repeat(last.scan.t[held, None], 2, axis=1))
    asked = replace(data, runs=(*data.runs[:-1], run), train=data.train[:-1], test=(run.name,))
    means, sds = predicted(asked)
    z = (last.scan.values[held] - means) / sds
    first, middle = z[::2][np.isfinite(z[::2])], z[1::2][np.isfinite(z[1::2])]
    assert np.nanmedian(sds[1::2]) < 0.7 * np.nanmedian(sds[::2])
    assert (np.abs(middle) < NORMAL90).mean() == pytest.approx(0.9, abs=0.05)
    assert (np.abs(first) < NORMAL90).mean() > 0.75


def test_readings_of_something_else_do_not_decide_how_wide_the_others_scatter():
    """Scans off their place by far more than readings scatter, a few of which met what the map does not have."""
    rng, shape = np.random.default_rng(1), (20, 300)
    slopes = np.stack([np.sin(np.linspace(-2, 2, 300)), np.cos(np.linspace(-2, 2, 300)), np.ones(300)], axis=1)
    shared = np.broadcast_to(np.column_stack([slopes, np.ones(300)]), (*shape, 4))
    error = rng.normal(0, 0.002, shape) + (shared[:, :, :3] @ rng.normal(0, 0.01, (20, 3, 1)))[:, :, 0]
    met = rng.random(shape) < 0.02
    use, factors = np.ones(shape, dtype=bool), np.array([1.0, 0.01, 0.01, 1e-4])

    def density(sd, error):
        what = Expected(np.ones(shape), np.full((4, *shape), sd**2), shared, use)
        return float(log_density(what, error, use, factors).sum())

    for off in (0.03, 0.3):
        seen = np.where(met, error + off, error)
        assert density(0.002, seen) > density(0.003, seen) + 500
    moved = density(0.002, np.where(met, error + 0.3, error)) - density(0.002, np.where(met, error + 3.0, error))
    assert abs(moved) < 1e-6
