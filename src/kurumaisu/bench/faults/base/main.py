# SPDX-License-Identifier: BSD-3-Clause
"""Every fault of the base, really made: master, commander, base_node, guard and a virtual D/A board. Prints a table."""

from __future__ import annotations

import argparse
import copy
import os
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from pathlib import Path

from kurumaisu.bench.faults.base import (
    board,
    chip,
    clock,
    commands,
    ends,
    hands,
    odometry,
    owners,
    parameters,
    signals,
    stops,
)
from kurumaisu.bench.faults.base.cases import OK, Case, Seen
from kurumaisu.bench.faults.base.chain import Chain, Setup, running_chain
from kurumaisu.bench.table import MarkdownTable
from kurumaisu.errors import Error

_MODULES = (
    commands,
    ends,
    board,
    chip,
    owners,
    clock,
    stops,
    odometry,
    parameters,
    hands,
    signals,
)
_TRIES = 3  # of a play that the benchmark's own commander spoils, on a machine that is busy otherwise
_COLUMNS = ("#", "fault", "injected", "expected", "seen", "verdict")


def cases() -> list[Case]:
    """Return all faults, in the order of their numbers."""
    found = [case for module in _MODULES for case in module.CASES]
    return sorted(found, key=lambda case: (not case.number.isdigit(), int(case.number) if case.number.isdigit() else 0))


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the table. Return 1 if anything is not as expected."""
    parser = argparse.ArgumentParser(prog="scripts/bench base_faults", description=__doc__)
    parser.add_argument(
        "--only", default="", metavar="TEXT", help="only the faults with that text in their row's start"
    )
    parser.add_argument("--times", type=int, default=3, help="repetitions of those whose times scatter")
    options = parser.parse_args(arguments)
    chosen = [case for case in cases() if options.only in case.name]
    if not chosen:
        parser.error(f"no fault has {options.only!r} in its row's start")
    load = os.getloadavg()[0]
    table = MarkdownTable("", *_COLUMNS)
    verdicts = [seen.verdict() for seen in _play(table, chosen, options.times)]
    good = verdicts.count(OK)
    table.note(f"{good} of {len(chosen)} faults as expected. The load average before was {load:.1f}.")
    return int(good < len(chosen))


def _play(table: MarkdownTable, chosen: Sequence[Case], times: int) -> Iterator[Seen]:
    """Play case after case, on the same stage as long as it is fit for the next one; print the rows."""
    with tempfile.TemporaryDirectory() as folder:
        players = _Players(Path(folder))
        try:
            for case in chosen:
                seen = Seen()
                for _ in range(times if case.repeated else 1):
                    seen = players.play(case, seen)
                table.row(case.number, case.fault, case.how, case.expected, seen.cell(), seen.verdict())
                yield seen
        finally:
            players.end()


class _Players:
    """The stage in use, kept as long as nothing went wrong on it."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._stage: Chain | None = None
        self._setup = Setup()
        self._stack = ExitStack()
        self._stages = 0
        self._commander_kept_time = True

    def play(self, case: Case, before: Seen) -> Seen:
        """Play a case once; return what was seen so far, and now. If its own commander was late, play it again."""
        for _ in range(_TRIES - 1):
            seen = self._once(case, copy.deepcopy(before))
            if self._commander_kept_time or seen.verdict() == before.verdict():
                return seen
        return self._once(case, copy.deepcopy(before))

    def _once(self, case: Case, seen: Seen) -> Seen:
        wrong = len(seen.wrong)
        on = None
        try:
            on = self._stage_for(case.setup)
            on.mark()
            case.play(on, seen)
            if case.clamped:
                seen.clamped(on)
        except Error as error:
            seen.check(False, str(error))
        self._commander_kept_time = on is None or not on.peer.heard("late", on.begun)
        if case.last or len(seen.wrong) > wrong:
            self.end()
        return seen

    def _stage_for(self, setup: Setup) -> Chain:
        if self._stage is None or setup != self._setup:
            self.end()
            self._stages += 1
            self._setup = setup
            self._stage = self._stack.enter_context(running_chain(self._folder / str(self._stages), setup))
        return self._stage

    def end(self) -> None:
        """End the stage, if there is one."""
        self._stage = None
        self._stack.close()
