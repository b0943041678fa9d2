# SPDX-License-Identifier: BSD-3-Clause
"""Every check of scripts/test: a line for each, the end of its output if it failed, and their count."""

from __future__ import annotations

import argparse
import contextlib
import json
import os
import signal
import subprocess
import sys
import time
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path
from threading import Event
from typing import Any

import results
import sources
from results import Counts

ROOT = sources.ROOT
BUILD = ROOT / ".ws/build"
XUNIT = BUILD / "test_results/kurumaisu"
LOGS = ROOT / ".ws/log"
LINKS = ROOT / ".ws/src/kurumaisu"  # the tree as the build sees it
CTEST = "_ctest_kurumaisu_"
BUILD_TESTS = "build tests"
TAIL = 60  # lines of a failed check's output that are shown
# Test files of pytest that only compute, by how their names begin: to them it is all the same how long they take.
SUMS = (
    "test_critic",
    "test_design",
    "test_effects",
    "test_hidden",
    "test_laser_effects",
    "test_paper",
    "test_physics",
    "test_smooth",
)
NO_SUMS = {"test_critic_batch", "test_critic_refuse", "test_paper_ros"}  # wait for processes


@dataclass(frozen=True)
class Check:
    """A command that succeeds or fails; with results, what they say counts, too."""

    name: str
    command: list[str]
    timeout: float = 1800.0  # [s] against what hangs: a busy machine may take long, and gives little to what is beside
    slow: bool = False  # left out by --fast
    results: str = ""  # pattern of its result files
    files: frozenset[str] = frozenset()  # test files of which each must have results, without suffix
    beside: bool = False  # needs no answer soon: runs beside the others, on what they leave of the cores
    crowd: bool = False  # may run beside its like
    after: str = ""  # name of a check beside the others that it waits for, if that is chosen, too
    reads: list[Path] = field(default_factory=list)  # if given: not run again until one of these changes

    def written(self) -> list[Path]:
        """Return the result files that are there."""
        return sorted(XUNIT.glob(self.results)) if self.results else []


def main() -> int:
    """Run the checks that the arguments select. Return 1 if anything failed, or nothing ran."""
    parser = argparse.ArgumentParser(prog="scripts/test", description="Run every check and every test.")
    parser.add_argument("--fast", action="store_true", help="leave out what takes minutes: catkin build, rostests")
    parser.add_argument("-k", metavar="WORD", default="", help="only the checks and test files whose name has WORD")
    arguments = parser.parse_args()
    # Started in the background of a script, it ignores Ctrl-C, and all its children would: tests interrupt theirs.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    LOGS.mkdir(parents=True, exist_ok=True)
    chosen = [c for c in [*_checks(), *_tests(arguments.k)] if arguments.k in c.name or _holds(c, arguments.k)]
    total = Counts(skipped=sum(c.slow for c in chosen) if arguments.fast else 0)
    for check in chosen:
        if check.slow and arguments.fast:
            _line("skip", check.name, 0.0, "--fast")
    total += _run_all([c for c in chosen if not (c.slow and arguments.fast)], arguments.k)
    if total == Counts():
        print(f"no check and no test file has {arguments.k!r} in its name")
        total = Counts(failed=1)
    print(total)
    return 1 if total.failed else 0


def _run_all(checks: list[Check], word: str) -> Counts:
    """Run the checks one after the other, but for those that run beside others."""
    total, beside, stop = Counts(), dict[str, Future[Counts]](), Event()

    def after(check: Check) -> Counts:
        """Run a check when what it waits for has ended."""
        if check.after in beside:
            beside[check.after].result()
        return _run(check, word, stop)

    # two: one of them alone often has work for one core only
    with ThreadPoolExecutor(2) as idle, ThreadPoolExecutor(os.cpu_count()) as several:
        crowd = list[Future[Counts]]()
        try:
            for check in checks:
                if check.beside:
                    beside[check.name] = idle.submit(after, check)
                elif check.crowd:
                    crowd.append(several.submit(after, check))
                else:
                    total = sum((future.result() for future in crowd), total)
                    crowd.clear()
                    total += after(check)
            return sum((future.result() for future in [*crowd, *beside.values()]), total)
        finally:
            stop.set()


