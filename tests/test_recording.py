# SPDX-License-Identifier: BSD-3-Clause
"""Recordings of CSV tables and meta.yaml: what is wrong must be said, and nothing else changed."""

import shutil

import numpy as np
import pytest
from recordings import BEAMS, PACKAGE, assert_same, full_run, series

from kurumaisu.critic.data.csv_reader import write_csv_run
from kurumaisu.critic.data.excerpt import Excerpt, gap, moment
from kurumaisu.critic.data.reading import read_recording
from kurumaisu.critic.values.recording import Run
from kurumaisu.errors import Error


def test_what_is_written_as_csv_reads_back_to_the_last_bit(tmp_path):
    run = full_run(start=1.7e9)
    write_csv_run(tmp_path / "run_1", run)
    recording = read_recording(tmp_path)
    assert recording.problems == ()
    assert recording.train == ("run_1",)
    assert recording.name == tmp_path.name
    back = recording.runs[0]
    assert_same(run, back, atol=0)
    assert all(np.array_equal(back.covariates[n].values, run.covariates[n].values) for n in run.covariates)


def test_the_queries_of_a_test_run_are_read(tmp_path):
    queries = np.array([[1.0, 2.5], [3.0, 3.0]])
    write_csv_run(tmp_path, Run("r", scan=full_run().scan, queries=queries))
    np.testing.assert_array_equal(read_recording(tmp_path).runs[0].queries, queries)
    (tmp_path / "query.csv").write_text("t0,t1\n1,2\n3,2\n")
    with pytest.raises(Error, match=r"query\.csv:3: t1 must not be before t0"):
        read_recording(tmp_path)


@pytest.fixture
def folder(tmp_path):
    write_csv_run(tmp_path / "run_1", full_run())
    return tmp_path


def lines_of(path):
    return path.read_text().splitlines()


def rewrite(path, lines):
    path.write_text("\n".join(lines) + "\n")


def test_a_cell_that_is_no_number_is_named_by_line_and_column(folder):
    path = folder / "run_1" / "pose.csv"
    lines = lines_of(path)
    lines[41] = lines[41].rsplit(",", 1)[0] + ",1.O5"
    rewrite(path, lines)
    with pytest.raises(Error, match=r"run_1/pose\.csv:42: column 'theta': is not a number: '1.O5'"):
        read_recording(folder)
    lines[41] = "1,2"
    rewrite(path, lines)
    with pytest.raises(Error, match=r"pose\.csv:42: 2 cells under 4 columns"):
        read_recording(folder)


def test_a_missing_column_is_named(folder):
    path = folder / "run_1" / "odom.csv"
    lines = lines_of(path)
    rewrite(path, ["t,x,y,yaw,v,w", *lines[1:]])
    with pytest.raises(Error, match=r"odom\.csv:1: column 'theta' is missing; there are: t, x, y, yaw, v, w"):
        read_recording(folder)


def test_a_heading_by_another_name_is_no_covariate(folder):
    path = folder / "run_1" / "pose.csv"
    rewrite(path, ["t,x,y,Yaw", *lines_of(path)[1:]])
    with pytest.raises(
        Error, match=r"pose\.csv:1: column 'theta' is missing: rename column 'Yaw' if it is the heading"
    ):
        read_recording(folder)


def test_odometry_needs_no_rates_and_a_reference_no_headings(tmp_path):
    """An eight of 2 m, forward and then backward along the same way; the heading is that of the derivative."""
    s = np.linspace(0, 2 * np.pi, 401)
    s = np.r_[s, s[-2::-1]]
    t = 0.1 * np.arange(len(s))
    theta = np.unwrap(np.arctan2(2 * np.cos(2 * s), 2 * np.cos(s)))
    noise = np.random.default_rng(5).normal(0, 0.002, (2, len(s)))
    true = 2 * np.sin(s), np.sin(2 * s)
    run = Run(
        "drive",
        pose=series(t, "xy", *(true + noise)),
        odom=series(t, ("x", "y", "theta"), *true, 0.9 * (theta - theta[0])),
    )
    write_csv_run(tmp_path / "drive", run)
    recording = read_recording(tmp_path)
    (read,) = recording.runs
    assert read.odom.columns == ("x", "y", "theta", "v", "w")
    np.testing.assert_allclose(read.odom.column("w")[100], 0.9 * (theta[100] - theta[99]) / 0.1, rtol=1e-6)
    assert read.pose.columns == ("x", "y", "theta")
    off = read.pose.column("theta") - theta
    assert np.abs(off[20:-20]).max() < 0.1  # the odometry's turns are short by a tenth: 0.6 rad
    assert any("has no headings" in words and "follow the odometry in between" in words for words in recording.problems)


