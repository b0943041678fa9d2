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
_COUNTS = (
    *("Bad Sums", "Unreadable", "Damaged", "Duplicate", "Lost", "Stray", "Reconnects", "Errors of"),
    "Scan Retrieve Error Count",
)


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the tables. Return 1 if our driver is beyond the bounds of a fault."""
    parser = argparse.ArgumentParser(prog="bench faults", description=__doc__)
    parser.add_argument("--urg-node", type=Path, metavar="PREFIX", help="where urg_node is installed; else only ours")
    parser.add_argument("--only", default="", metavar="TEXT", help="only the faults with that text in their name")
    parser.add_argument("--at-once", type=int, default=8, help="sensors side by side")
    options = parser.parse_args(arguments)
    cases = [case for case in CASES if options.only in case.name]
    bad = _table(_NODE, lambda *a: ours(a[0], a[1], **a[2].parameters), cases, _OURS, options.at_once)
    if options.urg_node:
        _table("urg_node", lambda *a: _urg_node(options.urg_node, *a), cases, _PEERS, options.at_once)
    print(f"\n{len(cases) - bad} of {len(cases)} faults within their bounds")
    return int(bad > 0)


def _urg_node(prefix: Path, address: Address, name: str, case: Case) -> list[str]:
    return urg_node(prefix, address, name, **case.parameters)


def _table(name: str, client: Client, cases: Sequence[Case], seconds: float, at_once: int) -> int:
    """Print what a driver makes of the faults, and return how many are beyond their bounds."""
    table = Table(f"{name}, {seconds:g} s at each fault", "fault", *_COLUMNS, "beyond its bounds: noted")
    bad = 0
    for begin in range(0, len(cases), at_once):
        group = cases[begin : begin + at_once]
        with tempfile.TemporaryDirectory() as folder, master() as environment:
            results = run.run(group, client, seconds, environment, Path(folder))
        for case, result in zip(group, results, strict=True):
            beyond = run.verdict(case, result, ours=name == _NODE)
            bad += bool(beyond)
            table.row(case.name, *_cells(case, result, beyond))
    return bad


def _cells(case: Case, result: Result, beyond: list[str]) -> list[str | float]:
    words = f"{'; '.join(beyond) or '-'}: {run.noted(result.status, _COUNTS)} {result.blank}".rstrip(": ")
    seen = [float(result.scans), float(result.lost), float(result.twice), float(result.wrong)]
    return [*seen, result.gap, case.outage, 1e3 * result.stamp, 100 * result.cpu, result.exit, words]
