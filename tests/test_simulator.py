# SPDX-License-Identifier: BSD-3-Clause
"""The simulator's motion and odometry in Stage's semantics, against closed forms."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from sim_worlds import ROOM, drive, euler, robot, simulator

from kurumaisu.errors import Error
from kurumaisu.geometry import wrap
from kurumaisu.sim import Simulator
from kurumaisu.sim.options import OdometryWalk

ODOM = 'localization "odom" odom_error [0 0 0 0]'


@pytest.mark.parametrize(("drive_mode", "command", "velocity"), [
    ("diff", (0.7, 0.5, 0.9), (0.7, 0.0, 0.9)),
    ("diff", (-0.3, 0.0, 0.0), (-0.3, 0.0, 0.0)),
    ("omni", (0.5, -0.4, -1.1), (0.5, -0.4, -1.1)),
    ("car", (0.8, 0.3, 0.5), (0.8 * math.cos(0.5), 0.0, 0.8 * math.sin(0.5) / 0.4)),
])  # fmt: skip
def test_motion_is_euler_along_the_old_heading(tmp_path: Path, drive_mode: str, command: Any, velocity: Any) -> None:
    sim = simulator(tmp_path, robot(f'drive "{drive_mode}" wheelbase 0.4', "1 2 0 30"))
    last = drive(sim, command, 73)[-1]
    start = np.array([1, 2, math.radians(30)])
    np.testing.assert_allclose(last.velocities[0], velocity, atol=1e-12)
    np.testing.assert_allclose(last.poses[0, :2], euler(start, np.array(velocity), 0.1, 73), atol=1e-9)
    assert last.poses[0, 3] == pytest.approx(float(wrap(start[2] + 7.3 * velocity[2])), abs=1e-9)
    assert last.time == pytest.approx(7.3)


def test_odometry_turns_before_it_drives(tmp_path: Path) -> None:
    sim = simulator(tmp_path, robot(ODOM + ' drive "omni"', "1 2 0 30"))
    velocity = np.array([0.5, -0.2, 0.8])
    last = drive(sim, velocity, 40)[-1]
    np.testing.assert_allclose(last.odometry[0, :2], euler(np.zeros(3), velocity, 0.1, 40, True), atol=1e-9)
    assert last.odometry[0, 2] == pytest.approx(float(wrap(3.2)), abs=1e-9)
    assert np.hypot(*(last.poses[0, :2] - [1, 2])) == pytest.approx(np.hypot(*last.odometry[0, :2]), abs=1e-9)


def test_given_odometry_errors_are_fixed_shares_and_the_fourth_is_read_as_degrees(tmp_path: Path) -> None:
    sim = simulator(tmp_path, robot('localization "odom" drive "omni" odom_error [0.1 -0.2 0 0.1]'))
    straight = drive(sim, (0.5, 0.4, 0.0), 50)[-1].odometry[0]
    np.testing.assert_allclose(straight, [2.5 * 1.1, 2.0 * 0.8, 0], atol=1e-9)
    sim.reset(5)
    turned = drive(sim, (0.0, 0.0, 0.5), 50)[-1].odometry[0, 2]
    assert turned == pytest.approx(2.5 * (1 + math.radians(0.1)), abs=1e-9)


def test_odometry_errors_are_drawn_within_half_of_the_default_once_per_seed(tmp_path: Path) -> None:
    sim = simulator(tmp_path, (robot('localization "odom" drive "omni"') * 500), threads=1)
    shares = []
    for seed in (1, 1, 2):
        sim.reset(seed)
        one, two = drive(sim, (0.5, 0.4, 0.0), 2)  # all on one spot: they stall, and odometry does not know
        assert two.stalled.all()
        np.testing.assert_allclose(two.odometry[:, :2], 2 * one.odometry[:, :2], rtol=1e-12)
        shares.append(one.odometry[:, :2] / [0.05, 0.04] - 1)
    np.testing.assert_array_equal(shares[0], shares[1])
    assert (shares[0] != shares[2]).all()
    assert np.abs(shares[0]).max() <= 0.015
    assert (np.abs(shares[0]).max(axis=0) > 0.0145).all()
    assert np.abs(shares[0].mean(axis=0)).max() < 5 * 0.03 / math.sqrt(12 * 500)


def test_odometry_under_integrates_as_in_stage(tmp_path: Path) -> None:
    sim = simulator(tmp_path, "interval_sim 20\n" + robot(ODOM))
    last = drive(sim, (0.5, 0.0, 0.0), 500)[-1]
    assert last.odometry[0, 0] == pytest.approx(0.5 * 10 / 5)  # one interval of 20 ms in every 100 ms
    assert last.poses[0, 0] == pytest.approx(0.5 * (10 - 4 * 0.02))  # the first update comes after 100 ms


def test_an_odometry_walk_has_its_variance(tmp_path: Path) -> None:
    walk = OdometryWalk(distance=0.02, heading_per_metre=0.0, heading_per_radian=0.03)
    sim = simulator(tmp_path, robot(ODOM + ' drive "omni" obstacle_return 0') * 800, odometry_walk=walk)
    sim.reset(3)
    last = drive(sim, (0.5, 0.0, 0.0), 40)[-1].odometry
    for error in (last[:, 0] - 2.0, last[:, 1]):
        assert (error**2).sum() / (0.02**2 * 2.0) == pytest.approx(800, abs=5 * math.sqrt(1600))
    assert (last[:, 2] == 0).all()
    sim.reset(3)
    heading = drive(sim, (0.0, 0.0, 0.5), 40)[-1].odometry[:, 2] - 2.0
    assert (heading**2).sum() / (0.03**2 * 2.0) == pytest.approx(800, abs=5 * math.sqrt(1600))


@pytest.mark.parametrize(("given_origin", "before"), [
    ("", (0, 0, 0)),
    ("localization_origin [1 2 0 0]", (0, 0, math.pi / 2)),
    ("localization_origin [0 0 0 90]", (2, -1, 0)),
])  # fmt: skip
def test_gps_heeds_localization_origin_before_the_first_update_only(
    tmp_path: Path, given_origin: str, before: Any
) -> None:
    sim = simulator(tmp_path, "interval_sim 50\n" + robot(given_origin, "1 2 0 90"))
    first, second, third = drive(sim, (0.5, 0, 0), 3)
    np.testing.assert_allclose(first.odometry[0], before, atol=1e-12)
    np.testing.assert_allclose(second.odometry[0], [1, 2, math.pi / 2], atol=1e-12)
    np.testing.assert_array_equal(third.odometry, second.odometry)  # of the last update, while it moves


def test_velocity_is_clamped_to_a_metre_and_a_quarter_turn_unless_the_file_says_otherwise(tmp_path: Path) -> None:
    wide = 'drive "omni" velocity_bounds [-2 3 -0.1 0.2 -1 1 -200 100] pose [0 3 0 0]'
    sim = simulator(tmp_path, robot('drive "omni"') + f"position ( {wide} )")
    fast = drive(sim, (1e6, 1e6, 1e6), 1)[-1].velocities
    np.testing.assert_allclose(fast, [[1, 1, math.pi / 2], [3, 0.2, math.radians(100)]])
    back = drive(sim, (-1e300, -9, -9), 1)[-1].velocities
    np.testing.assert_allclose(back, [[-1, -1, -math.pi / 2], [-2, -0.1, math.radians(-200)]])


def test_a_car_is_clamped_after_its_law(tmp_path: Path) -> None:
    sim = simulator(tmp_path, robot('drive "car" wheelbase 0.1'))
    np.testing.assert_allclose(drive(sim, (3.0, 0, 0.3), 1)[-1].velocities[0], [1.0, 0, math.pi / 2])


@pytest.mark.parametrize(("interval", "update", "period"), [(100, 100, 1), (100, 250, 3), (20, 100, 5), (100, 0, 1)])
def test_commands_are_heard_at_updates_whose_interval_is_rounded_up(
    tmp_path: Path, interval: int, update: int, period: int
) -> None:
    sim = simulator(tmp_path, f"interval_sim {interval}\n" + robot(f"update_interval {update}"))
    heard = []
    for k in range(1, 13):
        heard.append(sim.step(np.array([[k / 100, 0, 0]])).velocities[0, 0])
    assert heard == [k // period * period / 100 for k in range(1, 13)]


def test_the_velocity_of_the_file_lasts_until_the_first_update(tmp_path: Path) -> None:
    sim = simulator(tmp_path, "interval_sim 50\n" + robot("velocity [0.4 0 0 0]"))
    assert [o.velocities[0, 0] for o in drive(sim, (0.1, 0, 0), 2)] == [0.4, 0.1]
    assert sim.observe().poses[0, 0] == pytest.approx(0.4 * 0.05 + 0.1 * 0.05)


def test_acceleration_is_limited_only_when_asked(tmp_path: Path) -> None:
    text = robot("acceleration_bounds [-2 0.5 -1 1 -1 1 -90 45]")
    assert drive(simulator(tmp_path, text), (1, 0, 1), 1)[-1].velocities[0].tolist() == [1, 0, 1]
    sim = simulator(tmp_path, text, limit_acceleration=True)
    speeds = np.array([o.velocities[0] for o in drive(sim, (1, 0, 1), 30) + drive(sim, (-1, 0, -1), 20)])
    np.testing.assert_allclose(speeds[:30, 0], np.minimum(0.05 * np.arange(1, 31), 1))
    np.testing.assert_allclose(speeds[:30, 2], np.minimum(math.radians(4.5) * np.arange(1, 31), 1))
    np.testing.assert_allclose(speeds[30:, 0], np.maximum(1 - 0.2 * np.arange(1, 21), -1), atol=1e-12)


def test_a_stalled_step_is_lost_as_a_whole_and_the_velocity_kept(tmp_path: Path) -> None:
    sim = simulator(tmp_path, ROOM + robot(ODOM + ' drive "omni"'))
    observations = drive(sim, (0.7, 0.3, 0.0), 80)
    free = next(i for i, o in enumerate(observations) if o.stalled[0])
    assert free == math.floor((5.0 - 0.2) / 0.07)  # the front, 0.2 m ahead, would cross x = 5 m in the next step
    stuck = observations[-1]
    np.testing.assert_allclose(stuck.poses[0, :2], [0.07 * free, 0.03 * free], atol=1e-9)  # it does not slide, either
    np.testing.assert_allclose(stuck.velocities[0], [0.7, 0.3, 0.0])
    np.testing.assert_allclose(stuck.odometry[0, :2], [0.07 * 80, 0.03 * 80], atol=1e-9)
    turned = drive(sim, (0.7, 0.0, 1.0), 1)[-1]
    np.testing.assert_array_equal(turned.poses, stuck.poses)  # the turn is lost, too
    assert drive(sim, (0, 0, 0), 3)[-1].stalled[0]  # who does not move keeps his last stall
    assert not drive(sim, (-0.1, 0, 0), 1)[-1].stalled[0]


def test_robots_stall_at_each_other_in_file_order(tmp_path: Path) -> None:
    sim = simulator(tmp_path, robot() + robot("", "0.55 0 0 180"))
    last = drive(sim, (1.0, 0, 0), 1)[-1]
    assert last.stalled.tolist() == [False, True]
    assert drive(sim, (1.0, 0, 0), 1)[-1].stalled.tolist() == [True, True]


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
def test_commands_that_are_no_numbers_are_held_at_zero_and_counted(tmp_path: Path, bad: float) -> None:
    sim = simulator(tmp_path, robot() + robot("", "0 3 0 0"))
    seen = sim.step(np.array([[0.5, 0, bad], [0.5, 0, 0]]))
    np.testing.assert_array_equal(seen.velocities, [[0, 0, 0], [0.5, 0, 0]])
    assert seen.dropped == 1
    assert sim.step(np.full((2, 3), bad)).dropped == 3
    assert sim.reset(1).dropped == 0


def test_commands_of_another_shape_are_refused(tmp_path: Path) -> None:
    sim = simulator(tmp_path, robot() * 2)
    for shape in ((3,), (1, 3), (2, 2), (3, 3)):
        with pytest.raises(Error, match=r"commands: must have shape \(2, 3\), not"):
            sim.step(np.zeros(shape))


def test_a_robot_that_begins_in_a_wall_is_named(tmp_path: Path) -> None:
    sim = simulator(tmp_path, ROOM + robot("", "4.9 0 0 0") + robot('name "b"', "0 0 0 0"))
    assert [w for w in sim.warnings if "touches" in w] == [
        f"{tmp_path / 't.world'}:4:1: position touches something at its start; it stalls until it is free"
    ]
    assert drive(sim, (0.01, 0, 0), 1)[-1].stalled.tolist() == [True, False]


def test_who_stands_on_a_robot_goes_with_it_and_drives_on_its_own(tmp_path: Path) -> None:
    rider = 'position ( pose [0.1 0 0 90] size [0.1 0.1 0.2] drive "omni" )'
    sim = simulator(tmp_path, ROOM + robot(rider))
    last = sim.step(np.array([[1.0, 0, 1.0], [0.5, 0, 0.2]]))
    carried = [0.1 + 0.1 * math.cos(0.1), 0.1 * math.sin(0.1)]
    heading = math.pi / 2 + 0.1
    along = [0.05 * math.cos(heading), 0.05 * math.sin(heading)]
    np.testing.assert_allclose(last.poses[1, :2], np.add(carried, along), atol=1e-12)
    assert last.poses[1, 3] == pytest.approx(heading + 0.02)
    assert last.poses[1, 2] == pytest.approx(0.4)
    sim.set_pose(sim.robots[0], [4.75, 0, 0, 0])
    stuck = sim.step(np.array([[1.0, 0, 0], [0, 0, 0]]))
    assert stuck.stalled.tolist() == [True, False]
    mount = (last.poses[1] - last.poses[0])[:2] @ [[math.cos(0.1), -math.sin(0.1)], [math.sin(0.1), math.cos(0.1)]]
    np.testing.assert_allclose(stuck.poses[1, :2], np.add([4.75, 0], mount), atol=1e-12)


@pytest.fixture(scope="module")
def crowd(tmp_path_factory: pytest.TempPathFactory) -> Simulator:
    modes = ("diff", "omni", "car")
    robots = "".join(robot(f'drive "{m}" {ODOM}', f"{i} 0 0 {50 * i}") for i, m in enumerate(modes))
    return simulator(tmp_path_factory.mktemp("crowd"), ROOM + robots)


@settings(max_examples=60)
@given(st.lists(st.lists(st.floats(allow_subnormal=True), min_size=9, max_size=9), min_size=1, max_size=5))
def test_no_command_leads_out_of_bounds(crowd: Simulator, commands: list[list[float]]) -> None:
    before = crowd.reset(1)
    for row in commands:
        after = crowd.step(np.array(row).reshape(3, 3))
        assert np.isfinite(after.poses).all()
        assert np.isfinite(after.odometry).all()
        assert (np.abs(after.velocities) <= [1, 1, math.pi / 2]).all()
        way = np.hypot(*(after.poses - before.poses)[:, :2].T)
        assert (way <= 0.1 * math.sqrt(2) + 1e-12).all()
        still = after.stalled & (way == 0)
        assert (still == after.stalled).all()
        before = after
