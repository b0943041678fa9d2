# SPDX-License-Identifier: BSD-3-Clause
"""Doors, grippers and slipping wheels, from the world file to the motion, against closed forms."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from physics_scene import DT, DYNAMICS, box, motion, run, walls

from kurumaisu.sim.motion.bodies import assemble, ground, movable
from kurumaisu.sim.motion.partition import build_arena, sort
from kurumaisu.sim.motion.physical import PhysicalMotion
from kurumaisu.sim.motion.rigid import GRAVITY
from kurumaisu.sim.motion.slip import hold
from kurumaisu.sim.settings import Dynamics
from kurumaisu.types import FloatArray
from kurumaisu.world import load_world

SLIPPERY = replace(DYNAMICS, slip=True)
# Hinged at its west end, it opens by 90 degrees towards +y, not towards -y.
DOOR = 'model ( name "door" pose [0 0 0 0] size [0.8 0.04 2] hinge [-0.4 0 0 90] mass 10 )\n'
HAND = "gripper ( pose [0.3 0 -0.4 0] size [0.2 0.3 0.2] )"


def loaded(folder: Path, text: str, dynamics: Dynamics = DYNAMICS) -> PhysicalMotion:
    path = folder / "t.world"
    path.write_text(text)
    world = load_world(path)
    moving = movable(world.models)
    bodies = sort(world.models, [model.index in moving for model in world.models])
    _, _, walls = build_arena(world.models, world.poses, bodies, threads=1)
    moved = PhysicalMotion(assemble(world.models, world.poses, dynamics), ground(walls), dynamics)
    moved.place(world.poses[moving])
    return moved


def robot(pose: str, inside: str = "") -> str:
    return f"position ( pose [{pose}] size [0.4 0.4 0.4] mass 20 {inside} )\n"


def test_a_door_opens_when_pushed_and_stops_at_its_limit(tmp_path: Path) -> None:
    moved = loaded(tmp_path, DOOR + robot("0.2 -0.6 0 90"))
    poses = run(moved, [(0, 0, 0), (0.3, 0, 0)], 70)
    door = poses[:, 0]
    assert (np.diff(door[:, 3]) >= -1e-3).all()
    assert door[40, 3] > 0.5
    assert door[:, 3].max() < math.pi / 2 + 1e-3
    # Its hinge has not moved: the west end is where it was.
    ends = door[:, :2] - 0.4 * np.stack([np.cos(door[:, 3]), np.sin(door[:, 3])], axis=1)
    np.testing.assert_allclose(ends, np.broadcast_to([-0.4, 0.0], ends.shape), atol=1e-9)


def test_a_door_does_not_open_the_other_way(tmp_path: Path) -> None:
    moved = loaded(tmp_path, DOOR + robot("0.2 0.6 0 -90"))
    poses = run(moved, [(0, 0, 0), (0.3, 0, 0)], 50)
    assert np.abs(poses[:, 0, 3]).max() < 5e-3
    assert poses[-1, 1, 1] == pytest.approx(0.02 + 0.2, abs=5e-3)


def test_a_swinging_door_comes_to_rest_by_its_friction(tmp_path: Path) -> None:
    moved = loaded(tmp_path, DOOR)
    state = moved.state()
    # omega = 0.5 rad/s about the hinge, 0.4 m from the centre
    state["velocities"][0] = [0.0, 0.2, 0.5]
    moved.restore(state)
    poses = run(moved, [(0, 0, 0)], 40)[:, 0]
    moment = 10 * (0.8**2 + 0.04**2) / 12 + 10 * 0.4**2
    assert poses[-1, 3] == pytest.approx(0.5**2 * moment / (2 * DYNAMICS.hinge_torque), rel=0.03)
    np.testing.assert_array_equal(poses[-1], poses[-2])


@pytest.mark.parametrize("turn", [0.0, 0.8])
def test_a_gripper_carries_what_is_between_its_paddles(tmp_path: Path, turn: float) -> None:
    parcel = "model ( pose [0.34 0 0 20] size [0.06 0.1 0.1] mass 1 gripper_return 1 )\n"
    moved = loaded(tmp_path, robot("0 0 0 0", HAND) + parcel)
    before = moved.poses
    assert moved.grip(0, True)
    poses = run(moved, [(0.3, 0, turn), (0, 0, 0)], 30)
    c, s = np.cos(poses[:, 0, 3]), np.sin(poses[:, 0, 3])
    seen = poses[:, 1] - poses[:, 0]
    ahead = np.stack([c * seen[:, 0] + s * seen[:, 1], c * seen[:, 1] - s * seen[:, 0]], axis=1)
    np.testing.assert_allclose(ahead, np.broadcast_to(before[1, :2], ahead.shape), atol=1e-12)
    moved.grip(0, False)
    left = moved.poses[1]
    back = run(moved, [(-0.3, 0, 0), (0, 0, 0)], 5)
    np.testing.assert_allclose(back[-1, 1], left, atol=1e-6)
    assert back[-1, 0, 0] != poses[-1, 0, 0]


def test_what_is_carried_meets_walls(tmp_path: Path) -> None:
    parcel = "model ( pose [0.37 0 0 0] size [0.16 0.1 0.1] mass 1 gripper_return 1 )\n"
    wall = "model ( pose [1.05 0 0 0] size [0.1 4 1] )\n"
    moved = loaded(tmp_path, robot("0 0 0 0", HAND) + parcel + wall)
    assert moved.grip(0, True)
    poses = run(moved, [(0.3, 0, 0), (0, 0, 0)], 40)
    assert poses[-1, 1, 0] + 0.08 == pytest.approx(1.0, abs=2e-3)
    assert poses[-1, 0, 0] == pytest.approx(poses[-1, 1, 0] - 0.37, abs=1e-9)


def test_a_gripper_leaves_what_it_cannot_take(tmp_path: Path) -> None:
    heavy = "model ( pose [0.34 0 0 0] size [0.06 0.1 0.1] mass 1 )\n"  # no gripper_return
    far = "model ( pose [0.9 0 0 0] size [0.06 0.1 0.1] mass 1 gripper_return 1 )\n"
    above = "model ( pose [0.34 0 0.5 0] size [0.06 0.1 0.1] mass 1 gripper_return 1 )\n"
    moved = loaded(tmp_path, robot("0 0 0 0", HAND) + heavy + far + above)
    assert not moved.grip(0, True)
    assert not moved.grip(1, True)  # has no gripper


def test_states_remember_what_is_held(tmp_path: Path) -> None:
    text = robot("0 0 0 0", HAND) + "model ( pose [0.34 0 0 0] size [0.06 0.1 0.1] mass 1 gripper_return 1 )\n"
    moved, other = loaded(tmp_path, text), loaded(tmp_path, text)
    moved.grip(0, True)
    run(moved, [(0.3, 0, 0.2), (0, 0, 0)], 5)
    other.restore(moved.state())
    np.testing.assert_array_equal(run(moved, [(0.3, 0, 0.2), (0, 0, 0)], 5), run(other, [(0.3, 0, 0.2), (0, 0, 0)], 5))


@pytest.mark.parametrize("speed", [1.0, 3.0])
def test_wheels_slip_where_too_much_is_asked(speed: float) -> None:
    """They give mu g: the way to a speed v is v^2 / (2 mu g) shorter, and that to a stop as long."""
    most = DYNAMICS.wheel_friction * GRAVITY
    moved = motion([box()], walls(), [(0, 0, 0)], SLIPPERY)
    driven = run(moved, [(speed, 0, 0)], 20)[-1, 0, 0]
    assert driven == pytest.approx(20 * DT * speed - speed**2 / (2 * most))
    stopped = run(moved, [(0, 0, 0)], 20)[:, 0, 0]
    assert stopped[-1] - driven == pytest.approx(speed**2 / (2 * most))
    assert stopped[-1] == stopped[-2]


def test_without_slip_wheels_hold() -> None:
    assert run(motion([box()], walls(), [(0, 0, 0)], DYNAMICS), [(3.0, 0, 0)], 10)[-1, 0, 0] == pytest.approx(3.0)


def test_slipping_robots_stop_at_walls() -> None:
    moved = motion([box()], walls((1, -5, 1, 5)), [(0, 0, 0)], SLIPPERY)
    poses = run(moved, [(2.0, 0, 0)], 20)[:, 0]
    assert poses[:, 0].max() < 0.8
    assert poses[-1, 0] == pytest.approx(0.8, abs=2e-3)


rate = st.floats(-5, 5)


@given(before=st.tuples(rate, rate, rate), wanted=st.tuples(rate, rate, rate), dt=st.floats(0.01, 1.0))
def test_slip_in_two_halves_is_slip_in_one(before: tuple[float, ...], wanted: tuple[float, ...], dt: float) -> None:
    most = np.array([[7.8, 20.0]])

    def one(rates: FloatArray, seconds: float) -> tuple[FloatArray, FloatArray]:
        return hold(rates, np.array([wanted]), most, seconds)

    mean, after = one(np.array([before]), dt)
    first, middle = one(np.array([before]), dt / 2)
    second, end = one(middle, dt / 2)
    np.testing.assert_allclose(after, end, atol=1e-9)
    np.testing.assert_allclose(mean, (first + second) / 2, atol=1e-9)
