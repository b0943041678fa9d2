# SPDX-License-Identifier: BSD-3-Clause
"""The paper's experiments through the chair's own programs, at small size: docs/paper.md has them in full."""

import contextlib
import os
import re
import signal
import subprocess
import time
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import rosbag

from kurumaisu.bench.processes import master, program, running
from kurumaisu.critic.data.reading import read_recording
from kurumaisu.errors import Error
from kurumaisu.paper.chair import drive
from kurumaisu.params import shipped
from kurumaisu.ros import recorder
from kurumaisu.ros.paper import figures, launches
from kurumaisu.ros.paper.command import main

SPEEDS = (0.3, 0.9, -0.4)
PATIENCE = 90.0  # [s] of wall time: this computer may be busy


def test_the_voltages_at_the_converter_are_those_of_the_law(tmp_path, capsys):
    text = shipped("launch/paper/figure_10.yaml").read_text().split("phases:")[0]
    phases = [f"  - {{seconds: 1.5, v: {v}, w: 0.0, ramp: 0.0}}\n" for v in (*SPEEDS, 0.0)]
    (tmp_path / "speeds.yaml").write_text(f"{text}phases:\n{''.join(phases)}")
    assert main(["dac", "--out", str(tmp_path / "out"), "--speeds", str(tmp_path / "speeds.yaml")]) == 0
    rows = np.genfromtxt(tmp_path / "out/figure_10.csv", delimiter=",", names=True, dtype=None, encoding="utf-8")
    for law, intercepts in (("intercept 0.1 V", (0.1, -0.1)), ("equation (1)", (0.127906, -0.108783))):
        mine = rows[rows["law"] == law]
        volts = dict(zip(mine["v"].tolist(), mine["volts"].tolist(), strict=True))
        for v in SPEEDS:  # by hand, from the paper
            line = 1.32402 * v + intercepts[0] if v > 0 else 2.07369 * v + intercepts[1]
            assert volts[v] == pytest.approx(line, abs=1.5 / 819)
    assert "a step is 1.22 mV" in capsys.readouterr().out


def test_the_wall_through_driver_and_virtual_sensor_agrees_with_equation_4(tmp_path, capsys):
    settings = tmp_path / "paper.yaml"
    settings.write_text(shipped("launch/paper.yaml").read_text().replace("  scans: 50 ", "  scans: 22 "))
    out = tmp_path / "out"
    assert main(["simulated-wall", "--out", str(out), "--settings", str(settings), "--speed", "4"]) == 0
    assert "off [se]" in capsys.readouterr().out
    assert "has died" not in (out / "scans.log").read_text()  # roslaunch tells it in red, even of a node that was done
    with rosbag.Bag(out / "scans/place_5.bag") as bag:
        (connection, *_) = bag._get_connections("scan")
        assert connection.header["callerid"] in ("/laser_node", b"/laser_node")
    rows = np.genfromtxt(out / "figure_12.csv", delimiter=",", names=True)
    assert list(rows["distance"]) == [0.2, 0.5, 1.0, 2.0, 4.0]
    assert (rows["scans"] >= 20).all()
    np.testing.assert_allclose(rows["mean"], 1.004587 * rows["distance"] * 1.0013 + 0.058826, atol=0.003)


def test_a_launch_that_fails_shows_the_end_of_its_log(tmp_path):
    with pytest.raises(Error, match=r"figure_12\.launch .*the end of"):
        launches.launch(["figure_12.launch", "bag:=b", "file:=none.yaml", "model:=none.yaml"], tmp_path / "l.log", 60.0)


def test_a_drive_is_watched_while_it_is_recorded(tmp_path):
    """Half a drive: what it lacks is said, and when it is interrupted the bag is whole."""
    said, bag = tmp_path / "said", tmp_path / "drive.bag"
    arguments = [f"file:={shipped(drive.HELD_OUT)}", f"bag:={tmp_path / 'other.bag'}", "speed:=4"]
    with (
        master() as ros,
        running(["roslaunch", "kurumaisu", "identification.launch", *arguments], environment=ros),
        running([program("calibrate"), "record", str(bag), "--every", "1"], said, ros) as watcher,
    ):
        deadline = time.monotonic() + PATIENCE
        while "turning left:" not in said.read_text() and time.monotonic() < deadline:
            time.sleep(0.2)
        watcher.send_signal(signal.SIGINT)
        assert watcher.wait(PATIENCE) == 1
    told = said.read_text()
    assert re.search(r"\d stretch(es)? of steady motion to this side, 8 are needed", told)
    assert "not enough" in told
    with rosbag.Bag(bag) as recorded:
        topics = recorded.get_type_and_topic_info().topics
        assert {"voltages", "ground_truth"} <= {name.lstrip("/") for name in topics}


@pytest.fixture(scope="module")
def chair(tmp_path_factory):
    """The environment of a chair that stands, on a master of its own.

    At three times the speed: bags are split by their stamps, whatever the clock on the wall says.
    """
    with (
        master() as ros,
        running(["roslaunch", "kurumaisu", "sim.launch", "speed:=3"], tmp_path_factory.mktemp("chair") / "log", ros),
    ):
        command = ["rostopic", "echo", "-n", "1", "--noarr", "/scan"]
        subprocess.run(command, env=ros, stdout=subprocess.DEVNULL, timeout=PATIENCE, check=True)
        yield ros