def _checks() -> list[Check]:
    python = [str(path) for path in sources.python_files()]
    cpp = [str(path) for path in sources.files(".cpp", ".h")]
    inside = [path for path in sources.files() if path.suffix != ".md"]
    return [
        Check("ruff check", ["ruff", "check", *python]),
        Check("ruff format", ["ruff", "format", "--check", *python]),
        Check("mypy", ["mypy"], timeout=4200, beside=True),
        Check("mypy .ci", ["mypy", "--config-file=", "--strict", *(str(p) for p in (ROOT / ".ci").glob("*.py"))]),
        Check("clang-format", ["clang-format", "--dry-run", "-Werror", *cpp]),
        Check("catkin_lint", ["catkin_lint", "--offline", "--strict", "-W2", str(ROOT / ".ws/src")]),
        # scripts/setup --dev built the rest; there, too, a warning is an error.
        Check(BUILD_TESTS, ["bash", str(ROOT / ".ci/build_tests.bash")], timeout=4200, beside=True),
        Check(
            "catkin build",
            ["bash", str(ROOT / ".ci/catkin_build.bash")],
            timeout=4200,
            slow=True,
            beside=True,
            reads=inside,
        ),
        # what the tests include is known when they are built
        Check("clang-tidy", ["python", str(ROOT / ".ci/tidy.py")], timeout=4200, beside=True, after=BUILD_TESTS),
        # make in the same folder, too
        Check(
            "install space",
            ["bash", str(ROOT / ".ci/install_space.bash")],
            timeout=4200,
            beside=True,
            after=BUILD_TESTS,
        ),
    ]


def _tests(word: str) -> list[Check]:
    """Return a check for each test program, run as ctest would; one that fails where CMake does not know the file.

    Nodes come first: they need no test program, and wait more than they compute, which leaves the cores to what runs
    beside them. pytest is two: what only computes is beside, too.
    """
    listing = subprocess.run(
        ["ctest", "--show-only=json-v1"], cwd=BUILD, check=True, capture_output=True, text=True
    ).stdout
    commands: dict[str, list[str]] = {test["name"]: test["command"] for test in json.loads(listing)["tests"]}

    def known(name: str, path: Path) -> list[str]:
        return commands.get(CTEST + name, ["bash", "-c", f"echo tests/CMakeLists.txt does not run {path.name}; false"])

    sums, waits = pytest_parts()
    whole = commands[f"{CTEST}pytest_unit"]
    checks = [_pytest("pytest sums", whole, sums, word, beside=True)]
    for path in sorted((ROOT / "tests").glob("*.test")):
        checks.append(Check(path.name, known(f"rostest_tests_{path.name}", path), slow=True, results="ros*.xml"))
    for path in sorted((ROOT / "tests").glob("test_*.cpp")):
        command, pattern = known(f"gtest_{path.stem}", path), f"gtest-{path.stem}.xml"
        checks.append(Check(path.name, command, results=pattern, crowd=True, after=BUILD_TESTS))
    return [*checks, _pytest("pytest", whole, waits, word, after=BUILD_TESTS)]


def pytest_parts() -> tuple[list[Path], list[Path]]:
    """Return the test files of pytest that only compute, and all others."""
    files = sorted((ROOT / "tests").glob("test_*.py"))
    sums = [path for path in files if path.stem.startswith(SUMS) and path.stem not in NO_SUMS]
    return sums, [path for path in files if path not in sums]


def _pytest(name: str, command: list[str], files: list[Path], word: str, **more: Any) -> Check:
    """Return a check of some of pytest's files; command: ctest's, for all of them; more: as Check has it."""
    everything, output = f" {LINKS}/tests ", f"{name.replace(' ', '-')}.xml"
    some = " ".join(["", *(f"{LINKS}/tests/{path.name}" for path in files), ""])
    chosen = [part.replace(everything, some).replace("pytest-unit.xml", output) for part in command]
    if word and word not in name:
        chosen = ["env", f"PYTEST_ADDOPTS=-k {word}", *chosen]
    stems = frozenset(path.stem for path in files)
    return Check(name, chosen, timeout=4200, results=output, files=stems, **more)


