# SPDX-License-Identifier: BSD-3-Clause
"""view RECORDING: what bags and tables hold is shown as they hold it; what cannot be shown is said."""

import base64
import hashlib
import json
import re
import signal
import subprocess
import sys
import time
import tracemalloc
import urllib.request
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from recordings import Bag, full_run, series, write_bag
from rosbags.rosbag1 import Reader
from rosbags.typesys import Stores, get_typestore
from stories import full_story, full_verdict
from viewer_rig import viewer_settings

from kurumaisu.critic import explain
from kurumaisu.critic.recording import Recording, Run
from kurumaisu.critic.report import write_report
from kurumaisu.critic.view import main, opened
from kurumaisu.critic.view_album import read_album
from kurumaisu.critic.view_spool import Spool
from kurumaisu.critic.view_tape import laid
from kurumaisu.critic.write_csv import write_csv_run
from kurumaisu.errors import Error
from kurumaisu.params import follow_commands, load_model, shipped
from kurumaisu.viewer import report
from kurumaisu.viewer.playback import CHAIR
from kurumaisu.viewer.tape import Track

DATA = Path(__file__).resolve().parents[2] / "shared/data"
ROOM = """\
name "room"
define wall model ( size [6.2 0.1 1.0] )
wall ( pose [3.0 -0.05 0 0] )
wall ( pose [3.0 5.05 0 0] )
wall ( pose [-0.05 2.5 0 90] size [5.2 0.1 1.0] )
wall ( pose [6.05 2.5 0 90] size [5.2 0.1 1.0] )
"""
LASER = {"x": 0.3, "y": 0.1, "yaw": 0.2, "angle_min": -1.5, "angle_increment": 0.5, "beams": 7}


class Look:
    """A recording that is open, and what a page would be told."""

    def __init__(self, path, folder=None, wanted=()):
        self.opened = opened(path, wanted, None, folder, viewer_settings())
        self.source = self.opened.source

    def __enter__(self):
        self.opened.__enter__()
        self.mailbox = self.source._hub.join(lambda: None)
        self.told = {}
        self._hear()
        return self

    def __exit__(self, *_):
        self.opened.__exit__()

    def _hear(self):
        for payload in self.mailbox.take():
            if isinstance(payload, bytes):
                self.scan = payload
            else:
                message = json.loads(payload)
                self.told[message["type"]] = message

    def at(self, t, run=None):
        if run is not None:
            self.source.command("run", {"run": run})
        self.source.command("seek", {"t": t})
        self._hear()
        return self.told["state"]

    @property
    def notes(self):
        return " | ".join(note["text"] for note in self.told["state"]["notes"])

    def ranges(self):
        """Return ranges and errors (None where there are none) of the scan that is shown, and where the laser is."""
        flags, count = self.scan[1], int.from_bytes(self.scan[2:4], "little")
        values = np.frombuffer(self.scan, np.float32, offset=8)
        return values[7 : 7 + count], values[7 + count : 7 + 2 * count] if flags & 1 else None, values[:3]


def stamp_of(message):
    stamp = message.header.stamp
    return (stamp.sec * 10**9 + stamp.nanosec) / 1e9


def meta(folder, **content):
    (folder / "meta.yaml").write_text(json.dumps(content))  # JSON is YAML


def test_a_bag_is_shown_as_rosbags_reads_it(tmp_path):
    write_bag(tmp_path / "drive.bag", full_run())
    meta(tmp_path, topics={"ground_truth": "/mocap/pose"})
    store = get_typestore(Stores.ROS1_NOETIC)
    with Look(tmp_path) as look, Reader(tmp_path / "drive.bag") as bag:
        wanted = [one for one in bag.connections if one.topic in ("/mocap/pose", "/scan")]
        rows = [(c.topic, store.deserialize_ros1(raw, c.msgtype)) for c, _, raw in bag.messages(wanted)]
        rng = np.random.default_rng(1)
        checked = 0
        for i in rng.permutation(len(rows)):  # to and fro
            topic, message = rows[i]
            state = look.at(stamp_of(message))
            if topic == "/scan":
                ranges, error, _ = look.ranges()
                seen = message.ranges.copy()
                seen[seen > message.range_max] = np.inf
                np.testing.assert_allclose(ranges, seen, atol=1e-6)
                assert error is None
                continue
            x, y, theta = state["truth"]
            turn = 2 * np.arctan2(message.pose.orientation.z, message.pose.orientation.w)
            assert (x, y) == pytest.approx((message.pose.position.x, message.pose.position.y))
            assert np.cos(theta - turn) == pytest.approx(1.0)
            assert state["poses"][CHAIR] == state["truth"]
            checked += 1
        assert checked == 100


