# SPDX-License-Identifier: BSD-3-Clause
"""Drives of the simulated chair to random places of a map, for logs that no setting was made with."""

from __future__ import annotations

from io import BytesIO
from pathlib import Path

import numpy as np
from PIL import Image
from scipy.ndimage import distance_transform_edt, label
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import dijkstra

from kurumaisu import slam
from kurumaisu.bench.slam.drive import SimulatedDrive
from kurumaisu.driving import Route, RouteFollower
from kurumaisu.errors import Error
from kurumaisu.map_file import MapFile
from kurumaisu.params import shipped
from kurumaisu.types import FloatArray, IntArray
from kurumaisu.whole_files import write_whole
from kurumaisu.world import World, load_world

_STEP = 0.2  # [m] of the planner's grid
_CLEAR = 0.55  # [m] from a way to the nearest wall
_NEAR = 1.2  # [m] from walls nearer than this a way keeps away
_FAR = 6.0  # [m] to the next place, at least
_STUCK = 6.0  # [s] without getting anywhere, after which the chair backs off
_BACK = 1.5  # [s] backwards, and on to another place
_WALL = 65  # [%]


class Ways:
    """Ways through what is free of a map, away from its walls."""

    def __init__(self, grid: MapFile) -> None:
        """Raise Error for a map without room for the chair."""
        stride = max(1, round(_STEP / grid.resolution))
        clear = distance_transform_edt(np.pad(grid.cells == 0, 1))[1:-1, 1:-1] * grid.resolution
        clear = clear[stride // 2 :: stride, stride // 2 :: stride]
        areas, count = label(clear > _CLEAR)
        if count == 0:
            raise Error("the map has no room for the chair")
        largest = 1 + int(np.argmax(np.bincount(areas.ravel())[1:]))
        self._nodes = np.argwhere(areas == largest)
        self._points = np.array(grid.origin[:2]) + (self._nodes[:, ::-1] * stride + stride // 2 + 0.5) * grid.resolution
        cost = 1 + 4 * np.clip(_NEAR - clear[tuple(self._nodes.T)], 0, None)
        self._graph = _graph(areas == largest, self._nodes, cost)

    def place(self, rng: np.random.Generator) -> FloatArray:
        """Return a random place (2,) [m]."""
        return np.asarray(self._points[rng.integers(len(self._points))])

    def way(self, start: FloatArray, rng: np.random.Generator) -> FloatArray:
        """Return points (n, 2) every half metre or so from near a place to a random one that is far from it."""
        here = self._nearest(start)
        distances, before = dijkstra(self._graph, indices=here, return_predecessors=True)
        far = np.flatnonzero(np.isfinite(distances) & (np.hypot(*(self._points - start).T) > _FAR))
        there = int(rng.choice(far)) if len(far) else int(np.argmax(distances))
        nodes: list[int] = []
        while there != here:
            nodes.append(there)
            there = int(before[there])
        return np.asarray(self._points[nodes[::-1]][::2])

    def _nearest(self, point: FloatArray) -> int:
        return int(np.argmin(np.hypot(*(self._points - point).T)))


def _graph(open_cells: IntArray, nodes: IntArray, cost: FloatArray) -> coo_matrix:
    number = np.full(open_cells.shape, -1)
    number[tuple(nodes.T)] = np.arange(len(nodes))
    padded = np.pad(number, 1, constant_values=-1)
    rows, columns, weights = [], [], []
    for dy, dx in ((0, 1), (1, 0), (1, 1), (1, -1)):
        other = padded[nodes[:, 0] + 1 + dy, nodes[:, 1] + 1 + dx]
        there = other >= 0
        rows.append(np.flatnonzero(there))
        columns.append(other[there])
        weights.append(np.hypot(dx, dy) * 0.5 * (cost[there] + cost[other[there]]))
    i, j, w = np.concatenate(rows), np.concatenate(columns), np.concatenate(weights)
    both = (np.concatenate([i, j]), np.concatenate([j, i]))
    return coo_matrix((np.concatenate([w, w]), both), shape=(len(nodes), len(nodes))).tocsr()


def world_of(grid: MapFile, start: FloatArray, heading: float, folder: Path) -> World:
    """Return a world whose walls are those of a map, with the chair at a pose; its files are written to folder."""
    walls = grid.cells > _WALL
    rows, columns = np.flatnonzero(walls.any(axis=1)), np.flatnonzero(walls.any(axis=0))
    # Stage's bitmaps are as large as what is drawn on them.
    walls = walls[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
    drawn = BytesIO()
    Image.fromarray(np.where(walls[::-1], 0, 255).astype(np.uint8)).save(drawn, "PNG")
    size = np.array(walls.shape[::-1]) * grid.resolution
    middle = np.array(grid.origin[:2]) + np.array([columns[0], rows[0]]) * grid.resolution + size / 2
    inc = shipped("worlds/md100.inc").read_text(encoding="utf-8")
    text = (
        f'name "map"\nsemantics "physical"\n{inc}\n'
        f'model ( name "walls" bitmap "walls.png" boundary 0 size [{size[0]} {size[1]} 2] '
        f"pose [{middle[0]} {middle[1]} 0 0] )\n"
        f'md100 ( name "chair" pose [{start[0]} {start[1]} 0 {np.degrees(heading)}] )\n'
    )
    write_whole({folder / "walls.png": drawn.getvalue(), folder / "map.world": text})
    return load_world(folder / "map.world")


def random_drive(grid: MapFile, folder: Path, seed: int, seconds: float) -> tuple[slam.ScanLog, FloatArray]:
    """Return scans and odometry of commands of a drive to random places, and the true poses (n, 3) at the scans."""
    ways, rng = Ways(grid), np.random.default_rng(seed)
    start = ways.place(rng)
    world = world_of(grid, start, _first_heading(ways.way(start, np.random.default_rng(seed)), start), folder)
    return _drive(SimulatedDrive(world, seed), ways, rng, seconds)


def _first_heading(way: FloatArray, start: FloatArray) -> float:
    ahead = way[min(2, len(way) - 1)] - start
    return float(np.arctan2(ahead[1], ahead[0]))


def _drive(
    drive: SimulatedDrive, ways: Ways, rng: np.random.Generator, seconds: float
) -> tuple[slam.ScanLog, FloatArray]:
    driver, there, since = RouteFollower(_route(np.zeros((0, 2)))), drive.observation.pose, 0.0
    v = w = 0.0
    while drive.observation.time < seconds:
        now, pose = drive.observation.time, drive.observation.pose
        stuck = now - since
        if np.hypot(*(pose - there)[:2]) > 0.3:
            there, since = pose, now
        if driver.done or stuck > _STUCK + _BACK:
            driver, since = RouteFollower(_route(ways.way(pose[:2], rng))), now
        if drive.due:
            v, w = driver.command(pose) if stuck < _STUCK else (-0.3, 0.0)
        drive.step(v, w)
    return drive.log()


def _route(way: FloatArray) -> Route:
    return Route(way, speed=0.6, turn=0.7, gain=1.5, reach=0.3, pause=1.0, deadline=1e9)
