# SPDX-License-Identifier: BSD-3-Clause
"""critic look: what a recording holds, what meta.yaml could map, and what is missing, before anything is fitted."""

import struct

import mcap.writer
import numpy as np
import pytest
from recordings import Bag, full_run, series, write_bag

from kurumaisu.critic.app.look import look, main
from kurumaisu.critic.bags.mcap_file import McapFile
from kurumaisu.critic.bags.ros1 import Ros1Bag
from kurumaisu.critic.bags.ros2 import Ros2Bag
from kurumaisu.critic.data.csv_reader import write_csv_run
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


def test_the_messages_are_read_once(drive, monkeypatch):
    """And those of an MCAP file are not read to be counted: it states at its end how many there are."""
    (drive.parent / "meta.yaml").write_text(f"{MAPPING}\n")
    passes = []
    for kind in (McapFile, Ros1Bag, Ros2Bag):
        original = kind.messages
        monkeypatch.setattr(
            kind, "messages", lambda *given, own=original, **how: passes.append(1) or own(*given, **how)
        )
    records = McapFile._records
    monkeypatch.setattr(McapFile, "_records", lambda self: passes.append(0) or records(self))
    assert "200" in next(line for line in look(drive) if "/robot/cmd_vel" in line)
    assert passes == ([1, 0] if drive.suffix == ".mcap" else [1])


def test_a_piece_of_a_drive_is_looked_at(drive, capsys):
    (drive.parent / "meta.yaml").write_text(f"{MAPPING}\n")
    assert main([str(drive), "--from", "+5", "--to", "+15"]) == 0
    told = capsys.readouterr().out
    assert "base: 10 s of motion" in told
    assert "rows of command are left out, as asked" in told
    assert main([str(drive), "--from", "100"]) == 1
    assert "nothing is left from 100" in capsys.readouterr().err
    with pytest.raises(SystemExit):
        main([str(drive), "--to", "soon"])
    assert "must be a time in seconds" in capsys.readouterr().err


@pytest.mark.parametrize(
    "how",
    [
        {"use_statistics": False},
        {"repeat_channels": False},
        {"enable_crcs": False},
        {"use_statistics": False, "repeat_channels": False, "repeat_schemas": False, "use_summary_offsets": False},
    ],
)
def test_an_mcap_file_that_states_less_is_counted(tmp_path, monkeypatch, how):
    whole = mcap.writer.Writer
    monkeypatch.setattr(mcap.writer, "Writer", lambda *given, **more: whole(*given, **more, **how))
    write_bag(tmp_path / "drive.mcap", full_run(), ros=2)
    assert " 100 " in next(line for line in look(tmp_path / "drive.mcap") if "/odom" in line)


def test_damage_to_what_an_mcap_file_states_is_noticed(tmp_path):
    """Any bit of its end: the counts are those of the messages, or the file is refused by name."""
    write_bag(tmp_path / "drive.mcap", full_run(), ros=2)
    data = (tmp_path / "drive.mcap").read_bytes()
    (start,) = struct.unpack("<Q", data[-28:-20])
    whole = [line for line in look(tmp_path / "drive.mcap") if "_msgs/" in line]
    rng = np.random.default_rng(1000)
    for at in rng.integers(start, len(data), 20):
        damaged = bytearray(data)
        damaged[at] ^= 1 << rng.integers(8)
        (tmp_path / "drive.mcap").write_bytes(damaged)
        try:
            assert [line for line in look(tmp_path / "drive.mcap") if "_msgs/" in line] == whole
        except Error as error:
            assert "drive.mcap" in str(error)  # noqa: PT017