def test_a_reference_without_ways_tells_no_heading(tmp_path):
    t = 0.1 * np.arange(50)
    still = np.random.default_rng(1).normal(0, 0.001, (2, 50))
    command = series([0.0], "vw", [0.0], [0.0])
    write_csv_run(tmp_path / "drive", Run("drive", pose=series(t, "xy", *still), command=command))
    with pytest.raises(Error, match=r"no two ways of 0\.05 m to tell headings from: not used"):
        read_recording(tmp_path)


def test_columns_may_come_in_any_order_quoted_and_with_covariates_among_them(folder):
    path = folder / "run_1" / "command.csv"
    path.write_text('﻿"w","note","t","load","v"\n"0.1",go,0.0,70,"0.5"\n0.2,stop,1.0,,0.6\n', encoding="utf-8")
    recording = read_recording(folder)
    run = recording.runs[0]
    assert run.command.columns == ("v", "w")
    assert run.command.values.tolist() == [[0.5, 0.1], [0.6, 0.2]]
    assert run.covariates["load"].values.tolist() == [[70]]
    assert recording.problems == ("run_1/command.csv: column 'note' is not read: it has no numbers",)


def test_repeated_rows_are_dropped_and_told(folder):
    whole = read_recording(folder).runs[0]
    path = folder / "run_1" / "pose.csv"
    lines = lines_of(path)
    rewrite(path, [*lines[:31], *lines[27:31], *lines[31:]])
    recording = read_recording(folder)
    np.testing.assert_array_equal(recording.runs[0].pose.values, whole.pose.values)
    (problem,) = [text for text in recording.problems if "repeated" in text]
    assert problem.startswith("run_1/pose.csv: 4 rows are repeated: the first is kept (first: line 32, t = ")
    assert recording.invalid == ()


def test_many_repeated_rows_forbid_a_verdict(folder):
    path = folder / "run_1" / "pose.csv"
    lines = lines_of(path)
    rewrite(path, [*lines[:31], *lines[11:31], *lines[31:]])
    recording = read_recording(folder)
    assert "run_1/pose.csv: repeats its rows: drop the copies (20 of 120)" in recording.invalid


def test_a_swapped_pair_of_rows_is_sorted_and_told(folder):
    whole = read_recording(folder).runs[0]
    path = folder / "run_1" / "scan.csv"
    lines = lines_of(path)
    lines[5], lines[6] = lines[6], lines[5]
    rewrite(path, lines)
    recording = read_recording(folder)
    np.testing.assert_array_equal(recording.runs[0].scan.values, whole.scan.values)
    assert len(recording.problems) == 1
    assert "scan.csv: time goes backward once, by up to 0.0954 s" in recording.problems[0]
    assert "(first: line 7, " in recording.problems[0]
    assert recording.invalid == ()


def test_a_row_that_came_late_is_sorted_however_slow_the_sensor(folder):
    """A scan of a laser of 1 Hz: it stands a second behind, and fills the hole that it left."""
    whole = read_recording(folder).runs[0]
    path = folder / "run_1" / "scan.csv"
    head, *rows = lines_of(path)
    slow = [row.split(",", 1) for row in rows]
    slow = [f"{float(slow[0][0]) + i!r},{rest}" for i, (_, rest) in enumerate(slow)]
    rewrite(path, [head, *slow])
    straight = read_recording(folder).runs[0].scan
    for late in ([4, 6, 5], [4, 6, 7, 5]):  # by one scan, by two
        order = [*range(4), *late, *range(max(late) + 1, len(slow))]
        rewrite(path, [head, *(slow[i] for i in order)])
        recording = read_recording(folder)
        assert recording.invalid == ()
        np.testing.assert_array_equal(recording.runs[0].scan.t, straight.t)
        np.testing.assert_array_equal(recording.runs[0].scan.values, whole.scan.values)


