# SPDX-License-Identifier: BSD-3-Clause
"""The critic on recordings whose hidden effect comes from code that shares nothing with the package's effects."""

import json
from dataclasses import replace

import hidden_effect
import numpy as np
import pytest
from hidden_effect import recording, recording_of
from scipy.integrate import trapezoid

from kurumaisu import geometry
from kurumaisu.critic import pipeline
from kurumaisu.critic.base import drive, replay
from kurumaisu.critic.data.reference import with_reference
from kurumaisu.critic.heldout import materiality
from kurumaisu.critic.heldout.materiality import simulates_nearer
from kurumaisu.critic.values import policy
from kurumaisu.critic.values.recording import Series
from kurumaisu.errors import Error
from kurumaisu.params import load_model, shipped

MD100 = shipped("launch/md100.yaml")


def criticise(data):
    return pipeline.criticise(data, MD100, lambda _: None)


@pytest.mark.parametrize("effect", hidden_effect.EFFECTS)
def test_a_hidden_effect_is_named_and_measured(effect):
    size = 0.3 * hidden_effect.draw_size(effect, np.random.default_rng(7))
    # Wheels that differ and a leak of V_f into V_s look alike, but for the volts of the threshold.
    seconds = 60.0 if effect == "base.veer" else 40.0
    verdict = criticise(recording(effect, size, 70, seconds)).verdict
    assert verdict.verdict == "named"
    assert [cause.id for cause in verdict.causes] == [effect]
    (estimate,) = (p for p in verdict.causes[0].parameters.values() if p.hi90 > p.lo90)  # a form has no interval
    error = (estimate.hi90 - estimate.lo90) / (2 * 1.645)
    assert abs(estimate.estimate - size) < 4 * error + 0.02 * abs(size)
    assert verdict.gain.log_density_per_sample.lo90 > 0


def test_a_chair_that_fluctuates_at_rest_too_has_nothing_else():
    restless = replace(hidden_effect.USUAL, at_rest=True)
    verdict = criticise(recording("base.lag_v", 0.15, 70, 40.0, restless)).verdict
    assert ([cause.id for cause in verdict.causes], verdict.unknown) == (["base.lag_v"], ())


@pytest.mark.parametrize("seed", [81, 82, 83])
def test_without_an_effect_nothing_is_named(seed):
    criticism = criticise(recording(None, 0.0, seed, 40.0))
    assert criticism.verdict.verdict == "none"
    assert criticism.verdict.causes == ()
    assert [setting.id for setting in criticism.settings] == ["base.process_noise"]


def test_two_effects_at_once_are_both_named():
    first = recording("base.lag_w", 0.15, 90, 40.0)
    slower = tuple(
        replace(run, pose=replace(run.pose, values=run.pose.values * [0.95, 0.95, 1.0])) for run in first.runs
    )
    verdict = criticise(replace(first, runs=slower)).verdict
    assert {cause.id for cause in verdict.causes} == {"base.lag_w", "base.gain_v"}


@pytest.mark.parametrize(
    ("columns", "words"),
    [
        ([-1.0, 1.0, 1.0], "x of the reference pose has the wrong sign"),
        ([1.0, -1.0, 1.0], "y of the reference pose has the wrong sign"),
        ([1.0, 1.0, 180 / np.pi], "heading of the reference pose is in degrees"),
        ([1000.0, 1000.0, 1.0], "millimetres"),
    ],
)
def test_wrong_data_are_said_and_not_fitted(columns, words):
    good = recording(None, 0.0, 91, 40.0)
    runs = tuple(replace(run, pose=replace(run.pose, values=run.pose.values * columns)) for run in good.runs)
    verdict = criticise(replace(good, runs=runs)).verdict
    assert verdict.verdict == "invalid_data"
    assert verdict.causes == ()
    assert words in verdict.problems[0]


def moments_are_rows_of_their_runs(criticism, data):
    """Return of how many samples: each was taken where the reference says that the chair was then."""
    runs = {run.name: run.pose for run in data.runs}
    count = 0
    for misfit in criticism.story.misfits:
        moments = misfit.moments
        assert len(moments.t) == len(moments.run) == len(moments.places) == len(misfit.residual)
        for run, t, place in zip(moments.run, moments.t, moments.places, strict=True):
            pose = runs[moments.runs[run]]
            row = int(np.searchsorted(pose.t, t))
            assert pose.t[row] == t
            assert list(pose.values[row, :2]) == list(place)
            count += 1
    return count


