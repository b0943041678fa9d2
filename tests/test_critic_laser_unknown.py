# SPDX-License-Identifier: BSD-3-Clause
"""Curves outside the catalogue, walls that are off, stands, and sets of effects that one wall cannot tell apart."""

import json
from dataclasses import replace

import laser_scene
import numpy as np
import pytest
from laser_scene import recording, sparse

from kurumaisu import effects
from kurumaisu.bench.hidden import Ask, make
from kurumaisu.critic import pipeline
from kurumaisu.critic.base.covariates import with_past
from kurumaisu.critic.judge.scan_verdict import criticise_scans
from kurumaisu.critic.ranges.noise.shared_errors import (
    Gram,
    Grams,
    Layout,
    OffsetProducts,
    ScanNoise,
    offset_products,
    whitened,
    without_beam_offsets,
)
from kurumaisu.critic.ranges.poses.pose_corrections import PoseEvidence, likeliest_path, motion_evidence
from kurumaisu.critic.ranges.scans.gathering import stands_averaged
from kurumaisu.critic.sanity import pose_jumps
from kurumaisu.critic.values.recording import Series
from kurumaisu.effects import LAGS, Echoes
from kurumaisu.errors import Error
from kurumaisu.params import EffectSetting, load_model, shipped

MD100 = shipped("launch/md100.yaml")
MODEL = load_model(MD100)


def say(_):
    """Progress that nobody reads."""


@pytest.mark.parametrize("size", [0.0, 0.004])
def test_a_step_of_the_range_is_outside_the_catalogue(tmp_path, size):
    data = recording(tmp_path, None, 0.0, 11, scans=30)
    run = data.runs[0]
    far = np.where(run.scan.values > 2.2, size, 0.0)
    data = replace(data, runs=(replace(run, scan=replace(run.scan, values=run.scan.values + far)),))
    criticism = pipeline.criticise(data, MD100, say)
    verdict = criticism.verdict
    if size == 0:
        assert verdict.verdict == "none"
        assert verdict.unknown == ()
        return
    assert verdict.verdict == "unknown"
    assert (verdict.unknown[0].channel, verdict.unknown[0].covariate) == ("laser.bias", "range")
    assert not any(cause.id.startswith("laser") for cause in verdict.causes)
    pipeline.write(criticism, MD100, tmp_path / "out")
    assert json.loads((tmp_path / "out" / "verdict.json").read_text())["verdict"] == "unknown"
    extended = load_model(tmp_path / "out" / "extended.yaml")
    (curve,) = [own for own in extended.effects if own.id == "smooth.range.range"]
    near, beyond = (added(curve, ranges) for ranges in (1.5, 2.8))
    assert beyond - near == pytest.approx(size, rel=0.4)


@pytest.mark.parametrize(
    ("size", "lasts", "leans", "told"),
    [(0.0, 1.0, False, []), (0.01, 0.8, False, ["time_since_command"]), (0.015, 0.2, True, ["acceleration"])],
)
def test_readings_may_follow_what_went_before(tmp_path, size, lasts, leans, told):
    """A chair that is asked for something else nods, or leans back to speed up and forward to slow down."""
    data = recording(tmp_path, None, 0.0, 11, scans=60)
    run, changes = data.runs[0], np.arange(-1.0, 25.0, 2.3)
    asked = np.stack([0.1 + 0.1 * (np.arange(len(changes)) % 2), np.zeros(len(changes))], axis=1)
    last = np.searchsorted(changes, run.scan.t, side="right") - 1
    since = run.scan.t - changes[last]
    by = size * np.exp(-since / lasts) * (2.0 * (last % 2) - 1 if leans else 1.0)
    nods = np.round(run.scan.values + by[:, np.newaxis], 3)
    run = replace(run, command=Series(changes, asked, ("v", "w")), scan=replace(run.scan, values=nods))
    data = with_past(replace(data, runs=(run,)), MODEL)
    known = data.runs[0].covariates["since_command"]
    assert np.interp(run.scan.t, known.t, known.values[:, 0]) == pytest.approx(since, abs=0.03)
    found = criticise_scans(data, MODEL, say)
    assert not found.causes
    assert [each.covariate for each in found.unknown[:1]] == told


