# SPDX-License-Identifier: BSD-3-Clause
"""critic look: what a recording holds, what meta.yaml could map, and what is missing, before anything is fitted."""

import numpy as np
import pytest
from recordings import Bag, full_run, series, write_bag

from kurumaisu.critic.app.look import look, main
from kurumaisu.critic.data.csv_writer import write_csv_run
from kurumaisu.critic.data.reading import read_recording
from kurumaisu.critic.values.recording import Run
from kurumaisu.errors import Error

MAPPING = "topics: {cmd_vel: /robot/cmd_vel, ground_truth: /vicon/chair/pose}"


@pytest.fixture(params=["drive.bag", "drive.mcap", "drive"])
def drive(tmp_path, request):
    """A drive of 20 s whose topics have names of their own: poses stop for 3 s, and come 50 ms late."""
    path = tmp_path / request.param
    bag = Bag(path, ros=2 if request.param == "drive" else 1)
    for n in range(200):
        t = 10.0 + 0.1 * n
        bag.write("/robot/cmd_vel", bag.twist(0.2, 0.0), t)
        bag.write("/move_base/goal", bag.pose_stamped(t, (5.0, 0.0, 0.0)), t)
        bag.write("/joint_states", bag.joints(t, ["l", "r"], [0.1 * n, 0.1 * n], []), t)
        bag.write("/tf", bag.transforms(), t)
        if not 100 <= n < 130:
            bag.write("/vicon/chair/pose", bag.pose_stamped(t, (0.02 * n, 0.0, 0.0)), t + 0.05)
    bag.writer.close()
    return path


def test_a_bag_of_other_topics_is_told_with_a_mapping_that_works(drive):
    with pytest.raises(Error) as raised:
        read_recording(drive)
    told = str(raised.value)
    assert f"meta.yaml could say {MAPPING}; meta.yaml could say reference: {{tf: [map, base_link]}}" in told
    assert "/robot/cmd_vel (geometry_msgs/Twist, 200 at 10" in told
    (drive.parent / "meta.yaml").write_text(f"{MAPPING}\ntrain: [another_drive]\n")
    (run,) = read_recording(drive).runs
    assert (len(run.command.t), len(run.pose.t)) == (200, 170)


def test_what_there_is_is_told_before_anything_is_fitted(drive, capsys):
    assert main([str(drive)]) == 0
    told = capsys.readouterr().out
    line = next(line for line in told.splitlines() if "/vicon/chair/pose" in line)
    for words in (
        "geometry_msgs/PoseStamped",
        "170",
        "10 Hz",
        "1, up to 3.1 s",
        "stamp, +50 ms",
        "could be ground_truth",
    ):
        assert words in line
    assert "receipt" in next(line for line in told.splitlines() if "/robot/cmd_vel" in line)
    assert "could be wheels" in next(line for line in told.splitlines() if "/joint_states" in line)
    for words in (
        MAPPING,
        "wheels: {topic: /joint_states, left: JOINT,",
        "base: not criticised: missing commands or voltages",
    ):
        assert words in told
    (drive.parent / "meta.yaml").write_text(f"{MAPPING}\n")
    assert main([str(drive)]) == 0
    told = capsys.readouterr().out
    assert "could say  topics" not in told
    assert "is pose" in next(line for line in told.splitlines() if "/vicon/chair/pose" in line)
    assert "base: 20 s of motion, against measured poses" in told
    assert "laser: not criticised: missing scans, a map (world: in meta.yaml)" in told


def test_a_topic_of_meta_that_is_not_there_is_told_with_those_that_could_serve(tmp_path):
    (tmp_path / "meta.yaml").write_text("topics: {ground_truth: /mocap/poses, tyre: /tyre}\n")
    write_bag(tmp_path / "drive.bag", full_run())
    pose, tyre = (words for words in read_recording(tmp_path).problems if "no topic" in words)
    assert pose.startswith(
        "drive.bag: there is no topic /mocap/poses; there are: /mocap/pose (geometry_msgs/PoseStamped, 100"
    )
    assert tyre == "drive.bag: there is no topic /tyre; did you mean /tyre_pressure?"


def test_tables_and_what_is_wrong_with_them_are_told(tmp_path):
    t = 0.1 * np.arange(100)
    commands = series(t, "vw", np.r_[np.full(50, 0.3), np.zeros(50)], np.zeros(100))
    odom = series(t, ("x", "y", "theta"), 0.03 * np.arange(100), np.zeros(100), np.zeros(100))
    write_csv_run(tmp_path / "one", Run("one", command=commands, odom=odom))
    write_csv_run(tmp_path / "two", Run("two", command=commands))
    (tmp_path / "one" / "notes.csv").write_text("t,x\n")
    told = "\n".join(look(tmp_path))
    for words in (
        "data: one/notes.csv: not read",
        "base: 5 s of motion, against odometry: what the wheels do on the floor does not show",
        "laser: not criticised: missing scans",
        "gain: on each drive in turn",
    ):
        assert words in told


def test_what_cannot_be_read_is_an_error(tmp_path, capsys):
    (tmp_path / "drive.mcap").write_bytes(b"\x89MCAP0\r\n")
    assert main([str(tmp_path / "drive.mcap")]) == 1
    assert "drive.mcap: is not a complete MCAP file (mcap recover may help)" in capsys.readouterr().err
