# SPDX-License-Identifier: BSD-3-Clause
"""What the simulator's rangers see, and when, against closed forms."""

import math
from pathlib import Path

import numpy as np
import pytest
from sim_worlds import LASER, ROOM, drive, robot, simulator

from kurumaisu.errors import Error


def test_a_scan_is_of_the_pose_before_the_move_as_in_stage(tmp_path: Path) -> None:
    sim = simulator(tmp_path, ROOM + robot(LASER, "-2 0 0 0"))
    for k, seen in enumerate(drive(sim, (0.6, 0, 0), 5)):
        assert seen.scans[0].ranges[90] == pytest.approx(7 - 0.06 * k, abs=1e-9)
        assert seen.odometry[0, 0] == pytest.approx(-2 + 0.06 * k)
        assert seen.poses[0, 0] == pytest.approx(-2 + 0.06 * (k + 1))
        assert seen.scans[0].time == seen.time


def test_consistent_timing_has_all_of_it_from_after_the_move(tmp_path: Path) -> None:
    sim = simulator(tmp_path, ROOM + robot(LASER, "-2 0 0 0"), timing="consistent")
    for k, seen in enumerate(drive(sim, (0.6, 0, 0), 5), start=1):
        assert seen.scans[0].ranges[90] == pytest.approx(7 - 0.06 * k, abs=1e-9)
        np.testing.assert_allclose(seen.odometry[0], seen.poses[0, [0, 1, 3]])


def test_beams_and_returns_are_where_stage_has_them(tmp_path: Path) -> None:
    sim = simulator(tmp_path, ROOM + robot(LASER, "1 0 0 0"))
    fan = sim.rangers[0]
    np.testing.assert_allclose(fan.bearings, np.linspace(-math.pi / 2, math.pi / 2, 181))
    scan = sim.observe().scans[0]
    hits = np.abs(np.tan(fan.bearings)) * 4 < 5
    np.testing.assert_allclose(scan.ranges[hits], 4 / np.cos(fan.bearings[hits]), atol=1e-9)
    assert np.isinf(scan.ranges[~hits]).all()
    assert (scan.returns[hits] == 7).all()
    assert (scan.returns[~hits] == 0).all()


def test_a_single_beam_looks_ahead(tmp_path: Path) -> None:
    sim = simulator(tmp_path, ROOM + robot("ranger ( sensor ( range [0 20] fov 90 samples 1 ) )"))
    np.testing.assert_allclose(sim.observe().scans[0].ranges, [5.0])


@pytest.mark.parametrize(("low", "seen"), [(0.74, True), (0.76, True), (0.77, False)])
def test_a_beam_is_as_high_as_what_it_stands_on(tmp_path: Path, low: float, seen: bool) -> None:
    """0.4 m of robot, 0.3 of a mast, 0.05 of the ranger's pose, 0.004 and half of 0.012 of the sensor: 0.76 m."""
    ranger = "ranger ( pose [0 0 0.05 0] sensor ( range [0 20] samples 1 pose [0 0 0.004 0] size [0 0 0.012] ) )"
    mast = f"model ( size [0.05 0.05 0.3] {ranger} )"
    wall = f"model ( pose [3.05 0 {low} 0] size [0.1 4 1] )"
    sim = simulator(tmp_path, wall + robot(mast))
    assert sim.rangers[0].mount[2] == pytest.approx(0.76)
    assert bool(np.isfinite(sim.observe().scans[0].ranges[0])) == seen


def test_the_rangers_origin_and_the_sensors_pose_move_the_beam(tmp_path: Path) -> None:
    ranger = "ranger ( pose [0.1 0 0 90] origin [0.2 0 0 -90] sensor ( range [0 20] samples 1 pose [0.3 0.5 0 0] ) )"
    sim = simulator(tmp_path, ROOM + robot(ranger, "1 0 0 0"))
    np.testing.assert_allclose(sim.rangers[0].mount[[0, 1, 3]], [0.1 + 0.3, 0.2 + 0.5, 0], atol=1e-12)
    assert sim.observe().scans[0].ranges[0] == pytest.approx(4 - 0.4)


def test_own_tree_is_invisible_and_others_are_not(tmp_path: Path) -> None:
    mast = "model ( pose [0.15 0 0 0] size [0.05 0.05 1] )"
    sim = simulator(
        tmp_path, ROOM + robot(mast + LASER.replace("ranger (", "ranger ( pose [0 0 0.2 0]")) + robot(mast, "2 0 0 180")
    )
    assert sim.observe().scans[0].ranges[90] == pytest.approx(2 - 0.175)


