# SPDX-License-Identifier: BSD-3-Clause
"""An imu of a robot: how it is mounted and what it reads at rest are found out, and what is of no use is told."""

import re

import numpy as np
import pytest
from gyro_drive import BIAS, drive, gyro
from recordings import Bag

from kurumaisu.critic import Meta, read_recording, write_csv_run
from kurumaisu.critic.app import look
from kurumaisu.critic.app.arrays import recording_of
from kurumaisu.critic.data.meta import read_meta
from kurumaisu.errors import Error

MADE = drive()
YAW = MADE["yaw"]
START = 1000.0  # [s] of bags
UPWARDS = ((0.0, 0.0, 1.0), (0.0, 0.0, -1.0), (1.0, 0.0, 0.0), (0.0, -1.0, 0.0))


def read(imu, without=(), axis=None, **others):
    """Return a run with the drive's odometry and commands and this imu, fit for a verdict, and what was told of it."""
    tables = {name: MADE[name] for name in ("command", "odom") if name not in without}
    recording = recording_of("made", {"one": {**tables, **others, "imu": imu}}, Meta(imu=axis))
    assert not recording.invalid
    return recording.runs[0], " ".join(note for note in recording.problems if "imu" in note)


def error(run):
    """Return rms and mean error of a run's yaw rate [rad/s], where the sensor measured."""
    t = run.imu.t - (START if run.imu.t[0] >= START else 0.0)
    off = run.imu.column("w") - np.interp(t, *YAW.T)
    return float(np.std(off)), float(np.mean(off))


@pytest.mark.parametrize("up", UPWARDS)
@pytest.mark.parametrize("without", [(), ("odom",), ("command",)])
def test_what_is_up_and_the_bias_are_found_by_how_it_turns(up, without):
    run, told = read(gyro(YAW, up)[:, :4], without)
    spread, mean = error(run)
    assert spread < 0.009
    assert abs(mean) < 0.002
    by = "the commands ask for" if "odom" in without else "the odometry turns"
    name = f"{'-' if sum(up) < 0 else ''}{'xyz'[int(np.argmax(np.abs(up)))]}"
    assert f"one: the imu's {name} is up (as {by}: correlation" in told
    bias = float(re.search(r"bias (\S+) rad/s", told)[1])
    assert bias == pytest.approx(np.dot(up, BIAS), abs=0.002)


def test_one_that_is_tilted_is_taken_about_the_vertical():
    run, told = read(gyro(YAW, (0.0, 0.5, 0.8))[:, :4])
    assert error(run)[0] < 0.012
    assert "32 deg off z" in told


def test_gravity_tells_what_is_up_where_nothing_turned():
    straight = MADE["odom"] * [1, 1, 1, 0, 1, 0]
    ahead = MADE["command"] * [1, 1, 0]
    still = np.column_stack([YAW[:, 0], np.zeros(len(YAW))])
    run, told = read(gyro(still, (0.0, -1.0, 0.0)), odom=straight, command=ahead)
    assert "the imu's -y is up (gravity points there)" in told
    assert abs(np.mean(run.imu.column("w"))) < 0.002
    run, told = read(gyro(still)[:, :4], odom=straight, command=ahead)
    assert run.imu is None
    assert "the imu is not used: too little turned to tell which of its axes is up: say `imu: {axis: z}`" in told
    run, told = read(gyro(still)[:, :4], odom=straight, command=ahead, axis="-x")
    assert "the imu's -x is up (as meta.yaml says)" in told


def test_an_accelerometer_that_says_the_opposite_is_told():
    run, told = read(gyro(YAW, gravity=-9.81))
    assert run.imu is not None
    assert "by its acceleration it is down" in told


def shifted(by):
    return gyro(YAW)[:, :4] + np.array([by, 0, 0, 0])


def noise(rows):
    return np.column_stack([YAW[:rows, 0], np.random.default_rng(1).normal(0, 0.1, (rows, 3))])


@pytest.mark.parametrize(
    ("imu", "words"),
    [
        (gyro(YAW)[:, :4] * [1, np.nan, np.nan, np.nan], "has no number in most rows (6000 of 6000): not used"),
        (gyro(YAW)[:, :4] * [1, 0, 0, 0], "the imu is not used: its rates never change"),
        (gyro(YAW)[:, :4] * [1, *3 * [180 / np.pi]], "its rates look like deg/s: multiply them by 0.01745"),
        (gyro(YAW)[:, :4] * [1, *3 * [1e3]], "its rates look like mrad/s"),
        (gyro(YAW, scale=9.0)[:, :4], "times as fast as the odometry: no known unit explains this"),
        (shifted(30.0), "its clock differs: it follows how the odometry turns 30.0 s late"),
        (shifted(-7.0), "its clock differs: it follows how the odometry turns 7.0 s early"),
        (shifted(1e6), "the imu is not used"),
        (noise(6000), "none of its axes follows how the odometry turns"),
        (noise(15), "it has 15 rows over 0.28 s"),
    ],
)
def test_what_is_of_no_use_is_told_and_costs_no_verdict(imu, words):
    run, told = read(imu)
    assert run.imu is None
    assert words in told


