# SPDX-License-Identifier: BSD-3-Clause
"""Every check of scripts/test: a line for each, the end of its output if it failed, and their count."""

from __future__ import annotations

import argparse
import json
import re
import shutil
import signal
import subprocess
import sys
from collections.abc import Callable, Iterable
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import cache, partial
from pathlib import Path
from threading import Event
from typing import Any

import inputs
import passed
import results
import running
import sources
from inputs import Inputs
from passed import Part
from results import Counts

ROOT = sources.ROOT
BUILD = ROOT / ".ws/build"
XUNIT = BUILD / "test_results"
LOGS = ROOT / ".ws/log"
CTEST = "_ctest_kurumaisu_"
BUILD_TESTS = "build tests"
TESTS_FAILED = "exit status 1"  # of pytest that ran to its end
TAIL = 60  # lines of a failed check's output that are shown
AT_ONCE = 3  # rostests; each has a master of its own, and waits more than it computes
# They compare with the wall's clock, and would find a busy machine rather than a mistake: no other rostest beside them.
ALONE = {
    "base_node": "how soon the chair rests when its commander falls silent",
    "laser_node": "how old a scan is when it is published",
    "stageros": "ten scans a second, neither eight nor twelve",
}


@dataclass(frozen=True)
class Check:
    """A command that succeeds or fails, of one part or, for pytest, of a part for each test file."""

    name: str
    command: list[str]
    parts: tuple[Part, ...]
    timeout: float = 4200.0  # [s] against what hangs: a busy machine may take long, and gives little to what is beside
    quick: bool = True  # part of --quick
    beside: bool = False  # needs no answer soon: gets what the others leave of the cores
    alone: bool = False  # not beside other rostests
    after: str = ""  # name of a check that it waits for, if that is chosen, too
    tests: bool = False  # writes its results to a folder of its name
    clock: bool = False  # waits for processes by the wall's clock: what fails on a busy machine gets a second try

    def only(self, word: str) -> Check:
        """Return what is left of it where only names with this word are asked for."""
        parts = self.parts if word in self.name else tuple(part for part in self.parts if word in part.name)
        return replace(self, parts=parts)


def main() -> int:
    """Run the checks that the arguments select. Return 1 if anything failed, or nothing ran."""
    parser = argparse.ArgumentParser(prog="scripts/test", description="Run every check and every test.")
    parser.add_argument(
        "--quick", action="store_true", help="what takes seconds: lint, types, tests that compute little"
    )
    parser.add_argument("-k", metavar="WORD", default="", help="only the checks and test files whose name has WORD")
    arguments = parser.parse_args()
    # Started in the background of a script, it ignores Ctrl-C, and all its children would: tests interrupt theirs.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    LOGS.mkdir(parents=True, exist_ok=True)
    chosen = [check.only(arguments.k) for check in every_check(Inputs(), arguments.quick)]
    chosen = [check for check in chosen if check.parts]
    skipped = [check for check in chosen if arguments.quick and not check.quick]
    for check in skipped:
        _line("skip", check.name, 0.0, 0.0, "--quick")
    total = Counts(skipped=len(skipped)) + _run_all([check for check in chosen if check not in skipped])
    if total == Counts():
        print(f"no check and no test file has {arguments.k!r} in its name")
        total = Counts(failed=1)
    print(total)
    return 1 if total.failed else 0


def every_check(tree: Inputs, quick: bool) -> list[Check]:
    """Return all checks, in the order in which they begin."""
    build, *others = _checks(tree, quick)
    sums, waits = _pytests(tree, quick)
    # the longest begin first; what waits for the clock comes last, when less is beside it
    return [build, sums, *others, *_rostests(tree), *_gtests(tree), waits]


def _run_all(checks: list[Check]) -> Counts:
    """Run some checks beside the others, and of those some at once."""
    stop, begun = Event(), dict[str, Future[Counts]]()
    behind = any(not check.beside for check in checks)  # there is somebody to stand back for

    def after(check: Check) -> Counts:
        """Run a check when what it waits for, which began before it, has ended."""
        if check.after in begun:
            begun[check.after].result()
        return _run(replace(check, beside=check.beside and behind), stop)

    # two beside: one of them alone often has work for one core only
    with ThreadPoolExecutor(2) as idle, ThreadPoolExecutor(AT_ONCE) as several:
        try:
            # lint at once: who made a slip does not want to wait
            for check in (check for check in checks if check.beside or not check.tests):
                begun[check.name] = (idle if check.beside else several).submit(after, check)
            total = sum((after(check) for check in checks if check.alone), Counts())
            for check in (check for check in checks if check.tests and not check.beside and not check.alone):
                begun[check.name] = several.submit(after, check)
            return sum((future.result() for future in begun.values()), total)
        finally:
            stop.set()