def test_beside_what_is_in_no_catalogue_nothing_is_told_of_scatter_but_what_is_lost(tmp_path):
    """Knots miss the edges of a stripe, which then looks like noise, tails, and scans that are off together."""
    data = recording(tmp_path, "laser.dropout", 0.1, 11, scans=30)
    run = data.runs[0]
    stripe = 0.03 * (np.abs(np.arange(run.scan.values.shape[1]) - 450) < 30)
    data = replace(data, runs=(replace(run, scan=replace(run.scan, values=np.round(run.scan.values - stripe, 3))),))
    finding = criticise_scans(data, MODEL, say)
    assert finding.unknown[0].covariate == "bearing"
    assert {cause.id for cause in finding.causes} == {"laser.dropout"}


@pytest.mark.parametrize("step", [0.0069, 0.0103])
def test_the_step_of_a_coarse_grid_is_known_to_a_thousandth(tmp_path, step):
    """Whose values are rounded to millimetres, and of which some are read by none of few beams."""
    data = sparse(recording(tmp_path, "laser.quantisation", step, 5, scans=40))
    (cause,) = criticise_scans(data, MODEL, say).causes
    assert cause.id == "laser.quantisation"
    assert cause.parameters["step"].estimate == pytest.approx(step, rel=2e-3)


def added(setting, ranges):
    """What an effect adds to the mean of one reading [m]."""
    chain = effects.build_laser((setting,), np.random.default_rng(0))
    one = np.ones(1)
    return chain.read(Echoes(0.0, 0 * one, ranges * one, 0 * one, one, ranges * one, 0 * one, 0 * one, one))[0] - ranges


def test_a_curve_over_where_beams_hit_needs_the_pose():
    values = {"knot_0": 0.0, "knot_1": 2.0, "value_0": 0.0, "value_1": 0.01}
    setting = EffectSetting("smooth.range.hit_x", values)
    assert added(setting, 1.5) == 0
    chain = effects.build_laser((setting,), np.random.default_rng(0))
    one = np.ones(1)
    echoes = Echoes(0.0, 0 * one, one, 0 * one, one, one, 0 * one, 0 * one, one, np.array([[0.5, 0.0, 0.0]]))
    assert chain.read(echoes)[0] - 1 == pytest.approx(0.0075)
    with pytest.raises(Error, match="knots must increase"):
        effects.check((EffectSetting("smooth.range.range", {**values, "knot_1": -1.0}),))
    moon = effects.build_laser((EffectSetting("smooth.range.moon", values),), np.random.default_rng(0))
    assert moon.read(echoes)[0] == 1, "nobody has recorded it"
    assert moon.read(replace(echoes, known={"moon": 1.0}))[0] - 1 == pytest.approx(0.005)


def test_the_temperature_that_was_recorded_is_followed():
    one = np.ones(1)
    values = {"coefficient": 5e-4, "swing": 5.0, "period": 600.0, "reference": 21.0}
    chain = effects.build_laser((EffectSetting("laser.temperature", values),), np.random.default_rng(0))
    echoes = Echoes(150.0, 0 * one, one, 0 * one, one, one, 0 * one, 0 * one, one)
    assert chain.read(replace(echoes, known={"temperature": 25.0}))[0] - 1 == pytest.approx(0.002)
    assert chain.read(echoes)[0] - 1 == pytest.approx(0.0025)
    slow = effects.build_laser((EffectSetting("laser.temperature", {**values, "lag": 60.0}),), np.random.default_rng(0))
    known = {"temperature": 25.0}
    assert slow.read(replace(echoes, known=known))[0] - 1 == pytest.approx(0.002), "nobody knows how it was before"
    past = {"temperature": 20.0 + LAGS[np.newaxis] / 60.0}
    assert slow.read(replace(echoes, known=known, past=past))[0] - 1 == pytest.approx(0.0)