def test_the_extended_model_leaves_nothing_to_find(tmp_path):
    data = recording("base.lag_w", 0.1, 92, 40.0)
    criticism = criticise(data)
    pipeline.write(criticism, MD100, tmp_path)
    assert [cause["id"] for cause in json.loads((tmp_path / "verdict.json").read_text())["causes"]] == ["base.lag_w"]
    assert moments_are_rows_of_their_runs(criticism, data) > 500
    assert "base.lag_w" in (tmp_path / "report.html").read_text(encoding="utf-8")
    extended = tmp_path / "extended.yaml"
    assert {setting.id for setting in load_model(extended).effects} == {"base.lag_w", "base.process_noise"}
    again = pipeline.criticise(recording("base.lag_w", 0.1, 93, 40.0), extended, lambda _: None).verdict
    assert again.verdict == "none"


@pytest.mark.parametrize(("size", "volts"), [(1.0, 1.32402 * 0.5 + 0.127906), (5.0, 0.5)])
def test_a_robot_without_voltages_follows_its_commands(tmp_path, size, volts):
    """By the law of the chair, or, where it is asked for more than that can say, as it is: all is larger there."""

    def grown(series, columns):
        return replace(series, values=series.values * np.where(np.isin(series.columns, columns), size, 1.0))

    data = recording("base.gain_w", -0.1, 94, 25.0)
    runs = (replace(run, voltage=None, command=grown(run.command, ["v"])) for run in data.runs)
    data = replace(data, runs=tuple(replace(run, pose=grown(run.pose, ["x", "y"])) for run in runs), truth=None)
    criticism = criticise(data)
    assert [cause.id for cause in criticism.verdict.causes] == ["base.gain_w"]
    pipeline.write(criticism, MD100, tmp_path)
    assert load_model(tmp_path / "extended.yaml").translation.volts(0.5) == pytest.approx(volts)


def test_one_run_is_judged_on_the_parts_held_out():
    data = recording("base.gain_v", 0.05, 95, 60.0)
    verdict = criticise(replace(data, runs=data.runs[:1], train=data.train[:1])).verdict
    assert [cause.id for cause in verdict.causes] == ["base.gain_v"]
    assert verdict.gain.log_density_per_sample.lo90 > 0


def test_what_the_drives_cannot_separate_is_said_as_a_set():
    """At one speed, a gain and a dead zone of v take the same share of it."""
    drives = []
    for seed in range(3):
        rng = np.random.default_rng(seed)
        starts = np.cumsum(rng.uniform(2.0, 4.0, 12))
        command = np.array([(t, 0.4 * (i % 2 == 0), 0.0) for i, t in enumerate(starts)])
        drives.append(hidden_effect.drive(command, "base.gain_v", 0.05, rng, hidden_effect.USUAL))
    verdict = criticise(recording_of("one speed", drives)).verdict
    assert verdict.verdict == "confounded"
    assert verdict.causes == ()
    (group,) = verdict.confounded
    assert {"base.gain_v", "base.dead_zone_v"} <= set(group)
    assert not {"base.gain_w", "base.reverse_gain", "base.lag_w"} & set(group)


def with_jittered_odometry(data, gain, jitter=0.1):
    """The commands integrated as odometry that is stamped up to `jitter` [s] off: noise in the input itself."""
    runs = []
    for run in data.runs:
        rng = np.random.default_rng(len(runs))
        times = np.arange(0.0, run.pose.t[-1], 0.25)
        truth = geometry.interpolate(run.pose.t, run.pose.values, times + rng.uniform(-jitter, jitter, len(times)))
        steps = geometry.between(truth[:-1], truth[1:]) / [1, 1, 1 + gain]
        poses = [np.zeros(3)]
        for step in steps:
            poses.append(geometry.compose(poses[-1], step))
        odom = Series(times, np.column_stack([poses, np.zeros((len(times), 2))]), ("x", "y", "theta", "v", "w"))
        runs.append(replace(run, odom=odom, voltage=None, command=None))
    return replace(data, runs=tuple(runs), truth=None)


def test_noise_of_the_odometry_does_not_pass_for_a_gain():
    data = with_jittered_odometry(recording(None, 0.0, 98, 60.0), 0.0)
    assert criticise(data).verdict.verdict == "none"


def test_a_gain_of_the_odometry_is_named():
    data = with_jittered_odometry(recording(None, 0.0, 98, 60.0), 0.1, 0.05)
    verdict = criticise(data).verdict
    assert [cause.id for cause in verdict.causes] == ["base.gain_w"]
    assert verdict.causes[0].parameters["gain"].estimate == pytest.approx(0.1, abs=0.03)


