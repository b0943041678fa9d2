# SPDX-License-Identifier: BSD-3-Clause
"""view RECORDING: what bags and tables hold is shown as they hold it."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from recordings import full_run, write_bag
from rosbags.rosbag1 import Reader
from rosbags.typesys import Stores, get_typestore
from stories import full_story, full_verdict
from view_rig import Look, drive, meta, on_circle, room_ranges, stamp_of

from kurumaisu.critic.data.csv_reader import write_csv_run
from kurumaisu.critic.judge.misfit import overlays
from kurumaisu.critic.report.page import report_page
from kurumaisu.critic.values.recording import Recording
from kurumaisu.critic.view.tape import laid
from kurumaisu.errors import Error
from kurumaisu.params import driven_as, load_model, shipped, shipped_robot
from kurumaisu.viewer.playback import CHAIR
from kurumaisu.viewer.tape import Track
from kurumaisu.whole_files import write_whole

DATA = Path(__file__).resolve().parents[2] / "shared/data"


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
    model = driven_as(load_model(shipped("launch/md100.yaml")), shipped_robot("velocity"))
    run = drive("late", 5000.0)
    (overlay,) = overlays(Recording("r", (run,), ("late",)), model)
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
    write_whole({folder / "report.html": report_page(full_verdict(), full_story())})
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