def test_a_laser_that_follows_the_temperature_late_is_told_with_its_lag(tmp_path):
    """Half a minute behind the thermometer, in rooms that get warmer and colder."""
    data = sparse(recording(tmp_path, None, 0.0, 7, scans=240), scans=3)
    (run,) = data.runs
    times = np.arange(0.0, run.scan.t[-1] + 1.0)
    room, own = 21 + 4 * np.sin(times / 12.0), [21.0]
    for warmth in room[1:].tolist():
        own.append(own[-1] + (warmth - own[-1]) / 30.0)
    drift = 0.003 * (np.interp(run.scan.t, times, own) - 21.0)
    scan = replace(run.scan, values=run.scan.values + drift[:, np.newaxis])
    known = {"temperature": Series(times, room[:, np.newaxis], ("temperature",))}
    found = criticise_scans(replace(data, runs=(replace(run, scan=scan, covariates=known),)), MODEL, say)
    assert [cause.id for cause in found.causes] == ["laser.temperature"]
    assert found.unknown == ()
    told = found.causes[0].parameters
    assert told["lag"].lo90 < 30.0 < told["lag"].hi90
    assert told["coefficient"].estimate == pytest.approx(0.003, rel=0.2)


def test_a_tilt_is_measured_along_both_axes_but_for_its_sense(tmp_path, monkeypatch):
    monkeypatch.setattr("kurumaisu.critic.ranges.scans.gathering.MOST_SCANS", 80)
    case = make(Ask("single", ("laser.tilt",), 40.0, regime="clean", design="room"), 1002, tmp_path)
    finding = criticise_scans(case.recording, MODEL, say)
    assert [cause.id for cause in finding.causes] == ["laser.tilt"]
    (setting,) = [setting for setting in finding.settings if setting.id == "laser.tilt"]
    for name, truth in case.truth.parameters["laser.tilt"].items():
        assert abs(setting.parameters[name]) == pytest.approx(abs(truth), abs=0.004)
    effects.check(finding.settings)


def test_one_wall_does_not_tell_the_mounting_from_the_map(tmp_path, monkeypatch):
    monkeypatch.setattr("kurumaisu.critic.ranges.scans.gathering.MOST_SCANS", 60)
    case = make(Ask("confounded", ("laser.mount_x",), 16.0, regime="clean"), 301, tmp_path)
    finding = criticise_scans(case.recording, MODEL, say)
    assert finding.confounded == (("laser.mount_x", "world.map_error"),)
    assert finding.causes == ()
    assert any("only one wall" in line and "room_poses" in line for line in finding.details)
    assert finding.next_experiment.id == "room_poses"
    assert finding.next_experiment.separates == ("laser.mount_x", "world.map_error")
    null = criticise_scans(case.null, MODEL, say)
    assert (null.confounded, null.causes, null.unknown) == ((), (), ())


def test_beams_that_keep_an_offset_are_integrated_out():
    rng = np.random.default_rng(8)
    scans, beams, own, common, sd_own = 4, 9, 6, 3, 0.002
    noise = ScanNoise(0.01, 0.02, 0.005, 1.5)
    times, run = np.array([0.0, 0.5, 1.5, 1.7]), np.array([0, 0, 0, 1])
    sd, rho = 0.003 * rng.uniform(0.5, 1.5, beams), 0.4
    valid = np.ones(beams, dtype=bool)
    valid[3] = False
    at = np.flatnonzero(valid)
    n = len(at)
    poses, columns = rng.standard_normal((scans, beams, own)), rng.standard_normal((scans, beams, common))
    inner, total, grams, parts = np.zeros((beams, beams)), np.zeros((beams, common)), [], []
    for k in range(scans):
        rows = whitened(np.hstack([poses[k], np.ones((beams, 1)), columns[k]]), valid, sd, rho)
        grams.append(Gram(rows.T @ rows, own, 1))
        products = offset_products(rows, valid, sd, rho, inner)
        parts.append(products[:, : own + 1])
        total += products[:, own + 1 :]
    layout = Layout(times, run, np.full(scans, -1))
    gram = without_beam_offsets(Grams.summed(grams), OffsetProducts(tuple(parts), total, inner), layout, noise, sd_own)
    modes = noise.common_sd**2 * np.exp(-np.abs(times[:, None] - times) / noise.common_tau)
    dense = np.kron(modes * (run[:, None] == run), np.ones((n, n)))
    dense += np.kron(np.ones((scans, scans)), sd_own**2 * np.eye(n))
    for k in range(scans):
        size = np.tile([0.01, 0.01, 0.02], 2) ** 2
        beam = rho ** np.abs(at[:, None] - at) * np.outer(sd[at], sd[at])
        dense[k * n : k * n + n, k * n : k * n + n] += beam + (poses[k][at] * size) @ poses[k][at].T
    x = columns[:, at].reshape(-1, common)
    np.testing.assert_allclose(gram, x.T @ np.linalg.solve(dense, x), rtol=1e-8)


