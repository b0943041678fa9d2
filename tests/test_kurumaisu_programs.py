# SPDX-License-Identifier: BSD-3-Clause
"""The program kurumaisu: its parts, what it says where one is not there, and drives of the simulated chair."""

import importlib
import sys

import numpy as np
import pytest

from kurumaisu.critic.data.reading import read_recording
from kurumaisu.errors import Error
from kurumaisu.params import load_model, shipped
from kurumaisu.programs import critic, sim
from kurumaisu.programs.main import main

WORLD = shipped("worlds/arena.world")


@pytest.fixture
def without(monkeypatch):
    """Return what takes modules away, as on a machine that has not got them."""

    def take(*names):
        for name in names:
            monkeypatch.setitem(sys.modules, name, None)
        for name in [name for name in sys.modules if name.startswith("kurumaisu.ros") or name == "kurumaisu.slam"]:
            monkeypatch.delitem(sys.modules, name)

    return take


def test_each_program_has_a_help(capsys):
    with pytest.raises(SystemExit) as ended:
        main(["--help"])
    assert ended.value.code == 0
    said = capsys.readouterr().out.partition("programs:\n")[2].partition("\n\n")[0]
    names = [line.split()[0] for line in said.splitlines()]
    assert "critic" in names
    for name in names:
        with pytest.raises(SystemExit) as ended:
            main([name, "--help"])
        assert ended.value.code == 0
        assert "usage:" in capsys.readouterr().out


def test_an_unknown_program_is_named(capsys):
    with pytest.raises(SystemExit) as ended:
        main(["critc"])
    assert ended.value.code == 2
    assert "there is no 'critc'; did you mean critic" in capsys.readouterr().err


@pytest.mark.parametrize("part", ["watch", "experiment"])
def test_a_part_of_the_critic_that_needs_ros_says_so_in_a_line(without, capsys, part):
    without("rospy")
    assert critic.main([part]) == 1
    said = capsys.readouterr().err
    assert said.startswith(f"critic: {part} needs ROS: install the ROS package")
    assert said.count("\n") == 1


def test_slam_without_mrpt_says_what_is_missing(without, tmp_path, capsys):
    without("kurumaisu._slam")
    with pytest.raises(Error, match="SLAM needs MRPT"):
        importlib.import_module("kurumaisu.slam")
    (tmp_path / "log.rawlog").touch()
    assert main(["critic", str(tmp_path / "log.rawlog"), "-q", "-o", str(tmp_path / "out")]) == 1
    said = capsys.readouterr().err
    assert "needs MRPT" in said
    assert said.count("\n") == 1


def test_a_drive_is_a_recording_of_what_was_commanded(tmp_path, capsys):
    assert main(["sim", str(WORLD), "-v", "0.3", "--seconds", "2", "-o", str(tmp_path)]) == 0
    assert "2.00 s driven" in capsys.readouterr().out
    recording = read_recording(tmp_path)
    (run,) = recording.runs
    np.testing.assert_array_equal(run.command.values, [[0.3, 0.0], [0.0, 0.0]])
    law = load_model(shipped("launch/md100.yaml")).translation
    assert run.voltage.column("v_f")[0] == law.volts(0.3)
    way = run.pose.values[-1, :2] - run.pose.values[0, :2]
    assert np.hypot(*way) == pytest.approx(0.3 * (run.pose.t[-1] - run.pose.t[0]), abs=0.03)  # the reference's noise
    assert recording.laser.beams == run.scan.values.shape[1]


def test_a_seed_is_a_drive(tmp_path):
    for name, seed in (("a", 5), ("b", 5), ("c", 6)):
        assert main(["sim", str(WORLD), "--seconds", "1", "--seed", str(seed), "-o", str(tmp_path / name)]) == 0
    texts = [(tmp_path / name / "drive/pose.csv").read_text() for name in "abc"]
    assert texts[0] == texts[1] != texts[2]


def test_commands_of_a_table_and_effects_of_a_file(tmp_path, capsys):
    (tmp_path / "c.csv").write_text("w,t,v\n0.5,1,0\n0,2,0\n")
    (tmp_path / "e.yaml").write_text("effects: [{id: base.gain_w, parameters: {gain: 0.5}}]\n")
    np.testing.assert_array_equal(sim.commands(tmp_path / "c.csv"), [[0, 0, 0], [1, 0, 0.5], [2, 0, 0]])
    turned = []
    for more in ([], ["--effects", str(tmp_path / "e.yaml")]):
        assert main(["sim", "--commands", str(tmp_path / "c.csv"), "-o", str(tmp_path / "out"), *more]) == 0
        pose = read_recording(tmp_path / "out").runs[0].pose.values
        turned.append(pose[-1, 2] - pose[0, 2])
    assert turned == pytest.approx([0.5, 0.75], abs=0.03)


def test_touching_a_wall_is_told(tmp_path, capsys):
    assert main(["sim", str(WORLD), "-v", "0.6", "--seconds", "20", "-o", str(tmp_path)]) == 0
    assert "touched something 1 times" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--seconds", "0"], "--seconds more than 0"),
        (["-v", "nan"], "-v and -w must be numbers"),
        (["nowhere.world"], "nowhere.world"),
        (["--commands", "short.csv"], "short.csv: t must increase"),
        (["--commands", "back.csv"], "back.csv: t must increase"),
        (["--commands", "empty.csv"], "empty.csv:2: column 'v': is not a number"),
        (["--commands", "other.csv"], "other.csv:1: column 'w' is missing"),
    ],
)
def test_senseless_drives_are_refused_in_a_line(tmp_path, monkeypatch, capsys, words, said):
    monkeypatch.chdir(tmp_path)
    tables = {"short": "t,v,w\n0,0,0\n", "back": "t,v,w\n1,0,0\n0,0,0\n", "empty": "t,v,w\n0,,0\n1,0,0\n"}
    for name, text in {**tables, "other": "t,v\n0,0\n"}.items():
        (tmp_path / f"{name}.csv").write_text(text)
    assert main(["sim", *words]) == 1
    printed = capsys.readouterr().err
    assert said in printed
    assert printed.count("\n") == 1
    assert not (tmp_path / "driven").exists()


def test_two_ways_to_say_the_commands_are_one_too_many(capsys):
    with pytest.raises(SystemExit) as ended:
        main(["sim", "--commands", "c.csv", "-v", "1"])
    assert ended.value.code == 2
    assert "--commands says what" in capsys.readouterr().err
