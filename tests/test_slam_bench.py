# SPDX-License-Identifier: BSD-3-Clause
"""The benchmark of mapping and localisation: its drives, what it says to peers, and how it judges maps."""

import subprocess
from dataclasses import replace

import numpy as np
import pytest

from kurumaisu import slam
from kurumaisu.bench.slam import peers
from kurumaisu.bench.slam.office import Bound
from kurumaisu.bench.slam.ours import ours
from kurumaisu.bench.slam.random_drives import Ways, random_drive
from kurumaisu.bench.slam.sharpness import sharpness
from kurumaisu.errors import Error
from kurumaisu.geometry import between, compose, wrap
from kurumaisu.localization import load_localizer_settings, make_localizer
from kurumaisu.map_file import MapFile, read_map
from kurumaisu.maps import Grid
from kurumaisu.params import load_model, shipped

BUILDING = shipped("worlds/maps/building.yaml")


@pytest.fixture(scope="module")
def drive(tmp_path_factory):
    return random_drive(read_map(BUILDING), tmp_path_factory.mktemp("world"), 7, 40.0)


def test_a_roaming_chair_gets_about_and_its_walls_are_the_maps(drive):
    log, truth = drive
    grid, error = read_map(BUILDING), load_model(shipped("launch/md100.yaml")).laser.error
    assert len(truth) == len(log.times)
    assert np.hypot(*np.diff(truth[:, :2], axis=0).T).sum() > 5
    ranges = error.range(log.ranges.astype(np.float64))
    index = np.arange(ranges.shape[1])
    bearing = log.fan.angle_min + log.fan.angle_increment * index
    ends = []
    for scan in range(50, len(truth), 50):
        laser = compose(truth[scan], np.array(log.fan.base_from_laser))
        valid = np.isfinite(ranges[scan])
        angle = laser[2] + bearing[valid]
        ends.append(laser[:2] + ranges[scan][valid, None] * np.column_stack([np.cos(angle), np.sin(angle)]))
    cells = np.floor((np.concatenate(ends) - grid.origin[:2]) / grid.resolution).astype(int)
    padded = np.pad(grid.cells, 3) > 65
    near = np.any(
        [padded[cells[:, 1] + 3 + dy, cells[:, 0] + 3 + dx] for dy in (-1, 0, 1) for dx in (-1, 0, 1)], axis=0
    )
    assert near.mean() > 0.9


def test_equal_seeds_roam_alike(tmp_path):
    grid = read_map(BUILDING)
    one, other = (random_drive(grid, tmp_path, 3, 4.0) for _ in range(2))
    np.testing.assert_array_equal(one[0].ranges, other[0].ranges)
    np.testing.assert_array_equal(one[1], other[1])


def test_a_map_without_room_is_refused():
    with pytest.raises(Error, match="no room"):
        Ways(MapFile(np.full((40, 40), 100, dtype=np.int8), 0.05, (0.0, 0.0, 0.0)))


def test_between_a_peers_poses_odometry_goes_on_and_its_error_is_spread():
    odom = np.column_stack([np.linspace(0, 1, 11), np.zeros(11), np.zeros(11)])
    nodes = np.full((11, 3), np.nan)
    nodes[0], nodes[10] = (5, 5, np.pi), (3.9, 5, -np.pi)
    filled = peers._between_nodes(nodes, odom)
    np.testing.assert_allclose(filled[:, 0], np.linspace(5, 3.9, 11), atol=1e-9)
    np.testing.assert_allclose(wrap(filled[:, 2] - np.pi), 0, atol=1e-9)
    with pytest.raises(Error, match="no pose"):
        peers._between_nodes(np.full((3, 3), np.nan), odom[:3])


