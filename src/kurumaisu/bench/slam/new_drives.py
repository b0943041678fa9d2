# SPDX-License-Identifier: BSD-3-Clause
"""Unknown starts and chairs that were carried away, on drives that are simulated for this run alone."""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np

from kurumaisu._core import LaserError
from kurumaisu.bench.slam.lost import Found, Logs, carried_away, from_nowhere
from kurumaisu.bench.slam.models import without_mean_error
from kurumaisu.bench.slam.office import Judged
from kurumaisu.bench.slam.random_drives import random_drive
from kurumaisu.bench.table import Table
from kurumaisu.localization import Localizer, LocalizerSettings, make_localizer
from kurumaisu.map_file import MapFile

_NOTICED = 3.0  # [s]
_RIGHT = 0.8  # share at least


def drives(grid: MapFile, seed: int, count: int, seconds: float) -> Logs:
    """Return logs, readings as they are, and their truth: drives to random places of a map, of seeds from one on."""
    with tempfile.TemporaryDirectory() as folder:
        return [random_drive(grid, Path(folder), seed + i, seconds) for i in range(count)]


def on_new_drives(
    name: str,
    logs: Logs,
    grid: MapFile,
    settings: LocalizerSettings,
    error: LaserError,
    seed: int,
    counts: tuple[int, int],
) -> list[Judged]:
    """Print how many of so many unknown starts and carried chairs come out right; return what became of the bounds."""
    corrected = [(without_mean_error(log, error), truth) for log, truth in logs]

    def make(case: int) -> Localizer:
        return make_localizer(settings, error, grid, case)

    columns = ("right at the end", "ever sure and wrong", "after [s]      ", "noticed in 3 s", "noticed after [s]")
    table = Table(
        f"{name}, {len(logs)} fresh drives, two minutes from anywhere: how many; median (worst)",
        "what",
        *columns,
        page=False,
    )
    starts = [from_nowhere(make, corrected, case, seed) for case in range(counts[0])]
    carried = [carried_away(make, corrected, case, seed) for case in range(counts[1])]
    for what, results in (("from nowhere", starts), ("carried away", carried)):
        if results:
            _row(table, f"{what}, {len(results)} times", results)
    right, moved = sum(r.right for r in starts), sum(r.right for r in carried)
    wrong = sum(r.wrong for r in [*starts, *carried])
    return [
        _judged(f"{name}: unknown starts, right at the end", right, len(starts)),
        _judged(f"{name}: carried away, right at the end", moved, len(carried)),
        Judged(f"{name}: sure and wrong", str(wrong), "0", "0", "-", "reached" if wrong == 0 else "BROKEN"),
    ]


def _judged(name: str, right: int, of: int) -> Judged:
    state = "kept" if right >= _RIGHT * of else "BROKEN"
    return Judged(name, f"{right} of {of}", f"{100 * _RIGHT:g} %", "-", "-", state)


def _row(table: Table, name: str, results: list[Found]) -> None:
    found, noticed = (np.array([getattr(r, key) for r in results]) for key in ("found_after", "noticed_after"))
    table.row(
        name,
        f"{sum(r.right for r in results)} of {len(results)}",
        f"{sum(r.wrong for r in results)}",
        f"{np.median(found):.1f} ({found.max():.1f})",
        f"{np.sum(noticed <= _NOTICED)} of {len(results)}",
        f"{np.median(noticed):.1f} ({noticed.max():.1f})",
    )
