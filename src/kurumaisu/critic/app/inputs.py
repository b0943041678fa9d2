# SPDX-License-Identifier: BSD-3-Clause
"""Which recordings a command line means, and where the answer about each is written."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

from kurumaisu.critic.bags.containers import SUFFIXES, is_bag
from kurumaisu.critic.data.csv_reader import is_csv_run
from kurumaisu.critic.data.reading import is_log
from kurumaisu.errors import Error

META = "meta.yaml"


def recordings(paths: Sequence[Path], output: Path) -> list[Path]:
    """Return the recordings among paths; a folder of recordings stands for all in it, without the output folder.

    Raise Error for one that is meant twice. What cannot be read is found out later, when it is read.
    """
    found = [item for path in paths for item in _inside(path, output)]
    twice = [item for item, count in Counter(item.resolve() for item in found).items() if count > 1]
    if twice:
        raise Error(f"{twice[0]}: is given twice")
    return found


def names(found: Sequence[Path]) -> list[str]:
    """Return a name for each of several recordings, all different: its path below the folder that all share."""
    whole = [item.resolve() for item in found]
    shared = Path(os.path.commonpath([item.parent for item in whole]))
    below = [item.relative_to(shared) for item in whole]
    short = [str(item if full.is_dir() else _bare(item)) for item, full in zip(below, whole, strict=True)]
    count = Counter(short)
    return [name if count[name] == 1 else str(item) for name, item in zip(short, below, strict=True)]


def _bare(path: Path) -> Path:
    while path.suffix in (*SUFFIXES, ".rawlog", ".gz", ".clf", ".log"):
        path = path.with_suffix("")
    return path


def _inside(path: Path, output: Path) -> list[Path]:
    """Return the recordings of a folder that is no recording itself, else the path."""
    if not path.is_dir() or is_bag(path) or (path / META).is_file():
        return [path]
    items = [item for item in sorted(path.iterdir()) if not item.name.startswith(".")]
    folders = [item for item in items if item.is_dir() and item.resolve() != output.resolve()]
    if not any(_is_recording(folder) for folder in folders):
        return [path]
    return sorted([*folders, *(item for item in items if item.is_file() and (is_bag(item) or is_log(item)))])


def _is_recording(folder: Path) -> bool:
    """Tell whether a folder is a recording of its own, rather than a run of the recording above it."""
    if (folder / META).is_file():
        return True
    if is_bag(folder):
        return False
    inside = sorted(folder.iterdir())
    runs = any(is_bag(item) or is_log(item) or (item.is_dir() and is_csv_run(item)) for item in inside)
    return runs and not is_csv_run(folder)
