# SPDX-License-Identifier: BSD-3-Clause
"""A recording read for looking at it: whatever there is, be it too little for a verdict."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from kurumaisu.critic.data.bag_reader import resolve
from kurumaisu.critic.data.clean import Faults
from kurumaisu.critic.data.consistency import check_run
from kurumaisu.critic.data.meta import Meta
from kurumaisu.critic.data.reading import chosen, meta_of, read_run, sources
from kurumaisu.critic.values.recording import Recording, Run, Series
from kurumaisu.critic.view.spool import Spool
from kurumaisu.errors import Error

_PARTS = ("command", "voltage", "pose", "odom", "scan")


@dataclass(frozen=True)
class Album:
    """A recording whose scans have a number for their only value, by which their run's spool gives the ranges."""

    recording: Recording
    spools: dict[str, Spool]


def read_album(path: Path, wanted: Sequence[str]) -> Album:
    """Read runs as the critic does, each with its scans put aside; wanted: their names or patterns, empty takes all.

    Raise Error for what cannot be read, and where there is nothing to look at.
    """
    meta = meta_of(path)
    faults, spools, runs, laser = Faults(), {}, [], meta.laser
    for source in chosen(sources(path), wanted):
        spool = Spool()
        run, mount = read_run(source, meta, faults, spool.put)
        laser = laser or mount
        run = _put_aside(run, spool)
        if not _has(run):
            faults.add(f"{run.name}: has nothing to look at: {_needed(meta)}")
            continue
        check_run(replace(run, scan=None), None, faults)
        spools[run.name] = spool
        runs.append(run)
    if not runs:
        raise Error("; ".join([f"{path}: has nothing to look at: {_needed(meta)}", *faults.notes[:3]]))
    recording = Recording(
        name=path.resolve().stem if path.is_file() else path.resolve().name,
        runs=tuple(runs),
        train=tuple(run.name for run in runs),
        model=meta.model,
        world=meta.world,
        laser=laser,
        problems=tuple(faults.notes),
        invalid=tuple(faults.invalid),
    )
    return Album(recording, spools)


def span(run: Run) -> tuple[float, float]:
    """Return the first and the last time of any part [s]."""
    times = [series.t for name in _has(run) if (series := getattr(run, name)) is not None]
    return min(float(t[0]) for t in times), max(float(t[-1]) for t in times)


def _has(run: Run) -> list[str]:
    return [name for name in _PARTS if getattr(run, name) is not None]


def _needed(meta: Meta) -> str:
    topics = resolve(meta.topics)
    return "none of " + ", ".join(f"{name}.csv or {topics[name]}" for name in _PARTS)


def _put_aside(run: Run, spool: Spool) -> Run:
    """Return a run whose scans are in the spool: those of tables and rawlogs come whole."""
    if run.scan is None or run.scan.columns == ("row",):
        return run
    rows = np.array([[spool.put(ranges)] for ranges in run.scan.values], dtype=np.float64)
    return replace(run, scan=Series(run.scan.t, rows, ("row",)))
