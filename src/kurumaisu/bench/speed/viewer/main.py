# SPDX-License-Identifier: BSD-3-Clause
"""What the viewer costs a simulator that runs flat out: one page, ten of which one hangs, a dead viewer; and a soak.

What else a machine does changes the cost of a step by more than a page does. So every measurement stands between two
without pages, and is divided by their mean; of these ratios the median counts.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import math
import os
import statistics
import tempfile
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from kurumaisu.bench.processes import memory
from kurumaisu.bench.speed.viewer.page import Page
from kurumaisu.bench.speed.viewer.rig import Rig, rig_of
from kurumaisu.bench.table import Table

_LIMIT = 1.05
_RATE = 30  # [1/s] views
_NOBODY, _ONE, _TEN, _DEAD = "nobody looks", "one page", "ten pages, one hangs", "one page, viewer hangs"
_PHASES = {"stageros": (_ONE, _TEN, _DEAD), "sim_node": (_ONE,)}
_PAGES = {_NOBODY: 0, _ONE: 1, _TEN: 10, _DEAD: 1}
_CERTAIN = 0.9  # of the interval in which the median of the ratios is


@dataclass(frozen=True)
class _Cost:
    """CPU [s] per simulated second, simulated seconds per second, viewer's share of a core, frames a page had [1/s]."""

    cpu: float
    speed: float
    viewer: float
    frames: float


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the tables. Return 1 if one page costs a simulator 5 % or more."""
    parser = argparse.ArgumentParser(prog="scripts/bench viewer", description=__doc__)
    parser.add_argument("--simulators", nargs="+", choices=_PHASES, default=list(_PHASES))
    parser.add_argument("--robots", type=int, default=10, help="in stageros, with 682 beams each")
    parser.add_argument("--seconds", type=float, default=0.7, help="of each measurement")
    parser.add_argument("--repeats", type=int, default=7, help="of all, in turns; the median counts; 0: none")
    parser.add_argument("--soak", type=float, default=20.0, help="seconds of ten pages on stageros, one of which hangs")
    options = parser.parse_args(arguments)
    dearer = False
    for simulator in options.simulators:
        with rig_of(simulator, options.robots) as rig:
            if options.repeats:
                dearer |= _costs(rig, simulator, options)
            if options.soak and simulator == "stageros":
                _soak(rig, options.soak)
        if options.repeats:
            _clock(simulator, options.robots, options.seconds * options.repeats)
    return int(dearer)


def _costs(rig: Rig, simulator: str, options: argparse.Namespace) -> bool:
    """Print what each phase costs; return whether one page costs too much."""
    what = f"in one thread, {options.robots} robots" if simulator == "stageros" else "the chair"
    phases = _PHASES[simulator]
    progress = Table(
        f"{simulator}, {what} of 682 beams, flat out, {os.cpu_count()} cores: CPU time, times nobody",
        *("turn of", *phases, "load average"),
        page=False,
    )
    runs: dict[str, list[_Cost]] = {name: [] for name in (_NOBODY, *phases)}
    ratios: dict[str, list[tuple[float, float]]] = {name: [] for name in phases}  # of CPU time, of speed
    before = _measure(rig, _NOBODY, options.seconds)
    for turn in range(options.repeats):
        for name in phases:
            cost = _measure(rig, name, options.seconds)
            after = _measure(rig, _NOBODY, options.seconds)
            runs[name].append(cost)
            runs[_NOBODY].append(after)
            ratios[name].append(
                (2 * cost.cpu / (before.cpu + after.cpu), 2 * cost.speed / (before.speed + after.speed))
            )
            before = after
        progress.row(
            f"{turn + 1}/{options.repeats}", *(ratios[name][-1][0] for name in phases), f"{os.getloadavg()[0]:.1f}"
        )
    _print(simulator, runs, ratios)
    return statistics.median(cpu for cpu, _ in ratios[_ONE]) >= _LIMIT


def _clock(simulator: str, robots: int, seconds: float) -> None:
    """Print what the thread that simulates does for one page, by its own clock."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "clock.json"
        with rig_of(simulator, robots, file) as rig:
            rig.look(1)
            time.sleep(seconds)
        frames, in_frames, calls, in_calls, passed = json.loads(file.read_text())
    table = Table(
        f"{simulator}, by the clock of the thread that simulates",
        *("what", "each [us]", f"of a core at {_RATE:g} views/s [%]", "of its CPU time here [%]"),
    )
    table.row("a view", 1e6 * in_frames / frames, 100 * _RATE * in_frames / frames, 100 * in_frames / passed)
    table.row("to see that none is due", 1e6 * in_calls / calls, "-", 100 * in_calls / passed)
    table.note(f"Here {frames / passed:.0f} views in a second of its CPU time.")


