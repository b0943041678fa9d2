# SPDX-License-Identifier: BSD-3-Clause
"""Runs one benchmark by its name."""

from __future__ import annotations

import importlib
import importlib.util
import os
import sys
from collections.abc import Sequence

MODULES = {
    "sim": "kurumaisu.bench.speed.sim",
    "pool": "kurumaisu.bench.speed.pool",
    "agreement": "kurumaisu.bench.accuracy.stage.main",
    "arena": "kurumaisu.bench.speed.arena",
    "stageros": "kurumaisu.bench.speed.stageros",
    "critic": "kurumaisu.bench.critic.main",
    "critic_time": "kurumaisu.bench.critic.cost",
    "next_experiment": "kurumaisu.bench.critic.next_experiment",
    "experiments_doc": "kurumaisu.bench.experiments_doc",
    "sanity": "kurumaisu.bench.critic.sanity",
    "laser": "kurumaisu.bench.speed.laser",
    "laser_clock": "kurumaisu.bench.accuracy.laser_clock",
    "faults": "kurumaisu.bench.faults.laser.main",
    "fuzz": "kurumaisu.bench.faults.fuzz",
    "guard": "kurumaisu.bench.faults.guard.main",
    "base": "kurumaisu.bench.speed.base",
    "base_faults": "kurumaisu.bench.faults.base.main",
    "drive": "kurumaisu.bench.speed.drive",
    "odometry": "kurumaisu.bench.accuracy.odometry",
    "slam": "kurumaisu.bench.slam.main",
    "slam_localise": "kurumaisu.bench.slam.localise",
    "predict": "kurumaisu.bench.critic.predict",
    "paper": "kurumaisu.bench.paper.drive",
    "paper_scans": "kurumaisu.bench.paper.scans",
    "paper_wall": "kurumaisu.bench.paper.wall",
    "viewer": "kurumaisu.bench.speed.viewer.main",
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
