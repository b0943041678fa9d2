# SPDX-License-Identifier: BSD-3-Clause
"""The ray caster over cells: counted by hand, against Stage's own readings, and against the exact one."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from sim_worlds import LASER, OPTIONS, drive, robot, simulator

from kurumaisu._core import CellRays, Scene
from kurumaisu.errors import Error
from kurumaisu.params import shipped
from kurumaisu.sim import Simulator
from kurumaisu.types import FloatArray
from kurumaisu.world import load_world

ROOM = np.array([[0, 0, 6, 0], [6, 0, 6, 5], [6, 5, 0, 5], [0, 5, 0, 0]], dtype=float)

# Stage 4.3.0 in this world, by libstage's ModelRanger::Sensor::Update: ranges [m], and beams that met something else.
SCENE = """
resolution 0.05
interval_sim 100
define room model ( block ( points 4 point[0] [0 0] point[1] [9 0] point[2] [9 7] point[3] [0 7] z [0 1] ) )
room ( pose [0.3 -0.2 0 12] size [9 7 1] )
model ( pose [-2.13 1.41 0 33] size [0.5 0.3 1] ranger_return 7 )
model ( pose [1.5 1.2 0 0] size [0.5 0.5 0.1] )
model ( pose [1.9 -1.3 0 50] size [0.6 0.4 1] ranger_return -1 )
position ( pose [-0.37 -0.62 0 71] size [0.4 0.3 0.2]
  ranger ( pose [0.1 0.02 0 10] sensor ( range [0 5.5] fov 350 samples 48 ) ) )