def _print(simulator: str, runs: dict[str, list[_Cost]], ratios: dict[str, list[tuple[float, float]]]) -> None:
    table = Table(
        f"{simulator}: medians; in brackets where the true one is, to {_CERTAIN:.0%}; limit of one page {_LIMIT:g}",
        *("who looks", "CPU [ms] per simulated s", "times nobody", "speed [s/s]", "times nobody's", "viewer, CPU [%]"),
        "frames/s of a page",
    )
    for name, costs in runs.items():
        middle = [
            statistics.median(getattr(cost, key) for cost in costs) for key in ("cpu", "speed", "viewer", "frames")
        ]
        cpu, speed = (_words(column) for column in zip(*ratios[name], strict=True)) if name in ratios else ("1", "1")
        table.row(name, 1e3 * middle[0], cpu, middle[1], speed, *(middle[2:]))


def interval(values: Sequence[float]) -> tuple[float, float] | None:
    """Return where the true median lies, whatever the distribution is; None if there are too few to say.

    By order statistics: each value is below the true median as likely as above.
    """
    n = len(values)
    below = np.cumsum([math.comb(n, k) / 2**n for k in range(n)])  # chance that at most k values are
    k = int(np.searchsorted(below, (1 - _CERTAIN) / 2, side="right"))
    ordered = sorted(values)
    return (ordered[k - 1], ordered[n - k]) if k else None


def _words(values: Sequence[float]) -> str:
    where = interval(values)
    return f"{statistics.median(values):.3f}" + (f" ({where[0]:.2f}-{where[1]:.2f})" if where else "")


def _measure(rig: Rig, phase: str, seconds: float) -> _Cost:
    rig.look(_PAGES[phase])
    with rig.stopped() if phase == _DEAD else contextlib.nullcontext():
        count, start = rig.pages[0].counts["state"] if rig.pages else 0, time.monotonic()
        simulated, wall, spent, viewer = rig.passed(seconds)
        frames = rig.pages[0].counts["state"] - count if rig.pages else 0
        rate = frames / (time.monotonic() - start)
    return _Cost(spent / simulated, simulated / wall, 100 * viewer / wall, rate)


def _soak(rig: Rig, seconds: float) -> None:
    """Print memory over time with ten pages, one of which hangs, is cut off and comes again; and who missed what."""
    columns = ("viewer [MB]", "simulator [MB]", "frames/s of a page", "cut off", "after [s]")
    table = Table("ten pages, one hangs", "[s]", *columns, page=False)
    rows: list[tuple[str | float, ...]] = []
    rig.look(_PAGES[_TEN])
    begin = hung = time.monotonic()
    cuts: list[float] = []
    for _ in _parts(begin, seconds):
        seen, start = rig.pages[0].counts["state"], time.monotonic()
        while time.monotonic() - start < max(seconds / 10, 1.0):
            time.sleep(0.1)
            if rig.pages[-1].cut_off:
                cuts.append(time.monotonic() - hung)
                rig.pages[-1].close()
                rig.pages[-1] = Page(rig.address)
                rig.pages[-1].stall()
                hung = time.monotonic()
        rate = (rig.pages[0].counts["state"] - seen) / (time.monotonic() - start)
        after = f"{cuts[-1]:.1f}" if cuts else "-"
        rows.append((memory(rig.viewer), memory(rig.simulator), rate, str(len(cuts)), after))
        table.row(f"{time.monotonic() - begin:.0f}", *rows[-1])
    ends = Table(f"ten pages of stageros for {seconds:g} s, one hangs, is cut off and comes again", "when", *columns)
    ends.row("at first", *rows[0])
    ends.row("at last", *rows[-1])
    print("\nwho looks, as the viewer says:", *rig.service("clients").split("; "), sep="\n  ", flush=True)


def _parts(begin: float, seconds: float) -> Iterator[None]:
    while time.monotonic() - begin < seconds:
        yield
