# SPDX-License-Identifier: BSD-3-Clause
"""Physical motion whatever the poses and speeds: no tunnelling, no overlap, no energy out of nothing; repeatable."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from physics_scene import DT, DYNAMICS, SKIN, box, motion, room, run, thing, walls

from kurumaisu.sim.motion.physical import PhysicalMotion
from kurumaisu.sim.motion.rigid import Rigid
from kurumaisu.types import FloatArray


def corners(body: Rigid, pose: FloatArray) -> FloatArray:
    c, s = math.cos(pose[3]), math.sin(pose[3])
    points = np.concatenate([part.corners for part in body.parts])
    return np.asarray(points @ np.array([[c, s], [-s, c]]) + pose[:2])


@given(
    heading=st.floats(-math.pi, math.pi),
    y=st.floats(-3, 3),
    rates=st.tuples(st.floats(-30, 30), st.floats(-30, 30), st.floats(-20, 20)),
    size=st.tuples(st.floats(0.05, 1.0), st.floats(0.05, 1.0)),
)
def test_no_speed_takes_a_robot_through_a_wall_without_thickness(
    heading: float, y: float, rates: tuple[float, float, float], size: tuple[float, float]
) -> None:
    body = box(*size)
    ground = walls((1.0, -100, 1.0, 100), (-1.0, -100, -1.0, 100))
    moved = motion([body], ground, [(0, y, heading)], DYNAMICS)
    for pose in run(moved, [rates], 8)[:, 0]:
        assert np.abs(corners(body, pose)[:, 0]).max() < 1.0 + SKIN


@settings(max_examples=25)
@given(seed=st.integers(0, 10**6), fastest=st.floats(0.0, 10.0))
def test_a_crowd_in_a_room_stays_in_it_and_apart(seed: int, fastest: float) -> None:
    rng = np.random.default_rng(seed)
    bodies = [box(0.3, 0.2, tree=i, mass=5.0 + 10 * i) for i in range(3)] + [thing(3, 8.0), thing(4, 30.0)]
    places = [(-0.6, -0.6), (0.6, -0.6), (-0.6, 0.6), (0.6, 0.6), (0.0, 0.0)]
    starts = [(x, y, h) for (x, y), h in zip(places, [*rng.uniform(-3, 3, 3), 0.0, 0.5], strict=True)]
    moved = motion(bodies, room(1.0), starts, DYNAMICS)
    commands = [(rng.uniform(-1, 1) * fastest, 0.0, rng.uniform(-5, 5)) for _ in bodies]
    for poses in run(moved, commands, 10):
        for body, pose in zip(bodies, poses, strict=True):
            assert np.abs(corners(body, pose)).max() < 1.0 + 4 * SKIN
        assert worst_overlap(bodies, poses) < 4 * SKIN


def worst_overlap(bodies: list[Rigid], poses: FloatArray) -> float:
    """Return the deepest overlap [m] of two of the (convex) bodies, by separating axes."""
    rings = [corners(body, pose) for body, pose in zip(bodies, poses, strict=True)]
    deepest = 0.0
    for i, a in enumerate(rings):
        for b in rings[i + 1 :]:
            edges = np.concatenate([np.roll(r, -1, axis=0) - r for r in (a, b)])
            normals = np.stack([edges[:, 1], -edges[:, 0]], axis=1) / np.hypot(*edges.T)[:, None]
            along_a, along_b = a @ normals.T, b @ normals.T
            depth = np.minimum(along_a.max(0) - along_b.min(0), along_b.max(0) - along_a.min(0)).min()
            deepest = max(deepest, float(depth))
    return deepest


@settings(max_examples=20)
@given(seed=st.integers(0, 10**6), friction=st.floats(0.0, 0.5))
def test_without_motors_energy_never_grows(seed: int, friction: float) -> None:
    rng = np.random.default_rng(seed)
    bodies = [thing(i, rng.uniform(1, 50), friction, 0.25) for i in range(6)]
    places = rng.permutation([(x, y) for x in (-0.6, 0.0, 0.6) for y in (-0.6, 0.0, 0.6)])[:6]
    moved = motion(bodies, room(0.9), [(x, y, rng.uniform(-3, 3)) for x, y in places], DYNAMICS)
    state = moved.state()
    state["velocities"][:] = rng.uniform(-3, 3, (6, 3))
    moved.restore(state)
    inertia = np.array([[body.mass, body.mass, body.moment] for body in bodies])
    energy = np.inf
    for _ in range(20):
        moved.move(np.zeros((6, 3)), DT)
        now = 0.5 * (inertia * moved.state()["velocities"] ** 2).sum()
        assert now <= energy * (1 + 1e-6) + 1e-12
        energy = now


def test_two_runs_are_bit_identical_and_states_carry_on() -> None:
    bodies = [box(0.3, 0.3, tree=i) for i in range(8)] + [thing(8), thing(9)]
    starts = [(0.5 * (i % 4) - 0.75, 0.6 * (i // 4) - 0.6, 0.7 * i) for i in range(10)]
    commands = [(0.6, 0.0, 0.3 * (-1) ** i) for i in range(10)]

    def moved() -> PhysicalMotion:
        return motion(bodies, room(1.2), starts, DYNAMICS)

    whole = run(moved(), commands, 40)
    np.testing.assert_array_equal(whole, run(moved(), commands, 40))
    half = moved()
    run(half, commands, 20)
    other = moved()
    other.restore(half.state())
    np.testing.assert_array_equal(run(other, commands, 20), whole[20:])


@pytest.mark.parametrize("dt", [0.01, 0.1, 0.5])
def test_a_blocked_robot_comes_off_the_wall(dt: float) -> None:
    moved = motion([box()], walls((0.5, -5, 0.5, 5)), [(0, 0, 0)], DYNAMICS)
    for _ in range(round(2 / dt)):
        pose, stalled = moved.move(np.array([[0.5, 0, 0]]), dt)
    assert stalled.all()
    assert pose[0, 0] == pytest.approx(0.3, abs=3 * SKIN)
    for _ in range(round(2 / dt)):
        back, stalled = moved.move(np.array([[-0.5, 0, 0]]), dt)
    assert not stalled.any()
    assert back[0, 0] == pytest.approx(-0.7, abs=0.03)


def test_a_start_in_a_wall_is_left_not_thrown_out() -> None:
    """What overlaps at the start is pushed apart gently enough to stay in the room."""
    moved = motion([box()], room(1.0), [(0.9, 0, 0.2)], DYNAMICS)
    poses = run(moved, [(-0.3, 0, 0)], 30)[:, 0]
    assert np.hypot(*np.diff(poses[:, :2], axis=0).T).max() < 0.3
    assert (np.abs(poses[:, :2]) < 1.3).all()
