# SPDX-License-Identifier: BSD-3-Clause
"""Predictions of withheld motion, against drives made by code that shares nothing with the predictor."""

import csv
from dataclasses import replace

import numpy as np
import pytest

from kurumaisu import geometry
from kurumaisu.bench.hidden.base.catalogue import BASE
from kurumaisu.bench.hidden.base.recordings import draw_drives, recording
from kurumaisu.bench.hidden.generator.noise import REGIMES
from kurumaisu.bench.hidden.oracle import noise_of
from kurumaisu.critic import pipeline
from kurumaisu.critic.app.arrays import recording_of
from kurumaisu.critic.data.csv_reader import write_csv_run
from kurumaisu.critic.data.meta import Meta
from kurumaisu.critic.data.reading import read_recording
from kurumaisu.critic.data.reference import with_reference
from kurumaisu.critic.predict import predictions
from kurumaisu.critic.predict.motion import Forecast
from kurumaisu.critic.values.recording import Recording, Series
from kurumaisu.errors import Error
from kurumaisu.params import EffectSetting, load_model, shipped

MD100 = shipped("launch/md100.yaml")
MODEL = load_model(MD100)
NORMAL90 = 1.6449


def drives_of(regime, seed, faults=(), seconds=40.0):
    return recording("made", draw_drives(None, REGIMES[regime], np.random.default_rng(seed), seconds), faults).runs


def rows(pose, keep):
    return Series(pose.t[keep], pose.values[keep], pose.columns)


def withheld(run, rng, horizons):
    """Return the run without the poses of some stretches, with the queries for them, and what was measured there."""
    t = run.pose.t
    keep, queries, truth = np.ones(len(t), dtype=bool), [], []
    i = int(np.searchsorted(t, 2.0))
    while True:
        j = i + max(1, round(rng.choice(horizons) / (t[1] - t[0])))
        if j >= len(t):
            break
        queries.append((t[i], t[j]))
        truth.append(geometry.between(run.pose.values[i], run.pose.values[j]))
        keep[i + 1 : j + 1] = False
        i = j + int(rng.integers(1, 20))
    return replace(run, pose=rows(run.pose, keep), queries=np.array(queries)), np.array(truth)


def z_of(run, truth, forecast):
    made = predictions.motions_of(run, forecast, run.queries)
    sds = np.array([one.sds for one in made])
    left = truth - np.array([one.means for one in made])
    left[:, 2] = geometry.wrap(left[:, 2])
    return left / sds, sds


def scores(regime, seeds, horizons, settings=(), faults=()):
    z, sds = [], []
    forecast = Forecast(MODEL, settings, noise_of(REGIMES[regime]))
    for seed in seeds:
        rng = np.random.default_rng([seed, 1])
        for run in drives_of(regime, seed, faults):
            one, sd = z_of(*withheld(run, rng, horizons), forecast)
            z.append(one)
            sds.append(sd)
    return np.concatenate(z), np.concatenate(sds)


@pytest.mark.parametrize("regime", ["usual", "slow", "poor reference", "two colours"])
def test_intervals_cover_in_every_channel(regime):
    z, _ = scores(regime, range(4), (0.2, 1.0, 4.0))
    assert len(z) > 100
    assert (np.abs(z) < NORMAL90).mean(axis=0) == pytest.approx(0.9, abs=0.07)
    assert np.sqrt((z**2).mean(axis=0)) == pytest.approx(1.0, abs=0.15)


def test_what_the_noise_does_at_t0_helps():
    """Of a drive of which only the pose at t0 is known, nobody can tell it."""
    with_past, without = [], []
    forecast = Forecast(MODEL, (), noise_of(REGIMES["slow"]))
    for run in [run for seed in range(3) for run in drives_of("slow", seed)]:
        for i in range(60, len(run.pose.t) - 20, 40):
            query = np.array([[run.pose.t[i], run.pose.t[i + 10]]])
            truth = geometry.between(run.pose.values[i], run.pose.values[i + 10])[None]
            for out, first in ((with_past, 0), (without, i)):
                kept = replace(run, pose=rows(run.pose, slice(first, i + 1)), queries=query)
                z, sd = z_of(kept, truth, forecast)
                out.append(-0.5 * z**2 - np.log(sd))
    gain = np.mean(with_past, axis=0) - np.mean(without, axis=0)
    assert (gain > 0.1).all()


@pytest.mark.parametrize(
    ("name", "sizes", "known"),
    [
        ("base.gain_v", {"size": 0.08}, {"gain": 0.08}),
        ("base.slope", {"size": 0.06, "bearing": 0.0}, {"climb_x": 0.06, "climb_y": 0.0}),
    ],
)
def test_with_the_hidden_effect_known_the_errors_are_those_of_the_noise(name, sizes, known):
    faults = (BASE[name].fault(sizes, "plain"),)
    right, _ = scores("usual", range(2), (2.0,), (EffectSetting(name, known),), faults)
    wrong, _ = scores("usual", range(2), (2.0,), (), faults)
    assert np.sqrt((right**2).mean(axis=0)) == pytest.approx(1.0, abs=0.2)
    assert np.sqrt((wrong[:, 0] ** 2).mean()) > 2


