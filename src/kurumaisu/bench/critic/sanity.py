# SPDX-License-Identifier: BSD-3-Clause
"""How often wrong data are recognised, with the right words, and how often good data are called wrong."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from kurumaisu.bench.critic import drives, wrong_data, wrong_scans
from kurumaisu.bench.table import Table, share
from kurumaisu.critic.data.clean import Faults, clean
from kurumaisu.critic.data.clean import Table as Rows
from kurumaisu.critic.data.csv_reader import REQUIRED
from kurumaisu.critic.data.reading import check_run
from kurumaisu.critic.sanity import examination
from kurumaisu.critic.values.recording import Recording, Run, Series
from kurumaisu.params import load_model, shipped


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the table; every draw has its own drive, effect, noise and fault."""
    parser = argparse.ArgumentParser(prog="scripts/bench sanity", description=__doc__)
    parser.add_argument("--draws", type=int, default=20, help="recordings per fault")
    parser.add_argument("--good", type=int, default=300, help="recordings without a fault")
    parser.add_argument("--seed", type=int, default=1000)
    parser.add_argument("--only", default="", help="faults whose name holds this")
    parser.add_argument("--show", action="store_true", help="print what was missed")
    options = parser.parse_args(arguments)
    columns = ("fault", "number", "called invalid   ", "with the right words")
    table = Table("one drive of 40-120 s; 90 % intervals", *columns, page=False)
    faults = {**wrong_data.SPOILT, **wrong_scans.SPOILT}
    totals: dict[str, list[tuple[bool, bool]]] = {}  # called invalid, with the right words
    for k, (name, (_, word)) in enumerate(faults.items()):
        if options.only not in name:
            continue
        said = [findings_of(name, [options.seed, k, i]) for i in range(options.draws)]
        right = [any(word in line for line in lines) for lines in said]
        table.row(name, str(len(said)), share(sum(map(bool, said)), len(said), 3), share(sum(right), len(said), 3))
        kind = "wrong drives" if name in wrong_data.SPOILT else "wrong scans, map or laser"
        totals.setdefault(kind, []).extend(zip(map(bool, said), right, strict=True))
        for i, lines in enumerate(said):
            if options.show and not right[i]:
                print("   ", i, drives.draw(np.random.default_rng([options.seed, k, i]), easy=True), lines)
    for name in ("", "with scans") if options.good else ():
        said = [findings_of(name, [options.seed, 999 + bool(name), i]) for i in range(options.good)]
        for i, lines in enumerate(said):
            if options.show and lines:
                print("   ", i, drives.draw(np.random.default_rng([options.seed, 999 + bool(name), i])), lines)
        table.row(f"none (good data) {name}", str(options.good), share(sum(map(bool, said)), options.good, 3), "-")
        totals[f"good drives {name}".strip()] = [(bool(lines), False) for lines in said]
    _sums(totals, columns, len(faults))
    return 0


def _sums(totals: dict[str, list[tuple[bool, bool]]], columns: Sequence[str], faults: int) -> None:
    table = Table(f"drives of 40-120 s, {faults} kinds of wrong data; 90 % intervals", *columns)
    for name, told in totals.items():
        shares = [share(sum(column), len(told), 3) for column in zip(*told, strict=True)]
        table.row(name, str(len(told)), shares[0], "-" if name.startswith("good") else shares[1])


def findings_of(fault: str, seed: Sequence[int]) -> list[str]:
    """Return what is said of a drive with a fault, or with none: "", or "with scans"."""
    rng = np.random.default_rng(seed)
    case = drives.draw(rng, easy=fault in wrong_data.SPOILT)
    tables = drives.make(case, rng)
    given = ["command", "pose"] if rng.random() < 0.5 else ["command", "voltage", "pose"]
    sight = None
    if fault in wrong_data.SPOILT:
        tables = wrong_data.SPOILT[fault][0](tables, rng)
        if "voltage" in fault:
            given = ["voltage", "pose"] if rng.random() < 0.5 else ["command", "voltage", "pose"]
        elif "command" in fault:
            given = ["command", "pose"]
    elif fault:
        off = rng.normal(size=3) * [0.03, 0.03, 0.03]
        sight = wrong_scans.look(tables, rng, off, float(rng.uniform(0.002, 0.02)))
        if fault in wrong_scans.SPOILT:
            sight = wrong_scans.SPOILT[fault][0](sight, rng)
    return findings_of_tables(tables, given, sight)


def findings_of_tables(tables: drives.Tables, given: Sequence[str], sight: wrong_scans.Sight | None) -> list[str]:
    """Return what forbids a verdict, as reader and critic say it."""
    faults = Faults()
    run = run_of(tables, given, faults)
    laser = sight.laser if sight is not None else None
    with TemporaryDirectory() as folder:
        world = None
        if sight is not None:
            beams = tuple(f"r{i}" for i in range(sight.scans.shape[1] - 1))
            rows = Rows("scan.csv", sight.scans[:, 0], sight.scans[:, 1:], beams, "line", 2)
            run = replace(run, scan=clean(rows, faults, ranges=True))
            world = Path(folder) / "place.world"
            wrong_scans.write_world(world, sight.walls)
        check_run(run, laser, faults)
        recording = Recording("r", (run,), train=(run.name,), world=world, laser=laser)
        return [*faults.invalid, *examination.examine(recording, load_model(shipped("launch/md100.yaml"))).invalid]


def run_of(tables: drives.Tables, parts: Sequence[str], faults: Faults) -> Run:
    """Return a run as the reader of tables would have it."""

    def part(name: str) -> Series | None:
        if name not in parts:
            return None
        rows = tables[name]
        return clean(Rows(f"{name}.csv", rows[:, 0], rows[:, 1:], REQUIRED[name], "line", 2), faults)

    return Run("run_1", command=part("command"), voltage=part("voltage"), pose=part("pose"))
