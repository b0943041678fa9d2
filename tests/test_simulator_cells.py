# SPDX-License-Identifier: BSD-3-Clause
"""Stage's collisions in a whole simulator: where Stage's own robots came to, and cells that come, go and are saved."""

from pathlib import Path

import numpy as np
import pytest
from sim_worlds import ROOM, drive, robot, simulator

from kurumaisu.errors import Error
from kurumaisu.sim import Simulator
from kurumaisu.types import FloatArray

CARTS = """
resolution 0.02
interval_sim 100
model ( size [5 4 1] pose [0.3 -0.2 0 17]
  block ( points 4 point[0] [0 0] point[1] [5 0] point[2] [5 4] point[3] [0 4] z [0 1] ) )
define cart position ( size [0.44 0.38 0.22] origin [-0.04 0 0 0] model ( pose [0.1 0 0 30] size [0.3 0.1 0.2] ) )
cart ( pose [0 0 0 0] )
cart ( pose [1 0 0 90] )
cart ( pose [-1 0 0 180] )
cart ( pose [0 1 0 45] )
cart ( pose [0 -1 0 -60] )
cart ( pose [1.2 0.9 0 200] )
"""
SPEEDS = np.array([(0.5, 0.0, 0.4), (0.37, 0, -0.3), (0.6, 0, 0.25), (0.45, 0, -0.5), (0.3, 0, 0.6), (0.55, 0, 0.1)])
# Of Stage 4.3.0 after 60 s, by src/kurumaisu/bench/drivers/stage_drive.cpp: x, y [m], heading [rad].
STAGE = [
    [1.36839452, 1.22433623, 1.64],
    [2.13864151, 1.32226557, 0.02879633],
    [-2.05854098, -0.09925789, -2.69159265],
    [0.90946055, 1.40314598, -0.36460184],
    [0.30471874, -1.21660845, -0.24075347],
    [-1.63549509, -1.3269028, -2.1265268],
]


def commands(steps: int) -> FloatArray:
    """There and back, so that robots run into walls and each other 62 times."""
    back = np.arange(steps) // 45 % 3 == 2
    return np.where(back[:, None, None], -0.6, 1.0) * SPEEDS


def run(sim: Simulator, steps: FloatArray) -> FloatArray:
    return np.array([sim.step(command).poses for command in steps])


def test_robots_come_to_where_those_of_stage_did(tmp_path: Path) -> None:
    poses = run(simulator(tmp_path, CARTS, collision="cells_stale"), commands(600))
    np.testing.assert_allclose(poses[-1][:, [0, 1, 3]], STAGE, atol=1e-8)


def test_without_stage_s_second_layer_only_who_meets_robots_goes_elsewhere(tmp_path: Path) -> None:
    poses = run(simulator(tmp_path, CARTS, collision="cells"), commands(600))
    off = np.abs(poses[-1][:, [0, 1, 3]] - STAGE).max(axis=1)
    assert off[4] < 1e-8  # met walls only
    assert 0.02 < off.max() < 0.1  # a step or two


@pytest.mark.parametrize("collision", ["cells", "cells_stale", "exact"])
def test_continues_bit_for_bit_from_a_saved_state(tmp_path: Path, collision: str) -> None:
    sim, steps = simulator(tmp_path, CARTS, collision=collision), commands(300)
    run(sim, steps[:151])
    saved, key = sim.save(), sim.state_hash()
    there = run(sim, steps[151:])
    again = simulator(tmp_path, CARTS, collision=collision)
    again.load(saved)
    assert again.state_hash() == key
    assert (run(again, steps[151:]) == there).all()


def test_a_robot_put_elsewhere_leaves_no_cells_behind(tmp_path: Path) -> None:
    for collision in ("cells", "cells_stale"):
        sim = simulator(tmp_path, robot(pose="0 0 0 0") + robot(pose="1 0 0 0"), collision=collision)
        assert drive(sim, [(0.6, 0, 0), (0, 0, 0)], 10)[-1].stalled.tolist() == [True, False]
        sim.set_pose(1, [9, 0, 0, 0])
        assert not drive(sim, [(0.6, 0, 0), (0, 0, 0)], 10)[-1].stalled.any()
        sim.delete(1)
        assert drive(sim, [(0.6, 0, 0)], 150)[-1].poses[0, 0] > 9.5


def test_what_stands_on_a_robot_is_moved_with_its_cells(tmp_path: Path) -> None:
    arm = 'model ( name "arm" pose [0 0 -0.4 0] size [0.1 0.1 0.4] )'
    sim = simulator(tmp_path, ROOM + robot(arm), collision="cells")
    sim.set_pose("arm", [1.0, 0, 0, 0])
    assert 3.9 < drive(sim, [(0.5, 0, 0)], 200)[-1].poses[0, 0] < 3.96  # its tip at 5 m


def test_a_resolution_that_would_need_too_many_cells_is_refused(tmp_path: Path) -> None:
    text = "resolution 0.00002\n" + ROOM.replace("10 2", "2000 2") + robot()
    with pytest.raises(Error, match=r"collision: cells of 2e-05 m: .*10.8 cells.*exact"):
        simulator(tmp_path, text)
    assert not drive(simulator(tmp_path, text, collision="exact"), [(0.1, 0, 0)], 1)[-1].stalled.any()
