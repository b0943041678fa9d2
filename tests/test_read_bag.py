# SPDX-License-Identifier: BSD-3-Clause
"""Bags: they must say the same as CSV, and what is wrong must be said."""

import numpy as np
import pytest
from recordings import BEAMS, PACKAGE, Bag, assert_same, full_run, write_bag
from rosbags.rosbag1 import Writer
from rosbags.rosbag2 import CompressionMode

from kurumaisu.critic.data.csv_writer import write_csv_run
from kurumaisu.critic.data.reading import read_recording
from kurumaisu.errors import Error

META = "topics: {ground_truth: /mocap/pose, tyre: /tyre_pressure}\n"


@pytest.mark.parametrize("compression", [None, Writer.CompressionFormat.BZ2, Writer.CompressionFormat.LZ4])
@pytest.mark.parametrize("start", [0.0, 1.7e9])
def test_a_bag_says_the_same_as_csv(tmp_path, compression, start):
    run = full_run(start=start)
    for kind in ("csv", "bag"):
        (tmp_path / kind).mkdir()
        (tmp_path / kind / "meta.yaml").write_text(META)
    write_csv_run(tmp_path / "csv" / "run_1", run)
    write_bag(tmp_path / "bag" / "run_1.bag", run, compression=compression, late=0.03)
    by_csv, by_bag = read_recording(tmp_path / "csv"), read_recording(tmp_path / "bag")
    assert by_bag.problems == by_csv.problems == ()
    assert by_bag.train == by_csv.train
    assert_same(by_csv.runs[0], by_bag.runs[0], atol=1e-12)
    # What the sensor reported in millimetres is the same number, not its float32 neighbour.
    np.testing.assert_array_equal(by_csv.runs[0].scan.values, by_bag.runs[0].scan.values)
    assert by_bag.runs[0].fan.beams == BEAMS


@pytest.mark.parametrize(
    ("name", "how"),
    {
        "sqlite3": ("run_1", {"ros": 2}),
        "sqlite3, messages packed": ("run_1", {"ros": 2, "compression": CompressionMode.MESSAGE}),
        "sqlite3, file packed": ("run_1", {"ros": 2, "compression": CompressionMode.FILE}),
        "mcap of ros2 bag": ("run_1", {"ros": 2, "storage": "MCAP"}),
        "mcap of ros2 bag, packed": (
            "run_1",
            {"ros": 2, "storage": "MCAP", "compression": CompressionMode.STORAGE},
        ),
        "mcap with ros 1": ("run_1.mcap", {"ros": 1, "compression": "LZ4"}),
        "mcap with ros 2": ("run_1.mcap", {"ros": 2, "compression": "ZSTD"}),
        "mcap, not packed": ("run_1.mcap", {"ros": 2}),
    }.values(),
    ids=str,
)
def test_every_container_says_the_same_as_csv(tmp_path, name, how):
    run = full_run(start=1.7e9)
    (tmp_path / "meta.yaml").write_text(META)
    write_bag(tmp_path / name, run, late=0.03, **how)
    recording = read_recording(tmp_path)
    assert recording.problems == ()
    assert recording.train == ("run_1",)
    assert_same(run, recording.runs[0], atol=1e-12)
    np.testing.assert_array_equal(recording.runs[0].scan.values, run.scan.values)


def test_a_file_of_a_ros2_bag_is_read_alone(tmp_path):
    run = full_run()
    (tmp_path / "meta.yaml").write_text(META)
    write_bag(tmp_path / "inner" / "drive", run, ros=2)
    (tmp_path / "inner" / "drive" / "drive.db3").replace(tmp_path / "run_1.db3")
    assert_same(run, read_recording(tmp_path).runs[0], atol=1e-12)


def test_a_twist_without_a_stamp_counts_when_received(tmp_path):
    run = full_run()
    (tmp_path / "meta.yaml").write_text(META)
    write_bag(tmp_path / "run_1.bag", run, stamped=False, late=0.2)
    assert_same(run, read_recording(tmp_path).runs[0], atol=1e-12)