@pytest.mark.parametrize("off", [-3.0, 3.0])
def test_one_wrong_stamp_costs_one_row(folder, off):
    whole = read_recording(folder).runs[0]
    path = folder / "run_1" / "pose.csv"
    head, *rows = lines_of(path)
    cells = [row.split(",") for row in rows]
    cells[50][0] = repr(float(cells[50][0]) + off)
    rewrite(path, [head, *map(",".join, cells)])
    recording = read_recording(folder)
    assert recording.invalid == ()
    assert any("pose.csv: 1 row is stamped out of turn: dropped (first: line 52, " in one for one in recording.problems)
    np.testing.assert_array_equal(recording.runs[0].pose.t, np.delete(whole.pose.t, 50))


@pytest.mark.parametrize("fault", ["reset", "shuffled", "conflict", "no numbers"])
def test_a_clock_that_cannot_be_trusted_forbids_a_verdict(folder, fault):
    path = folder / "run_1" / "pose.csv"
    head, *rows = lines_of(path)
    cells = [row.split(",") for row in rows]
    if fault == "reset":
        for row in cells[60:]:
            row[0] = repr(float(row[0]) - 4.01)
    elif fault == "shuffled":
        np.random.default_rng(1).shuffle(cells)
    elif fault == "conflict":
        for row, before in zip(cells[1:40:2], cells[0:40:2], strict=True):
            row[0] = before[0]
    else:
        for row in cells[10:90]:
            row[1] = "nan"
    rewrite(path, [head, *(",".join(row) for row in cells)])
    recording = read_recording(folder)
    assert len(recording.invalid) == 1
    assert recording.invalid[0].startswith("run_1/pose.csv: ")
    assert set(recording.invalid) <= set(recording.problems)
    assert (np.diff(recording.runs[0].pose.t) > 0).all()


def test_theta_is_unwrapped_whatever_the_convention(tmp_path):
    t = np.arange(100) / 10
    true = 3.0 + 0.9 * t
    for name, theta in {
        "a": (true + np.pi) % (2 * np.pi) - np.pi,
        "b": true % (2 * np.pi),
        "c": true,
    }.items():
        write_csv_run(
            tmp_path / name, Run(name, pose=series(t, ("x", "y", "theta"), t, t, theta), scan=full_run().scan)
        )
    for run in read_recording(tmp_path).runs:
        np.testing.assert_allclose(run.pose.column("theta"), true, atol=1e-12)


def test_degrees_are_not_unwrapped_as_radians(tmp_path):
    t = np.arange(100) / 10
    degrees = np.rad2deg(0.9 * t + np.pi) % 360 - 180
    write_csv_run(tmp_path, Run("r", pose=series(t, ("x", "y", "theta"), t, t, degrees), command=full_run().command))
    recording = read_recording(tmp_path)
    assert any("degrees" in text for text in recording.invalid)
    np.testing.assert_array_equal(recording.runs[0].pose.column("theta"), degrees)


def test_parts_of_different_drives_and_units_forbid_a_verdict(tmp_path):
    run, other = full_run(), full_run(start=1000.0)
    write_csv_run(tmp_path / "mixed", Run("mixed", command=run.command, pose=other.pose))
    millimetres = series(run.scan.t, run.scan.columns, run.scan.values * 1000)
    write_csv_run(tmp_path / "units", Run("units", scan=millimetres))
    recording = read_recording(tmp_path)
    assert [text.split(":")[0] for text in recording.invalid] == ["mixed", "units"]
    assert "not recorded at the same time" in recording.invalid[0]
    assert "millimetres" in recording.invalid[1]


