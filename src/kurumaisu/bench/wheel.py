# SPDX-License-Identifier: BSD-3-Clause
"""The package without ROS: how large the wheel is, and how long it takes to build, to install and to start."""

from __future__ import annotations

import argparse
import os
import subprocess
import time
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

from kurumaisu.bench.table import Table
from kurumaisu.errors import Error
from kurumaisu.params import shipped

_OURS = {"VIRTUAL_ENV", "PYTHONPATH", "PYTHONHOME"}  # variables that would show it this environment


def main(arguments: Sequence[str] | None = None) -> int:
    """Print sizes and times. What pip has downloaded before, it takes from its cache."""
    parser = argparse.ArgumentParser(prog="scripts/bench wheel", description=__doc__)
    parser.add_argument("--python", default="/usr/bin/python3", help="interpreter (/usr/bin/python3)")
    options = parser.parse_args(arguments)
    tree = shipped("package.xml").parent
    table = Table(f"{os.cpu_count()} cores", "what", "time [s]", "size [MB]")
    with TemporaryDirectory() as name:
        folder = Path(name)
        there = folder / "there/bin"
        _timed(folder, options.python, "-m", "venv", folder / "there")
        seconds = _timed(folder, there / "pip", "wheel", "--no-deps", "--wheel-dir", folder / "wheel", tree)
        (wheel,) = (folder / "wheel").iterdir()
        table.row("the wheel, built from its sources", seconds, _size(wheel))
        before = _size(folder / "there")
        seconds = _timed(folder, there / "pip", "install", wheel)
        table.row("installed, with all that it needs", seconds, _size(folder / "there") - before)
        (own,) = (folder / "there/lib").glob("python3*/site-packages/kurumaisu")
        table.row("of that its own", "", _size(own) + _size(folder / "there/share/kurumaisu"))
        for words in ("check-world {}", "sim --seconds 10", "critic driven --quiet"):
            command = words.format(shipped("worlds/room.world")).split()
            said = f"kurumaisu {words.format('worlds/room.world')}"
            table.row(said, _timed(folder, there / "kurumaisu", *command, codes=(0, 3, 4, 5)), "")
    return 0


def _timed(folder: Path, *command: str | Path, codes: tuple[int, ...] = (0,)) -> float:
    """Run a command; return its seconds by the clock. Raise Error if it fails."""
    environment = {key: value for key, value in os.environ.items() if key not in _OURS}
    begin = time.monotonic()
    done = subprocess.run(
        [*map(str, command)], cwd=folder, capture_output=True, text=True, check=False, env=environment
    )
    if done.returncode not in codes:
        raise Error(f"{command[0]} {command[1]}: exit code {done.returncode}: {done.stderr[-500:]}")
    return time.monotonic() - begin


def _size(path: Path) -> float:
    """Return the size of a file, or of all in a folder, in MB."""
    files = path.rglob("*") if path.is_dir() else [path]
    return sum(file.stat().st_size for file in files if file.is_file() and not file.is_symlink()) / 1e6