@contextlib.contextmanager
def watching(bag, *arguments, environment):
    """calibrate record, and the file of what it says."""
    said = bag.with_name("said")
    with running(
        [program("calibrate"), "record", str(bag), *arguments, "--every", "0.5"], said, environment
    ) as watcher:
        yield watcher, said


def wait_for(condition):
    deadline = time.monotonic() + PATIENCE
    while not condition() and time.monotonic() < deadline:
        time.sleep(0.1)
    assert condition()


def test_nobody_there_is_told(tmp_path):
    said = tmp_path / "said"
    with (
        master() as ros,
        running([program("calibrate"), "record", str(tmp_path / "a.bag"), "--every", "0.5"], said, ros) as watcher,
    ):
        wait_for(lambda: "no voltages, or no poses on ground_truth or odom" in said.read_text())
        watcher.send_signal(signal.SIGINT)
        assert watcher.wait(PATIENCE) == 1
    alone = {**os.environ, "ROS_MASTER_URI": "http://localhost:1"}
    with running([program("calibrate"), "record", str(tmp_path / "b.bag")], said, alone) as watcher:
        wait_for(lambda: "no master at http://localhost:1: start roscore, or use roslaunch" in said.read_text())
        watcher.send_signal(signal.SIGINT)
        assert watcher.wait(PATIENCE) == 128 + signal.SIGINT


def test_a_full_disk_is_told_before_and_while_it_is_recorded(tmp_path, monkeypatch):
    left = [5 * 2**30]
    monkeypatch.setattr(recorder.shutil, "disk_usage", lambda _: SimpleNamespace(free=left[0]))
    monkeypatch.setattr(recorder.Recorder, "_wait_until_heard", lambda *_: None)
    monkeypatch.setattr(recorder.rospy, "resolve_name", lambda name: name)
    with master() as ros:
        for name, value in ros.items():
            monkeypatch.setenv(name, value)
        watched = recorder.Recorder(tmp_path / "a.bag", ["voltages"])
        wait_for((tmp_path / "a.bag.active").exists)
        watched.check()
        left[0] = 2**29
        with pytest.raises(Error, match=r"0\.50 GiB are free: below 1 GiB rosbag record writes nothing"):
            watched.check()
        watched.close()
        assert watched.bags == [tmp_path / "a.bag"]
        with pytest.raises(Error, match="GiB are free"):
            recorder.Recorder(tmp_path / "b.bag", ["voltages"])
    with pytest.raises(Error, match=r"a\.bag: exists already"):
        recorder.Recorder(tmp_path / "a.bag", ["voltages"])


def test_programs_are_where_rosrun_looks():
    for name in ("paper", "calibrate"):
        assert os.access(program(name), os.X_OK)
        assert Path(program(name)).name == name


def test_all_figures_are_repeated_and_one_that_fails_is_not_forgotten(monkeypatch, tmp_path):
    done = []

    def part(name, code):
        def run(*_, **__):
            done.append(name)
            return code

        return run

    monkeypatch.setattr(figures, "drive", part("3-6", 1))
    monkeypatch.setattr(figures.wall, "figures_wall_of", part("7-9", 0))
    monkeypatch.setattr(figures.wall, "asked", part("conjecture", 0))
    monkeypatch.setattr(figures, "dac", part("10", 0))
    monkeypatch.setattr(figures, "simulated_wall", part("11-12", 0))
    assert main(["all", "--out", str(tmp_path)]) == 1
    assert done == ["3-6", "7-9", "conjecture", "10", "11-12"]


def test_what_is_recorded_is_packed_and_split_and_each_part_is_readable_alone(chair, tmp_path):
    bag = tmp_path / "drive.bag"
    with watching(bag, "--split", "3", environment=chair) as (watcher, said):
        wait_for((tmp_path / "drive_2.bag.active").exists)
        watcher.send_signal(signal.SIGINT)
        assert watcher.wait(PATIENCE) == 1
    parts = sorted(tmp_path.glob("drive_*.bag"))
    assert len(parts) >= 3
    assert " ".join(map(str, parts)) in said.read_text()
    assert "stretches of steady motion to this side, 8 are needed" in said.read_text()  # it stood
    for part in parts[:-1]:  # the last had just begun
        with rosbag.Bag(part) as recorded:
            assert recorded.get_compression_info().compression == "lz4"
            topics = {name.lstrip("/") for name in recorded.get_type_and_topic_info().topics}
        assert {"voltages", "ground_truth", "scan", "tf_static"} <= topics
    runs = [read_recording(part).runs[0] for part in parts[:-1]]
    assert all(run.pose is not None and run.voltage is not None for run in runs)


def test_a_recorder_that_dies_is_no_drive_that_is_enough(chair, tmp_path):
    bag = tmp_path / "drive.bag"
    with watching(bag, environment=chair) as (watcher, said):
        wait_for(lambda: "still missing" in said.read_text())
        (writer,) = [
            int(path.parent.name)
            for path in Path("/proc").glob("[0-9]*/cmdline")
            if str(bag).encode() in (line := path.read_bytes()) and line.split(b"\0")[0].endswith(b"/record")
        ]
        os.kill(writer, signal.SIGKILL)
        assert watcher.wait(PATIENCE) == 1
    assert "rosbag record ended by itself; what it wrote: rosbag reindex" in said.read_text()
