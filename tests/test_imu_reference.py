# SPDX-License-Identifier: BSD-3-Clause
"""An imu as a second reference: of headings that nobody measured, of those that somebody did, and of turning alone."""

import numpy as np
import pytest
from gyro_drive import drive, gyro

from kurumaisu.critic import Meta, criticise_arrays, write, write_csv_run
from kurumaisu.critic.app import look
from kurumaisu.critic.app.arrays import recording_of, run_of
from kurumaisu.critic.data.clean import Faults
from kurumaisu.critic.sanity.examination import examine
from kurumaisu.critic.sanity.masks import set_aside
from kurumaisu.params import load_model, robot_of, shipped
from kurumaisu.settings import Section

MODEL = shipped("launch/md100.yaml")
WHEELS = robot_of(Section({"robot": {"kind": "diff_drive", "radius": 0.05, "track": 0.4}}, "meta.yaml"))
BESIDE = ("command", "odom")


def measured(made, sd=0.005, seed=5):
    """Return the true poses as a reference measures them."""
    return made["pose"] + np.column_stack(
        [np.zeros(len(made["pose"])), np.random.default_rng(seed).normal(0, sd, (len(made["pose"]), 3))]
    )


def later(poses, by):
    return np.column_stack([poses[:, 0] + by, poses[:, 1:]])


def recorded(made, **tables):
    return recording_of("made", {"one": {name: made[name] for name in BESIDE} | tables}, Meta(robot=WHEELS))


# Where positions were measured


def test_headings_follow_the_imu_rather_than_odometry_that_turns_too_far():
    made = drive(turned=0.88)
    places = measured(made)[:, :3]
    off = []
    for imu in ({}, {"imu": gyro(made["yaw"], scale=1.02)}):
        recording = recorded(made, pose=places, **imu)
        error = recording.runs[0].pose.column("theta") - made["pose"][:, 3]
        off.append(float(np.sqrt(np.mean((error - np.median(error)) ** 2))))
    assert "follow the imu in between" in " ".join(recording.problems)
    assert off[1] < 0.02
    assert off[1] < off[0] / 3


# Where poses were measured


def looked_at(pose, imu, made):
    """Return what is wrong with the recording, and what was set aside, in words."""
    recording = set_aside(recorded(made, pose=pose, imu=imu), load_model(MODEL))
    told = [note for note in recording.problems if "imu says" in note]
    return " ".join(examine(recording, load_model(MODEL)).invalid), " ".join(told), recording.runs[0].aside


@pytest.mark.parametrize("late", [0.0, 0.2])
@pytest.mark.parametrize("scale", [0.97, 1.03])
def test_a_reference_that_turns_as_the_imu_says_is_right(late, scale):
    made = drive()
    invalid, told, aside = looked_at(later(measured(made), late), gyro(made["yaw"], scale=scale), made)
    assert (invalid, told, aside) == ("", "", ())


def test_a_reference_that_measures_once_a_second_is_right():
    made = drive()
    invalid, told, _ = looked_at(measured(made)[::10], gyro(made["yaw"]), made)
    assert (invalid, told) == ("", "")


def test_headings_that_are_scaled_are_wrong_and_odometry_is_asked():
    made = drive()
    invalid, _, _ = looked_at(measured(made) * [1, 1, 1, 0.9], gyro(made["yaw"]), made)
    assert "the heading of the reference turns 0.9" in invalid
    assert "times as far as the imu says, whose scale may be off by 5 %" in invalid
    assert "as the imu (or leave the imu out: `imu: {axis: none}`)" in invalid


def test_a_reference_of_another_clock_is_wrong():
    made = drive()
    invalid, _, _ = looked_at(later(measured(made), 0.8), gyro(made["yaw"]), made)
    assert "the reference turns 0.80 s after the imu; try t of the reference pose -0.80 s" in invalid


def test_a_moment_in_which_a_reference_turns_by_itself_is_set_aside():
    made = drive()
    pose = measured(made)
    pose[pose[:, 0] > 50.03, 3] += 0.25
    invalid, told, aside = looked_at(pose, gyro(made["yaw"]), made)
    assert invalid == ""
    assert "turns otherwise than the imu says once (first: by +0.2" in told
    ((start, stop),) = aside
    assert start < 50.05 < stop < start + 1.3


