# SPDX-License-Identifier: BSD-3-Clause
"""Many recordings at once: the same answers as one by one, nothing lost to a crash, nothing left after Ctrl-C."""

import io
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from hidden_effect import recording

from kurumaisu.critic.app import batch
from kurumaisu.critic.app.cli import main
from kurumaisu.critic.app.display import Display, Plain, Terminal
from kurumaisu.critic.app.job import Job, Outcome
from kurumaisu.critic.data.csv_reader import write_csv_run
from kurumaisu.critic.processes.worker import ProgressMessage, Worker
from kurumaisu.errors import Error

QUICK = ["--only", "base.gain_v", "--quiet"]
CRITIC = [
    sys.executable,
    "-P",
    "-c",
    "import sys; from kurumaisu.programs.critic import main; sys.exit(main())",
]


@pytest.fixture(scope="module")
def many(tmp_path_factory):
    folder = tmp_path_factory.mktemp("many")
    for name, effect, size in (("fast", "base.gain_v", 0.1), ("right", None, 0.0)):
        for run in recording(effect, size, 5, 10.0).runs[:2]:
            write_csv_run(folder / name / run.name, run)
        (folder / name / "meta.yaml").write_text("truth: {position_sd: 0.005, heading_sd: 0.005}\n")
    (folder / "broken").mkdir()
    (folder / "broken" / "meta.yaml").write_text("thruth: 1\n")
    return folder


@pytest.fixture(scope="module")
def one_by_one(many, tmp_path_factory):
    folder = tmp_path_factory.mktemp("one_by_one")
    for name, code in (("fast", 3), ("right", 0)):
        assert main([str(many / name), *QUICK, "-o", str(folder / name)]) == code
    return folder


@pytest.fixture
def seen_by_workers(monkeypatch):
    """Let a worker import this file."""
    monkeypatch.setenv("PYTHONPATH", f"{Path(__file__).parent}:{os.environ['PYTHONPATH']}")


def test_two_at_a_time_answer_as_one_by_one_and_a_broken_one_is_told(many, one_by_one, tmp_path, capfd):
    table = tmp_path / "all.csv"
    assert main([str(many), *QUICK, "--jobs", "2", "-o", str(tmp_path / "two"), "--table", str(table)]) == 1
    said = capfd.readouterr()
    assert "broken/meta.yaml: thruth: is not a known key" in said.err
    rows = [line.split()[:2] for line in said.out.splitlines()[1:4]]
    assert rows == [["broken", "error"], ["fast", "named"], ["right", "none"]]
    assert said.out.splitlines()[4] == "3 recordings: 1 error, 1 named, 1 none"
    assert [line.split(",")[1] for line in table.read_text().splitlines()] == ["verdict", "error", "named", "none"]
    for name in ("fast", "right"):
        for file in ("verdict.json", "extended.yaml", "report.html"):
            assert (one_by_one / name / file).read_bytes() == (tmp_path / "two" / name / file).read_bytes(), file


def test_json_of_several_is_a_line_each_in_their_order(many, tmp_path, capfd):
    assert main([str(many / "right"), str(many / "broken"), *QUICK, "--json", "-o", str(tmp_path / "out")]) == 1
    lines = [json.loads(line) for line in capfd.readouterr().out.splitlines()]
    assert [(Path(line["recording"]).name, line["exit"]) for line in lines] == [("right", 0), ("broken", 1)]
    assert lines[0]["verdict"]["verdict"] == "none"
    assert lines[1]["verdict"] is None
    assert "thruth" in lines[1]["error"]


def die(progress):
    progress("dying")
    os.kill(os.getpid(), signal.SIGKILL)


def test_what_kills_a_worker_is_told(seen_by_workers):
    worker = Worker()
    worker.send(die)
    assert worker.receive() == ProgressMessage("dying")
    with pytest.raises(EOFError):
        worker.receive()
    assert "SIGKILL" in worker.died_of()
    worker.close()


def doomed(job, progress):
    if job.name == "bad":
        os._exit(7)
    return Outcome(job, 1.0, error="fine")


def test_a_crash_costs_one_job(monkeypatch, seen_by_workers):
    monkeypatch.setattr(batch, "run", doomed)
    jobs = [Job(Path("x"), Path("y"), name) for name in ("one", "bad", "two")]
    told = {outcome.job.name: outcome.error for outcome in batch.on_processes(jobs, 1, Display())}
    assert told == {"one": "fine", "bad": "its process ended with the code 7", "two": "fine"}


def children(pid):
    return [int(child) for child in Path(f"/proc/{pid}/task/{pid}/children").read_text().split()]


def alive(pid):
    stat = Path(f"/proc/{pid}/stat")
    return stat.exists() and stat.read_text().rpartition(")")[2].split()[0] != "Z"


def wait_until(condition, what):
    deadline = time.monotonic() + 40.0
    while not condition():
        assert time.monotonic() < deadline, what
        time.sleep(0.02)