def test_twists_received_in_one_tick_are_no_copies_and_the_last_of_them_holds(tmp_path):
    """A clock of 0.1 s, as that of a simulation at speed: three at a time, some with the same content."""
    bag = Bag(tmp_path / "drive.bag")
    asked = [(0.0, 0.0), (0.1, 0.0), (0.3, 0.1), (0.3, 0.1), (0.3, 0.1), (0.3, 0.1), (0.5, 0.0), (0.4, 0.0), (0.2, 0.0)]
    for n, command in enumerate(asked):
        bag.write("/cmd_vel", bag.twist(*command), 1.0 + 0.1 * (n // 3))
        bag.write("/odom", bag.odometry(1.0 + 0.03 * n, (0.01 * n, 0.0, 0.0), 0.3, 0.0), 1.0 + 0.03 * n)
    bag.writer.close()
    recording = read_recording(tmp_path / "drive.bag")
    assert recording.invalid == ()
    (told,) = (words for words in recording.problems if "cmd_vel" in words)
    assert "6 messages were dropped: a later one has the same time of receipt" in told
    command = recording.runs[0].command
    np.testing.assert_allclose(command.t, [1.0, 1.1, 1.2])
    np.testing.assert_array_equal(command.values, [asked[2], asked[5], asked[8]])


def test_stamped_rows_that_repeat_are_copies_as_before(tmp_path):
    bag = Bag(tmp_path / "drive.bag")
    for n in range(30):
        bag.write("/cmd_vel", bag.twist_stamped(1.0 + n // 3, 0.1 * (n // 3), 0.0), 1.0 + 0.3 * n)
        bag.write("/odom", bag.odometry(1.0 + 0.3 * n, (0.1 * n, 0.0, 0.0), 0.3, 0.0), 1.0 + 0.3 * n)
    bag.writer.close()
    assert any("repeats its rows" in words for words in read_recording(tmp_path / "drive.bag").invalid)


def test_topics_recorded_by_relative_names_count_too(tmp_path):
    """As `rosbag record scan odom` writes them."""
    run = full_run()
    (tmp_path / "meta.yaml").write_text(META)
    write_bag(tmp_path / "run_1.bag", run, slash="")
    assert_same(run, read_recording(tmp_path).runs[0], atol=1e-12)


def test_stamps_of_another_clock_forbid_a_verdict(tmp_path):
    (tmp_path / "meta.yaml").write_text(META)
    write_bag(tmp_path / "run_1.bag", full_run(), stamped=False, late=30.0)
    assert any("different clocks" in text and "+30 s" in text for text in read_recording(tmp_path).invalid)


def test_a_bag_alone_is_a_recording_and_its_queries_lie_in_a_folder_of_its_name(tmp_path):
    write_bag(tmp_path / "drive.bag", full_run())
    recording = read_recording(tmp_path / "drive.bag")
    assert recording.name == "drive"
    assert recording.runs[0].pose is None
    (tmp_path / "drive").mkdir()
    (tmp_path / "drive" / "query.csv").write_text("t0,t1\n1,2\n")
    assert read_recording(tmp_path).runs[0].queries.tolist() == [[1, 2]]
    (tmp_path / "drive" / "pose.csv").write_text("t,x,y,theta\n1,2,3,4\n")
    with pytest.raises(Error, match="the run drive also exists as a bag"):
        read_recording(tmp_path)


def test_a_topic_of_the_wrong_type_is_named(tmp_path):
    (tmp_path / "meta.yaml").write_text("topics: {scan: /odom}\n")
    write_bag(tmp_path / "run_1.bag", full_run())
    with pytest.raises(Error, match="/odom is assigned to two parts"):
        read_recording(tmp_path)
    (tmp_path / "meta.yaml").write_text("topics: {scan: /mocap/pose}\n")
    with pytest.raises(
        Error, match=r"run_1.bag: /mocap/pose: is of type geometry_msgs/PoseStamped, not of sensor_msgs/L"
    ):
        read_recording(tmp_path)
    (tmp_path / "meta.yaml").write_text("topics: {scan: /laser/scan}\n")
    assert "run_1.bag: there is no topic /laser/scan" in read_recording(tmp_path).problems


def test_a_cut_bag_is_an_error_not_a_traceback(tmp_path):
    write_bag(tmp_path / "whole.bag", full_run())
    data = (tmp_path / "whole.bag").read_bytes()
    for size in (0, 10, 5000, len(data) // 2, len(data) - 100):
        path = tmp_path / "cut.bag"
        path.write_bytes(data[:size])
        with pytest.raises(Error, match=r"cut\.bag: is not a complete ROS 1 bag"):
            read_recording(path)


def test_damage_anywhere_in_a_bag_is_an_error_that_names_it_or_harmless(tmp_path):
    write_bag(tmp_path / "whole.bag", full_run())
    data = bytearray((tmp_path / "whole.bag").read_bytes())
    rng = np.random.default_rng(7)
    path = tmp_path / "damaged.bag"
    messages = []
    for _ in range(40):
        damaged = data.copy()
        for at in rng.integers(0, len(data), 30):
            damaged[at] = rng.integers(256)
        path.write_bytes(damaged)
        try:
            read_recording(path)
        except Error as error:
            messages.append(str(error))
    assert messages
    assert all("damaged.bag" in message for message in messages)


def test_every_type_of_pose_is_read(tmp_path):
    for name, make in {
        "odometry": lambda bag, t: bag.odometry(t, (t, 2.0, 0.5), 0.0, 0.0),
        "stamped": lambda bag, t: bag.pose_stamped(t, (t, 2.0, 0.5)),
    }.items():
        bag = Bag(tmp_path / f"{name}.bag")
        for t in (1.0, 2.0, 3.0):
            bag.write("/ground_truth", make(bag, t), t)
            bag.write("/cmd_vel", bag.twist(0.5, 0.1), t)
        bag.writer.close()
    for run in read_recording(tmp_path).runs:
        np.testing.assert_allclose(run.pose.values, [[1, 2, 0.5], [2, 2, 0.5], [3, 2, 0.5]], atol=1e-15)


def test_a_bag_of_2010_by_a_real_urg_is_read():
    path = PACKAGE.parent / "shared" / "data" / "scan_tools" / "demo.bag"
    if not path.exists():
        pytest.skip(f"needs the recording {path.name} of scan_tools beside the repository")
    (run,) = read_recording(path).runs
    assert run.scan.values.shape == (360, 681)
    # Written by that driver as 0 m or as error codes of 1 to 19 mm.
    assert np.isnan(run.scan.values).mean() == pytest.approx(0.054, abs=0.001)
    assert np.nanmin(run.scan.values) > 0.02