@pytest.mark.parametrize(
    "settings", [(), (EffectSetting("base.slope", {"climb_x": 0.05, "climb_y": 0.0}),)], ids=["none", "placed"]
)
def test_nothing_after_t0_is_used_but_the_inputs_up_to_t1(settings):
    run = drives_of("usual", 5)[0]
    forecast = Forecast(MODEL, settings, noise_of(REGIMES["usual"]))
    query = np.array([[20.0, 22.0]])
    (first,) = predictions.motions_of(run, forecast, query)
    values = run.pose.values.copy()
    values[run.pose.t > 20.0] += [3.0, -2.0, 1.0]
    later = replace(run, pose=replace(run.pose, values=values))
    volts = run.voltage.values.copy()
    volts[run.voltage.t > 22.05] *= 0.3
    later = replace(later, voltage=replace(run.voltage, values=volts))
    (again,) = predictions.motions_of(later, forecast, query)
    np.testing.assert_allclose(again.means, first.means, rtol=0, atol=1e-9)
    np.testing.assert_allclose(again.sds, first.sds, rtol=1e-6)
    volts[(run.voltage.t > 20.0) & (run.voltage.t < 22.0)] *= 0.3
    (other,) = predictions.motions_of(replace(later, voltage=replace(run.voltage, values=volts)), forecast, query)
    assert np.abs(other.means - first.means).max() > 0.01


def test_an_uncertain_model_predicts_wider():
    run = drives_of("quiet", 6)[0]
    sure = Forecast(MODEL, (), noise_of(REGIMES["quiet"]))
    doubtful = replace(sure, others=((EffectSetting("base.gain_v", {"gain": 0.1}),),))
    queries = np.array([[3.0, 8.0]])  # soon after the start, when the drive itself has told little yet
    few = replace(run, pose=rows(run.pose, run.pose.t < 0.15))
    (one,), (other,) = (predictions.motions_of(few, forecast, queries) for forecast in (sure, doubtful))
    way = abs(one.means[0])
    assert other.sds[0] == pytest.approx(np.hypot(one.sds[0], 0.1 * way), rel=0.1)
    assert other.sds[2] == pytest.approx(one.sds[2], rel=0.05)


def test_few_poses_or_none_are_enough():
    run = drives_of("usual", 7)[0]
    forecast = Forecast(MODEL, (), noise_of(REGIMES["usual"]))
    queries = np.array([[10.0, 11.0], [10.0, 30.0]])
    whole = predictions.motions_of(run, forecast, queries)
    for pose in (rows(run.pose, slice(0, 1)), rows(run.pose, slice(0, 2)), None):
        made = predictions.motions_of(replace(run, pose=pose), forecast, queries)
        for one, full in zip(made, whole, strict=True):
            assert np.isfinite(one.means).all()
            assert (one.sds > 0.99 * full.sds).all()
            assert (np.abs(one.means - full.means) < 6 * one.sds).all()
        assert (made[1].sds > made[0].sds).all()


def test_a_run_that_nothing_drove_is_not_predicted():
    run = replace(drives_of("usual", 8)[0], command=None, voltage=None, queries=np.array([[1.0, 2.0]]))
    made = Recording("r", (run,), train=(), test=(run.name,))
    (one,) = predictions.predictions(made, Forecast(MODEL, (), noise_of(REGIMES["usual"])), [])
    assert np.isnan(one.means).all()


def test_a_withheld_run_is_predicted_and_written(tmp_path):
    """From tables to prediction.csv, with a hidden gain; of a second withheld run only the first pose is known."""
    faults = (BASE["base.gain_w"].fault({"size": 0.1}, "plain"),)
    first, second, third = drives_of("usual", 9, faults, 30.0)
    held, truth = withheld(third, np.random.default_rng(1), (1.0, 3.0))
    blind = replace(second, name="blind", pose=rows(second.pose, slice(0, 1)), queries=np.array([[0.0, 5.0]]))
    unknown = replace(second, name="unseen", pose=None, queries=np.array([[1.0, 1.5]]))
    for run in (first, second, held, blind, unknown):
        write_csv_run(tmp_path / "in" / run.name, run)
    (tmp_path / "in/meta.yaml").write_text("test: [run_3, blind, unseen]\n")
    data = with_reference(read_recording(tmp_path / "in"), 1, lambda _: None)
    criticism = pipeline.criticise(data, MD100, lambda _: None, ids=frozenset({"base.gain_w", "base.gain_v"}))
    assert [cause.id for cause in criticism.verdict.causes] == ["base.gain_w"]
    assert criticism.verdict.gain.log_density_per_sample.lo90 > 0
    pipeline.write(criticism, MD100, tmp_path / "out")
    with (tmp_path / "out/prediction.csv").open() as stream:
        lines = list(csv.DictReader(stream))
    assert list(lines[0]) == ["run", "channel", "t0", "t1", "beam", "mean", "sd"]
    asked = {"run_3": len(truth), "blind": 1, "unseen": 1}
    for name, count in asked.items():
        assert [line["channel"] for line in lines if line["run"] == name] == ["dx", "dy", "dtheta"] * count
    own = [line for line in lines if line["run"] == "run_3"]
    np.testing.assert_array_equal([(float(x["t0"]), float(x["t1"])) for x in own[::3]], held.queries)
    z = (truth.ravel() - [float(x["mean"]) for x in own]) / [float(x["sd"]) for x in own]
    assert np.sqrt((z**2).mean()) < 1.5
    assert (np.abs(z) < NORMAL90).mean() > 0.75


def test_queries_may_be_arrays():
    run = drives_of("usual", 10)[0]
    tables = {
        "voltage": np.column_stack([run.voltage.t, run.voltage.values]),
        "pose": np.column_stack([run.pose.t, run.pose.values]),
    }
    asked = {**tables, "query": [[1.0, 2.0], [3.0, 3.0]]}
    made = recording_of("arrays", {"drive": tables, "asked": asked}, Meta(test=("asked",)))
    assert made.runs[1].queries.tolist() == [[1.0, 2.0], [3.0, 3.0]]
    with pytest.raises(Error, match="asked/query:1: t1 must not be before t0: 3, 2"):
        recording_of("arrays", {"drive": tables, "asked": {**tables, "query": [[1.0, 2.0], [3.0, 2.0]]}}, Meta())
