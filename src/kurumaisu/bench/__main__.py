# SPDX-License-Identifier: BSD-3-Clause
"""Runs one benchmark by its name."""

from __future__ import annotations

import importlib
import importlib.util
import os
import sys
from collections.abc import Sequence

NAMES = (
    "sim",
    "pool",
    "agreement",
    "arena",
    "stageros",
    "critic",
    "critic_time",
    "next_experiment",
    "experiments_doc",
    "sanity",
    "laser",
    "laser_clock",
    "faults",
    "fuzz",
    "guard",
    "mutations",
    "base",
    "base_faults",
    "drive",
    "odometry",
    "slam",
    "slam_localise",
    "predict",
    "paper",
    "paper_scans",
    "paper_wall",
    "viewer",
)


def main(arguments: Sequence[str]) -> int:
    """Run the benchmark that the first argument names, with the other arguments. Return 2 if there is none."""
    there = [name for name in NAMES if importlib.util.find_spec(f"kurumaisu.bench.{name}")]
    if not arguments or arguments[0] not in there:
        asked = f"no benchmark {arguments[0]!r}; " if arguments else ""
        print(f"scripts/bench: {asked}there are: {', '.join(there)}", file=sys.stderr)
        return 2
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # figures are of one core; --jobs uses others
    status: int = importlib.import_module(f"kurumaisu.bench.{arguments[0]}").main(arguments[1:])
    return status


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
