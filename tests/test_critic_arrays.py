# SPDX-License-Identifier: BSD-3-Clause
"""The critic on arrays, and the window that a watch keeps."""

from dataclasses import replace

import numpy as np
import pytest
from hidden_effect import recording

from kurumaisu.critic.app.arrays import criticise_arrays, recording_of
from kurumaisu.critic.app.watch import ContinuousCritic, Heard, WatchedCriticism, Window
from kurumaisu.critic.data.clean import Faults
from kurumaisu.critic.data.csv_reader import write_csv_run
from kurumaisu.critic.data.meta import Meta
from kurumaisu.critic.data.reading import read_recording
from kurumaisu.critic.values.recording import Fan
from kurumaisu.errors import Error
from kurumaisu.params import shipped

META = Meta(truth=(0.005, 0.005))


def arrays(runs):
    parts = ("command", "voltage", "pose")
    return {
        run.name: {part: np.column_stack([getattr(run, part).t, getattr(run, part).values]) for part in parts}
        for run in runs
    }


def test_arrays_are_the_same_recording_as_their_tables(tmp_path):
    runs = recording(None, 0.0, 3, 10.0).runs
    for run in runs:
        write_csv_run(tmp_path / run.name, run)
    (tmp_path / "meta.yaml").write_text("truth: {position_sd: 0.005, heading_sd: 0.005}\n")
    of_arrays = recording_of(tmp_path.name, arrays(runs), META)
    of_tables = read_recording(tmp_path)
    for one, other in zip(of_arrays.runs, of_tables.runs, strict=True):
        for part in ("command", "voltage", "pose"):
            np.testing.assert_array_equal(getattr(one, part).values, getattr(other, part).values)
            assert getattr(one, part).columns == getattr(other, part).columns
    assert replace(of_arrays, runs=()) == replace(of_tables, runs=())


@pytest.mark.parametrize(("size", "verdict", "causes"), [(0.1, "named", ["base.gain_v"]), (0.0, "none", [])])
def test_a_verdict_from_arrays(size, verdict, causes):
    runs = arrays(recording("base.gain_v", size, 5, 10.0).runs[:2])
    found = criticise_arrays(runs, META, only=["base.gain_*"]).verdict
    assert (found.verdict, [cause.id for cause in found.causes]) == (verdict, causes)


@pytest.mark.parametrize(
    ("tables", "message"),
    [
        ({"pose": np.zeros((5, 2))}, "run/pose: must have the columns t, x, y; it has 2 columns"),
        ({"pose": np.zeros(5)}, r"run/pose: must have rows of t .* its shape is \(5,\)"),
        ({"pose": [["a", 1.0]]}, "run/pose: is not an array of numbers"),
        ({"tyre": np.zeros((5, 3))}, "run/tyre: must have the columns t, tyre"),
        ({"pose": np.arange(20.0).reshape(5, 4)}, "nothing to criticise a model with: run has only pose"),
    ],
)
def test_arrays_that_cannot_be_used_are_named(tables, message):
    with pytest.raises(Error, match=message):
        criticise_arrays({"run": tables})


def test_a_window_forgets_what_is_old_but_not_the_command_that_still_holds():
    window = Window(("command", "pose"), 10.0, 1_000_000)
    window.add("command", 0.0, (0.5, 0.0))
    window.add("command", 1.0, (0.7, 0.0))
    for t in range(31):
        window.add("pose", float(t), (0.1 * t, 0.0, 0.0))
    run = window.run("window", Faults())
    assert run.pose.t.tolist() == list(range(20, 31))
    assert window.heard("command") == Heard(1, 0.0, 1.0)
    window.add("command", 30.5, (0.0, 0.0))
    assert window.run("window", Faults()).command.t.tolist() == [1.0, 30.5]


def test_scans_of_another_fan_begin_the_window_of_scans_anew():
    window = Window(("scan", "pose"), 1e9, 1_000_000)
    first, second = Fan(-2.0, 0.1, 40, 0.0, 0.1), Fan(-2.0, 0.05, 80, 0.0, 0.1)
    for t in range(3):
        window.add("pose", float(t), (0.0, 0.0, 0.0))
        window.see(first)
        window.add("scan", float(t), np.ones(40))
    assert window.run("window", Faults()).fan == first
    for t in (3.0, 4.0):
        window.see(second)
        window.add("scan", t, np.ones(80))
    run = window.run("window", Faults())
    assert run.fan == second
    assert run.scan.values.shape == (2, 80)
    assert len(run.pose.t) == 3


def test_a_window_stays_within_its_memory_and_begins_anew_when_the_clock_is_set_back():
    window = Window(("scan",), 1e9, 100_000)
    for t in range(1000):
        window.add("scan", float(t), np.zeros(682))
    assert 10 < window.heard("scan").rows <= 100_000 / (682 * 8)
    assert window.heard("scan").newest == 999.0
    window.add("scan", 998.5, np.zeros(682))  # late, no more
    assert window.heard("scan").rows > 10
    window.add("scan", 5.0, np.zeros(682))
    window.add("scan", 1000.0, np.zeros(682))
    window.add("scan", 5.0, np.zeros(682))  # single ones are left out
    assert window.heard("scan").newest == 1000.0
    for t in (5.1, 5.2):
        window.add("scan", t, np.zeros(682))
    assert window.heard("scan") == Heard(1, 0.0, 5.2)


def test_one_row_of_the_future_does_not_keep_a_window_empty():
    window = Window(("scan",), 10.0, 100_000)
    for t in (1.0, 2.0, 1e6, 3.0, 4.0, 5.0, 6.0):
        window.add("scan", t, np.zeros(10))
    assert window.heard("scan") == Heard(2, 1.0, 6.0)


def test_a_rolling_verdict_outlives_its_process():
    rolling = ContinuousCritic(shipped("launch/md100.yaml"), frozenset({"base.gain_v"}))
    data = recording(None, 0.0, 3, 10.0)

    def answer():
        rolling.start(data, 0.0)
        said = None
        while said is None:
            rolling._worker.connection.poll(1.0)
            said = rolling.answer(0.0)
        assert not rolling.busy
        return said

    rolling._worker._process.kill()
    assert answer() == WatchedCriticism(None, "no verdict: its process was ended by SIGKILL (out of memory?)")
    assert answer().verdict.verdict == "none"
    rolling.start(data, 0.0)
    assert rolling.answer(299.0) is None
    assert rolling.answer(301.0) == WatchedCriticism(None, "no verdict: given up after 300 s")
    rolling.close()


def test_of_rows_received_while_the_clock_stood_the_last_holds():
    window, faults = Window(["command"], 10.0, 10000), Faults()
    for t, v in ((1.0, 0.1), (1.0, 0.1), (1.0, 0.2), (1.5, 0.2), (1.5, 0.3)):
        window.add_received("command", t, [v, 0.0])
    run = window.run("window", faults)
    assert run.command.t.tolist() == [1.0, 1.5]
    assert run.command.values[:, 0].tolist() == [0.2, 0.3]
    assert not faults.notes
