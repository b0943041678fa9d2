# SPDX-License-Identifier: BSD-3-Clause
"""The benchmark of the base's faults: three of them for real, and that it sees what is not as expected."""

import contextlib
import math
from types import SimpleNamespace

import numpy as np
import pytest

from kurumaisu.bench.faults.base import main, path
from kurumaisu.bench.faults.base.cases import Case, Seen
from kurumaisu.bench.guard_rig import Change, changed
from kurumaisu.errors import Error
from kurumaisu.params import load_model, shipped

NUMBERS = {str(number) for number in range(1, 18)}


@pytest.mark.parametrize("fault", ["3 base_node dies, SIGKILL", "5 wire: blocked", "8 wall clock set, -"])
def test_a_fault_for_real(fault, capsys):
    status = main.main(["--only", fault, "--times", "1"])
    rows = [line.split(" | ") for line in capsys.readouterr().out.splitlines() if line.startswith("| ")]
    (row,) = rows[2:]
    seen, verdict = row[-2], row[-1]
    assert "neutral after" in seen
    assert "WRONG" not in verdict, row
    # how soon on a machine that does other things, too, is no test; that the status fits the verdict is
    assert status == int("LATE" in verdict)


def test_all_of_the_list_are_there():
    cases = main.cases()
    assert {case.number for case in cases} >= NUMBERS
    assert len({case.name for case in cases}) == len(cases)


def test_a_text_that_no_fault_has():
    with pytest.raises(SystemExit):
        main.main(["--only", "no such fault"])


@pytest.mark.parametrize(
    ("play", "verdict", "status"),
    [
        (lambda _stage, seen: seen.within("neutral", 0.009, 0.010), "ok", 0),
        (lambda _stage, seen: seen.within("neutral", 0.011, 0.010), "LATE: neutral after 11 ms, bound 10", 1),
        (lambda _stage, seen: seen.within("neutral", math.nan, 0.010), "WRONG: never neutral", 1),
        (lambda _stage, seen: seen.check(False, "moved"), "WRONG: moved", 1),
        (lambda stage, _seen: stage.fail(), "WRONG: not within 30 s: neutral", 1),
    ],
)
def test_what_is_not_as_expected_is_told(monkeypatch, capsys, play, verdict, status):
    def fail():
        raise Error("not within 30 s: neutral")

    peer = SimpleNamespace(heard=lambda _what, _since: [])
    stage = SimpleNamespace(mark=lambda: None, fail=fail, peer=peer, begun=0.0)
    monkeypatch.setattr(main, "running_chain", lambda _folder, _setup: contextlib.nullcontext(stage))
    monkeypatch.setattr(main, "cases", lambda: [Case("1", "a", "b", "c", play, clamped=False)])
    assert main.main(["--times", "1"]) == status
    assert f"| {verdict} |" in capsys.readouterr().out


def test_a_play_that_its_commander_spoils_does_not_count(monkeypatch, capsys):
    late = [["late"], []]
    stage = SimpleNamespace(mark=lambda: None, begun=0.0, peer=SimpleNamespace(heard=lambda _what, _since: late[0]))

    def play(_stage, seen):
        seen.check(not late[0], "brakes")
        seen.note("done")

    def stages(_folder, _setup):
        return contextlib.nullcontext(stage)

    monkeypatch.setattr(main, "running_chain", stages)
    monkeypatch.setattr(main, "cases", lambda: [Case("1", "a", "b", "c", play, clamped=False)])
    assert main.main([]) == 1  # it never keeps time
    stage.peer.heard = lambda _what, _since: late.pop(0)
    late.insert(0, ["late"])
    assert main.main([]) == 0
    assert "| done | ok |" in capsys.readouterr().out


def test_of_repetitions_the_worst_counts():
    seen = Seen()
    for seconds in (0.001, 0.015, 0.002):
        seen.within("neutral", seconds, 0.010)
    assert seen.cell() == "neutral after 1.0 to 15.0 ms"
    assert seen.verdict().startswith("LATE: neutral after 15 ms")


@pytest.mark.parametrize(
    ("volts", "good"),
    [((2.2, 1.0, 2.5), True), ((2.21, 0.0, 2.5), False), ((0.0, -1.01, 2.5), False), ((0.0, 0.0, 2.62), False)],
)
def test_a_voltage_outside_the_clamp_is_seen(volts, good):
    band = {"translation": (-1.8, 2.2), "steering": (-1.0, 1.0), "reference": (2.4, 2.6)}
    channels = {name: {"volt": {"min": a, "max": b}} for name, (a, b) in band.items()}
    stage = SimpleNamespace(
        law=load_model(shipped("launch/md100.yaml")),
        device_values={"channels": channels},
        rig=SimpleNamespace(step=1 / 819.0),
        changes=lambda: [Change(0.0, None), Change(1.0, False, volts)],
    )
    seen = Seen()
    seen.clamped(stage)
    assert (seen.verdict() == "ok") == good


def test_slopes_jerks_and_distances_of_a_known_path():
    law = load_model(shipped("launch/md100.yaml")).translation
    times = np.arange(0.0, 2.0, 0.02)
    speeds = 0.5 * 3.0 * np.minimum(times, 0.4) ** 2 + 1.2 * np.maximum(times - 0.4, 0.0)  # jerk 3, then 1.2 m/s^2
    samples = list(zip(times, law.volts(speeds), strict=True))
    t, v = path.rates(law, samples)
    assert v == pytest.approx(speeds, abs=1e-9)
    assert path.steepest(t, v, 0.1) == pytest.approx(1.2)
    assert path.sharpest(t, v, 0.1) == pytest.approx(3.0)
    changes = [Change(time, False, (volts, 0.0, 2.5)) for time, volts in samples]
    assert path.distance(law, changes, 2.0) == pytest.approx(0.02 * float(np.sum(speeds)))


def test_changes_of_a_tree():
    tree = {"a": {"b": 1, "c": 2}, "d": 3}
    assert changed(tree, {"a/b": 5, "d": None}) == {"a": {"b": 5, "c": 2}}
    assert tree == {"a": {"b": 1, "c": 2}, "d": 3}
