# SPDX-License-Identifier: BSD-3-Clause
"""The simulator in physical semantics: exact arcs, one time for all, boxes that give way."""

from pathlib import Path

import numpy as np
import pytest
from sim_worlds import LASER, ROOM, drive, robot, simulator

ODOM = 'localization "odom" odom_error [0 0 0 0]'


def test_free_robots_and_their_odometry_drive_exact_arcs(tmp_path: Path) -> None:
    sim = simulator(tmp_path, "interval_sim 50\n" + ROOM + robot(ODOM), semantics="physical")
    v, w = 0.5, 0.9
    last = drive(sim, (v, 0, w), 60)[-1]
    arc = [v / w * np.sin(3 * w), v / w * (1 - np.cos(3 * w)), 3 * w]
    np.testing.assert_allclose(last.poses[0, [0, 1, 3]], arc, atol=1e-9)
    np.testing.assert_allclose(last.odometry[0], arc, atol=1e-9)


def test_scans_and_gps_are_of_the_same_moment_as_the_truth(tmp_path: Path) -> None:
    sim = simulator(tmp_path, ROOM + robot(LASER, "-2 0 0 0"), semantics="physical")
    for k, seen in enumerate(drive(sim, (0.6, 0, 0), 5), start=1):
        assert seen.scans[0].ranges[90] == pytest.approx(7 - 0.06 * k, abs=1e-6)
        np.testing.assert_allclose(seen.odometry[0], seen.poses[0, [0, 1, 3]])


def test_a_pushed_box_moves_and_is_seen_where_it_is(tmp_path: Path) -> None:
    box = 'model ( name "box" pose [0.6 0 0 0] size [0.4 0.4 1] mass 1 )'
    high = LASER.replace("ranger (", "ranger ( pose [0 0 0.3 0]")
    sim = simulator(tmp_path, box + ROOM + robot("mass 20 " + high), semantics="physical")
    seen = drive(sim, (0.5, 0, 0), 40)[-1]
    assert seen.poses[0, 0] == pytest.approx(2.0, abs=0.05)
    assert sim.model_poses[0, 0] == pytest.approx(seen.poses[0, 0] + 0.4, abs=0.01)
    assert seen.scans[0].ranges[90] == pytest.approx(0.2, abs=0.01)
    assert seen.poses.shape == (1, 4)


def test_physical_states_continue_bit_for_bit(tmp_path: Path) -> None:
    text = "model ( pose [0.6 0 0 0] size [0.4 0.4 1] mass 1 )" + ROOM + robot("mass 20 " + LASER) * 1
    sim = simulator(tmp_path, text, semantics="physical")
    drive(sim, (0.5, 0, 0.1), 15)
    saved = sim.save()
    drive(sim, (0.5, 0, 0.2), 25)
    after = sim.state_hash()
    for other in (sim, simulator(tmp_path, text, semantics="physical", threads=1)):
        other.load(saved)
        drive(other, (0.5, 0, 0.2), 25)
        assert other.state_hash() == after
    assert sim.reset(0).time == 0
    np.testing.assert_allclose(sim.model_poses[0], [0.6, 0, 0, 0], atol=1e-12)
