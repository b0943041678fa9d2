# SPDX-License-Identifier: BSD-3-Clause
"""Runs one benchmark by its name."""

from __future__ import annotations

import importlib
import importlib.util
import os
import sys
from collections.abc import Sequence

MODULES = {
    "sim": "kurumaisu.bench.sim",
    "pool": "kurumaisu.bench.pool",
    "agreement": "kurumaisu.bench.agreement",
    "arena": "kurumaisu.bench.arena",
    "stageros": "kurumaisu.bench.stageros",
    "critic": "kurumaisu.bench.critic",
    "critic_time": "kurumaisu.bench.critic_time",
    "next_experiment": "kurumaisu.bench.next_experiment",
    "experiments_doc": "kurumaisu.bench.experiments_doc",
    "sanity": "kurumaisu.bench.sanity",
    "laser": "kurumaisu.bench.laser",
    "laser_clock": "kurumaisu.bench.laser_clock",
    "faults": "kurumaisu.bench.faults",
    "fuzz": "kurumaisu.bench.fuzz",
    "guard": "kurumaisu.bench.guard",
    "base": "kurumaisu.bench.base",
    "base_faults": "kurumaisu.bench.base_faults",
    "drive": "kurumaisu.bench.drive",
    "odometry": "kurumaisu.bench.odometry",
    "slam": "kurumaisu.bench.slam",
    "slam_localise": "kurumaisu.bench.slam_localise",
    "predict": "kurumaisu.bench.predict",
    "paper": "kurumaisu.bench.paper",
    "paper_scans": "kurumaisu.bench.paper_scans",
    "paper_wall": "kurumaisu.bench.paper_wall",
    "viewer": "kurumaisu.bench.viewer",
}


def main(arguments: Sequence[str]) -> int:
    """Run the benchmark that the first argument names, with the other arguments. Return 2 if there is none."""
    there = {name: module for name, module in MODULES.items() if importlib.util.find_spec(module)}
    if not arguments or arguments[0] not in there:
        asked = f"no benchmark {arguments[0]!r}; " if arguments else ""
        print(f"scripts/bench: {asked}there are: {', '.join(there)}", file=sys.stderr)
        return 2
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # figures are of one core; --jobs uses others
    status: int = importlib.import_module(there[arguments[0]]).main(arguments[1:])
    return status


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