def test_nothing_usable_says_what_is_missing(tmp_path):
    write_csv_run(tmp_path, Run("r", pose=full_run().pose))
    with pytest.raises(Error, match=r"has only pose. Needed are scans .*or commands or voltages"):
        read_recording(tmp_path)
    (tmp_path / "empty").mkdir()
    with pytest.raises(Error, match="holds no run"):
        read_recording(tmp_path / "empty")
    with pytest.raises(Error, match="there is no such file"):
        read_recording(tmp_path / "nowhere")


def test_meta_is_read_strictly(folder):
    write_csv_run(folder / "run_2", full_run("run_2"))
    (folder / "room.world").write_text("")
    meta = folder / "meta.yaml"
    good = (
        "model: md100.yaml\nworld: room.world\ntruth: {position_sd: 0.005, heading_sd: 0.006}\n"
        "laser: {x: 0.3, y: 0.0, yaw: 0.1, angle_min: -2.0862, angle_increment: 0.0061359, beams: 7}\n"
        "train: [run_2]\ntest: [run_1]\n"
    )
    meta.write_text(good)
    recording = read_recording(folder)
    assert recording.model == PACKAGE / "launch" / "md100.yaml"
    assert recording.world == folder / "room.world"
    assert recording.truth == (0.005, 0.006)
    assert recording.laser.beams == BEAMS
    assert (recording.train, recording.test) == (("run_2",), ("run_1",))
    for old, new, message in (
        ("truth:", "thruth:", "thruth: is not a known key"),
        ("heading_sd", "heading", r"truth.heading_sd: is missing"),
        ("room.world", "hall.world", r"world: is not a file: .*hall.world"),
        ("[run_2]", "[run_3]", "train: there is no run 'run_3'; did you mean run_2 or run_1"),
        ("[run_2]", "[run_1]", "test: 'run_1' is in train too"),
        ("beams: 7", "beams: 682", "scans have 7 beams, but meta.yaml says laser.beams: 682"),
        ("[run_2]", "run_2", "train: must be a list of names"),
    ):
        meta.write_text(good.replace(old, new))
        with pytest.raises(Error, match=message):
            read_recording(folder)


def test_a_table_with_an_unknown_name_is_told(folder):
    shutil.copy(folder / "run_1" / "pose.csv", folder / "run_1" / "poses.csv")
    assert read_recording(folder).problems[0].startswith("run_1/poses.csv: not read: its name is none of command.csv")


def test_pieces_of_a_drive_are_taken_and_rows_left_out(tmp_path):
    t = 5.0 + 0.1 * np.arange(101)
    path = (("x", "y", "theta"), 0.03 * np.arange(101), np.zeros(101), np.zeros(101))
    command = series([5.0, 7.0, 9.0, 14.0], "vw", [0.1, 0.2, 0.3, 0.0], np.zeros(4))
    run = Run("drive", command=command, pose=series(t, *path), queries=np.array([[5.5, 6.0], [9.0, 10.0]]))
    write_csv_run(tmp_path / "drive", run)
    wanted = Excerpt(moment("8"), moment("+7"), (gap("pose:+4..10"), gap("11..11.05")))
    recording = read_recording(tmp_path, excerpt=wanted)
    (read,) = recording.runs
    assert read.command.t.tolist() == [8.0, 9.0]
    assert read.command.column("v").tolist() == [0.2, 0.3]
    np.testing.assert_allclose(read.pose.t, np.r_[8.0:8.95:0.1, 10.1:10.95:0.1, 11.1:12.05:0.1])
    assert read.queries.tolist() == [[9.0, 10.0]]
    assert "drive: 72 of 101 rows of pose are left out, as asked" in recording.problems
    assert not read_recording(tmp_path).problems
    with pytest.raises(Error, match=r"drive: lasts from 5.000000 to 15.000000 s: nothing is left from 20.000000 to 15"):
        read_recording(tmp_path, excerpt=Excerpt(moment("20")))


@pytest.mark.parametrize("text", ["", "a..b", "1..", "1", "poses:1..2", "pose:1-2", "1..inf"])
def test_rows_that_make_no_sense_are_refused(text):
    with pytest.raises(Error, match=r"must be "):
        gap(text)
