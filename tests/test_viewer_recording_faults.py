# SPDX-License-Identifier: BSD-3-Clause
"""view RECORDING: what is missing or cannot be shown is said; the command ends when it is asked to."""

import re
import signal
import subprocess
import sys
import urllib.request
from dataclasses import replace

import numpy as np
import pytest
from recordings import Bag, full_run, write_bag
from view_rig import LASER, Look, drive, meta

from kurumaisu.critic.data.csv_reader import write_csv_run
from kurumaisu.critic.values.recording import Run
from kurumaisu.critic.view.command import main
from kurumaisu.viewer.playback import CHAIR


def test_a_run_without_poses_shows_its_scans_where_odometry_is(tmp_path):
    run = drive("one", 0.0)
    write_csv_run(tmp_path / "one", replace(run, pose=None))
    meta(tmp_path, laser=LASER)
    with Look(tmp_path) as look:
        state = look.at(10.0)
        assert state["truth"] is None
        assert state["poses"][CHAIR] == state["odom"] == pytest.approx(run.odom.values[100, :3].tolist())
        assert look.ranges()[1] is None
        assert "no reference pose was recorded: odometry serves" in look.notes
        assert "scans have no range error without a map" in look.notes


def test_scans_alone_are_shown_from_the_origin(tmp_path):
    run = drive("one", 0.0)
    write_csv_run(tmp_path / "one", Run("one", scan=run.scan))
    meta(tmp_path, laser=LASER)
    with Look(tmp_path) as look:
        state = look.at(10.0)
        assert state["poses"] == {}
        ranges, _, laser = look.ranges()
        np.testing.assert_allclose(ranges, run.scan.values[100], rtol=1e-6)
        assert laser == pytest.approx([0.3, 0.1, 0.2])
        assert "its scans at 0, 0" in look.notes


def test_poses_alone_are_enough_to_look_at(tmp_path):
    write_csv_run(tmp_path / "one", Run("one", pose=drive("one", 0.0).pose))
    with Look(tmp_path) as look:
        assert "not simulated: one: has neither voltages nor commands nor odometry" in look.notes
        assert look.at(1.0)["truth"]


def test_scans_of_another_laser_are_said_and_not_drawn(tmp_path):
    write_csv_run(tmp_path / "one", drive("one", 0.0))
    with Look(tmp_path) as look:
        look.at(10.0)
        assert "scans of 7 beams are not shown: the laser has 682; say laser in meta.yaml" in look.notes


def test_an_empty_run_beside_another_is_said(two_runs):
    (two_runs / "nothing").mkdir()
    (two_runs / "nothing" / "pose.csv").write_text("t,x,y,theta\n")
    with Look(two_runs) as look:
        assert "nothing: has nothing to look at: none of command.csv or /cmd_vel" in look.notes
        assert look.told["state"]["playback"]["runs"] == ["early", "late"]


def empty_bag(path):
    bag = Bag(path)
    bag.write("/unrelated", bag.make("std_msgs/msg/Float64", data=1.0), 1.0)
    bag.writer.close()


def cut_bag(path):
    write_bag(path, full_run())
    whole = path.read_bytes()
    path.write_bytes(whole[: len(whole) // 2])


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (empty_bag, r"drive.bag: has nothing to look at: none of command.csv or /cmd_vel.*/scan"),
        (cut_bag, r"drive.bag: is not a complete ROS 1 bag \(rosbag reindex may help\)"),
        (lambda path: path.write_text("no bag"), r"drive.bag: is not a complete ROS 1 bag"),
        (lambda path: None, r"drive.bag: there is no such file or folder"),
        (lambda path: path.mkdir(), r"drive.bag: holds no run"),
    ],
)
def test_what_cannot_be_shown_is_said_on_one_line(tmp_path, capsys, make, words):
    make(tmp_path / "drive.bag")
    assert main([str(tmp_path / "drive.bag"), "--port", "0"]) == 1
    told = capsys.readouterr().err.splitlines()
    assert re.search(words, told[1])
    assert len(told) == 2  # the first says what is read


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--report", "nowhere"], "--report: nowhere/report.html: there is no such file"),
        (["--runs", "noon"], "--runs"),
        (["--model", "nowhere.yaml"], "nowhere.yaml"),
    ],
)
def test_a_wrong_option_is_named(two_runs, capsys, arguments, words):
    assert main([str(two_runs), "--port", "0", *arguments]) == 1
    assert words in capsys.readouterr().err


def test_a_world_that_is_not_there_is_named(two_runs, capsys):
    meta(two_runs, world="other.world")
    assert main([str(two_runs), "--port", "0"]) == 1
    assert "meta.yaml: world: is not a file" in capsys.readouterr().err


@pytest.mark.parametrize("how", [signal.SIGINT, signal.SIGTERM])
def test_the_command_says_where_to_look_and_ends_when_asked(two_runs, how):
    command = [sys.executable, "-c", "import sys; from kurumaisu.critic.view.command import main; sys.exit(main())"]
    process = subprocess.Popen([*command, str(two_runs), "--port", "0"], stdout=subprocess.PIPE, text=True)
    try:
        told = [process.stdout.readline(), process.stdout.readline()]
        assert told[0].endswith("2 runs\n")
        address = re.fullmatch(r"open (http://127.0.0.1:\d+/)#token=\S+\n", told[1])[1]
        with urllib.request.urlopen(address, timeout=10) as answer:
            assert b"kurumaisu" in answer.read()
        process.send_signal(how)
        assert process.wait(10) == 0
    finally:
        process.kill()
        process.wait()
