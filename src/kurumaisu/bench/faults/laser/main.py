# SPDX-License-Identifier: BSD-3-Clause
"""Every fault of a laser, and what the drivers make of it: ours, and urg_node where it is built."""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Sequence
from pathlib import Path

from kurumaisu.bench.faults.laser import run
from kurumaisu.bench.faults.laser.cases import CASES, Case
from kurumaisu.bench.faults.laser.run import Client, Result
from kurumaisu.bench.processes import master
from kurumaisu.bench.rigs.laser import Address, ours, urg_node
from kurumaisu.bench.table import Table

_NODE = "laser_node"
_OURS, _PEERS = 6.0, 14.0  # [s] after the first scan; the fault comes at 2 s, urg_node needs 10 s to come back
_COLUMNS = ("scans", "lost", "twice", "wrong", "gap [s]", "outage", "stamp [ms]", "CPU [%]", "exit [s]")
_THEIR_COLUMNS = ("urg_node: lost", "gap [s]", "twice", "wrong")
_COUNTS = (
    *("Bad Sums", "Unreadable", "Damaged", "Duplicate", "Lost", "Stray", "Reconnects", "Errors of"),
    "Scan Retrieve Error Count",
)


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the table. Return 1 if our driver is beyond the bounds of a fault."""
    parser = argparse.ArgumentParser(prog="scripts/bench faults", description=__doc__)
    parser.add_argument("--urg-node", type=Path, metavar="PREFIX", help="where urg_node is installed; else only ours")
    parser.add_argument("--only", default="", metavar="TEXT", help="only the faults with that text in their name")
    parser.add_argument("--at-once", type=int, default=8, help="sensors side by side")
    options = parser.parse_args(arguments)
    cases = [case for case in CASES if options.only in case.name]
    return int(_table(cases, options.urg_node, options.at_once) > 0)


def _urg_node(prefix: Path, address: Address, name: str, case: Case) -> list[str]:
    return urg_node(prefix, address, name, **case.parameters)


def _table(cases: Sequence[Case], peer: Path | None, at_once: int) -> int:
    """Print what ours makes of the faults, and urg_node where it is; return in how many ours is beyond its bounds."""
    title = f"{_NODE}, {_OURS:g} s at each fault" + (f"; urg_node, {_PEERS:g} s" if peer else "")
    others = _THEIR_COLUMNS if peer else ()
    table = Table(title, "fault", *_COLUMNS, "beyond its bounds: noted", *others)
    bad = 0
    for begin in range(0, len(cases), at_once):
        group = cases[begin : begin + at_once]
        results = _run(group, lambda *a: ours(a[0], a[1], **a[2].parameters), _OURS)
        theirs = _run(group, lambda *a: _urg_node(peer, *a), _PEERS) if peer else ()
        for i, (case, result) in enumerate(zip(group, results, strict=True)):
            beyond = run.verdict(case, result)
            bad += bool(beyond)
            table.row(case.name, *_cells(case, result, beyond), *(_their_cells(theirs[i]) if theirs else ()))
    table.note(f"{len(cases) - bad} of {len(cases)} faults within their bounds.")
    return bad


def _run(group: Sequence[Case], client: Client, seconds: float) -> list[Result]:
    with tempfile.TemporaryDirectory() as folder, master() as environment:
        return run.run(group, client, seconds, environment, Path(folder))


def _their_cells(result: Result) -> list[str | float]:
    if not result.scans:
        return ["no scan", "-", "-", "-"]
    return [str(result.lost), result.gap, str(result.twice), str(result.wrong)]


def _cells(case: Case, result: Result, beyond: list[str]) -> list[str | float]:
    words = f"{'; '.join(beyond) or '-'}: {run.noted(result.status, _COUNTS)} {result.blank}".rstrip(": ")
    seen = [float(result.scans), float(result.lost), float(result.twice), float(result.wrong)]
    return [*seen, result.gap, case.outage, 1e3 * result.stamp, 100 * result.cpu, result.exit, words]