def test_one_whose_axis_is_said_wrongly_is_not_used():
    run, told = read(gyro(YAW)[:, :4], axis="-z")
    assert run.imu is None
    assert "-z is up, as meta.yaml says, but then it turns against the odometry" in told


def test_it_can_be_left_out():
    run, told = read(gyro(YAW), axis="none")
    assert run.imu is None
    assert not told


@pytest.mark.parametrize("kind", ["drive.bag", "drive.mcap", "drive"])
def test_it_is_read_from_bags_whatever_its_topic_is_called(tmp_path, kind, capsys):
    write(tmp_path / kind, {"/camera/gyro": gyro(YAW, (0.0, 0.0, -1.0))})
    (run,) = read_recording(tmp_path / kind).runs
    assert error(run)[0] < 0.009
    assert look.main([str(tmp_path / kind)]) == 0
    told = capsys.readouterr().out
    line = next(line for line in told.splitlines() if "/camera/gyro" in line)
    assert "sensor_msgs/Imu" in line
    assert "is imu" in line
    assert "the imu's -z is up" in told


def test_of_several_one_must_be_named(tmp_path):
    write(tmp_path / "drive.bag", {"/a": gyro(YAW), "/b": gyro(YAW, (1.0, 0.0, 0.0))})
    recording = read_recording(tmp_path / "drive.bag")
    assert recording.runs[0].imu is None
    (note,) = (note for note in recording.problems if "imu" in note)
    assert "which imu is the robot's is not said, so none is used: meta.yaml could say topics: {imu: /a}" in note
    assert "/b (sensor_msgs/Imu, 6000 at" in note
    (tmp_path / "meta.yaml").write_text("topics: {imu: /b}")
    assert "the imu's x is up" in " ".join(read_recording(tmp_path / "drive.bag").problems)


def test_stamps_of_another_clock_cost_the_imu_only(tmp_path):
    late = gyro(YAW)
    write(tmp_path / "drive.bag", {"/imu": late}, behind=500.0)
    recording = read_recording(tmp_path / "drive.bag")
    assert recording.runs[0].imu is None
    assert not recording.invalid
    assert "the imu is not used" in " ".join(recording.problems)


def test_tables_say_it_and_are_written_back(tmp_path):
    run, _ = read(gyro(YAW, (0.0, 0.0, -1.0)))
    write_csv_run(tmp_path / "one", run)
    (again,) = read_recording(tmp_path / "one").runs
    assert np.allclose(again.imu.column("w"), run.imu.column("w"), atol=1e-3)
    np.savetxt(tmp_path / "one" / "imu.csv", gyro(YAW), delimiter=",", header="t,wx,wy,wz,ax,ay,az", comments="")
    assert "the imu's z is up" in " ".join(read_recording(tmp_path / "one").problems)
    (tmp_path / "one" / "imu.csv").write_text("t,yaw\n0,1\n1,2\n")
    with pytest.raises(Error, match=r"imu\.csv:1: a rate is missing: w of the robot, or wx, wy, wz"):
        read_recording(tmp_path / "one")


def test_meta_names_its_axis(tmp_path):
    (tmp_path / "meta.yaml").write_text("imu: {axis: -z}")
    assert read_meta(tmp_path / "meta.yaml").imu == "-z"
    (tmp_path / "meta.yaml").write_text("imu: {axis: up}")
    with pytest.raises(Error, match=r"imu\.axis: must be one of x, y, z, -x, -y, -z, none: 'up'"):
        read_meta(tmp_path / "meta.yaml")


def write(path, sensors, behind=0.0):
    """Write the drive's commands and odometry, and sensors by topic, as a bag; behind [s]: their stamps are so old."""
    ros = 2 if path.suffix == "" else 1
    bag = Bag(path, ros=ros)
    rows = [(t, "/cmd_vel", (v, w)) for t, v, w in MADE["command"]]
    rows += [(row[0], "/odom", row[1:]) for row in MADE["odom"]]
    rows += [(row[0], topic, row[1:]) for topic, imu in sensors.items() for row in imu]
    for t, topic, values in sorted(rows, key=lambda row: row[:2]):
        t = round(START + t, 6)
        if topic == "/cmd_vel":
            bag.write(topic, bag.twist(*values), t)
        elif topic == "/odom":
            bag.write(topic, bag.odometry(t, values[:3], *values[3:]), t)
        else:
            bag.write(topic, bag.imu(t - behind, values), t)
    bag.writer.close()
