# SPDX-License-Identifier: BSD-3-Clause
"""CPU time, start-up and memory of whole worlds of robots, next to Stage."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from kurumaisu.bench.peers import Run, Stage, read_run
from kurumaisu.bench.scenes import SPARSE, URG, Fan, Map, free_poses, walls, write_world
from kurumaisu.bench.table import Table
from kurumaisu.errors import Error

SPEED = (0.3, 0.5)  # v [m/s], w [rad/s] of all robots


@dataclass(frozen=True)
class Row:
    """A world of robots, and how small a share of Stage's CPU time is the floor and the aim."""

    robots: int
    fan: Fan
    place: int  # in the list of maps; the last if there are fewer
    seconds: float  # share of the benchmark's
    floor: float
    aim: float


ROWS = (Row(1, URG, 0, 1.0, 1.5, 4), Row(100, URG, 1, 0.1, 5, 10), Row(1000, SPARSE, 1, 0.1, 5, 10))


def table(places: Sequence[Map], stage: Stage | None, folder: Path, seconds: float, repeats: int) -> None:
    """Print CPU seconds per simulated second of whole worlds, their start-up and their memory."""
    out = Table(
        f"robots of 0.1 m at {SPEED[0]:g} m/s, {SPEED[1]:g} rad/s, every beam at 10 Hz, Stage's semantics, one thread",
        *("scene", "CPU per simulated s [ms]", "Stage [ms]", "Stage / ours", "floor, aim"),
        *("start [s]", "Stage [s]", "memory [MiB]", "Stage [MiB]"),
    )
    for row in ROWS:
        place = places[min(row.place, len(places) - 1)]
        world = scene(row, place, folder)
        time = max(1.0, row.seconds * seconds)
        mine, theirs = in_turns(stage, world, time, repeats)
        out.row(
            f"{row.robots} x {row.fan.beams} beams, {place.name}",
            *(1e3 * mine.cpu / time, 1e3 * theirs.cpu / time if theirs else "-"),
            *(theirs.cpu / mine.cpu if theirs else "-", f"{row.floor:g}, {row.aim:g}"),
            *(mine.load, theirs.load if theirs else "-", mine.memory, theirs.memory if theirs else "-"),
        )


def scene(row: Row, place: Map, folder: Path) -> Path:
    """Write the world of a row; return its path."""
    poses = free_poses(walls(place, folder), row.robots, np.random.default_rng(3))
    return write_world(folder / f"{place.name}-{row.robots}.world", place, row.fan, poses)


def in_turns(stage: Stage | None, world: Path, seconds: float, repeats: int) -> tuple[Run, Run | None]:
    """Return what a world costs in ours and in Stage, medians of runs that take turns."""
    ours, theirs = [], []
    for _ in range(repeats):
        ours.append(run(world, seconds))
        if stage:
            theirs.append(stage.run(world, seconds, *SPEED))
    return medians(ours), medians(theirs) if theirs else None


def medians(runs: Sequence[Run]) -> Run:
    """Return the medians of what runs cost, and the first one's poses."""
    load, cpu, memory = np.median([[run.load, run.cpu, run.memory] for run in runs], axis=0).tolist()
    return Run(load, cpu, memory, runs[0].poses)


def run(world: Path, seconds: float, semantics: str = "stage", threads: int = 1) -> Run:
    """Run our simulator in a process of its own, as Stage's driver does."""
    command = [sys.executable, "-m", "kurumaisu.bench.speed.run_ours", str(world), f"{seconds:g}"]
    command += [*(f"{value!r}" for value in SPEED), semantics, str(threads)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        raise Error(f"{' '.join(command)}: returned {done.returncode}: {done.stderr[-1000:]}")
    return read_run(done.stdout)
