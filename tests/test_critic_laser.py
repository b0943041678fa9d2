# SPDX-License-Identifier: BSD-3-Clause
"""The laser's criticism on scans that share no code with the effects, on nulls, and on a real sensor."""

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from laser_scene import neighbours, recording

from kurumaisu.critic import pipeline
from kurumaisu.critic.judge.scan_verdict import criticise_scans
from kurumaisu.critic.ranges.noise.shared_errors import Gram, Grams, Layout, ScanNoise, Stacked, whitened
from kurumaisu.critic.ranges.scans.gathering import gather
from kurumaisu.critic.ranges.scans.repeatability import repeatability
from kurumaisu.critic.ranges.search.effect_sets import FormSearch, confusion
from kurumaisu.critic.ranges.search.normal_equations import Assembly
from kurumaisu.critic.ranges.signals.effect_columns import EffectColumns
from kurumaisu.errors import Error
from kurumaisu.params import load_model, shipped
from kurumaisu.world import load_world

MD100 = shipped("launch/md100.yaml")
MODEL = load_model(MD100)
REAL = Path(__file__).resolve().parents[2] / "shared/data/player_urg04lx/hokuyo_aist.logr"


def say(_):
    """Progress that nobody reads."""


@pytest.mark.filterwarnings("error")
def test_where_beams_meet_nothing_no_effect_on_readings_does_anything(tmp_path):
    shots = gather(recording(tmp_path, None, 0.0, 1, scans=6), MODEL)
    away = EffectColumns(replace(shots, walls=replace(shots.walls, segments=shots.walls.segments + 1e6)))
    assert not np.isfinite(away.base).any()
    assert away.forms(None)[0] == []


def test_what_is_missing_is_said(tmp_path):
    good = recording(tmp_path, None, 0.0, 1, scans=6)
    mapless = criticise_scans(replace(good, world=None), MODEL, say)
    assert "map" in mapless.refused
    assert mapless.next_experiment is None, "no drive makes a map of measured walls"
    blind = replace(good, runs=(replace(good.runs[0], pose=None),))
    assert "reference pose" in criticise_scans(blind, MODEL, say).refused
    mapped = replace(good, runs=(replace(good.runs[0], pose_source="particle filter over 6 scans"),))
    assert "computed from these scans" in criticise_scans(mapped, MODEL, say).refused
    none = replace(good, runs=(replace(good.runs[0], scan=None),))
    scanless = criticise_scans(none, MODEL, say)
    assert "scans" in scanless.refused
    assert scanless.next_experiment.id == "room_poses"
    assert {"laser.offset", "laser.scale", "laser.mount_yaw"} <= set(scanless.next_experiment.separates)
    assert not {"laser.latency", "laser.sweep"} & set(scanless.next_experiment.separates), "they show on the way only"
    late = replace(good.runs[0].scan, t=good.runs[0].scan.t + 1000)
    assert (
        "within the time"
        in criticise_scans(replace(good, runs=(replace(good.runs[0], scan=late),)), MODEL, say).refused
    )


def test_without_an_effect_the_verdict_is_none(tmp_path):
    finding = criticise_scans(recording(tmp_path, None, 0.0, 2, scans=30), MODEL, say)
    assert finding.causes == ()
    assert finding.confounded == ()


@pytest.mark.parametrize("seed", [3])
def test_dependent_noise_does_not_pass_for_an_effect_on_the_mean(tmp_path, seed):
    """The i.i.d. likelihood of the same data, beside it, is certain of effects that are not there."""
    shots = gather(
        recording(tmp_path, None, 0.0, seed, scans=30, rho=0.5, common=0.001, truth=0.005, told=False), MODEL
    )
    assembly = Assembly(shots)
    normal = assembly.settle(None)
    found = FormSearch(assembly.forms, normal.gram).run()
    assert found.named == ()
    assert normal.beam_noise.rho == pytest.approx(0.5, abs=0.05)
    assert normal.scan_noise.position_sd == pytest.approx(0.005, rel=0.4)
    assert normal.scan_noise.heading_sd == pytest.approx(0.005, rel=0.4)
    naive = assembly.grams(assembly.first).common
    assert FormSearch(assembly.forms, naive).run().named


@pytest.mark.parametrize(
    ("effect", "size", "parameter"), [("laser.scale", 0.006, "scale"), ("laser.mount_yaw", -0.02, "yaw")]
)
def test_a_hidden_effect_is_named_and_measured(tmp_path, effect, size, parameter):
    finding = criticise_scans(recording(tmp_path, effect, size, 5, scans=30), MODEL, say)
    assert [cause.id for cause in finding.causes] == [effect]
    estimate = finding.causes[0].parameters[parameter]
    error = (estimate.hi90 - estimate.lo90) / (2 * 1.645)
    assert abs(estimate.estimate - size) < 4 * error
    assert error < 0.1 * abs(size)