def _holds(check: Check, word: str) -> bool:
    """Say whether a check consists of several files, one of which has the word in its name."""
    return any(word in stem for stem in check.files)


def _run(check: Check, word: str, stop: Event) -> Counts:
    stamp = LOGS / f"{check.name}.clean"
    state = sources.content_hash(check.reads)
    if check.reads and stamp.exists() and stamp.read_text() == state:
        _line("ok", check.name, 0.0, "nothing changed since it passed")
        return Counts(passed=1)
    start = time.monotonic()
    log = LOGS / f"{check.name}.log"
    for path in check.written():
        path.unlink()
    problem = _execute(check, log, stop)
    counts, note = _judge(check, word, problem)
    _line("FAILED" if counts.failed else "ok", check.name, time.monotonic() - start, note)
    if counts.failed:
        said = [line for line in log.read_text(errors="replace").splitlines() if not line.endswith("[passed]")]
        # what failed comes first: who reads this may see the beginning only
        lines = [f"    {line}" for line in [*results.failures(check.written()), *said[-TAIL:]]]
        print("\n".join(lines), f"\n    (whole output: {log})", flush=True)
    elif check.reads:
        stamp.write_text(state)
    return counts


def _judge(check: Check, word: str, problem: str) -> tuple[Counts, str]:
    """Return the counts of a check that has ended, and a note on them."""
    if not check.results:
        return (Counts(failed=1) if problem else Counts(passed=1)), problem
    counts = results.read(check.written())
    if problem and not counts.failed:  # it passed all, and died after that
        return counts + Counts(failed=1), problem
    silent = _silent(check, word)
    if silent:
        return counts + Counts(failed=len(silent)), f"no test ran in: {', '.join(silent)}"
    return counts, str(counts)


def _silent(check: Check, word: str) -> list[str]:
    """Return the test files of pytest without any result: they must not look like success."""
    if not check.files or (word and word not in check.name):
        return []
    return sorted(check.files - results.classes(XUNIT / check.results))


def _execute(check: Check, log: Path, stop: Event) -> str:
    """Run the command in a session of its own, output to the log. Return what went wrong, or nothing."""
    with log.open("w") as output:
        output.write(f"{' '.join(check.command)[:400]}\n")
        output.flush()
        process = subprocess.Popen(
            [*(["chrt", "--idle", "0"] if check.beside else []), *check.command],
            cwd=ROOT,
            stdin=subprocess.DEVNULL,
            stdout=output,
            stderr=output,
            start_new_session=True,
        )
        if check.beside:
            _stand_back(process.pid)
        deadline = time.monotonic() + check.timeout
        try:
            while (status := process.poll()) is None:
                if time.monotonic() > deadline:
                    return f"not done after {check.timeout:.0f} s"
                if stop.wait(0.05):
                    return "interrupted"
        finally:
            _end(process)
    return f"exit status {status}" if status else ""


def _stand_back(session: int) -> None:
    """Give way to other sessions: where the kernel shares cores among sessions first, --idle means little to others."""
    with contextlib.suppress(OSError):
        Path(f"/proc/{session}/autogroup").write_text("10")  # a tenth of another's share: 19 would be next to nothing


def _end(process: subprocess.Popen[bytes]) -> None:
    """End what is left of the session: after a time-out, an interrupt, or a node that outlived its test."""
    try:
        os.killpg(process.pid, signal.SIGTERM)
        process.wait(10)
    except ProcessLookupError:
        return
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGKILL)
        process.wait()


def _line(verdict: str, name: str, seconds: float, note: str) -> None:
    print(f"{verdict:<7} {name:<24} {seconds:6.1f} s  {note}".rstrip(), flush=True)


if __name__ == "__main__":
    sys.exit(main())
