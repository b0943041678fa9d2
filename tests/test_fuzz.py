# SPDX-License-Identifier: BSD-3-Clause
"""A moment of what scripts/bench fuzz does for minutes: the targets are built, reach what they are for, and survive."""

import os
from pathlib import Path

import pytest

from kurumaisu.bench.faults import fuzz
from kurumaisu.bench.faults.fuzz_seeds import seeds
from kurumaisu.errors import Error

RUNS = 1500
LOG = Path(__file__).resolve().parents[2] / "shared/data/player_urg04lx/hokuyo_aist.logr"


def test_each_target_survives_and_goes_beyond_its_seeds(capsys):
    log = ["--log", str(LOG)] if LOG.exists() else []
    assert fuzz.main(["--runs", str(RUNS), *log]) == 0
    rows = {line.split()[0]: line.split()[1:] for line in capsys.readouterr().out.splitlines() if line[:1].islower()}
    assert rows.keys() >= fuzz.TARGETS.keys()
    for target in fuzz.TARGETS:
        inputs, _, reached, edges, corpus = map(float, rows[target])
        assert RUNS <= inputs < 1.1 * RUNS  # libFuzzer may run a few more: 8 were seen
        assert 0.25 * edges < reached <= edges
        assert corpus > len(list(seeds(target, None))) / 2


def test_seeds_of_a_real_sensor():
    if not LOG.exists():
        pytest.skip(f"{LOG} is not there")
    recorded = set(seeds("scip", LOG)) - set(seeds("scip", None))
    assert any(b"GD0046072201\n00P\n01_2b\n" in seed for seed in recorded)


def test_a_log_that_is_cut_off(tmp_path):
    (tmp_path / "a.logr").write_bytes(b"\0" * 7)
    with pytest.raises(Error, match=r"a\.logr: byte 0"):
        list(seeds("scip", tmp_path / "a.logr"))


def test_a_target_that_fails_is_shown(monkeypatch, tmp_path, capsys):
    program = tmp_path / "share/kurumaisu/tests/fuzz_scip"
    program.parent.mkdir(parents=True)
    program.write_text(
        "#!/bin/sh\necho '#7 NEW cov: 3 ft: 4 corp: 2/9b' >&2\necho FUZZ: a scan that was not sent >&2\nexit 77\n"
    )
    program.chmod(0o755)
    monkeypatch.setenv("CMAKE_PREFIX_PATH", str(tmp_path))
    assert fuzz.main(["--target", "scip"]) == 1
    printed = capsys.readouterr()
    assert "FUZZ: a scan that was not sent" in printed.err
    assert printed.out.splitlines()[-1].split()[:2] == ["scip", "7"]


def test_a_target_that_is_not_built(monkeypatch, tmp_path):
    monkeypatch.setenv("CMAKE_PREFIX_PATH", os.pathsep.join(["", str(tmp_path)]))
    with pytest.raises(Error, match="fuzz_device: is not built"):
        fuzz.main(["--target", "device"])