def test_poses_of_a_stand_are_one_and_those_of_a_drive_are_not():
    rng = np.random.default_rng(3)
    times = np.concatenate([0.1 * np.arange(30), 100 + 0.1 * np.arange(30)])
    places = np.repeat([[0.0, 0.0, 0.0], [1.0, 0.5, 2.0]], 30, axis=0)
    still = stands_averaged(times, places + 0.001 * rng.standard_normal(places.shape))
    assert len(np.unique(still, axis=0)) == 2
    np.testing.assert_allclose(still, places, atol=0.001)
    driven = np.column_stack([0.3 * times, 0.0 * times, 0.0 * times]) + 0.001 * rng.standard_normal(places.shape)
    np.testing.assert_array_equal(stands_averaged(times, driven), driven)


def seen(times, truth, reference, sd, every):
    """Sights of scans that rest on three poses each, and find them within sd."""
    rng = np.random.default_rng(8)
    inner = np.kron(np.eye(3), np.diag([sd**-2.0] * 3))
    rows = [slice(i, i + 3) for i in range(0, len(times) - 3, every)]
    errors = [(truth[r] - reference[r] + sd * rng.standard_normal((3, 3))).ravel() for r in rows]
    return [PoseEvidence(r, inner, inner @ error) for r, error in zip(rows, errors, strict=True)]


@pytest.mark.parametrize("step", [0.05, 0.02])
def test_a_path_has_the_rates_of_the_truth_and_shows_where_they_jump(step):
    rng = np.random.default_rng(4)
    times = step * np.arange(round(20 / step))
    rates = 0.4 * np.where(times % 4 < 2, 1.0, -1.0)  # a chair that drives to and fro
    x = np.cumsum(rates) * step
    truth = np.column_stack([x, 0.0 * x, 2 * x])
    reference = truth + np.array([0.01, 0.01, 0.005]) * rng.standard_normal(truth.shape)
    known = seen(times, truth, reference, 0.001, round(0.2 / step))
    path, jumps = likeliest_path(times, reference, known, np.zeros(len(times), dtype=bool), np.zeros_like(truth))
    under = np.concatenate([np.arange(sight.rows.start, sight.rows.stop - 1) for sight in known])
    under = under[~(jumps[under] | jumps[under + 1]) & (under > 5) & (under < len(times) - 6)]
    found, right = (np.diff(poses, axis=0)[under] / step for poses in (path, truth))
    for axis in (0, 2):  # neither too small, as where no rate may jump, nor noisy, as those of the reference
        assert np.sum(found[:, axis] * right[:, axis]) / np.sum(right[:, axis] ** 2) == pytest.approx(1, abs=0.01)
        noise = (np.diff(reference, axis=0) / step)[under, axis] - right[:, axis]
        assert np.std(found[:, axis] - right[:, axis]) < 0.2 * np.std(noise)
    turns = np.flatnonzero(np.diff(rates)) + 1
    near = np.abs(np.flatnonzero(jumps)[:, np.newaxis] - turns).min(axis=1)
    assert jumps.sum() < 6 * len(turns)
    assert np.mean(near <= round(0.2 / step)) > 0.8


