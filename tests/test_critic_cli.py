# SPDX-License-Identifier: BSD-3-Clause
"""The command critic: what it writes, and what it says of input that it cannot use."""

import json
import shutil
from pathlib import Path

import pytest
from hidden_effect import recording

from kurumaisu import effects
from kurumaisu.critic.app import cli
from kurumaisu.critic.app.cli import main
from kurumaisu.critic.app.job import Job, Outcome
from kurumaisu.critic.data.csv_reader import write_csv_run
from kurumaisu.critic.data.reading import read_recording
from kurumaisu.critic.values.selection import effect_ids
from kurumaisu.critic.values.verdict import Verdict
from kurumaisu.errors import Error
from kurumaisu.params import shipped


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    folder = tmp_path_factory.mktemp("made") / "drives"
    for run in recording("base.gain_v", 0.06, 5, 30.0).runs:
        write_csv_run(folder / run.name, run)
    (folder / "meta.yaml").write_text("truth: {position_sd: 0.005, heading_sd: 0.005}\n")
    return folder


@pytest.fixture
def drives(made, tmp_path):
    return Path(shutil.copytree(made, tmp_path / "drives"))


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


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--only", "base.gian_v"], "--only: there is no effect 'base.gian_v'; did you mean base.gain_v"),
        (["--without", "lasre.*"], "--without: there is no effect 'lasre.*'"),
        (["--without", "*"], "--without: leaves no effect to look for"),
        (["--runs", "run_1,run_7"], "--runs: there is no run 'run_7'; did you mean run_"),
        (["--table", "nowhere/t.csv"], "--table: nowhere/t.csv: there is no such folder"),
    ],
)
def test_a_senseless_option_is_named(drives, tmp_path, capsys, options, message):
    assert main([str(drives), "-q", "-o", str(tmp_path / "out"), *options]) == 1
    assert message in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    "options", [["--jobs", "0"], ["--jobs", "2", "--dask", "x"], ["--outptu", "x"], ["--runs", ","]]
)
def test_a_wrong_command_line_is_told_from_wrong_data(drives, options):
    with pytest.raises(SystemExit) as ended:
        main([str(drives), *options])
    assert ended.value.code == 2


def test_patterns_choose_effects():
    everything = {effect.id for effect in effects.ALL} | {"smooth"}
    assert effect_ids([], []) is None
    assert effect_ids(["base.lag_*", "base.delay"], ["*_w"]) == {"base.lag_v", "base.delay"}
    assert effect_ids([], ["base.lag_*", "laser.*"]) == {
        name for name in everything if not name.startswith(("base.lag_", "laser."))
    }


@pytest.mark.parametrize("only", ["laser.offset", "base.process_noise", "base.sign"])
def test_effects_that_these_drives_have_no_size_for_may_be_asked_for_alone(drives, tmp_path, capsys, only):
    assert main([str(drives), "-q", "-o", str(tmp_path / "out"), "--only", only]) == 0
    told = capsys.readouterr()
    assert told.out.startswith("verdict: none")
    assert told.err == ""
    assert (tmp_path / "out" / "report.html").is_file()


def test_only_chosen_runs_are_read(drives):
    (drives / "run_2" / "pose.csv").write_text("spoilt\n")
    chosen = read_recording(drives, ["run_[13]"])
    assert chosen.train == ("run_1", "run_3")
    spoil(drives / "meta.yaml", "truth", "test: [run_3]\ntruth")
    chosen = read_recording(drives, ["run_1", "run_3"])
    assert (chosen.train, chosen.test) == (("run_1",), ("run_3",))
    with pytest.raises(Error, match="--runs: no run is left to fit: all are in test"):
        read_recording(drives, ["run_3"])


def test_a_folder_of_recordings_is_told_from_a_recording(tmp_path):
    for name in ("a/meta.yaml", "b/run_1/pose.csv", "c.bag", "d/x.bag", ".hidden/meta.yaml", "out/notes", "notes.txt"):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).touch()
    found = cli.recordings([tmp_path], tmp_path / "out")
    assert [item.name for item in found] == ["a", "b", "c.bag", "d"]
    assert cli.names(found) == ["a", "b", "c", "d"]
    assert cli.recordings([tmp_path / "b"], tmp_path / "out") == [tmp_path / "b"]
    (tmp_path / "meta.yaml").touch()
    assert cli.recordings([tmp_path], tmp_path / "out") == [tmp_path]
    with pytest.raises(Error, match="is given twice"):
        cli.recordings([tmp_path / "b", tmp_path / "a" / ".." / "b"], tmp_path / "out")


def test_names_differ_where_recordings_do(tmp_path):
    given = [tmp_path / name for name in ("mon/x.bag", "tue/x.bag", "tue/x.rawlog.gz", "tue/y.bag")]
    assert cli.names(given) == ["mon/x", "tue/x.bag", "tue/x.rawlog.gz", "tue/y"]


@pytest.mark.parametrize(
    ("words", "code"), [(["none"], 0), (["none", "named"], 3), (["invalid_data", "named"], 6), (["named", "error"], 1)]
)
def test_the_code_of_several(words, code):
    job = Job(Path("a"), Path("b"))
    outcomes = [Outcome(job, 0.0, None if word == "error" else Verdict(word)) for word in words]
    assert cli.exit_code(outcomes) == code


def test_the_version_is_the_packages(capsys):
    with pytest.raises(SystemExit):
        main(["--version"])
    assert f"<version>{capsys.readouterr().out.split()[1]}</version>" in shipped("package.xml").read_text()


def test_json_is_the_verdict_and_nothing_else(drives, tmp_path, capsys):
    assert (
        main([str(drives), "-q", "--json", "--only", "base.gain_v", "--runs", "run_1", "-o", str(tmp_path / "o")]) == 3
    )
    said = capsys.readouterr()
    assert json.loads(said.out) == json.loads((tmp_path / "o" / "verdict.json").read_text())
    assert said.err == ""