def _checks(tree: Inputs, quick: bool) -> list[Check]:
    """Return the checks that are no tests."""
    python = [str(path) for path in sources.python_files()]
    cpp = [str(path) for path in sources.files(".cpp", ".h")]
    settings = {path for path in tree.tree if path.parent == ROOT or path.is_relative_to(ROOT / ".ci")}
    written = {Path(path) for path in [*python, *cpp]} | {path for path in tree.tree if path.suffix == ".pyi"}
    package = tree.tree - tree.under("tests", ".ci")
    in_wheel = {ROOT / "tests" / name for name in re.findall(r"test_\w+\.py", (ROOT / ".ci/wheel.bash").read_text())}

    def check(name: str, command: str, reads: set[Path], *files: str, **more: Any) -> Check:
        part = Part(name, lambda: tree.state(reads | settings, command))
        return Check(name, [*command.split(), *files], (part,), **more)

    return [
        # scripts/setup --dev built the rest; there, too, a warning is an error. What make finds done takes no time.
        Check(
            BUILD_TESTS, ["bash", f"{ROOT}/.ci/build_tests.bash"], (Part(BUILD_TESTS, lambda: ""),), beside=not quick
        ),
        check("ruff check", "ruff check", written, *python),
        check("ruff format", "ruff format --check", written, *python),
        check("mypy", "mypy", written, beside=not quick),
        check("mypy .ci", "mypy --config-file= --strict", written, *map(str, sorted((ROOT / ".ci").glob("*.py")))),
        check("clang-format", "clang-format --dry-run -Werror", written, *cpp),
        check("catkin_lint", f"catkin_lint --offline --strict -W2 {ROOT}/.ws/src", tree.tree),
        # what the tests include is known when they are built
        check("clang-tidy", f"python {ROOT}/.ci/tidy.py", tree.native, after=BUILD_TESTS, beside=True, quick=False),
        # make in the same folder, too
        check(
            "install space", f"bash {ROOT}/.ci/install_space.bash", package, after=BUILD_TESTS, beside=True, quick=False
        ),
        check("wheel", f"bash {ROOT}/.ci/wheel.bash", package | in_wheel, beside=True, quick=False),
        check("catkin build", f"bash {ROOT}/.ci/catkin_build.bash", package, beside=True, quick=False),
    ]


@cache
def _known() -> dict[str, list[str]]:
    """Return the commands of the tests that CMake knows, without its prefix."""
    command = ["ctest", "--show-only=json-v1"]
    listing = json.loads(subprocess.run(command, cwd=BUILD, check=True, capture_output=True, text=True).stdout)
    return {test["name"].removeprefix(CTEST): test["command"] for test in listing["tests"]}


def _folder(name: str) -> Path:
    """Return where a check's test programs write their results."""
    return XUNIT / name.replace(" ", "-")


def _ctest(name: str, command: list[str] | None, state: Callable[[], str], **more: Any) -> Check:
    """Return a check of a test that CMake should know: without a command it fails."""
    words = command or ["bash", "-c", f"echo tests/CMakeLists.txt does not run {name}; false"]
    own = [word.replace(str(XUNIT), str(_folder(name))) for word in words]
    return Check(name, own, (Part(name, state),), tests=True, **more)


def _rostests(tree: Inputs) -> list[Check]:
    """Return a check for each rostest: first those that are alone, then those that took longest."""
    known, paths = _known(), sorted((ROOT / "tests").glob("*.test"))
    paths.sort(key=lambda path: (path.stem not in ALONE, -passed.seconds(path.name, 0.0)))
    return [
        _ctest(
            path.name,
            known.get(f"rostest_tests_{path.name}"),
            partial(tree.of_rostest, path),
            alone=path.stem in ALONE,
            quick=False,
            clock=True,
        )
        for path in paths
    ]


def _gtests(tree: Inputs) -> list[Check]:
    """Return a check for each program of gtest; that each source belongs to a program, .ci/tidy.py sees."""
    checks = []
    for name, command in _known().items():
        if name.startswith("gtest_"):
            program = Path(re.findall(r"(\S+) --gtest_output", " ".join(command))[0])
            state = partial(tree.of_program, program)
            checks.append(_ctest(name.replace("_", " ", 1), command, state, after=BUILD_TESTS, clock=True))
    return checks


