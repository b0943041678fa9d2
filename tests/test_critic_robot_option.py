# SPDX-License-Identifier: BSD-3-Clause
"""critic --robot: which robot a recording is of where meta.yaml does not say it, or says another."""

import json

import numpy as np
import pytest
from recordings import Bag, series

from kurumaisu.critic.app import look
from kurumaisu.critic.app.cli import main
from kurumaisu.critic.data.csv_reader import write_csv_run
from kurumaisu.critic.data.reading import read_recording
from kurumaisu.critic.values.recording import Run
from kurumaisu.params import robot_called

MINE = "{kind: diff_drive, radius: 0.1, track: 0.5}"


def in_degrees(folder):
    """Write a drive that no verdict needs a fit for: its headings jump by 360."""
    t = 0.1 * np.arange(100)
    heading = np.where(t < 5.0, 179.0, -179.0)
    pose = series(t, ("x", "y", "theta"), 0.02 * t, 0.0 * t, heading)
    write_csv_run(folder, Run(folder.name, command=series(t, "vw", 0.2 + 0 * t, 0 * t), pose=pose))
    return folder


def taken(output):
    return json.loads((output / "verdict.json").read_text())


def test_it_says_which_robot_a_bag_without_meta_is_of(tmp_path, capsys):
    bag = Bag(tmp_path / "drive.bag")
    for n in range(100):
        bag.write("/cmd_vel", bag.twist(0.2, 0.0), 10.0 + 0.1 * n)
        bag.write("/ground_truth", bag.pose_stamped(10.0 + 0.1 * n, (0.02 * n, 0.0, 0.0)), 10.0 + 0.1 * n)
    bag.writer.close()
    (tmp_path / "mine.yaml").write_text(MINE)
    for word, kind in (("velocity", "velocity"), (str(tmp_path / "mine.yaml"), "diff_drive")):
        assert look.main(["--robot", word, str(tmp_path / "drive.bag")]) == 0
        assert f"\nrobot: {kind}\n" in capsys.readouterr().out
    assert look.main([str(tmp_path / "drive.bag")]) == 0
    assert "robot: not said: an MD-100, or one without voltages, is assumed; --robot" in capsys.readouterr().out


def test_it_holds_in_place_of_another_in_meta_which_is_said(tmp_path, capsys):
    drive = in_degrees(tmp_path / "drive")
    (drive / "meta.yaml").write_text(f"robot: {MINE}")
    assert main([str(drive), "-o", str(tmp_path / "out"), "--robot", "velocity", "-q"]) == 6
    verdict = taken(tmp_path / "out")
    assert (verdict["robot"]["kind"], verdict["robot"]["assumed"]) == ("velocity", False)
    words = (
        "meta.yaml: robot: {kind: diff_drive, radius: 0.1, track: 0.5}: "
        "the command line says {kind: velocity}, which holds"
    )
    assert words in verdict["problems"]
    assert look.main([str(drive), "--robot", "velocity"]) == 0
    assert f"data: {words}" in capsys.readouterr().out
    (tmp_path / "mine.yaml").write_text(MINE)
    same = read_recording(drive, robot=robot_called(str(tmp_path / "mine.yaml")))
    assert not [note for note in same.problems if "robot" in note]


def test_it_goes_with_each_of_several_recordings_to_another_process(tmp_path):
    for name in ("a", "b"):
        in_degrees(tmp_path / "all" / name)
        (tmp_path / "all" / name / "meta.yaml").write_text("{}")
    assert main([str(tmp_path / "all"), "-o", str(tmp_path / "out"), "--robot", "velocity", "-q"]) == 6
    assert [taken(tmp_path / "out" / name)["robot"]["kind"] for name in ("a", "b")] == ["velocity"] * 2


def test_the_wheels_of_a_recording_have_its_sizes(tmp_path):
    (tmp_path / "mine.yaml").write_text(MINE)
    t = 0.1 * np.arange(100)
    turned = np.column_stack([t, t, 2 * t])
    drive = in_degrees(tmp_path / "drive")
    np.savetxt(drive / "wheels.csv", turned, delimiter=",", header="t,left,right", comments="")
    (run,) = read_recording(drive, robot=robot_called(str(tmp_path / "mine.yaml"))).runs
    assert np.allclose(run.odom.values[:, 3:], (0.15, 0.2))


@pytest.mark.parametrize(
    ("word", "words"),
    [
        ("tank", "there is no robot 'tank'; there are: diff_drive, md100, skid_steer, velocity"),
        ("velocty", "did you mean velocity?"),
        ("diff_drive", "its wheels are not known: give a .yaml file that says {kind: diff_drive, radius: METRES"),
        ("gone.yaml", "gone.yaml"),
        ("odd.yaml", "odd.yaml: weels: is not a known key"),
        ("", "there is no robot ''"),
    ],
)
@pytest.mark.parametrize("program", [main, look.main])
def test_what_no_robot_is_is_a_wrong_command_line(tmp_path, monkeypatch, capsys, program, word, words):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "odd.yaml").write_text("{kind: velocity, weels: 4}")
    with pytest.raises(SystemExit) as end:
        program(["--robot", word, "drive.bag"])
    assert end.value.code == 2
    said = capsys.readouterr().err
    assert "--robot: " in said
    assert words in said
