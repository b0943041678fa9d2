# SPDX-License-Identifier: BSD-3-Clause
"""How the simulator's cost grows with beams, robots and the size of the map, drawn."""

from __future__ import annotations

import io
import math
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from kurumaisu._core import Scene
from kurumaisu.bench.peers import Stage
from kurumaisu.bench.scenes import URG, Map, free_poses, walls
from kurumaisu.bench.speed import robots
from kurumaisu.types import FloatArray
from kurumaisu.whole_files import write_whole

_BEAMS = (16, 64, 256, 682, 1081, 2048, 4096)
_ROBOTS = (1, 3, 10, 30, 100, 300, 1000)
_COPIES = (1, 2, 4, 8, 16)  # of the map along each side
_FANS = 300  # for each point
_SECONDS = 5.0  # of simulated time for each point


@dataclass(frozen=True)
class Curve:
    """Costs over something: x and y of the same length."""

    name: str
    x: Sequence[float]
    y: Sequence[float]


def draw(places: Sequence[Map], stage: Stage | None, folder: Path, into: Path) -> None:
    """Measure and write beams.svg, robots.svg and map_size.svg into a folder."""
    into.mkdir(parents=True, exist_ok=True)
    place = places[-1]
    segments = walls(places[0], folder).segments
    poses = free_poses(walls(places[0], folder), _FANS, np.random.default_rng(7))
    beams = [1e6 * _fan(Scene(segments), poses, count) for count in _BEAMS]
    _plot(into / "beams.svg", "beams of a fan", "CPU time per fan [us]", [Curve(places[0].name, _BEAMS, beams)])
    _plot(
        into / "robots.svg",
        f"robots with 16 beams in the {place.name}",
        "CPU time per simulated second [s]",
        _robots(place, stage, folder),
    )
    sizes = [_tiled(segments, copies) for copies in _COPIES]
    cost = [1e6 * _fan(Scene(size), poses, URG.beams) for size in sizes]
    curve = Curve(f"{places[0].name}, repeated", [len(size) for size in sizes], cost)
    _plot(into / "map_size.svg", "segments of the map", f"CPU time per fan of {URG.beams} beams [us]", [curve])


def _fan(scene: Scene, poses: FloatArray, beams: int) -> float:
    """Return the CPU time of a fan [s], the median of three."""
    times = []
    for _ in range(3):
        start = time.process_time()
        for pose in poses:
            scene.cast_fan(pose, -URG.fov / 2, URG.fov / (beams - 1), beams, URG.range_max)
        times.append((time.process_time() - start) / len(poses))
    return float(np.median(times))


def _robots(place: Map, stage: Stage | None, folder: Path) -> list[Curve]:
    row = robots.ROWS[-1]
    ours, theirs = [], []
    for count in _ROBOTS:
        mine, other = robots.in_turns(stage, robots.scene(replace(row, robots=count), place, folder), _SECONDS, 1)
        ours.append(mine.cpu / _SECONDS)
        if other:
            theirs.append(other.cpu / _SECONDS)
    return [Curve("kurumaisu", _ROBOTS, ours), *([Curve("Stage", _ROBOTS, theirs)] if theirs else [])]


def _tiled(segments: FloatArray, copies: int) -> FloatArray:
    """Return a map of copies x copies of one, side by side, the original in its place."""
    ends = segments.reshape(-1, 2)
    size = ends.max(axis=0) - ends.min(axis=0)
    steps = np.stack(np.meshgrid(np.arange(copies), np.arange(copies)), axis=-1).reshape(-1, 1, 2) * size
    return np.asarray((ends[np.newaxis] + steps).reshape(-1, 4))


def _plot(path: Path, x: str, y: str, curves: Sequence[Curve]) -> None:
    import matplotlib  # takes long to load, and few ask for plots

    matplotlib.use("Agg")
    from matplotlib import pyplot

    figure, axes = pyplot.subplots(figsize=(5, 3.5))
    for curve in curves:
        axes.loglog(curve.x, curve.y, "o-", label=curve.name)
    axes.set_xlabel(x)
    axes.set_ylabel(y)
    axes.set_ylim(bottom=10 ** math.floor(math.log10(min(min(curve.y) for curve in curves))))
    axes.grid(visible=True, which="both", alpha=0.3)
    axes.legend()
    drawn = io.StringIO()
    figure.savefig(drawn, format="svg", bbox_inches="tight", metadata={"Date": None})
    pyplot.close(figure)
    write_whole({path: drawn.getvalue()})