def test_tables_are_shown_as_numpy_reads_them(tmp_path):
    write_csv_run(tmp_path / "one", full_run())
    tables = {
        name: np.genfromtxt(tmp_path / f"one/{name}.csv", delimiter=",", names=True)
        for name in ("pose", "command", "voltage", "odom")
    }
    with Look(tmp_path) as look:
        for row in tables["pose"][::-7]:
            assert look.at(row["t"])["truth"] == pytest.approx([row["x"], row["y"], row["theta"]])
        for row in tables["voltage"][1::9]:
            assert look.at(row["t"] + 1e-4)["volts"] == pytest.approx([row["v_f"], row["v_s"]])
        for before, row in zip(tables["command"], tables["command"][1:], strict=False):
            assert look.at(row["t"])["commanded"] == pytest.approx([row["v"], row["w"]])
            assert look.at(row["t"] - 1e-4)["commanded"] == pytest.approx([before["v"], before["w"]])
        row = tables["odom"][40]
        state = look.at(row["t"])
        assert [state["v"], state["w"]] == pytest.approx([row["v"], row["w"]])
        playback = state["playback"]
        assert playback["from"] == min(table["t"][0] for table in tables.values())


def on_circle(t):
    theta = 0.25 * t
    return 2.0 + 1.2 * np.sin(theta), 1.3 + 1.2 * (1 - np.cos(theta)), theta


def drive(name, start, seconds=30.0):
    """A chair that circles as it is asked to."""
    t = start + np.arange(0, seconds, 0.1)
    v, w = np.full(len(t), 0.3), np.full(len(t), 0.25)
    x, y, theta = on_circle(t - start)
    turned = np.column_stack([x - 1.0, y + 2.0, theta])
    ranges = np.array([room_ranges(pose) for pose in np.column_stack([x, y, theta])]) + 0.02
    return Run(
        name,
        command=series(t, "vw", v, w),
        pose=series(t, ("x", "y", "theta"), x, y, theta),
        odom=series(t, ("x", "y", "theta", "v", "w"), *turned.T, v, w),
        scan=series(t, [f"r{i}" for i in range(7)], ranges),
    )


def room_ranges(pose):
    """Return the ranges in a room of 6 x 5 m, by the planes that each beam meets."""
    x, y, theta = pose
    x, y = x + 0.3 * np.cos(theta) - 0.1 * np.sin(theta), y + 0.3 * np.sin(theta) + 0.1 * np.cos(theta)
    along = theta + 0.2 - 1.5 + 0.5 * np.arange(7)
    c, s = np.cos(along), np.sin(along)
    with np.errstate(divide="ignore"):
        return np.minimum(np.where(c > 0, 6 - x, -x) / c, np.where(s > 0, 5 - y, -y) / s)


@pytest.fixture
def two_runs(tmp_path):
    (tmp_path / "room.world").write_text(ROOM)
    meta(tmp_path, world="room.world", laser=LASER)
    for run in (drive("early", 10.0), drive("late", 5000.0)):
        write_csv_run(tmp_path / run.name, run)
    return tmp_path


