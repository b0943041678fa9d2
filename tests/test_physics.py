# SPDX-License-Identifier: BSD-3-Clause
"""Physical motion against closed forms: arcs, pushes, friction, momentum."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from physics_scene import DT, DYNAMICS, SKIN, SMOOTH, box, motion, room, run, thing, walls

from kurumaisu._core import integrate
from kurumaisu.errors import Error
from kurumaisu.sim.motion.rigid import GRAVITY, Ground, convex

EMPTY = walls()
rates = st.floats(-3, 3)


@settings(deadline=None)
@given(v=rates, leftward=rates, w=rates, heading=st.floats(-7, 7))
def test_free_bodies_drive_exact_arcs(v: float, leftward: float, w: float, heading: float) -> None:
    last = run(motion([box()], EMPTY, [(1.0, -2.0, heading)], DYNAMICS), [(v, leftward, w)], 20)[-1, 0]
    t = 20 * DT
    start = complex(1.0, -2.0)
    turned = np.expm1(1j * w * t) / (1j * w) if abs(w) > 1e-3 else t * (1 + 0.5j * w * t - (w * t) ** 2 / 6)
    end = start + complex(v, leftward) * np.exp(1j * heading) * turned
    np.testing.assert_allclose(last[:2], [end.real, end.imag], atol=1e-8 if 0 < abs(w) <= 1e-3 else 1e-12)
    assert last[3] == pytest.approx(heading + w * t, abs=1e-12)


def test_a_free_robot_goes_where_the_chair_would() -> None:
    moved = run(motion([box()], EMPTY, [(0.0, 0.0, 0.3)], DYNAMICS), [(0.7, 0.0, -0.4)], 50)[:, 0]
    chair = integrate(np.full(50, 0.7), np.full(50, -0.4), np.full(50, DT), [0, 0, 0.3])[1:]
    np.testing.assert_allclose(moved[:, [0, 1, 3]], chair, rtol=0, atol=1e-12)


def test_a_robot_beside_a_crash_still_drives_its_arc() -> None:
    """It is in the island of those that touch, and nothing touches it."""
    bodies = [box(tree=0), box(tree=1), box(tree=2)]
    moved = motion(bodies, walls((0.3, -5, 0.3, 5)), [(0, 0, 0), (0, 0.8, 2.0), (0, -5, 0)], DYNAMICS)
    poses = run(moved, [(1.0, 0, 0), (0.2, 0, 0.9), (0, 0, 0)], 5)
    arc = integrate(np.array([0.2]), np.array([0.9]), np.array([5 * DT]), [0, 0.8, 2.0])[1]
    np.testing.assert_allclose(poses[-1, 1, [0, 1, 3]], arc, atol=1e-12)


def test_a_push_at_constant_speed_moves_the_box_at_that_speed() -> None:
    poses = run(motion([box(), thing(1)], EMPTY, [(0, 0, 0), (0.7, 0, 0)], DYNAMICS), [(0.5, 0, 0), (0, 0, 0)], 30)
    speeds = np.diff(poses[10:, :, 0], axis=0) / DT
    np.testing.assert_allclose(speeds, 0.5, atol=1e-5)
    gap = poses[-1, 1, 0] - poses[-1, 0, 0] - 0.4
    assert 0 <= gap <= 2 * SKIN + 1e-6


@pytest.mark.parametrize(("friction", "moves"), [(0.79, True), (0.81, False)])
def test_motors_push_what_is_not_held_by_more_than_their_grip(friction: float, moves: bool) -> None:
    moved = motion([box(), thing(1, friction=friction)], EMPTY, [(0, 0, 0), (0.5, 0, 0)], DYNAMICS)
    poses = run(moved, [(0.3, 0, 0)] * 2, 100)
    late = poses[-1, 1, 0] - poses[-30, 1, 0]
    assert late > 0.2 if moves else abs(late) < 1e-5


@pytest.mark.parametrize("speed", [0.5, 2.0])
@pytest.mark.parametrize("friction", [0.1, 0.5])
def test_a_released_box_slides_as_far_as_friction_lets_it(speed: float, friction: float) -> None:
    moved = motion([box(), thing(1, friction=friction)], EMPTY, [(0, 0, 0), (0.45, 0, 0)], DYNAMICS)
    run(moved, [(speed, 0, 0), (0, 0, 0)], 10)
    released = moved.state()["centres"][1, 0]
    poses = run(moved, [(-speed, 0, 0), (0, 0, 0)], 60)
    assert poses[-1, 1, 0] - released == pytest.approx(speed**2 / (2 * friction * GRAVITY), rel=0.02, abs=1e-3)
    assert not moved.state()["velocities"][1].any()  # at rest, and for good


@settings(deadline=None, max_examples=30)
@given(
    masses=st.tuples(st.floats(1, 100), st.floats(1, 100)),
    offset=st.floats(-0.35, 0.35),
    turn=st.floats(-math.pi, math.pi),
    speed=st.floats(0.1, 5),
)
def test_a_crash_keeps_momentum_and_gains_no_energy(
    masses: tuple[float, float], offset: float, turn: float, speed: float
) -> None:
    bodies = [thing(i, mass, 0.0) for i, mass in enumerate(masses)]
    moved = motion(bodies, EMPTY, [(0, 0, 0), (0.8, offset, turn)], DYNAMICS)
    state = moved.state()
    state["velocities"][0, 0] = speed
    moved.restore(state)
    inertia = np.array([[body.mass, body.mass, body.moment] for body in bodies])

    def sums() -> tuple[float, ...]:
        state = moved.state()
        centre, p = state["centres"], inertia * state["velocities"]
        spin = (centre[:, 0] * p[:, 1] - centre[:, 1] * p[:, 0] + p[:, 2]).sum()
        return p[:, 0].sum(), p[:, 1].sum(), spin, (p**2 / inertia).sum() / 2

    before = sums()
    for _ in range(round(2.0 / speed / DT) + 2):
        energy = sums()[3]
        moved.move(np.zeros((2, 3)), DT)
        assert sums()[3] <= energy * (1 + 1e-9)
    scale = masses[0] * speed
    assert sums()[:2] == pytest.approx(before[:2], abs=1e-9 * scale)
    # Two overlapping skins let the contact force act up to 1 mm off: so exactly goes the angular momentum.
    assert sums()[2] == pytest.approx(before[2], abs=2e-3 * scale)


def test_boxes_that_nothing_moves_stay() -> None:
    moved = motion([thing(0), thing(1)], room(0.5), [(0, 0, 0.3), (0, 0.45, 0)], DYNAMICS)
    start = moved.poses
    poses = run(moved, [(0.4, 0, 0)] * 2, 20)  # commands do not drive boxes
    np.testing.assert_array_equal(poses[-1], start)


@pytest.mark.parametrize("degrees", [15, 30, 45, 60])
def test_sliding_along_a_smooth_wall_keeps_the_tangential_speed(degrees: float) -> None:
    """An omnidirectional robot: a round one would turn nothing, a box stands flat on the wall."""
    angle = math.radians(degrees)
    moved = motion([box()], walls((-50, 0.2 + SKIN, 50, 0.2 + SKIN)), [(0, 0, 0)], SMOOTH)
    poses = run(moved, [(math.cos(angle), math.sin(angle), 0)], 30)
    np.testing.assert_allclose(np.diff(poses[5:, 0, 0]) / DT, math.cos(angle), atol=1e-4)
    assert np.abs(poses[:, 0, 1]).max() < SKIN


def test_friction_with_the_wall_slows_a_slider() -> None:
    moved = motion([box()], walls((-50, 0.2 + SKIN, 50, 0.2 + SKIN)), [(0, 0, 0)], DYNAMICS)
    poses = run(moved, [(0.5, 0.5, 0)], 30)
    assert 0.3 < (poses[-1, 0, 0] - poses[-2, 0, 0]) / DT < 0.4999


def test_robots_push_robots_and_equals_stand_still() -> None:
    facing = motion([box(tree=0), box(tree=1)], EMPTY, [(0, 0, 0), (1, 0, math.pi)], DYNAMICS)
    poses = run(facing, [(0.5, 0, 0)] * 2, 30)
    assert abs(poses[-1, :, 0].mean() - 0.5) < 1e-3
    parked = motion([box(tree=0), box(tree=1, mass=10)], EMPTY, [(0, 0, 0), (1, 0, 0)], DYNAMICS)
    poses = run(parked, [(0.5, 0, 0), (0, 0, 0)], 30)
    assert poses[-1, 1, 0] > 1.5


def test_heights_and_trees_decide_who_meets() -> None:
    bridge = walls((1, -5, 1, 5), heights=(1.5, 2.0))
    under = motion([box()], bridge, [(0, 0, 0)], DYNAMICS)
    assert run(under, [(1.0, 0, 0)], 20)[-1, 0, 0] == pytest.approx(2.0)
    low, high = box(tree=0, heights=(0, 0.5)), box(tree=1, heights=(0.5, 1.0))
    over = motion([low, high], walls((3, -1, 3, 1)), [(0, 0, 0), (1, 0, 0)], DYNAMICS)
    poses = run(over, [(1.0, 0, 0), (0, 0, 0)], 50)[-1]
    assert poses[0, 0] == pytest.approx(2.8, abs=2e-3)
    assert poses[1, 0] == 1.0
    same = motion([box(tree=3), box(tree=3)], EMPTY, [(0, 0, 0), (1, 0, 0)], DYNAMICS)
    assert run(same, [(1.0, 0, 0), (0, 0, 0)], 20)[-1, 0, 0] == pytest.approx(2.0)


def test_what_has_no_outline_meets_nothing() -> None:
    ghost = box()
    ghost = type(ghost)(**{**ghost.__dict__, "parts": (), "edges": np.empty((0, 6))})
    moved = motion([ghost], walls((1, -5, 1, 5)), [(0, 0, 0)], DYNAMICS)
    assert run(moved, [(1.0, 0, 0)], 20)[-1, 0, 0] == pytest.approx(2.0)


@pytest.mark.parametrize("bad", [math.nan, math.inf])
def test_what_is_not_finite_is_refused(bad: float) -> None:
    moved = motion([box()], room(1), [(0, 0, 0)], DYNAMICS)
    with pytest.raises(Error, match="velocity: body 0: not finite"):
        moved.move(np.array([[bad, 0, 0]]), DT)
    with pytest.raises(Error, match="pose: body 0: not finite"):
        moved.place(np.array([[0, bad, 0, 0]]))
    with pytest.raises(Error, match=r"velocity: must have shape \(1, 3\), not \(3,\)"):
        moved.move(np.zeros(3), DT)
    with pytest.raises(ValueError, match="must be finite"):
        motion([box()], Ground(np.array([[0, 0, bad, 0, 0, 1]]), np.zeros(1, np.int64)), [(0, 0, 0)], DYNAMICS)


def test_polygons_become_convex() -> None:
    ell = np.array([(0, 0), (2, 0), (2, 1), (1, 1), (1, 2), (0, 2)], dtype=float)
    for ring in (ell, ell[::-1]):
        parts = convex(ring)
        assert len(parts) > 1
        assert sum(0.5 * abs(np.cross(p, np.roll(p, -1, axis=0)).sum()) for p in parts) == pytest.approx(3.0)
    assert convex(np.array([(0, 0), (1, 1), (2, 2)], dtype=float)) == []
