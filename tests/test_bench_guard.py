# SPDX-License-Identifier: BSD-3-Clause
"""The benchmark of kills: each end once, and that it sees a bound that is broken."""

import math

import pytest

from kurumaisu.bench.faults.guard import main


@pytest.mark.parametrize("device", ["serial", "iio"])
def test_every_end_leads_to_neutral(capsys, device):
    status = main.main(["--times", "1", "--load", "idle", "--device", device])
    printed = capsys.readouterr().out
    for case in main.CASES:
        cells = next(line[len(case.name) :].split() for line in printed.splitlines() if line.startswith(case.name))
        times, low, *_, never = cells[:6]
        assert (times, never) == ("1", "0"), case.name
        assert 0 < float(low) < 2000, case.name
    # how soon on a machine that does other things, too, is no test; that the verdict fits the figures is
    assert status == int("BROKEN" in printed)


@pytest.mark.parametrize(
    ("times", "bound", "verdict"),
    [
        ([0.001, 0.009], 0.010, "kept"),
        ([0.001, 0.011], 0.010, "BROKEN"),
        ([0.001, math.nan], 0.010, "BROKEN"),
        ([0.001, math.nan], None, "BROKEN"),
        ([0.001, 5.0], None, "-"),
    ],
)
def test_a_bound_is_judged_by_the_worst(times, bound, verdict):
    assert main.judge(times, bound, max) == verdict


def test_of_busy_cores_the_99th_percentile_counts(monkeypatch):
    bounds = []
    monkeypatch.setattr(main, "_table", lambda _device, _options, worst, loops: bounds.append((worst, loops)) or [])
    assert main.main(["--device", "iio"]) == 0
    (idle, none), (busy, loops) = bounds
    times = [0.001] * 199 + [1.0]
    assert none == 0
    assert loops > 0
    assert main.judge(times, 0.010, idle) == "BROKEN"
    assert main.judge(times, 0.010, busy) == "kept"
