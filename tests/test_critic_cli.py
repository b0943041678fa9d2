# SPDX-License-Identifier: BSD-3-Clause
"""The command critic: what it writes, and what it says of input that it cannot use."""

import json

import pytest

from kurumaisu.bench.critic import recording
from kurumaisu.critic.cli import main
from kurumaisu.critic.write_csv import write_csv_run


@pytest.fixture
def drives(tmp_path):
    folder = tmp_path / "drives"
    for run in recording("base.gain_v", 0.06, 5, 30.0).runs:
        write_csv_run(folder / run.name, run)
    (folder / "meta.yaml").write_text("truth: {position_sd: 0.005, heading_sd: 0.005}\n")
    return folder


def test_a_recording_gives_a_verdict_a_model_and_a_report(drives, tmp_path, capsys):
    output = tmp_path / "out"
    assert main([str(drives), "-o", str(output)]) == 3
    said = capsys.readouterr().out
    assert "verdict: named" in said
    assert "base.gain_v: gain 0.0" in said
    verdict = json.loads((output / "verdict.json").read_text())
    assert [cause["id"] for cause in verdict["causes"]] == ["base.gain_v"]
    assert sorted(path.name for path in output.iterdir()) == ["extended.yaml", "report.html", "verdict.json"]


def spoil(path, old, new):
    path.write_text(path.read_text().replace(old, new, 1))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda folder: spoil(folder / "meta.yaml", "truth", "thruth"), "meta.yaml: thruth: is not a known key"),
        (lambda folder: spoil(folder / "run_2" / "pose.csv", "t,x,y", "t,x,z"), "run_2/pose.csv"),
        (lambda folder: (folder / "run_1" / "pose.csv").unlink(), "run_1: has no reference pose"),
        (lambda folder: spoil(folder / "meta.yaml", "truth", "model: none.yaml\ntruth"), "none.yaml"),
    ],
)
def test_bad_input_is_named_and_nothing_is_written(drives, tmp_path, capsys, change, message):
    change(drives)
    output = tmp_path / "out"
    assert main([str(drives), "-o", str(output)]) == 1
    said = capsys.readouterr().err
    assert message in said
    assert "Traceback" not in said
    assert not output.exists()


def test_a_path_that_is_not_there(tmp_path, capsys):
    assert main([str(tmp_path / "nowhere")]) == 1
    assert "nowhere" in capsys.readouterr().err