position ( pose [0.85 0.93 0 140] size [0.3 0.3 0.6] ranger_return 3 )
"""
STAGE = """
3.489564 3.387191 3.341274 3.351297 3.421823 3.563995 3.851489 4.104504 4.614535 5.330041 5.5 5.5
5.373953 5.262675 5.233611 5.248517 5.357896 5.5 5.5 1.695715 1.710419 4.704996 4.281511 4.01759
3.835189 3.721606 3.670521 3.68098 3.757552 3.880995 2.443136 2.527001 4.917908 4.987979 4.539761 4.236411
4.015022 3.895039 3.840709 3.850805 3.929847 4.031027 4.288319 4.614209 5.004359 4.432875 4.008631 3.742223
"""
OTHERS = {19: 3, 20: 3, 30: 7, 31: 7}


def add(rays: CellRays, walls: FloatArray, ranger_return: float = 1.0, tree: int = -1, top: float = 1.0) -> int:
    edges = np.hstack([walls, np.tile([0.0, top], (len(walls), 1))])
    place = np.zeros((1, 9))
    return rays.add(np.array([-1]), place, edges, np.zeros(len(walls), int), np.array([ranger_return]), tree)


def cells(walls: FloatArray, resolution: float) -> CellRays:
    rays = CellRays(resolution, 1)
    add(rays, walls)
    return rays


def look(rays: CellRays, poses: FloatArray, range_max: float, z: float = 0.5, tree: int = -1) -> FloatArray:
    origins = np.insert(np.atleast_2d(poses), 2, z, axis=1)
    return rays.cast(origins, np.full(len(origins), tree), range_max)[0]


def test_stage_itself_sees_the_same(tmp_path: Path) -> None:
    path = tmp_path / "scene.world"
    path.write_text(SCENE)
    scan = Simulator(load_world(path), replace(OPTIONS, ray_casting="cells")).observe().scans[0]
    stage = np.array([float(word) for word in STAGE.split()])
    missed = stage == 5.5
    np.testing.assert_allclose(scan.ranges[~missed], stage[~missed], atol=1e-6)
    assert np.isinf(scan.ranges[missed]).all()
    expected = [0 if missed[i] else OTHERS.get(i, 1) for i in range(len(stage))]
    np.testing.assert_array_equal(scan.returns, expected)


def test_ranges_count_cells_along_the_nearer_axis() -> None:
    rays = cells(ROOM, 0.25)
    poses = np.array([[1.1, 2.1, 0.0], [1.1, 2.1, math.pi / 2], [1.1, 2.1, 0.4], [1.1, 2.1, math.pi]])
    # columns 4 and 24, rows 8 and 20: 20 columns, 12 rows, 20 columns along a slant, 4 columns; angles are floats
    np.testing.assert_allclose(look(rays, poses, 8.0), [5.0, 3.0, 5.0 / math.cos(0.4), 1.0], rtol=1e-7)


def test_an_empty_region_is_left_at_a_fraction_of_a_cell() -> None:
    wall = np.array([[4.0, -9.0, 4.0, 9.0]])
    # from column 11.5, through regions that end at columns 32, 64, to column 40 of region 32 to 64: 28.5 columns
    assert look(cells(wall, 0.1), np.array([1.15, 0.05, 0.0]), 8.0)[0] == pytest.approx(2.85)
    # with something in the first region, which no ray meets, it steps: 11.5, 12.5 .. 32.5 is not left by a jump
    rays = cells(wall, 0.1)
    add(rays, np.array([[1.0, 2.0, 1.5, 2.0]]), ranger_return=-1.0)
    assert look(rays, np.array([1.15, 0.05, 0.0]), 8.0)[0] == pytest.approx(2.9)


def test_below_0_rays_round_towards_it() -> None:
    room = cells(ROOM - 8.0, 0.25)
    # x -2.1 is in column -9 but counts as -8.4, column -8: the wall x -2 is met on its own cell, 0.4 columns on
    assert look(room, np.array([-2.1, -5.0, 0.0]), 8.0)[0] == pytest.approx(0.0)
    assert look(room, np.array([-2.3, -5.0, 0.0]), 8.0)[0] == pytest.approx(0.25)


def test_a_miss_is_infinite_and_a_start_on_a_wall_is_0() -> None:
    rays = cells(ROOM, 0.1)
    assert look(rays, np.array([3.0, 2.0, 0.3]), 1.2345)[0] == math.inf
    assert look(rays, np.array([-3.0, 2.0, math.pi]), 9.9)[0] == math.inf
    assert look(rays, np.array([6.05, 2.0, 1.0]), 9.9)[0] == 0.0
    assert look(CellRays(0.1, 1), np.array([0.0, 0.0, 0.0]), 2.0)[0] == math.inf


def test_a_wall_within_a_cell_is_invisible() -> None:
    wall = np.array([[1.01, -0.04, 1.01, 0.04]]) + 0.05  # both ends in one cell
    assert look(cells(wall, 0.1), np.array([0.05, 0.05, 0.0]), 5.0)[0] == math.inf
    assert look(cells(wall, 0.01), np.array([0.05, 0.05, 0.0]), 5.0)[0] == pytest.approx(1.01)


def test_own_trees_what_is_lower_and_what_no_ranger_sees_are_passed() -> None:
    rays = CellRays(0.1, 1)
    for x, kind in ((1.05, {"tree": 4}), (2.05, {"top": 0.3}), (3.05, {"ranger_return": -1.0}), (4.05, {})):
        add(rays, np.array([[x, -1.0, x, 1.0]]), **kind)  # type: ignore[arg-type]
    at = np.array([0.05, 0.05, 0.0])
    assert look(rays, at, 9.0, tree=4)[0] == pytest.approx(4.0)
    assert look(rays, at, 9.0, tree=4, z=0.3)[0] == pytest.approx(2.0)  # its top belongs to it
    assert look(rays, at, 9.0, tree=5)[0] == pytest.approx(1.0)


def test_what_moves_is_seen_where_it_is_and_leaves_nothing_behind(tmp_path: Path) -> None:
    text = robot(LASER) + robot(pose="3.01 0 0 0")
    still = [drive(simulator(tmp_path, text, ray_casting=k), [(0, 0, 0), (0, 0, 0)], 1) for k in ("exact", "cells")]
    away = [drive(simulator(tmp_path, text, ray_casting=k), [(0, 0, 0), (0.5, 0, 0)], 20) for k in ("exact", "cells")]
    for exact, over_cells in (still, away):
        expected, ranges = exact[-1].scans[0].ranges, over_cells[-1].scans[0].ranges
        hit = np.isfinite(expected)
        assert hit.sum() >= 5
        np.testing.assert_allclose(ranges[90], expected[90], atol=0.04)
        assert np.isfinite(ranges).sum() == pytest.approx(hit.sum(), abs=2)


def test_stale_robots_are_seen_where_stage_has_them(tmp_path: Path) -> None:
    text = robot(LASER) + robot(pose="3.01 0 0 0")
    options = {"ray_casting": "cells", "collision": "cells_stale"}
    sim = simulator(tmp_path, text, **options)
    drive(sim, [(0, 0, 0), (0.5, 0, 0)], 5)
    stopped = [seen.scans[0].ranges[90] for seen in drive(sim, [(0, 0, 0), (0, 0, 0)], 6)]
    flicker = np.abs(np.diff(stopped))
    np.testing.assert_allclose(flicker[1:], 0.05, atol=0.021)  # a step of 0.05 m, in cells of 0.02 m


@pytest.mark.parametrize("shift", [0.0, -50.0])
def test_it_agrees_with_exact_geometry_within_cells(shift: float) -> None:
    world, resolution = load_world(shipped("worlds/building.world")), 0.02
    walls: FloatArray = world.segments + shift
    rng = np.random.default_rng(9)
    x0, y0, x1, y1 = np.array(world.bounds) + shift
    poses = rng.uniform([x0, y0, -math.pi], [x1, y1, math.pi], (3000, 3))
    scene = Scene(walls)
    met = [scene.cast_fan(pose, 0.0, 0.0, 1, 8.0) for pose in poses]
    exact, wall = np.concatenate([ranges for ranges, _ in met]), np.concatenate([walls for _, walls in met])
    hit = np.isfinite(exact)
    ranges = look(cells(walls, resolution), poses, 8.0)
    hit &= np.isfinite(ranges)
    error = np.abs(ranges[hit] - exact[hit]) / resolution
    along = np.arctan2(*(walls[wall[hit], 2:] - walls[wall[hit], :2]).T[::-1])
    across = np.abs(np.sin(poses[hit, 2] - along))
    assert np.median(error) <= 0.85
    # Seen at a grazing angle, a cell beside a wall is a long way before it: what counts is how far it is from the wall.
    assert np.percentile(error * across, 95) <= 1.6
    assert np.median(error) > 0.05  # cells it is, not exact geometry again


def test_results_do_not_depend_on_threads() -> None:
    origins = np.random.default_rng(1).uniform([1, 1, 0.5, -3], [5, 4, 0.5, 3], (50, 4))
    fans = np.tile([-1.0, 0.01, 200, 9.0], (50, 1))
    scans = []
    for threads in (1, 3):
        rays = CellRays(0.05, threads)
        add(rays, ROOM)
        scans.append(rays.scan(origins, np.zeros(50, int), fans))
    np.testing.assert_array_equal(scans[0], scans[1])


@pytest.mark.parametrize(
    ("walls", "resolution", "message"),
    [
        (ROOM, 0.0, "resolution must be positive, not 0"),
        (ROOM, math.nan, "resolution must be positive, not nan"),
        (ROOM, 1e-8, "resolution is too fine"),
        (ROOM, 1e-300, r"more than 2\^30 cells from its frame"),
        (np.full((1, 4), math.nan), 0.1, "edge 0 is not finite"),
    ],
)
def test_bad_walls(walls: FloatArray, resolution: float, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        cells(walls, resolution)


@pytest.mark.parametrize(
    ("pose", "range_max", "message"),
    [
        ([math.nan, 0, 0], 1.0, "an origin is not finite"),
        ([0, 0, math.inf], 1.0, "an origin is not finite"),
        ([1e300, 0, 0], 1.0, "an origin is not finite, or beyond"),
        ([0, 0, 0], 0.0, "range_max must be positive"),
        ([0, 0, 0], math.inf, "range_max of inf m is beyond"),
    ],
)
def test_bad_rays(pose: list[float], range_max: float, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        look(cells(ROOM, 0.1), np.array(pose, dtype=np.float64), range_max)


def test_bad_bodies_and_fans() -> None:
    rays = cells(ROOM, 0.1)
    with pytest.raises(ValueError, match="there is no body 1"):
        rays.set_poses(np.array([1]), np.zeros((1, 4)))
    with pytest.raises(ValueError, match="pose 0 is not finite"):
        rays.set_poses(np.array([0]), np.full((1, 4), math.nan))
    with pytest.raises(ValueError, match="fan 0 is not finite"):
        rays.scan(np.zeros((1, 4)), np.zeros(1, int), np.array([[math.nan, 0.1, 3, 1.0]]))
    with pytest.raises(ValueError, match="returns"):
        rays.add(np.array([-1]), np.zeros((1, 9)), np.zeros((1, 6)), np.zeros(1, int), np.zeros(2), 0)


def test_cells_too_fine_name_the_option(tmp_path: Path) -> None:
    with pytest.raises(Error, match=r"ray_casting: cells of 1e-05 m: .*; ray_casting: exact needs none"):
        simulator(
            tmp_path,
            "resolution 0.00001\nmodel ( size [600 600 1] )\n" + robot(LASER),
            ray_casting="cells",
            collision="exact",
        )
    far = LASER.replace("20]", "100000000]")
    with pytest.raises(Error, match=r"t.world:\d+:.*: ray_casting: cells: range_max .* is beyond"):
        simulator(tmp_path, robot(far), ray_casting="cells", collision="exact")
