# SPDX-License-Identifier: BSD-3-Clause
"""Bags: they must say the same as CSV, and what is wrong must be said."""

import dataclasses
import sqlite3

import mcap.writer
import numpy as np
import pytest
import rosbag
from recordings import BEAMS, PACKAGE, Bag, assert_same, full_run, write_bag
from rosbags.rosbag1 import Writer
from rosbags.rosbag2 import CompressionMode
from rosbags.typesys import get_types_from_msg

from kurumaisu.critic.data.csv_reader import write_csv_run
from kurumaisu.critic.data.reading import read_recording
from kurumaisu.errors import Error

CONTAINERS = pytest.mark.parametrize(
    ("name", "how"),
    {
        "format 1.2": ("run_1.bag", {"old": True}),
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


@CONTAINERS
def test_every_container_says_the_same_as_csv(tmp_path, name, how):
    run = full_run(start=1.7e9)
    (tmp_path / "meta.yaml").write_text(META)
    write_bag(tmp_path / name, run, late=0.03, **how)
    recording = read_recording(tmp_path)
    assert recording.problems == ()
    assert recording.train == ("run_1",)
    assert_same(run, recording.runs[0], atol=1e-12)
    np.testing.assert_array_equal(recording.runs[0].scan.values, run.scan.values)


def test_a_bag_of_format_1_2_is_one_to_ros_too(tmp_path):
    write_bag(tmp_path / "run_1.bag", full_run(), old=True)
    with rosbag.Bag(str(tmp_path / "run_1.bag"), allow_unindexed=True) as bag:
        assert bag.version == 102
        stamped = [message for topic, message, _ in bag.read_messages() if topic == "/cmd_vel"]
    twists = [(message.header.stamp.to_sec(), message.twist.linear.x) for message in stamped]
    command = read_recording(tmp_path).runs[0].command
    np.testing.assert_allclose(twists, np.stack([command.t, command.column("v")], axis=1))


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


@pytest.mark.parametrize("start", [0.0, 1.7e9])
def test_a_stamp_of_0_is_one_where_a_clock_begins_there_and_else_was_not_set(tmp_path, start):
    bag = Bag(tmp_path / "drive.bag")
    for n in range(20):
        stamp = start + 0.1 * n if n else 0.0
        bag.write("/cmd_vel", bag.twist_stamped(stamp, 0.5, 0.1), start + 0.1 * n + 0.02)
        bag.write("/odom", bag.odometry(stamp, (0.1 * n, 0.0, 0.0), 0.5, 0.1), start + 0.1 * n + 0.02)
    bag.writer.close()
    (run,) = read_recording(tmp_path).runs
    for part in (run.command, run.odom):
        np.testing.assert_allclose(part.t[:2], [start if start == 0.0 else start + 0.02, start + 0.1], rtol=1e-15)


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
    (told,) = read_recording(tmp_path).problems
    assert told.startswith("run_1.bag: there is no topic /laser/scan; there are: /scan (sensor_msgs/LaserScan, 100 at")


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
    (tmp_path / "whole.bag").rename(tmp_path / "damaged.bag")
    assert all("damaged.bag" in message for message in refusals_of_damage(tmp_path / "damaged.bag", tmp_path, 40))


@CONTAINERS
def test_damage_in_any_container_is_an_error_that_names_it_or_harmless(tmp_path, name, how):
    """And a file that was cut, wherever it was, is never read as if it had been whole."""
    (tmp_path / "meta.yaml").write_text(META)
    write_bag(tmp_path / name, full_run(), **how)
    folder = tmp_path / name
    for path in [folder] if folder.is_file() else sorted(folder.iterdir()):
        assert all(name in message for message in refusals_of_damage(path, tmp_path, 6))
        data = path.read_bytes()
        for size in (0, 10, len(data) // 2, len(data) - 12) if path.suffix != ".yaml" else (0, len(data) // 2):
            path.write_bytes(data[:size])
            with pytest.raises(Error, match=rf"{name}"):
                read_recording(tmp_path)
        path.write_bytes(data)


def refusals_of_damage(path, recording, count):
    """Damage a file in so many ways, and return what was said of those that could not be read."""
    data = bytearray(path.read_bytes())
    rng = np.random.default_rng(7)
    messages = []
    for _ in range(count):
        damaged = data.copy()
        for at in rng.integers(0, len(data), 30):
            damaged[at] = rng.integers(256)
        path.write_bytes(damaged)
        try:
            read_recording(recording)
        except Error as error:
            messages.append(str(error))
    path.write_bytes(data)
    assert messages
    return messages


def test_what_a_recorder_left_beside_its_database_is_not_lost(tmp_path):
    write_bag(tmp_path / "run_1", full_run(), ros=2)
    (tmp_path / "run_1" / "run_1.db3-wal").write_bytes(b"messages")
    with pytest.raises(Error, match=r"run_1\.db3: was not closed: run_1\.db3-wal holds messages; sqlite3 "):
        read_recording(tmp_path)


def test_a_file_that_metadata_names_must_be_there_and_lies_in_the_bag(tmp_path):
    write_bag(tmp_path / "run_1", full_run(), ros=2)
    metadata = tmp_path / "run_1" / "metadata.yaml"
    metadata.write_text(metadata.read_text().replace("run_1.db3", "../../etc/passwd"))
    with pytest.raises(Error, match=r"run_1/passwd: No such file or directory"):
        read_recording(tmp_path)


def test_bags_before_iron_carry_no_definitions(tmp_path):
    write_bag(tmp_path / "run_1", full_run(), ros=2)
    database = sqlite3.connect(tmp_path / "run_1" / "run_1.db3")
    database.executescript("DROP TABLE message_definitions; UPDATE schema SET schema_version = 3;")
    database.close()
    (tmp_path / "meta.yaml").write_text(META)
    with pytest.raises(Error, match=r"/voltages: the bag has no definition of its type kurumaisu/Voltages"):
        read_recording(tmp_path)
    (tmp_path / "meta.yaml").write_text("topics: {ground_truth: /mocap/pose, tyre: /tyre_pressure, voltages: /none}\n")
    run = dataclasses.replace(read_recording(tmp_path).runs[0], voltage=full_run().voltage)
    assert_same(full_run(), run, atol=1e-12)


def test_messages_that_are_none_of_ros_are_told_by_topic(tmp_path):
    with (tmp_path / "drive.mcap").open("wb") as file:
        writer = mcap.writer.Writer(file)
        writer.start()
        schema = writer.register_schema("foxglove.PoseInFrame", "jsonschema", b"{}")
        channel = writer.register_channel("/ground_truth", "json", schema)
        writer.add_message(channel, 1, b"{}", 1)
        writer.finish()
    with pytest.raises(
        Error, match=r"drive\.mcap: /ground_truth: its messages are encoded as 'json', not as those of ROS"
    ):
        read_recording(tmp_path / "drive.mcap")


def poses_of(tmp_path, make):
    """The reference of a drive whose poses at 1, 2 and 3 s are these messages, recorded by ROS 1 and by ROS 2."""
    for ros, name in ((1, "one.bag"), (2, "two")):
        bag = Bag(tmp_path / name, ros=ros)
        for t in (1.0, 2.0, 3.0):
            bag.write("/ground_truth", make(bag, t), t)
            bag.write("/cmd_vel", bag.twist(1.0, 0.0), t)
        bag.writer.close()
    return [run.pose for run in read_recording(tmp_path).runs]


def test_every_type_of_pose_is_read(tmp_path):
    for name, make in {
        "odometry": lambda bag, t: bag.odometry(t, (t, 2.0, 0.5), 0.0, 0.0),
        "stamped": lambda bag, t: bag.pose_stamped(t, (t, 2.0, 0.5)),
        "covariance": lambda bag, t: bag.pose_with_covariance(t, (t, 2.0, 0.5)),
        "transform": lambda bag, t: bag.transform(t, "world", "marker", (t, 2.0, 0.5)),
        "plain": lambda bag, t: bag.pose(t, 2.0, 0.5),
        "planar": lambda bag, t: bag.make("geometry_msgs/msg/Pose2D", x=t, y=2.0, theta=0.5),
    }.items():
        (tmp_path / name).mkdir()
        for pose in poses_of(tmp_path / name, make):
            np.testing.assert_allclose(pose.values, [[1, 2, 0.5], [2, 2, 0.5], [3, 2, 0.5]], atol=1e-15, err_msg=name)


def test_positions_are_read_and_a_satellite_s_are_metres(tmp_path):
    """Headings come from the way driven: here straight on, to the north-east."""
    for name, make in {
        "points": lambda bag, t: bag.point_stamped(t, t, t),
        # At 45 degrees a minute of arc of latitude is 1852 m, and of longitude its cosine, but for 0.3 %.
        "fixes": lambda bag, t: bag.fix(t, 45.0 + t / 1852 / 60, 7.0 + t / 1852 / 60 / np.cos(np.pi / 4)),
    }.items():
        (tmp_path / name).mkdir()
        for pose in poses_of(tmp_path / name, make):
            np.testing.assert_allclose(np.diff(pose.values[:, :2], axis=0), np.ones((2, 2)), rtol=5e-3)
            np.testing.assert_allclose(pose.values[:, 2], np.pi / 4, atol=2e-3)


@pytest.mark.parametrize(("ros", "name"), [(1, "drive.bag"), (2, "drive")])
def test_a_chain_of_transforms_is_the_reference(tmp_path, ros, name):
    """map -> odom turned a quarter and moved now and then, odom -> base_footprint fast, a mounting that is static."""
    bag = Bag(tmp_path / name, ros=ros)
    fixed = bag.transform(0.0, "base_footprint", "base_link", (0.1, 0.0, 0.0))
    bag.write("/tf_static", bag.transforms(fixed), 0.0)
    for n in range(101):
        t = 0.1 * n
        if n % 50 == 0:
            bag.write("/tf", bag.transforms(bag.transform(t, "map", "/odom", (0.02 * t, 1.0, np.pi / 2))), t)
        moved = bag.transform(t, "odom", "base_footprint", (0.5 * t, 0.0, 0.0))
        other = bag.transform(t, "base_link", "wheel", (0.0, 0.0, 3.0 * t))
        bag.write("/tf", bag.transforms(moved, other), t + 0.01)
        bag.write("/cmd_vel", bag.twist(0.5, 0.0), t)
    bag.writer.close()
    (tmp_path / "meta.yaml").write_text("reference: {tf: [map, base_link]}\n")
    (run,) = read_recording(tmp_path).runs
    t = 0.1 * np.arange(101)
    np.testing.assert_allclose(run.pose.t, t, atol=1e-9)
    expected = np.stack([0.02 * t, 1.1 + 0.5 * t, np.full(101, np.pi / 2)], axis=1)
    np.testing.assert_allclose(run.pose.values, expected, atol=1e-12)
    for frames, words in {
        "map, base_lnk": "no frame 'base_lnk'; did you mean base_link?",
        "base_link, map": "no chain of transforms leads from base_link down to map; there are: ",
        "base_footprint, base_link": "nothing moves between base_footprint and base_link",
    }.items():
        (tmp_path / "meta.yaml").write_text(f"reference: {{tf: [{frames}]}}\n")
        with pytest.raises(Error, match=words):
            read_recording(tmp_path)
    (tmp_path / "meta.yaml").write_text("reference: {tf: base_link}\n")
    with pytest.raises(Error, match=r"meta.yaml: reference.tf: must be two frames, as in \[map, base_link\]"):
        read_recording(tmp_path)


WHEELS = "radius: 0.1, track: 0.4"


@pytest.mark.parametrize("given", ["angles", "rates", "topics"])
def test_wheels_are_odometry(tmp_path, given):
    """A quarter of a circle of 1 m to the left in 4 s; other joints come in messages of their own."""
    w = np.pi / 8
    left, right = (w - 0.2 * w) / 0.1, (w + 0.2 * w) / 0.1
    bag = Bag(tmp_path / "drive.bag")
    for n in range(41):
        t = 1.0 + 0.1 * n
        if given == "topics":
            for side, rate in (("left", left), ("right", right)):
                bag.write(f"/{side}", bag.make("std_msgs/msg/Float64", data=rate), t)
        else:
            angles = [right * 0.1 * n, 9.0, left * 0.1 * n] if given == "angles" else []
            bag.write("/joint_states", bag.joints(t, ["r", "arm", "l"], angles, [right, 0.0, left]), t)
            bag.write("/joint_states", bag.joints(t, ["lift"], [1.0], [0.0]), t)
        bag.write("/cmd_vel", bag.twist(w, w), t)
    bag.writer.close()
    source = "left: /left, right: [/right]" if given == "topics" else "topic: /joint_states, left: l, right: r"
    (tmp_path / "meta.yaml").write_text(f"wheels: {{{source}, {WHEELS}}}\n")
    (run,) = read_recording(tmp_path).runs
    np.testing.assert_allclose(run.odom.values[-1], [1, 1, np.pi / 2, w, w], atol=1e-9)
    np.testing.assert_allclose(run.odom.values[20], [np.sin(2 * w), 1 - np.cos(2 * w), 2 * w, w, w], atol=1e-9)
    for wrong, words in {
        source.replace("right", "wrong"): "wheels.right: is missing",
        "topic: /joint_states, left: lef, right: r": "wheels: /joint_states",
        "left: /lef, right: /right": "wheels: there is no topic /lef",
    }.items():
        (tmp_path / "meta.yaml").write_text(f"wheels: {{{wrong}, {WHEELS}}}\n")
        with pytest.raises(Error, match=words):
            read_recording(tmp_path)


def test_odometry_without_rates_has_those_of_its_poses(tmp_path):
    """Whether a type has none, or a driver leaves them at 0: each row has those of the interval that ends there."""
    for name, make in {
        "poses": lambda bag, t: bag.pose_stamped(t, (t * t, 0.0, 0.0)),
        "zeros": lambda bag, t: bag.odometry(t, (t * t, 0.0, 0.0), 0.0, 0.0),
    }.items():
        bag = Bag(tmp_path / f"{name}.bag")
        for t in (1.0, 2.0, 3.0):
            bag.write("/odom", make(bag, t), t)
            bag.write("/cmd_vel", bag.twist(0.5, 0.1), t)
        bag.writer.close()
    for run in read_recording(tmp_path).runs:
        np.testing.assert_allclose(run.odom.column("v"), [3, 3, 5])
        np.testing.assert_array_equal(run.odom.column("w"), [0, 0, 0])


def test_a_command_of_a_steering_angle_is_refused_with_the_reason(tmp_path):
    bag = Bag(tmp_path / "drive.bag")
    text = (
        "float32 steering_angle\nfloat32 steering_angle_velocity\nfloat32 speed\nfloat32 acceleration\nfloat32 jerk\n"
    )
    bag.store.register(get_types_from_msg(text, "ackermann_msgs/msg/AckermannDrive"))
    fields = ("steering_angle", "steering_angle_velocity", "speed", "acceleration", "jerk")
    for t in (1.0, 2.0):
        bag.write("/cmd_vel", bag.make("ackermann_msgs/msg/AckermannDrive", **dict.fromkeys(fields, 0.1)), t)
    bag.writer.close()
    with pytest.raises(Error, match=r"/cmd_vel: a command of type ackermann_msgs/AckermannDrive steers by an angle"):
        read_recording(tmp_path / "drive.bag")


def test_a_command_ends_where_meta_says_so(tmp_path):
    bag = Bag(tmp_path / "drive.bag")
    for t in (1.0, 1.1, 1.2, 4.0):
        bag.write("/cmd_vel", bag.twist(0.5, 0.1), t)
        bag.write("/odom", bag.odometry(t, (t, 0.0, 0.0), 0.5, 0.1), t)
    bag.writer.close()
    assert read_recording(tmp_path).runs[0].command.t.tolist() == [1.0, 1.1, 1.2, 4.0]
    (tmp_path / "meta.yaml").write_text("command_hold: 0.5\n")
    command = read_recording(tmp_path).runs[0].command
    np.testing.assert_allclose(command.t, [1.0, 1.1, 1.2, 1.7, 4.0, 4.5])
    assert command.column("v").tolist() == [0.5, 0.5, 0.5, 0.0, 0.5, 0.0]


def test_a_type_of_ones_own_is_read_by_its_definition(tmp_path):
    for ros, name in ((1, "one.bag"), (2, "two"), (1, "three.mcap"), (2, "four.mcap")):
        bag = Bag(tmp_path / name, ros=ros)
        bag.store.register(get_types_from_msg("float32 pressure\nTyre inner\nuint8 SOFT=3\n", "lab/msg/Tyres"))
        bag.store.register(get_types_from_msg("float64 wear\n", "lab/msg/Tyre"))
        for t in (1.0, 2.0):
            tyre = bag.make("lab/msg/Tyre", wear=0.5)
            bag.write("/tyres", bag.make("lab/msg/Tyres", pressure=2.0 + t, inner=tyre), t)
            bag.write("/cmd_vel", bag.twist(0.5, 0.1), t)
            bag.write("/odom", bag.odometry(t, (t, 0.0, 0.0), 0.5, 0.1), t)
        bag.writer.close()
    (tmp_path / "meta.yaml").write_text("topics: {tyre: /tyres}\n")
    for run in read_recording(tmp_path).runs:
        assert run.covariates["tyre.pressure"].values.tolist() == [[3.0], [4.0]]
        assert run.covariates["tyre.inner.wear"].values.tolist() == [[0.5], [0.5]]
        assert set(run.covariates) == {"tyre.pressure", "tyre.inner.wear"}


def test_a_bag_of_2010_by_a_real_urg_is_read():
    path = PACKAGE.parent / "shared" / "data" / "scan_tools" / "demo.bag"
    if not path.exists():
        pytest.skip(f"needs the recording {path.name} of scan_tools beside the repository")
    (run,) = read_recording(path).runs
    assert run.scan.values.shape == (360, 681)
    # Written by that driver as 0 m or as error codes of 1 to 19 mm.
    assert np.isnan(run.scan.values).mean() == pytest.approx(0.054, abs=0.001)
    assert np.nanmin(run.scan.values) > 0.02
