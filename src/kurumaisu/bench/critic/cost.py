# SPDX-License-Identifier: BSD-3-Clause
"""What ten minutes of driving cost the critic: reference and voltages at 50 Hz, scans of 682 beams at 10 Hz."""

from __future__ import annotations

import argparse
import os
import resource
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from kurumaisu.bench.hidden import Ask, make
from kurumaisu.bench.hidden.base.catalogue import BASE
from kurumaisu.bench.hidden.base.recordings import RUNS, draw_drives
from kurumaisu.bench.hidden.base.recordings import recording as base_recording
from kurumaisu.bench.hidden.generator.noise import USUAL
from kurumaisu.bench.processes import cpu_time
from kurumaisu.bench.table import Table
from kurumaisu.critic import pipeline
from kurumaisu.critic.values.recording import Recording, Run
from kurumaisu.params import shipped

_RATE = 50.0  # [Hz]
_SECONDS = 600.0
_SCANS = 6000
_LIMITS = ("30", "-", "2048")  # wall time [s] on two cores, CPU time, memory [MiB]: of the issue that asked for it


def main(arguments: Sequence[str] | None = None) -> int:
    """Print time and memory of a verdict over ten minutes of driving with scans."""
    parser = argparse.ArgumentParser(prog="scripts/bench critic_time", description=__doc__)
    parser.add_argument("--seed", type=int, default=1000)
    parser.add_argument("--runs", type=int, default=1, help="times it is done; the median is shown")
    options = parser.parse_args(arguments)
    with TemporaryDirectory() as folder:
        recording = _recording(options.seed, Path(folder))
        rows = [_measured(recording) for _ in range(options.runs)]
    wall, cpu, verdict = rows[int(np.argsort([row[0] for row in rows])[len(rows) // 2])]
    # Of this process and of the largest other one, though they need not peak at the same time.
    both = (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)
    peak = sum(resource.getrusage(which).ru_maxrss for which in both) / 1024
    scans = sum(len(run.scan.t) for run in recording.runs if run.scan is not None)
    table = Table(
        f"{_SECONDS:g} s of driving, {scans} scans, {os.cpu_count()} cores: {verdict}",
        "",
        "wall [s]",
        "CPU [s]",
        "peak memory [MiB]",
    )
    table.row("critic", f"{wall:.1f}", f"{cpu:.1f}", f"{peak:.0f}")
    table.row("limit", *_LIMITS)
    return 0


def _measured(recording: Recording) -> tuple[float, float, str]:
    wall, cpu = time.perf_counter(), cpu_time()
    found = pipeline.criticise(recording, shipped("launch/md100.yaml"), lambda _: None).verdict
    return time.perf_counter() - wall, cpu_time() - cpu, found.verdict


def _recording(seed: int, folder: Path) -> Recording:
    """Return ten minutes of drives with a lag, and as many scans of other, short drives, taken again and again."""
    rng = np.random.default_rng(seed)
    hidden = BASE["base.lag_v"]
    drives = draw_drives(None, USUAL, rng, _SECONDS / RUNS, _RATE)
    driven = base_recording("ten minutes", drives, [hidden.fault(hidden.draw(rng), "plain")])
    seen = make(Ask("null", regime="usual", design="drive", family="laser"), seed, folder).recording
    runs = list(driven.runs)
    scans = 0
    while scans < _SCANS:
        run = seen.runs[len(runs) % len(seen.runs)]
        assert run.scan is not None
        runs.append(Run(f"scans_{len(runs)}", pose=run.pose, scan=run.scan))
        scans += len(run.scan.t)
    return replace(seen, name="ten minutes", runs=tuple(runs), train=tuple(run.name for run in runs), truth=None)