def test_motion_tells_errors_that_differ_from_pose_to_pose_unless_the_rates_jump():
    rng = np.random.default_rng(6)
    times = 0.05 * np.arange(100)
    rates = np.where(times < 2.5, 0.4, -0.4)
    truth = np.cumsum(np.outer(rates, [0.05, 0.0, 0.1]), axis=0)
    reference = truth + np.array([0.01, 0.01, 0.005]) * rng.standard_normal(truth.shape)
    scans = [slice(i, i + 3) for i in (10, 30, 48, 70)]
    made = motion_evidence(times, reference, truth, scans)
    for known, rows in zip(made, scans, strict=True):
        errors = (truth - reference)[rows].ravel()
        off = known.rows @ errors - known.left
        if rows.start == 48:
            assert 1 < np.abs(off).max() < 3  # a jump of many usual changes, in units that it has widened itself
        else:
            np.testing.assert_allclose(off, 0, atol=1e-9)
            assert np.abs(known.left).max() > 3  # of the reference's errors much is told
    fewer = motion_evidence(times, reference, truth, [slice(10, 12)])
    assert fewer[0].rows.shape == (0, 6)


def test_a_pose_that_is_known_stays_and_pauses_say_nothing_of_rates():
    times = np.r_[0.1 * np.arange(20), 60 + 0.1 * np.arange(20)]
    places = np.repeat([[0.0, 0.0, 0.0], [1.5, 0.5, 1.0]], 20, axis=0)
    errors = np.repeat([[0.003, 0.0, 0.001], [0.0, -0.002, 0.0]], 20, axis=0)
    path, jumps = likeliest_path(times, places, [], np.ones(40, dtype=bool), errors)
    np.testing.assert_allclose(path, places + errors, atol=1e-6)
    assert not jumps.any()


@pytest.mark.parametrize(("pause", "jumps"), [(0.0, True), (60.0, False)])
def test_a_chair_that_was_carried_has_not_jumped(pause, jumps):
    rng = np.random.default_rng(5)
    times = 0.1 * np.arange(40)
    times[20:] += pause
    places = np.repeat([[0.0, 0.0, 0.0], [1.5, 0.5, 1.0]], 20, axis=0) + 0.0005 * rng.standard_normal((40, 3))
    assert bool(pose_jumps.problems(Series(times, places, ("x", "y", "theta")))) == jumps


def test_what_follows_a_recorded_column_is_told_over_it(tmp_path):
    """The pressure of a tyre goes up and down; nothing in the catalogue follows it."""
    data = recording(tmp_path, None, 0.0, 7, scans=30)
    (run,) = data.runs
    pressure = 2.5 + 0.2 * np.sin(1.1 * np.arange(len(run.scan.t)) ** 1.3)
    scan = replace(run.scan, values=run.scan.values + 0.02 * (pressure - 2.5)[:, np.newaxis])
    known = {"tyre_pressure": Series(run.scan.t, pressure[:, np.newaxis], ("tyre_pressure",))}
    found = criticise_scans(replace(data, runs=(replace(run, scan=scan, covariates=known),)), MODEL, say)
    assert found.unknown[0].covariate == "tyre_pressure"
    assert "rad" not in found.unknown[0].shape, "nobody knows its unit"
    assert found.causes == ()


def test_a_curve_that_draws_an_effect_is_that_effect_in_another_form(tmp_path, monkeypatch):
    """Oblique walls are read longer by the square of the angle: the footprint of the catalogue is another equation."""

    def by_the_square(effect, size, r, incidence, *_):
        return 1.004587 * r + 0.058826 + size * incidence**2

    monkeypatch.setattr(laser_scene, "mean_reading", by_the_square)
    data = recording(tmp_path, "laser.incidence_bias", 0.01, 9, scans=30)
    assert [cause.id for cause in criticise_scans(data, MODEL, say).causes] == ["laser.incidence_bias"]
