# SPDX-License-Identifier: BSD-3-Clause
"""Benchmarks are found by name, and the one of the base judges what it measures."""

import pytest

from kurumaisu.bench import __main__, base
from kurumaisu.bench.table import Table


@pytest.mark.parametrize("arguments", [[], ["nothing"], ["table"]])
def test_a_name_that_is_none(arguments, capsys):
    assert __main__.main(arguments) == 2
    assert "there are: " in capsys.readouterr().err


def test_base(capsys):
    assert __main__.main(["base", "--repeats", "1"]) in (0, 1)  # the limit of time is the machine's
    out = capsys.readouterr().out
    assert all(name in out for name in ("published, steering", "corrected, translation", "base.lag_w", "all"))


@pytest.mark.parametrize(("worst", "dearest", "status"), [(1e-15, 0.9, 0), (1e-9, 0.9, 1), (1e-15, 1.1, 1)])
def test_base_fails_beyond_its_limits(monkeypatch, worst, dearest, status):
    monkeypatch.setattr(base, "_round_trips", lambda repeats: worst)
    monkeypatch.setattr(base, "_minutes", lambda repeats: dearest)
    assert base.main([]) == status


def test_table_columns_stay_in_line(capsys):
    table = Table("title", "name", "error [mm]")
    table.row("first", 1.23456)
    table.row("second", "none")
    lines = capsys.readouterr().out.splitlines()
    assert lines[1] == "title"
    assert len({len(lines[2]), *(len(line) for line in lines[4:])}) == 1
    assert lines[4].endswith("1.235")