def test_a_reference_that_turns_by_itself_all_the_time_is_wrong():
    made = drive()
    pose = measured(made)
    pose[:, 3] += np.random.default_rng(1).choice([0, 0, 0, 0, 0.3], len(pose) // 10).repeat(10)
    invalid, told, aside = looked_at(pose, gyro(made["yaw"]), made)
    assert "turns otherwise than the imu says" in invalid
    assert told == ""
    assert aside == ()


# Where nothing else was measured


def turned(seed, parts, imu=None, only=(), **robot):
    made = drive(seed, **robot)
    tables = {name: made[name] for name in parts} | {"imu": gyro(made["yaw"], (0, 0, -1), seed=seed, **(imu or {}))}
    return criticise_arrays({"one": tables}, Meta(robot=WHEELS), only=only)


def causes(found):
    return {cause.id: cause.parameters for cause in found.verdict.causes}


def test_odometry_that_turns_too_far_is_told_by_the_imu_with_the_multiplier():
    found = turned(1, ("odom",), turned=1 / 1.1)
    (cause,) = causes(found).items()
    assert cause[0] == "base.gain_w"
    assert cause[1]["gain"].estimate == pytest.approx(1 / 1.1 - 1, abs=0.01)
    separation = found.verdict.robot.multipliers.wheel_separation_multiplier
    assert separation.lo90 < 1.1 < separation.hi90
    assert separation.hi90 - separation.lo90 > 0.04  # no gyro's scale is known better
    assert found.story.paste.splitlines()[0].startswith("wheel_separation_multiplier: 1.10")
    assert "wheel_radius_multiplier" not in found.story.paste
    assert "if their radius is right, which turning alone does not tell" in " ".join(found.story.details)


def test_what_was_not_measured_is_not_told(tmp_path):
    found = turned(2, ("odom",), veer=0.05)
    assert list(causes(found)) == ["base.veer"]
    assert "cannot tell how far it drives or slips" in found.story.details[0]
    assert "headings by the imu, along the way of the odometry, which nothing checks" in found.story.pose_source
    assert list(found.verdict.gain.channels) == ["dtheta"]
    assert found.verdict.gain.rmse == {}
    assert {each.unit for each in found.story.noise} <= {"rad", "rad/s", "s"}
    multipliers = found.verdict.robot.multipliers
    left, right = multipliers.left_wheel_radius_multiplier, multipliers.right_wheel_radius_multiplier
    assert right.estimate - left.estimate == pytest.approx(0.05 * 0.4, abs=0.002)
    write(found, MODEL, tmp_path / "out")
    assert "<svg" in (tmp_path / "out" / "report.html").read_text()
    assert "sd_v: 0.0" in (tmp_path / "out" / "extended.yaml").read_text()


@pytest.mark.parametrize("scale", [0.98, 1.0, 1.02])
def test_what_the_scale_of_the_imu_explains_is_no_cause(scale):
    found = turned(3, ("odom",), imu={"scale": scale})
    assert found.verdict.verdict == "none"
    assert not found.verdict.unknown
    assert ("no more than the scale of the imu may be off by" in " ".join(found.story.details)) == (scale != 1.0)


@pytest.mark.parametrize(
    ("parts", "lags"), [(("command", "odom"), {"base.lag_v", "base.lag_w"}), (("command",), {"base.lag_w"})]
)
def test_commands_are_held_against_the_imu_and_as_far_as_there_is_one_against_odometry(parts, lags):
    some = ["base.gain_w", "base.lag_w", "base.lag_v", "base.gain_v", "base.dead_zone_v"]
    found = turned(1, parts, only=some, turned=1 / 1.1)
    assert set(causes(found)) == {"base.gain_w", *lags}
    assert causes(found)["base.gain_w"]["gain"].estimate == pytest.approx(1 / 1.1 - 1, abs=0.01)
    for lag in lags:
        assert causes(found)[lag]["tau"].estimate == pytest.approx(0.25, abs=0.05)
    assert ("effects on its speed were not looked for" in found.story.details[0]) == (parts == ("command",))


def test_a_look_says_what_it_would_serve_for(tmp_path, capsys):
    made = drive()
    tables = {"odom": made["odom"], "imu": gyro(made["yaw"])}
    write_csv_run(tmp_path / "one", run_of("one", tables, Faults()))
    assert look.main([str(tmp_path / "one")]) == 0
    told = capsys.readouterr().out
    assert "base: how far it turns, against the imu; how far it drives: not known" in told
    write_csv_run(
        tmp_path / "two", run_of("two", {**tables, "command": made["command"], "pose": made["pose"]}, Faults())
    )
    assert look.main([str(tmp_path / "two")]) == 0
    assert "against measured poses, whose headings the imu checks" in capsys.readouterr().out