def test_a_scan_is_repeated_until_the_rangers_next_update(tmp_path: Path) -> None:
    other = LASER.replace("ranger (", "ranger ( update_interval 90")
    sim = simulator(tmp_path, "interval_sim 40\n" + ROOM + robot(LASER + other))
    seen = [(o.scans[0].count, o.scans[1].count, o.scans[0].time) for o in drive(sim, (0.1, 0, 0), 7)]
    assert [s[:2] for s in seen] == [(0, 0), (0, 0), (1, 1), (1, 1), (1, 1), (2, 2), (2, 2)]
    assert [s[2] for s in seen] == pytest.approx([0, 0, 0.12, 0.12, 0.12, 0.24, 0.24])


def test_rangers_of_different_intervals_keep_their_order(tmp_path: Path) -> None:
    slow = LASER.replace("ranger (", "ranger ( update_interval 300").replace("samples 181", "samples 3")
    sim = simulator(tmp_path, ROOM + robot(slow + LASER + slow, "-2 0 0 0"))
    last = drive(sim, (0.5, 0, 0), 5)[-1]
    assert [len(scan.ranges) for scan in last.scans] == [3, 181, 3]
    assert [scan.count for scan in last.scans] == [1, 5, 1]
    assert [len(scan.ranges) for scan in last.scans[-2:]] == [181, 3]
    assert len(last.scans.ranges) == 187
    np.testing.assert_array_equal(last.scans.ranges[3:184], last.scans[1].ranges)
    assert last.scans[0].ranges[1] == pytest.approx(7 - 0.1)
    assert last.scans[1].ranges[90] == pytest.approx(7 - 0.2)


@pytest.mark.parametrize("timing", ["stage", "consistent"])
@pytest.mark.parametrize("omega", [1.2, -1.2])
def test_beams_that_fire_one_after_another_see_a_moving_world(tmp_path: Path, timing: str, omega: float) -> None:
    """The robot turns on the spot; the wall's distance is that of each beam's direction when it fires."""
    sim = simulator(tmp_path, ROOM + robot(LASER), timing=timing, scan_sweep=0.08)
    seen = drive(sim, (0, 0, omega), 4)[-1]
    end = omega * (0.4 if timing == "consistent" else 0.3)
    directions = sim.rangers[0].bearings + end - omega * 0.08 * (1 - np.arange(181) / 180)
    ahead = np.cos(directions) > 0.75
    np.testing.assert_allclose(seen.scans[0].ranges[ahead], (5 / np.cos(directions))[ahead], atol=1e-9)
    assert ahead.sum() > 60


def test_a_sweep_longer_than_a_step_is_refused(tmp_path: Path) -> None:
    with pytest.raises(Error, match=r"scan_sweep: 0\.11 s is more than a step of .*t\.world: 0\.1 s"):
        simulator(tmp_path, ROOM, scan_sweep=0.11)


def test_ranger_noise_follows_the_seed_and_has_its_variance(tmp_path: Path) -> None:
    noisy = LASER.replace("fov 180", "fov 2 noise [0.0004 0 0]")
    sim = simulator(tmp_path, ROOM + robot(noisy), threads=1)
    runs = []
    for seed in (4, 4, 5):
        sim.reset(seed)
        runs.append(np.array([o.scans[0].ranges for o in drive(sim, (0, 0, 0), 50)]))
    np.testing.assert_array_equal(runs[0], runs[1])
    errors = runs[0] - 5 / np.cos(sim.rangers[0].bearings)
    n = errors.size
    assert (errors**2).sum() / 0.0004 == pytest.approx(n, abs=5 * math.sqrt(2 * n))
    assert (runs[2] != runs[0]).all()


def test_angle_noise_moves_beams(tmp_path: Path) -> None:
    noisy = LASER.replace("fov 180", "fov 90 noise [0 0 30]")
    wall = "model ( pose [3.05 0 0 0] size [0.1 90 2] )"
    sim = simulator(tmp_path, wall + robot(noisy))
    ranges = drive(sim, (0, 0, 0), 1)[-1].scans[0].ranges
    off = np.arccos(3 / ranges) - np.abs(sim.rangers[0].bearings)
    swing = 0.5 * math.radians(30) * math.radians(0.5)
    assert np.abs(off).max() <= swing + 1e-9
    assert np.abs(off).max() > 0.9 * swing


def test_a_ranger_on_the_ground_sees_robots_pass(tmp_path: Path) -> None:
    sim = simulator(tmp_path, f"model ( pose [0 -3 0 90] size [0.1 0.1 0.1] {LASER} )" + robot("", "-1 0 0 0"))
    assert sim.rangers[0].robot == -1
    middle = [o.scans[0].ranges[90] for o in drive(sim, (0.5, 0, 0), 40)]
    hidden = np.abs(-1 + 0.05 * np.arange(40)) < 0.2 - 1e-9
    np.testing.assert_allclose(np.array(middle)[hidden], 2.8, atol=1e-9)
    assert np.isinf(np.array(middle)[np.abs(-1 + 0.05 * np.arange(40)) > 0.21]).all()