def test_the_error_of_a_scan_is_against_the_map_at_the_measured_pose(two_runs):
    with Look(two_runs) as look:
        for t in (39.0, 10.0, 24.0):
            x, y, theta = look.at(t)["truth"]
            ranges, error, laser = look.ranges()
            still = room_ranges((x, y, theta)) + 0.02
            np.testing.assert_allclose(ranges, still, atol=1e-5)
            rate = load_model(shipped("launch/md100.yaml")).laser.time_increment
            swept = [room_ranges(on_circle(t - 10.0 + k * rate))[k] for k in range(7)]  # the chair moves on meanwhile
            np.testing.assert_allclose(error, still - swept, atol=2e-5)
            assert laser[2] == pytest.approx(theta + 0.2)
            assert laser[:2] == pytest.approx(
                [x + 0.3 * np.cos(theta) - 0.1 * np.sin(theta), y + 0.3 * np.sin(theta) + 0.1 * np.cos(theta)]
            )
        walls = next(body for body in look.told["world"]["bodies"] if body["kind"] == "wall")
        corners = np.array(walls["segments"]).reshape(-1, 2)
        assert corners.min(axis=0) == pytest.approx([-0.1, -0.1], abs=0.01)
        assert corners.max(axis=0) == pytest.approx([6.1, 5.1], abs=0.01)


def test_runs_begin_at_their_own_times(two_runs):
    with Look(two_runs) as look:
        assert look.told["state"]["playback"]["run"] == "early"
        assert look.at(5012.0, "late")["truth"] == pytest.approx(look.at(22.0, "early")["truth"])
        with pytest.raises(Error, match=r"seek: t must be 10.000 to 39.900 s"):
            look.at(5012.0)


def test_odometry_is_laid_on_the_truth_where_it_began(two_runs):
    with Look(two_runs) as look:
        for t in (10.0, 25.0, 38.7):  # this odometry is without an error, in a frame of its own
            state = look.at(t)
            assert state["odom"] == pytest.approx(state["truth"], abs=1e-9)


def test_odometry_that_was_set_is_laid_anew():
    run = drive("one", 0.0)
    odom = run.odom.values.copy()
    odom[150:, :2] += 50.0
    odom[150:, 2] += 1.0
    truth = Track(run.pose.t, run.pose.values)
    np.testing.assert_allclose(laid(replace(run.odom, values=odom), truth)[150], run.pose.values[150], atol=1e-9)
    np.testing.assert_allclose(laid(run.odom, None), run.odom.values[:, :3])


def test_the_simulated_drive_is_the_reports(two_runs):
    model = follow_commands(load_model(shipped("launch/md100.yaml")))
    run = drive("late", 5000.0)
    (overlay,) = explain.overlays(Recording("r", (run,), ("late",)), model)
    with Look(two_runs) as look:
        start = look.at(5000.0, "late")
        assert start["poses"]["model"] == pytest.approx(start["truth"])
        gaps = np.flatnonzero(np.isnan(overlay.baseline[:, 0]))
        assert len(gaps) == 2  # begun again after 10 s and 20 s
        for t, row in ((5004.0, 40), (5009.9, 99), (5015.0, 150 + 2)):
            assert look.at(t)["poses"]["model"][:2] == pytest.approx(overlay.baseline[row].tolist(), abs=1e-6)
        assert "extended" not in start["poses"]


def test_the_reports_model_drives_too(two_runs, tmp_path):
    folder = tmp_path / "criticism"  # where it is found without being named
    folder.mkdir()
    write_report(folder / "report.html", full_verdict(), full_story())
    text = shipped("launch/md100.yaml").read_text()
    custom = "{positive: {slope: 1.0, intercept: 0.0}, negative: {slope: 1.0, intercept: 0.0}}"
    text = text.replace("voltage_law: published", "voltage_law: identity")
    text = text.replace("voltage_laws:", f"voltage_laws:\n  identity: {{translation: {custom}, steering: {custom}}}")
    text = text.replace("effects: []", "effects: [{id: base.gain_v, parameters: {gain: 0.5}}]")
    (folder / "extended.yaml").write_text(text)
    with Look(two_runs, folder) as look:
        state = look.at(11.0)
        begin = np.array(look.at(10.0)["truth"][:2])
        ways = {name: np.hypot(*(np.array(state["poses"][name][:2]) - begin)) for name in ("model", "extended")}
        assert ways["extended"] == pytest.approx(1.5 * ways["model"], rel=0.01)


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
        (cut_bag, r"drive.bag: is not a whole ROS 1 bag \(rosbag reindex may help\)"),
        (lambda path: path.write_text("no bag"), r"drive.bag: is not a whole ROS 1 bag"),
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
    command = [sys.executable, "-c", "import sys; from kurumaisu.critic.view import main; sys.exit(main())"]
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


