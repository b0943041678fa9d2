# SPDX-License-Identifier: BSD-3-Clause
"""A recording that was split: NAME.bag names NAME_0.bag, NAME_1.bag, ..., as rosbag record --split -O NAME.bag does."""

from __future__ import annotations

import glob
from pathlib import Path

from kurumaisu.errors import Error


def numbered(path: Path, ending: str = "") -> list[Path]:
    """Return NAME_0.bag, NAME_1.bag, ... of those that are there, in order; ending: behind .bag."""
    lead, trail = len(path.stem) + 1, len(path.suffix + ending)
    found = path.parent.glob(f"{glob.escape(path.stem)}_*{path.suffix}{ending}")
    numbers = {int(words): item for item in found if (words := item.name[lead : len(item.name) - trail]).isdigit()}
    return [numbers[number] for number in sorted(numbers)]


def is_split(path: Path) -> bool:
    """Return whether a bag that is not there itself was split."""
    return path.suffix == ".bag" and not path.exists() and bool(numbered(path))


def parts_of(path: Path) -> list[Path]:
    """Return the bags that a recording is in: itself, or its parts in order. Raise Error where one is missing."""
    if not is_split(path):
        return [path]
    parts = numbered(path)
    for number, part in enumerate(parts):
        wanted = path.with_name(f"{path.stem}_{number}{path.suffix}")
        if part != wanted:
            raise Error(f"{wanted}: is missing, but {part.name} exists")
    return parts