def test_a_driver_reads_the_log_that_is_written(drive, tmp_path):
    log = replace(drive[0], times=drive[0].times[:5], ranges=drive[0].ranges[:5], odom=drive[0].odom[:5])
    peers.write_log(log, tmp_path / "log")
    (tmp_path / "echo.cpp").write_text(
        '#include <cassert>\n#include "slam_log.h"\nint main(int n, char** words) {\n'
        '  Arguments from(n, words);\n  const Log log(from.text("log"));\n'
        '  const std::string to = from.text("poses");\n'
        "  from.end();\n  std::vector<double> out;\n  for (std::size_t i = 0; i < log.scans; ++i) {\n"
        "    const Pose p = compose(log.odom(i), inverse(log.base_from_laser));\n"
        "    out.insert(out.end(), {p.x, p.y, log.ranges(i)[log.beams - 1]});\n  }\n"
        "  writeDoubles(to, out);\n  printCosts(0.5, log);\n}\n"
    )
    program = tmp_path / "echo"
    drivers = peers.DRIVERS
    subprocess.run(["g++", "-std=c++17", f"-I{drivers}", str(tmp_path / "echo.cpp"), "-o", str(program)], check=True)
    peer = peers.Peer(program, tmp_path)
    run, poses = peer.run(log, {})
    assert run.cpu == 0.5
    assert 0 < run.memory < 50
    expected = compose(log.odom, np.broadcast_to(between(np.array(log.fan.base_from_laser), np.zeros(3)), (5, 3)))
    np.testing.assert_allclose(poses[:, :2], expected[:, :2], atol=1e-12)
    np.testing.assert_array_equal(poses[:, 2], log.ranges[:, -1].astype(np.float64))
    with pytest.raises(Error, match="nonsense"):
        peer.run(log, {"nonsense": 1})


def test_our_mapper_in_its_own_process_says_what_it_says_here(drive, tmp_path):
    log, _ = drive
    run, poses, grid = ours(log, 1, tmp_path)
    here = slam.map_scans(slam.load_mapping_settings(shipped("launch/mapping_node.yaml")), log, 1)
    np.testing.assert_array_equal(poses, here.trajectory[:, 1:])
    np.testing.assert_array_equal(grid.cells, here.grid.cells)
    assert run.cpu > 0
    assert 50 < run.memory < 300


def test_thick_and_double_walls_are_told_from_thin_ones():
    thin = np.zeros((40, 40), dtype=np.int8)
    thin[20, 5:35] = 100
    thick, double = thin.copy(), thin.copy()
    thick[21:23, 5:35] = 100
    double[24, 5:35] = 100
    told = [sharpness(Grid(cells, 0.05, 0.0, 0.0)) for cells in (thin, thick, double)]
    assert [each.thickness for each in told] == pytest.approx([0.05, 0.15, 0.05])
    assert [each.double for each in told] == [0, 0, 1]
    assert sharpness(Grid(np.full((9, 9), 50, dtype=np.int8), 0.05, 0.0, 0.0)).entropy == pytest.approx(1)


def test_bounds_say_which_is_broken():
    bound = Bound("x", 2.0, 1.0)
    assert [bound.judged(value).state for value in (1.0, 1.5, 2.5)] == ["reached", "kept", "BROKEN"]


def test_the_covariance_of_a_pose_has_the_maps_own(drive):
    """However many readings agree, nobody knows where in its cell a wall is."""
    log, truth = drive
    grid, error = read_map(BUILDING), load_model(shipped("launch/md100.yaml")).laser.error
    settings = load_localizer_settings(shipped("launch/localization_node.yaml"))
    localizer = make_localizer(settings, error, grid, 1)
    localizer.set_pose(truth[0].tolist(), np.diag([1e-6, 1e-6, 1e-6]))
    for i in range(30):
        said = localizer.add(log.times[i], log.ranges[i], log.fan, log.odom[i].tolist(), log.odom_end[i].tolist())
    assert np.linalg.eigvalsh(said["covariance"][:2, :2])[0] >= grid.resolution**2 / 12
