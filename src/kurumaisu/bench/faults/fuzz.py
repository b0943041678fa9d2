# SPDX-License-Identifier: BSD-3-Clause
"""Arbitrary bytes into the laser's parts and the guard, under sanitizers: what each survived, and what was reached."""

from __future__ import annotations

import argparse
import os
import re
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from kurumaisu.bench.faults.fuzz_seeds import seeds
from kurumaisu.bench.table import Table
from kurumaisu.errors import Error
from kurumaisu.whole_files import write_whole

TARGETS = {"scip": 1024, "stream": 2048, "device": 128, "dac": 512, "guard": 512}  # longest input [bytes]
_ONE_INPUT = 5  # [s] one that takes longer is a failure
_MEMORY = 512  # [MB] with the sanitizers' own
_TAIL = 40  # lines of a failed target's output that are shown


@dataclass(frozen=True)
class Outcome:
    """How a target's run ended."""

    runs: int
    seconds: float
    reached: int  # edges
    edges: int  # of the program
    kept: int  # inputs that reached something new
    complaint: str  # empty if it survived


def main(arguments: Sequence[str]) -> int:
    """Run the benchmark. Return 1 if a target failed."""
    parser = argparse.ArgumentParser(prog="scripts/bench fuzz", description=__doc__)
    parser.add_argument("--runs", type=int, default=1_000_000, help="inputs per target")
    parser.add_argument("--target", action="append", choices=TARGETS, help="only this one; may be repeated")
    parser.add_argument("--log", type=Path, help="a sensor's bytes as Player logged them (.logr), as seeds")
    parser.add_argument("--seed", type=int, default=1, help="of the fuzzer's random numbers; 0: another each time")
    options = parser.parse_args(arguments)
    table = Table(
        "libFuzzer, address and undefined behaviour", "target", "inputs", "time [s]", "reached", "of edges", "corpus"
    )
    failed = False
    for target in options.target or TARGETS:
        outcome = run(target, options.runs, options.seed, options.log)
        table.row(
            target, str(outcome.runs), outcome.seconds, str(outcome.reached), str(outcome.edges), str(outcome.kept)
        )
        if outcome.complaint:
            print(outcome.complaint, file=sys.stderr)
            failed = True
    return 1 if failed else 0


def run(target: str, runs: int, seed: int, log: Path | None = None) -> Outcome:
    """Give a target so many inputs. Raise Error if it is not built."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for number, data in enumerate(seeds(target, log)):
            write_whole({folder / f"seed{number}": data})
        command = [str(_program(target)), f"-runs={runs}", f"-seed={seed}", f"-max_len={TARGETS[target]}"]
        command += [
            "-len_control=0",
            f"-timeout={_ONE_INPUT}",
            f"-rss_limit_mb={_MEMORY}",
            "-artifact_prefix=" + name + "/",
            name,
        ]
        # Linux counts the memory of who starts a program as that program's: a shell is small.
        command = ["sh", "-c", '"$@"; exit $?', "sh", *command]
        environment = {**os.environ, "ASAN_OPTIONS": "quarantine_size_mb=8:malloc_context_size=4"}
        start = time.monotonic()
        done = subprocess.run(command, check=False, stderr=subprocess.PIPE, env=environment)
        return _outcome(done.returncode, done.stderr.decode(errors="replace"), time.monotonic() - start)


def _outcome(status: int, text: str, seconds: float) -> Outcome:
    """Read libFuzzer's report."""

    def last(pattern: str) -> int:
        return int(([*re.findall(pattern, text)] or [0])[-1])

    complaint = "" if status == 0 else "\n".join(text.splitlines()[-_TAIL:])
    runs = last(r"Done (\d+) runs") or last(r"(?m)^#(\d+)\s")
    return Outcome(runs, seconds, last(r"cov: (\d+)"), last(r"\((\d+) PCs\)"), last(r"corp: (\d+)"), complaint)


def _program(target: str) -> Path:
    """Return the path of a target's program, which tests/CMakeLists.txt builds."""
    for prefix in os.environ.get("CMAKE_PREFIX_PATH", "").split(":"):
        path = Path(prefix) / f"share/kurumaisu/tests/fuzz_{target}"
        if path.exists():
            return path
    raise Error(f"fuzz_{target}: is not built: it comes with the tests (cmake --build .ws/build --target fuzz)")