def test_an_effect_on_the_scatter_is_named_and_measured(tmp_path):
    finding = criticise_scans(recording(tmp_path, "laser.dropout", 0.04, 6, scans=20), MODEL, say)
    assert [cause.id for cause in finding.causes] == ["laser.dropout"]
    assert finding.causes[0].parameters["probability"].estimate == pytest.approx(0.04, rel=0.25)


def assert_taken_in_scans_and_on_walls(moments, data):
    """Of each reading: its scan's time, and a place that lies on a wall of the map."""
    scans = {run.name: run.scan.t for run in data.runs}
    ends = load_world(data.world).segments
    start, way = ends[:, :2], ends[:, 2:] - ends[:, :2]
    for run, t, place in zip(moments.run[::20], moments.t[::20], moments.places[::20], strict=True):
        assert np.abs(scans[moments.runs[run]] - t).min() < 1e-9
        share = np.clip(np.sum((place - start) * way, axis=1) / np.sum(way**2, axis=1), 0, 1)
        assert np.hypot(*(start + share[:, np.newaxis] * way - place).T).min() < 1e-6


def test_the_pipeline_tells_of_scans_without_commands(tmp_path):
    data = recording(tmp_path, "laser.quadratic", 0.003, 7, scans=30)
    criticism = pipeline.criticise(data, MD100, say)
    (misfit,) = criticism.story.misfits
    assert_taken_in_scans_and_on_walls(misfit.moments, data)
    assert len(misfit.moments.t) == len(misfit.residual)
    pipeline.write(criticism, MD100, tmp_path / "out")
    verdict = json.loads((tmp_path / "out" / "verdict.json").read_text())
    assert [cause["id"] for cause in verdict["causes"]] == ["laser.quadratic"]
    extended = load_model(tmp_path / "out" / "extended.yaml")
    assert [setting.id for setting in extended.effects] == ["laser.quadratic"]
    refused = pipeline.criticise(replace(data, world=None), MD100, say)
    assert any("laser not criticised" in line for line in refused.story.details)


def test_normal_equations_are_those_of_the_dense_covariance():
    """Errors of poses, an autoregressive common mode and neighbours' correlation, all at once, by brute force."""
    rng = np.random.default_rng(8)
    scans, beams, own, common = 4, 9, 6, 3
    noise = ScanNoise(0.01, 0.02, 0.005, 1.5)
    times, run = np.array([0.0, 0.5, 1.5, 1.7]), np.array([0, 0, 0, 1])
    sd, rho = 0.003 * np.ones(beams), 0.4
    valid = np.ones(beams, dtype=bool)
    valid[3] = False
    at = np.flatnonzero(valid)
    poses = rng.standard_normal((scans, beams, own))
    columns = rng.standard_normal((scans, beams, common))
    grams = []
    for k in range(scans):
        rows = whitened(np.hstack([poses[k], np.ones((beams, 1)), columns[k]]), valid, sd, rho)
        grams.append(Gram(rows.T @ rows, own, 1))
    layout = Layout(times, run, np.full(scans, -1))
    gram, log_det = Stacked(Grams.summed(grams), layout).marginal(noise)
    same = run[:, None] == run[None, :]
    modes = noise.common_sd**2 * np.exp(-np.abs(times[:, None] - times) / noise.common_tau) * same
    n = len(at)
    dense = np.kron(modes, np.ones((n, n)))
    beam = 0.003**2 * rho ** np.abs(at[:, None] - at)
    for k in range(scans):
        size = np.tile([0.01, 0.01, 0.02], 2) ** 2
        dense[k * n : k * n + n, k * n : k * n + n] += beam + (poses[k][at] * size) @ poses[k][at].T
    x = columns[:, at].reshape(-1, common)
    np.testing.assert_allclose(gram, x.T @ np.linalg.solve(dense, x), rtol=1e-6)
    expected = np.linalg.slogdet(dense)[1] - scans * np.linalg.slogdet(beam)[1]
    assert log_det == pytest.approx(expected, rel=1e-6)