def _pytests(tree: Inputs, quick: bool) -> list[Check]:
    """Return two checks of pytest's files: those that only compute, beside all others, and those that wait."""
    paths = sorted(
        (ROOT / "tests").glob("test_*.py"), key=lambda path: -passed.seconds(path.stem, len(inputs.closure(path)))
    )
    wait = [path for path in paths if inputs.waits(path)]

    def check(name: str, some: Iterable[Path], *options: str, **more: Any) -> Check:
        output = _folder(name) / "pytest.xml"
        command = ["env", "OPENBLAS_NUM_THREADS=1", "python", "-m", "pytest", "-n", "auto", "--dist", "loadfile"]
        command += [f"--junit-xml={output}", *(["--quick"] if quick else []), *options]
        parts = tuple(Part(path.stem, partial(tree.of_pytest, path), path, quick) for path in some)
        return Check(name, command, parts, tests=True, **more)

    sums = check("pytest sums", (path for path in paths if path not in wait), after=BUILD_TESTS, beside=not quick)
    hangs = "--timeout=300"  # [s] for each, where the longest takes some 70: says which hangs and where, and goes on
    return [sums, check("pytest", wait, hangs, after=BUILD_TESTS, quick=False, clock=True)]


def _run(check: Check, stop: Event) -> Counts:
    """Run what has changed of a check since it passed, and say how that went."""
    states = {part: part.state() for part in check.parts}
    before = {part: counts for part in check.parts if (counts := passed.counts(part, states[part])) is not None}
    total, stale = sum(before.values(), Counts()), [part for part in check.parts if part not in before]
    if not stale:
        _line("ok", check.name, 0.0, 0.0, f"{total if check.tests else 'nothing changed'} (as before)")
        return total
    as_before = f"({len(before)} of {len(check.parts)} files as before)" if before else ""
    now = _attempt(check, stale, states, stop, as_before)
    failed = [part for part in stale if now[part].failed]
    if check.clock and failed and not stop.is_set():
        now |= _attempt(check, failed, states, stop, "(second try)")
    return sum(now.values(), total)


def _attempt(check: Check, parts: list[Part], states: dict[Part, str], stop: Event, remark: str) -> dict[Part, Counts]:
    """Run some parts of a check, say how that went, and keep what passed."""
    folder, log = _folder(check.name), LOGS / f"{check.name}.log"
    if check.tests:
        shutil.rmtree(folder, ignore_errors=True)
    files = [str(part.path) for part in parts if part.path]
    ended = running.run([*check.command, *files], log, check.timeout, stop, check.beside)
    xunit = sorted(folder.rglob("*.xml")) if check.tests else []
    now = _counts(check, parts, xunit, ended.problem)
    for part in parts:
        if not now[part].failed and ended.problem in ("", TESTS_FAILED):  # else some of them may not have run
            took = results.seconds(xunit, part.name) if part.path else ended.wall
            passed.keep(part, states[part], now[part], took)
    ran = sum(now.values(), Counts())
    note = ended.problem or (str(ran) if check.tests else "")
    _line("FAILED" if ran.failed else "ok", check.name, ended.wall, ended.cpu, f"{note} {remark}")
    if ran.failed:
        said = [line for line in log.read_text(errors="replace").splitlines() if not line.endswith("[passed]")]
        silent = [f"no test ran in {part.name}" for part in parts if part.path and not results.of(xunit, part.name)]
        # what failed comes first: who reads this may see the beginning only
        lines = [f"    {line}" for line in [*results.failures(xunit), *silent, *said[-TAIL:]]]
        print("\n".join(lines), f"\n    (whole output: {log})", flush=True)
    return now


def _counts(check: Check, parts: list[Part], xunit: list[Path], problem: str) -> dict[Part, Counts]:
    """Return the counts of each part of a check that has ended: silence is a failure."""
    if not check.tests:
        return {parts[0]: Counts(failed=1) if problem else Counts(passed=1)}
    if parts[0].path is None:
        found = {parts[0]: results.read(xunit)}
    else:
        found = {part: results.of(xunit, part.name) or Counts(failed=1) for part in parts}
    if problem and not any(counts.failed for counts in found.values()):  # it passed all, and died after that
        found[parts[-1]] += Counts(failed=1)
    return found


def _line(verdict: str, name: str, wall: float, cpu: float, note: str) -> None:
    print(f"{verdict:<7} {name:<28} {wall:6.1f} s {cpu:7.1f} s CPU  {note}".rstrip(), flush=True)


if __name__ == "__main__":
    sys.exit(main())