def test_without_poses_and_scans_the_odometry_is_what_commands_are_compared_with():
    """It repeats itself at rest, to the last bit, as no reference that is measured does."""
    data = recording("base.gain_w", 0.1, 70, 40.0)

    def counted(run):
        steady = np.round(run.pose.values, 3)
        rates = np.zeros((len(steady), 2))
        return replace(
            run, pose=None, odom=Series(run.pose.t, np.hstack([steady, rates]), ("x", "y", "theta", "v", "w"))
        )

    runs = tuple(counted(run) for run in data.runs)
    found = criticise(with_reference(replace(data, runs=runs), 0, lambda _: None))
    assert [cause.id for cause in found.verdict.causes] == ["base.gain_w"]
    assert found.story.pose_source.startswith("the odometry")


@pytest.mark.parametrize(("near", "verdict"), [(True, "named"), (False, "unknown")])
def test_what_cannot_be_noise_is_named_where_it_simulates_nearer(monkeypatch, near, verdict):
    """Though the density of what is held out gains nothing, as where it differs from drive to drive; else amber."""
    monkeypatch.setattr(materiality, "confirmed", lambda worth, nats: False)
    monkeypatch.setattr(
        materiality, "simulates_nearer", lambda worth, channels: near and simulates_nearer(worth, channels)
    )
    assert criticise(recording("base.gain_w", 0.1, 70, 40.0)).verdict.verdict == verdict


def test_a_recording_too_short_to_hold_anything_back_names_nothing():
    data = with_jittered_odometry(recording(None, 0.0, 99, 8.0), 1.0)
    criticism = criticise(replace(data, runs=data.runs[:1], train=data.train[:1]))
    assert criticism.verdict.verdict == "none"
    assert criticism.verdict.gain is None
    assert criticism.story.headline == "None of the 29 effects can be named, because only 8.0 s were recorded."


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"pose": None}, "run_1: has no reference pose"),
        ({"voltage": None, "command": None}, "run_1: has neither voltages nor commands nor odometry"),
    ],
)
def test_missing_parts_are_named(change, message):
    data = recording(None, 0.0, 96, 5.0)
    with pytest.raises(Error, match=message):
        criticise(replace(data, runs=tuple(replace(run, **change) for run in data.runs)))


def test_replay_of_a_noiseless_drive_is_exact():
    """Commands held over the grid, equation (3) in closed form: the replay must end where the arcs end."""
    data = recording(None, 0.0, 97, 20.0)
    run, model = data.runs[0], load_model(MD100)
    prepared = drive.prepare(run, model)
    pose, t_end = np.zeros(3), prepared.times[-1]
    command = run.command
    for t, until, (v, w) in zip(command.t, [*command.t[1:], t_end], command.values, strict=True):
        dt = until - t
        if w == 0:
            local = np.array([v * dt, 0.0, 0.0])
        else:
            local = np.array([v / w * np.sin(w * dt), v / w * (1 - np.cos(w * dt)), w * dt])
        c, s = np.cos(pose[2]), np.sin(pose[2])
        pose += [c * local[0] - s * local[1], s * local[0] + c * local[1], local[2]]
    prepared = replace(prepared, poses=np.zeros_like(prepared.poses))
    np.testing.assert_allclose(replay.path(prepared, model, ())[-1], pose, atol=2e-4)


def prior_density(x):
    """Log-uniform on 3 to 50 with nine tenths of the weight, and on 50 to 5000 with the rest; x > 0."""
    return np.where(x < 50, 0.9 / np.log(50 / 3), 0.1 / np.log(100)) / x


def test_occam_factor_against_quadrature():
    z = np.array([0.0, 2.0, 5.0, 30.0])
    x = np.geomspace(3, 5000, 1_000_001)
    for value, cost in zip(z, policy.occam(z), strict=True):
        density = prior_density(x) / 2 * (np.exp(-0.5 * (value - x) ** 2) + np.exp(-0.5 * (value + x) ** 2))
        assert cost == pytest.approx(-np.log(trapezoid(density, x)), abs=0.02)
    assert policy.occam(np.array(5.0), sides=1) == pytest.approx(policy.occam(np.array(5.0)) - np.log(2))


def test_occam_factor_of_two_amplitudes_against_quadrature():
    x = np.geomspace(3, 5000, 5001)
    angle = np.linspace(0, 2 * np.pi, 601)
    for value in (0.0, 4.0, 12.0):
        near = x[np.abs(x - value) < 12]
        squares = (near[:, None] * np.cos(angle) - value) ** 2 + (near[:, None] * np.sin(angle)) ** 2
        mean = trapezoid(np.exp(-0.5 * squares), angle, axis=1) / (2 * np.pi)
        expected = -np.log(trapezoid(prior_density(near) * mean, near))
        assert policy.occam_plane(np.array(value)) == pytest.approx(expected, abs=0.05)
