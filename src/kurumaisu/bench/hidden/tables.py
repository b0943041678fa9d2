# SPDX-License-Identifier: BSD-3-Clause
"""Cases as folders of tables, as people hand them in; and what only happens to tables, on the way there."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path

import numpy as np
import yaml

from kurumaisu.bench.hidden.generator.case import Truth
from kurumaisu.critic.data.csv_reader import write_csv_run
from kurumaisu.critic.values.recording import Recording
from kurumaisu.errors import Error
from kurumaisu.whole_files import write_whole

Lines = list[str]


def _twice(lines: Lines, rng: np.random.Generator) -> Lines:
    """Return lines of which a fifth are there twice, as a recorder does that writes a buffer again."""
    return [line for line in lines for _ in range(1 + (rng.random() < 0.2))]


def _swapped(lines: Lines, rng: np.random.Generator) -> Lines:
    """Return lines of which every tenth pair has changed places: messages that overtook each other."""
    out = list(lines)
    for i in range(0, len(out) - 1, 20):
        out[i], out[i + 1] = out[i + 1], out[i]
    return out


def _set_back(lines: Lines, rng: np.random.Generator) -> Lines:
    """Return lines whose clock was set back by 5 s half-way."""
    half = len(lines) // 2
    late = [line.split(",", 1) for line in lines[half:]]
    return lines[:half] + [f"{float(t) - 5.0!r},{rest}" for t, rest in late]


# Wrong data that a recording in memory cannot hold, because its times increase.
TABLES: dict[str, Callable[[Lines, np.random.Generator], Lines]] = {
    "rows twice in the table": _twice,
    "rows swapped in the table": _swapped,
    "clock set back": _set_back,
}


def write_case(folder: Path, recording: Recording, truth: Truth | None = None, damage: str = "", seed: int = 0) -> None:
    """Write a recording as a folder with meta.yaml and one folder of tables per run.

    truth: written beside it, into FOLDER.truth.json; damage: name in TABLES, done to the poses of each run.
    Raise Error for a damage that there is not.
    """
    if damage and damage not in TABLES:
        raise Error(f"hidden: damage: {damage!r} is none of {', '.join(TABLES)}")
    rng = np.random.default_rng(seed)
    for run in recording.runs:
        write_csv_run(folder / run.name, run)
        if damage:
            table = folder / run.name / "pose.csv"
            head, *lines = table.read_text(encoding="utf-8").splitlines()
            write_whole({table: "\n".join([head, *TABLES[damage](lines, rng)]) + "\n"})
    meta: dict[str, object] = {"train": list(recording.train)}
    if recording.world is not None:
        write_whole({folder / recording.world.name: recording.world.read_text(encoding="utf-8")})
        meta["world"] = recording.world.name
    if recording.laser is not None:
        meta["laser"] = recording.laser.known
    if recording.truth is not None:
        meta["truth"] = dict(zip(("position_sd", "heading_sd"), recording.truth, strict=True))
    write_whole({folder / "meta.yaml": yaml.safe_dump(meta)})
    if truth is not None:
        write_whole({folder.with_name(folder.name + ".truth.json"): json.dumps(asdict(truth), indent=1)})