def long_bag(path, scans=1200, beams=682):
    """Two minutes of scans at 10 Hz, and poses."""
    bag = Bag(path)
    rng = np.random.default_rng(1)
    fan = {"angle_min": -2.0862138, "angle_max": 2.0922, "angle_increment": 0.0061359, "scan_time": 0.1}
    for i in range(scans):
        t = 100.0 + 0.1 * i
        bag.write("/ground_truth", bag.pose_stamped(t, (0.01 * i, 0.0, 0.0)), t)
        message = bag.make(
            "sensor_msgs/msg/LaserScan",
            header=bag.header(t),
            **fan,
            time_increment=0.0,
            range_min=0.06,
            range_max=4.0,
            ranges=rng.uniform(0.5, 3.5, beams).astype(np.float32),
            intensities=np.zeros(0, dtype=np.float32),
        )
        bag.write("/scan", message, t)
    bag.writer.close()


def test_the_scans_of_a_long_bag_are_not_held_in_memory(tmp_path):
    long_bag(tmp_path / "long.bag")
    tracemalloc.start()
    album = read_album(tmp_path / "long.bag", ())
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    (run,) = album.recording.runs
    assert run.scan.columns == ("row",)
    assert len(run.scan.t) == 1200
    # read whole, as the critic must, they are 6.5 MB several times over
    assert peak < 4e6


def test_any_moment_is_there_at_once(two_runs):
    with Look(two_runs) as look:
        times = np.random.default_rng(2).uniform(10.0, 39.9, 200)
        spent = []
        for t in times:
            begin = time.perf_counter()
            look.source.command("seek", {"t": float(t)})
            spent.append(time.perf_counter() - begin)
        assert np.median(spent) < 0.02


def test_a_spool_gives_back_what_was_put_aside_in_any_order():
    rng = np.random.default_rng(3)
    rows = rng.uniform(0.0, 4.0, (50, 9))
    rows[7, 2:4] = np.nan, np.inf
    spool = Spool()
    assert [spool.put(row) for row in rows] == list(range(50))
    assert spool.put(np.zeros(8)) == -1
    for i in rng.permutation(50):
        np.testing.assert_array_equal(spool.get(i), rows[i].astype(np.float32))


def test_a_report_is_served_with_our_script_and_no_other():
    evil = (
        b"<html><head><style>a{}</style></head><body><style type='x'>b{}</style><script>alert(1)</script></body></html>"
    )
    body, headers = report.page(evil)
    policy = dict(part.split(" ", 1) for part in headers["Content-Security-Policy"].split("; "))
    assert policy["default-src"] == "'none'"
    assert policy["script-src"] == "'self'"  # so the inline one does not run
    for sheet in (b"a{}", b"b{}"):
        assert base64.b64encode(hashlib.sha256(sheet).digest()).decode() in policy["style-src-elem"]
    assert body.count(b'<script type="module" src="../page/report.js"></script>') == 1
    assert body.index(b"report.js") < body.index(b"</body>")


@pytest.mark.skipif(not (DATA / "office").is_dir(), reason="no recordings beside the source tree")
def test_a_bag_of_others_can_be_scrubbed():
    path = DATA / "office/runA_cmd_rolling.bag"
    store = get_typestore(Stores.ROS1_NOETIC)
    with Look(path) as look, Reader(path) as bag:
        (topic,) = [one for one in bag.connections if one.topic == "/ground_truth"]
        rows = [store.deserialize_ros1(raw, c.msgtype) for c, _, raw in bag.messages([topic])]
        for message in rows[:: -(len(rows) // 40)]:
            state = look.at(stamp_of(message))
            place = message.pose.pose.position
            assert state["truth"][:2] == pytest.approx([place.x, place.y], abs=1e-6)
        assert state["poses"]["model"]
