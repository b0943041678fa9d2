# SPDX-License-Identifier: BSD-3-Clause
"""The benchmark of equation (4)'s intervals: it fails where they hold the truth too seldom, and counts what it says."""

from dataclasses import replace

import numpy as np
import pytest

from kurumaisu.bench.paper import wall
from kurumaisu.paper.options import load_options

OPTIONS = load_options()


def test_a_case_is_told_with_its_shares(monkeypatch, capsys):
    monkeypatch.setattr(wall, "judge", lambda *_: [True, True, True, True, False])
    assert wall.main(["--walls", "40"]) == 1  # one of the five never holds
    rows = capsys.readouterr().out.splitlines()
    assert [row.startswith(case.name) for case, row in zip(wall.CASES, rows[-4:], strict=True)] == [True] * 4
    assert rows[-1].count("1.00 (") == 4
    assert rows[-1].count("0.00 (") == 1


def test_a_level_that_is_kept_is_no_failure(monkeypatch):
    monkeypatch.setattr(wall, "judge", lambda case, seed, _: [seed % 10 > 0] * 5)
    assert wall.main(["--walls", "40"]) == 0


@pytest.mark.parametrize("case", wall.CASES, ids=lambda case: case.name)
def test_walls_of_every_case_can_be_fitted(case):
    few = replace(OPTIONS, bootstrap=replace(OPTIONS.bootstrap, resamples=120))
    held = np.array([wall.judge(case, seed, few) for seed in range(5)])
    assert held.shape == (5, 5)
    assert held.mean() > 0.6  # of 0.9; five coefficients of a wall go together
