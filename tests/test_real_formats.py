# SPDX-License-Identifier: BSD-3-Clause
"""Real recordings of other robots, in every format that others' libraries write: what is read and said is the same."""

import dataclasses
from pathlib import Path

import mcap.reader
import mcap.writer
import numpy as np
import pytest
import rosbag
from recordings import Bag
from rosbags.convert import convert
from rosbags.typesys import Stores, get_typestore

from kurumaisu.critic.app.job import Job, criticise
from kurumaisu.critic.data.reading import read_recording

REAL = Path(__file__).resolve().parents[2] / "shared/strangers/real"
ROBOTS = {
    "lego_camera": "robot: {kind: diff_drive, radius: 0.03, track: 0.15}\n",
    "lego_scan": "",
    "create_r5": "robot: velocity\n",
    "gap_stop": "robot: velocity\n",
}


def as_tables(folder, name):
    """Copy a real recording with what is said of it; skip, saying so, where it is not there."""
    if not (REAL / name).exists():
        pytest.skip(f"the real recording {name} is not there")
    meta = ROBOTS[name]
    (folder / "drive").mkdir(parents=True)
    for item in (REAL / name).iterdir():
        meta += item.read_text() if item.suffix == ".yaml" else ""
        if item.suffix == ".csv":
            (folder / "drive" / item.name).write_bytes(item.read_bytes())
    (folder / "meta.yaml").write_text(meta)


def as_ros1(path, run):
    """Write a bag of format 2.0 by the library rosbags, each message received 20 ms after its stamp."""
    bag = Bag(path)

    def posed(t, row):
        return bag.pose_stamped(t, row) if len(row) == 3 else bag.point_stamped(t, *row)

    def scanned(t, row):
        fan = {"angle_min": -2.02485, "angle_increment": 0.006135923, "range_min": 0.0, "range_max": 0.0}
        return dataclasses.replace(bag.scan(t, row), **fan)

    to_message = {
        "command": ("/cmd_vel", lambda t, row: bag.twist_stamped(t, *row)),
        "pose": ("/ground_truth", posed),
        "odom": ("/odom", lambda t, row: bag.odometry(t, row[:3], *row[3:])),
        "scan": ("/scan", scanned),
    }
    messages = []
    for part, (topic, message) in to_message.items():
        if (run / f"{part}.csv").exists():
            rows = np.loadtxt(run / f"{part}.csv", delimiter=",", skiprows=1)
            messages += [(row[0], topic, message(row[0], row[1:])) for row in rows]
    for t, topic, message in sorted(messages, key=lambda item: item[0]):
        bag.write(topic, message, t + 0.02)
    bag.writer.close()


def as_ros_writes_it(path, source):
    """Copy a bag of ROS 1 by ROS's own library, packed."""
    with rosbag.Bag(str(source)) as read, rosbag.Bag(str(path), "w", compression="lz4") as written:
        for topic, message, t in read.read_messages(raw=True):
            written.write(topic, message, t, raw=True)


def as_ros2(path, source, storage):
    """Convert a bag of ROS 1 as rosbags-convert does."""
    humble = get_typestore(Stores.ROS2_HUMBLE)
    convert([source], path, storage, 9, None, "file", None, humble, (), (), (), ())


def as_one_mcap(path, source):
    """Copy the file of a bag of ROS 2 by the library mcap, packed, with an index of its own."""
    with source.open("rb") as read, path.open("wb") as written:
        writer = mcap.writer.Writer(written, compression=mcap.writer.CompressionType.LZ4)
        writer.start(profile="ros2")
        channels = {}
        for schema, channel, message in mcap.reader.make_reader(read).iter_messages():
            if channel.topic not in channels:
                kind = writer.register_schema(schema.name, schema.encoding, schema.data)
                channels[channel.topic] = writer.register_channel(channel.topic, channel.message_encoding, kind)
            writer.add_message(channels[channel.topic], message.log_time, message.data, message.publish_time)
        writer.finish()


def in_every_format(folder, name):
    """Return a real recording's tables, and the same as bags and MCAP files, by format."""
    formats = ("tables", "bag 2.0", "bag 2.0 of ROS, packed", "sqlite3", "mcap", "mcap of its library, packed")
    found = {kind: folder / kind for kind in formats}
    as_tables(found["tables"], name)
    for kind in formats[1:]:
        found[kind].mkdir()
        (found[kind] / "meta.yaml").write_bytes((found["tables"] / "meta.yaml").read_bytes())
    source = found["bag 2.0"] / "drive.bag"
    as_ros1(source, found["tables"] / "drive")
    as_ros_writes_it(found["bag 2.0 of ROS, packed"] / "drive.bag", source)
    for storage in ("sqlite3", "mcap"):
        as_ros2(found[storage] / "drive", source, storage)
    as_one_mcap(found["mcap of its library, packed"] / "drive.mcap", found["mcap"] / "drive" / "drive.mcap")
    return found


@pytest.mark.parametrize("name", ROBOTS)
def test_a_real_recording_reads_the_same_from_every_format(tmp_path, name):
    tables, *others = (read_recording(path) for path in in_every_format(tmp_path, name).values())
    for other in others:
        assert (other.train, other.robot, other.invalid) == (tables.train, tables.robot, tables.invalid)
        assert len(other.problems) == len(tables.problems)
        (one,), (two,) = tables.runs, other.runs
        parts = [(getattr(one, part), getattr(two, part)) for part in ("command", "voltage", "pose", "odom", "scan")]
        assert any(a is not None for a, _ in parts)
        for a, b in parts:
            assert (a is None) == (b is None)
            if a is not None:
                assert a.columns == b.columns
                np.testing.assert_array_equal(a.t, b.t)
                np.testing.assert_allclose(a.values, b.values, rtol=0, atol=1e-9)
        assert set(one.covariates) == set(two.covariates)


def test_the_verdict_on_a_recording_is_the_same_from_every_format(tmp_path):
    found = in_every_format(tmp_path, "gap_stop")
    first, *others = (
        criticise(Job(found[kind], tmp_path / "out" / kind), lambda _: None).verdict
        for kind in ("tables", "bag 2.0", "sqlite3", "mcap")
    )
    for other in others:
        assert (other.verdict, other.robot) == (first.verdict, first.robot)
        assert [cause.id for cause in other.causes] == [cause.id for cause in first.causes]