def test_errors_that_last_and_those_of_stands_are_those_of_the_dense_covariance():
    """Three of seven scans are of one stand, amid the way; positions and headings wander as far as they do."""
    rng = np.random.default_rng(18)
    scans, beams, common = 7, 11, 2
    noise = ScanNoise(0.01, 0.02, 0.005, 1.5, lasting=2.0, lasting_turn=0.7, lasting_tau=3.0)
    times, run = np.array([0.0, 0.5, 1.5, 1.7, 2.0, 2.9, 0.4]), np.array([0, 0, 0, 0, 0, 0, 1])
    stand = np.array([-1, -1, 0, 0, 0, -1, -1])
    poses, columns = rng.standard_normal((scans, beams, 3)), rng.standard_normal((scans, beams, common))
    grams = []
    for k in range(scans):
        own = poses[k] if stand[k] < 0 else np.empty((beams, 0))
        rows = whitened(
            np.hstack([own, np.ones((beams, 1)), poses[k], columns[k]]), np.full(beams, True), np.ones(beams), 0
        )
        grams.append(Gram(rows.T @ rows, own.shape[1], 4))
    gram, log_det = Stacked(Grams.summed(grams), Layout(times, run, stand)).marginal(noise)
    apart, same = np.abs(times[:, None] - times), run[:, None] == run[None, :]
    dense = np.kron(noise.common_sd**2 * np.exp(-apart / noise.common_tau) * same, np.ones((beams, beams)))
    dense += np.eye(scans * beams)
    moving, one = np.outer(stand < 0, stand < 0), np.outer(stand == 0, stand == 0)
    for axis, (own, times_as_large) in enumerate([(0.01, 2.0), (0.01, 2.0), (0.02, 0.7)]):
        slow = (own * times_as_large) ** 2 * np.exp(-apart / noise.lasting_tau) * same * moving
        shared = slow + own**2 * np.diag(stand < 0) + own**2 * (1 + times_as_large**2) * one
        each = poses[:, :, axis]
        dense += np.einsum("kb,kl,lc->kblc", each, shared, each).reshape(dense.shape)
    x = columns.reshape(-1, common)
    np.testing.assert_allclose(gram, x.T @ np.linalg.solve(dense, x), rtol=1e-6)
    assert log_det == pytest.approx(np.linalg.slogdet(dense)[1], rel=1e-6)


def test_a_still_laser_gives_its_noise_away():
    rng = np.random.default_rng(9)
    ranges = np.linspace(0.5, 3.0, 682)
    sd = 0.002 + 0.0005 * ranges
    readings = np.round(ranges + sd * neighbours(rng, 0.5, 60), 3)
    readings[rng.random(readings.shape) < 0.0005] = np.nan
    found = repeatability(readings)
    assert found.sd_between(0.5, 1.0) == pytest.approx(np.sqrt(0.00238**2 + 1e-6 / 12), rel=0.03)
    assert found.correlation[1] == pytest.approx(0.5 / (1 + 1e-6 / 12 / 0.0028**2), abs=0.03)
    with pytest.raises(Error, match="at least 10 scans"):
        repeatability(readings[:9])


@pytest.mark.skipif(not REAL.exists(), reason="the real sensor's log is not there")
def test_the_real_sensor_has_the_noise_that_careful_people_measured():
    readings = real_scans()[:34] / 1000.0
    found = repeatability(np.where(readings < 0.02, np.nan, readings))
    assert 1e3 * found.sd_between(0.02, 0.75) == pytest.approx(2.3, abs=0.3)
    assert 1e3 * found.sd_between(2.0, 2.5) == pytest.approx(3.6, abs=0.3)
    # Theirs lie between ours with the scans' common mode (0.57, 0.36, 0.22) and without it.
    assert [found.correlation[lag] for lag in (1, 2, 3)] == pytest.approx([0.52, 0.31, 0.18], abs=0.05)


def real_scans():
    """The distances [mm] of the log's scans: SCIP 2.0, three characters each, 64 to a line and a sum."""
    data, stream, at = REAL.read_bytes(), b"", 0
    while at < len(data):
        size = int.from_bytes(data[at + 8 : at + 12], "big")
        stream, at = stream + data[at + 12 : at + 12 + size], at + 12 + size
    out = []
    for part in stream.split(b"GD0046072201\n")[1:]:
        lines = part.split(b"\n\n")[0].split(b"\n")[2:]
        codes = np.frombuffer(b"".join(line[:-1] for line in lines), dtype=np.uint8).astype(int) - 0x30
        if len(codes) == 3 * 677:
            out.append(codes.reshape(-1, 3) @ [4096, 64, 1])
    return np.array(out, dtype=float)


def test_one_more_effect_that_nobody_knows_is_no_rival():
    a_or_b = [(("a",), 0.4), (("b",), 0.38), (("a", "c"), 0.11), (("b", "c"), 0.1), ((), 0.01)]
    weights = [(frozenset(ids), weight) for ids, weight in a_or_b]
    p, confounded = confusion(weights, frozenset("a"), "abc")
    assert p["c"] == pytest.approx(0.21)
    assert confounded == (("a", "b"),)


def test_of_some_ten_readings_nothing_is_said(tmp_path):
    """As where all walls of a map are stairs: most beams meet an edge."""
    data = recording(tmp_path, "laser.offset", 0.05, 4, scans=12)
    (run,) = data.runs
    values = np.full(run.scan.values.shape, np.nan)
    values[:, ::60] = run.scan.values[:, ::60]
    few = replace(data, runs=(replace(run, scan=replace(run.scan, values=values)),))
    finding = criticise_scans(few, MODEL, say)
    assert not finding.causes
    assert finding.refused is not None
    assert re.match(r"only \d+ of \d+ readings of walls are away from edges of the map, fewer than", finding.refused)
