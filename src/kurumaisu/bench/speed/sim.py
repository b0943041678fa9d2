# SPDX-License-Identifier: BSD-3-Clause
"""What rays, robots, start-up and memory of the simulator cost, next to Stage where that is at hand."""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Sequence
from pathlib import Path

from kurumaisu.bench import peers
from kurumaisu.bench.scenes import maps, shipped_map
from kurumaisu.bench.speed import chair, plots, rays, robots, ways
from kurumaisu.params import load_model, shipped
from kurumaisu.world import load_world


def main(arguments: Sequence[str] | None = None) -> int:
    """Print all tables. Return 1 if the ranges of two ways differ by more than rounding."""
    options = _parser().parse_args(arguments)
    model, building = load_model(shipped("launch/md100.yaml")), load_world(shipped("worlds/building.world"))
    difference = ways.compare(model, building, min(options.poses, 200), options.repeats)
    chair.simulated_time(model, building, options.seconds, options.repeats)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        stage = peers.Stage(options.stage, folder) if options.stage else None
        places = maps(options.stage_tree) if options.stage_tree else (shipped_map(),)
        rays.table(places, stage, folder, options.poses, options.repeats)
        robots.table(places, stage, folder, options.seconds, options.repeats)
        if options.plots:
            plots.draw(places, stage, folder, options.plots)
    if not options.stage_tree:
        print("\nno --stage-tree: the worlds are this package's own, not the cave and the hospital")
    return 0 if difference <= ways.EXACT else 1


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="scripts/bench sim", description=__doc__)
    parser.add_argument("--repeats", type=int, default=5, help="of everything that is timed; the median counts")
    parser.add_argument("--poses", type=int, default=2000, help="free poses, a fan of beams from each")
    parser.add_argument("--seconds", type=float, default=60.0, help="of simulated time")
    parser.add_argument("--stage", type=Path, metavar="PREFIX", help="where a Stage 4.3 is installed, to compare with")
    parser.add_argument("--stage-tree", type=Path, metavar="DIR", help="Stage's sources, for the bitmaps of its worlds")
    parser.add_argument("--plots", type=Path, metavar="DIR", help="draw cost against beams, robots and map size")
    return parser
