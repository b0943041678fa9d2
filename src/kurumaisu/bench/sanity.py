# SPDX-License-Identifier: BSD-3-Clause
"""How often wrong data are recognised, with the right words, and how often good data are called wrong."""

from __future__ import annotations

import argparse
from collections import Counter
from collections.abc import Sequence

import numpy as np
from scipy.stats import beta

from kurumaisu.bench import drives, wrong_data
from kurumaisu.bench.table import Table
from kurumaisu.critic import sanity
from kurumaisu.critic.checks import check_run
from kurumaisu.critic.clean import Faults, clean
from kurumaisu.critic.clean import Table as Rows
from kurumaisu.critic.read_csv import REQUIRED
from kurumaisu.critic.recording import Recording, Run, Series
from kurumaisu.params import load_model, shipped


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the table; every draw has its own drive, effect, noise and fault."""
    parser = argparse.ArgumentParser(prog="bench sanity")
    parser.add_argument("--draws", type=int, default=20, help="recordings per fault")
    parser.add_argument("--good", type=int, default=300, help="recordings without a fault")
    parser.add_argument("--seed", type=int, default=1000)
    parser.add_argument("--only", default="", help="faults whose name holds this")
    parser.add_argument("--show", action="store_true", help="print what was missed")
    options = parser.parse_args(arguments)
    table = Table(
        "one drive of 40-120 s; 90 % intervals", "fault", "number", "called invalid   ", "with the right words"
    )
    chosen = [name for name in wrong_data.SPOILT if options.only in name]
    for k, name in enumerate(chosen):
        said = [said_of(name, [options.seed, k, i]) for i in range(options.draws)]
        word = wrong_data.SPOILT[name][1]
        right = [any(word in line for line in lines) for lines in said]
        table.row(name, str(len(said)), share(sum(map(bool, said)), len(said)), share(sum(right), len(said)))
        for i, lines in enumerate(said):
            if options.show and not right[i]:
                print(
                    "   ",
                    [options.seed, k, i],
                    drives.draw(np.random.default_rng([options.seed, k, i]), easy=True),
                    lines,
                )
    wrong = Counter[str]()
    for i in range(options.good):
        lines = said_of(None, [options.seed, 999, i])
        case = drives.draw(np.random.default_rng([options.seed, 999, i]))
        wrong[case.effect or "none"] += bool(lines)
        if lines and options.show:
            print("   ", i, case, lines)
    table.row("none (good data)", str(options.good), share(wrong.total(), options.good), "-")
    return 0


def said_of(fault: str | None, seed: Sequence[int]) -> list[str]:
    """Return what is said of a drive with a fault or without."""
    rng = np.random.default_rng(seed)
    case = drives.draw(rng, easy=fault is not None)
    tables = drives.make(case, rng)
    given = ["command", "pose"] if rng.random() < 0.5 else ["command", "voltage", "pose"]
    if fault is not None:
        tables = wrong_data.SPOILT[fault][0](tables, rng)
        given = [*given[:1], "voltage", "pose"] if "voltage" in fault else given
        if "voltage" in fault and rng.random() < 0.5:
            given = ["voltage", "pose"]
        elif "command" in fault:
            given = ["command", "pose"]
    faults = Faults()
    run = run_of(tables, given, faults)
    check_run(run, None, faults)
    recording = Recording("r", (run,), train=(run.name,))
    model = load_model(shipped("launch/md100.yaml"))
    return [*faults.invalid, *sanity.examine(recording, model).invalid]


def run_of(tables: drives.Tables, parts: Sequence[str], faults: Faults) -> Run:
    """Return a run as the reader of tables would have it."""

    def part(name: str) -> Series | None:
        if name not in parts:
            return None
        rows = tables[name]
        return clean(Rows(f"{name}.csv", rows[:, 0], rows[:, 1:], REQUIRED[name], "line", 2), faults)

    return Run("run_1", command=part("command"), voltage=part("voltage"), pose=part("pose"))


def share(k: int, n: int) -> str:
    """Return a share with its exact (Clopper-Pearson) 90 % interval."""
    low = beta.ppf(0.05, k, n - k + 1) if k else 0.0
    high = beta.ppf(0.95, k + 1, n - k) if k < n else 1.0
    return f"{k / n:.3f} ({low:.2f}-{high:.2f})"