@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGKILL, -9)])
def test_nothing_is_left_running_when_it_is_interrupted_or_killed(many, tmp_path, number, code):
    names = [str(many / "fast"), str(many / "right")]
    command = [*CRITIC, *names, "--jobs", "2", "-o", str(tmp_path / "out"), "--table", str(tmp_path / "t.csv")]
    process = subprocess.Popen(command, stderr=subprocess.PIPE, stdout=subprocess.DEVNULL, text=True)
    wait_until(lambda: len(children(process.pid)) == 2, "two workers")
    workers = children(process.pid)
    process.send_signal(number)
    said = process.communicate(timeout=20)[1]
    assert process.returncode == code
    wait_until(lambda: not any(map(alive, workers)), "the workers to end")
    assert "Traceback" not in said
    if number == signal.SIGINT:
        assert said.splitlines()[-1] == "critic: interrupted"
        assert (tmp_path / "t.csv").read_text().startswith("recording,verdict,")


def test_a_reader_that_has_heard_enough_is_no_error(many, tmp_path):
    read, write = os.pipe()
    os.close(read)
    command = [*CRITIC, str(many / "right"), *QUICK, "-o", str(tmp_path / "out")]
    done = subprocess.run(command, stdout=write, stderr=subprocess.PIPE, text=True, timeout=60, check=False)
    os.close(write)
    assert (done.returncode, done.stderr) == (141, "")


def test_dask_that_is_not_installed_is_named(many, tmp_path, capsys, monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    assert main([str(many), "--dask", "tcp://localhost:8786", "-o", str(tmp_path / "out")]) == 1
    assert "needs Dask's package distributed (apt-get install python3-distributed" in capsys.readouterr().err


@pytest.fixture
def cluster(tmp_path):
    pytest.importorskip("distributed", reason="Dask is not installed: --dask is not tested")
    file = tmp_path / "scheduler.json"
    common = ["--no-dashboard", "--scheduler-file", str(file)]
    commands = (["scheduler", "--port", "0"], ["worker", "--nthreads", "1", "--no-nanny"])
    processes = [
        subprocess.Popen(
            [sys.executable, "-P", "-m", f"distributed.cli.dask_{name}", *arguments, *common],
            stderr=subprocess.DEVNULL,
        )
        for name, *arguments in commands
    ]
    wait_until(lambda: file.exists() and file.read_text().endswith("}"), "a scheduler")
    yield json.loads(file.read_text())["address"]
    for process in reversed(processes):
        process.kill()
        process.wait()


def test_a_dask_cluster_gives_the_same(many, one_by_one, cluster, tmp_path, capfd):
    assert main([str(many), *QUICK, "--dask", cluster, "-o", str(tmp_path / "dask")]) == 1
    assert "3 recordings: 1 error, 1 named, 1 none" in capfd.readouterr().out
    there = (tmp_path / "dask" / "fast" / "verdict.json").read_bytes()
    assert there == (one_by_one / "fast" / "verdict.json").read_bytes()


def job(name):
    return Job(Path(name), Path("out"), name)


def test_a_terminal_shows_a_line_for_each_that_runs_and_is_left_clean():
    stream = io.StringIO()
    shown = Terminal(stream, 3)
    shown.start("a")
    shown.start("b\n\033[2J")
    shown.tell("a", "fitting")
    shown.draw()
    last = stream.getvalue().rpartition("\r")[2]
    assert [line.split("  ")[-1] for line in last.split("\n")[:2]] == ["a: fitting", "b??[2J: starting"]
    assert "0 of 3" in last
    shown.end(Outcome(job("a"), 1.0, error="x"))
    assert "1 of 3" in stream.getvalue().rpartition("\r")[2]
    shown.close()
    assert stream.getvalue().endswith("\033[2A\r\033[J")


def test_a_log_gets_a_line_for_each_that_ends_and_no_codes():
    stream = io.StringIO()
    shown = Plain(stream, 2)
    shown.start("a")
    shown.tell("a", "fitting")
    shown.end(Outcome(job("a"), 12.4, error="x"))
    assert stream.getvalue() == "critic: 1 of 2: a: error (12 s)\n"


def test_a_log_is_not_flooded_by_steps_of_one_kind(monkeypatch):
    monkeypatch.setattr("time.monotonic", iter([100.0, 101.0, 109.0, 112.0, 112.5]).__next__)
    stream = io.StringIO()
    shown = Plain(stream, 1)
    for message in ("fitting a", "fitting b", "estimating", "fitting c", "fitting d"):
        shown.tell("x", message)
    assert stream.getvalue().split("critic: ")[1:] == ["fitting a\n", "estimating\n", "fitting c\n"]


def test_no_scheduler_is_named(many, tmp_path, monkeypatch):
    pytest.importorskip("distributed", reason="Dask is not installed: --dask is not tested")
    monkeypatch.setattr(batch, "_HELLO", 0.5)
    with pytest.raises(Error, match=r"no scheduler answers within 0\.5 s"):
        list(batch.on_dask([job("a")], "tcp://127.0.0.1:1", Display()))
