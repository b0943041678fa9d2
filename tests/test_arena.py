# SPDX-License-Identifier: BSD-3-Clause
"""What sensors see of walls and of bodies: rooms of known size, and anything against an oracle."""

import math

import numpy as np
import pytest
from arenas import FREE, ROOM, add, arena, box, brute_force, faces, one, random_arena
from hypothesis import given, settings
from hypothesis import strategies as st

from kurumaisu._core import Arena


@settings(max_examples=300)
@given(
    seed=st.integers(0, 10**6),
    bodies=st.integers(0, 12),
    fan=st.tuples(
        st.floats(-7, 7),
        st.sampled_from([0.0, 1e-3, 0.01, -0.01, 0.1, -0.4, 2 * math.pi / 40, 1.0, 3.0]),
        st.integers(0, 80),
        st.sampled_from([0.5, 3.0, 8.0, math.inf]),
    ),
    heading=st.floats(-10, 10),
)
def test_fans_agree_with_brute_force(
    seed: int, bodies: int, fan: tuple[float, float, int, float], heading: float
) -> None:
    rng = np.random.default_rng(seed)
    place, everything = random_arena(rng, bodies)
    origin = np.append(rng.uniform([-6, -6, 0], [6, 6, 1.5]), heading)
    if rng.random() < 0.5:
        origin[2] = rng.choice([0.2, 0.5])  # just where faces begin
    tree = int(rng.integers(-1, 12))
    ranges, returns = place.scan(origin[None], np.array([tree]), np.array([fan]))
    angles = heading + fan[0] + fan[1] * np.arange(fan[2])
    expected, expected_returns, unsure = brute_force(everything, origin, tree, angles, fan[3])
    assert ranges.shape == returns.shape == (fan[2],)
    np.testing.assert_allclose(ranges[~unsure], expected[~unsure], rtol=1e-9, atol=1e-9)
    np.testing.assert_array_equal(returns[~unsure], expected_returns[~unsure])
    rays = np.stack([np.full(fan[2], value) for value in origin[:3]] + [angles], axis=1)
    singly = place.cast(rays, np.full(fan[2], tree), fan[3])
    np.testing.assert_allclose(singly[0][~unsure], expected[~unsure], rtol=1e-9, atol=1e-9)
    np.testing.assert_array_equal(singly[1][~unsure], expected_returns[~unsure])


def test_a_body_before_the_wall() -> None:
    place = arena(faces(ROOM), np.full(4, 0.25))
    body = add(place, box(1.0, 1.0), tree=1, returns=3.0)
    place.set_poses(np.array([body]), np.array([[3.0, 2.0, 0.0, 0.0]]))
    assert one(place, (1.0, 2.0, 0.5, 0.0)) == (1.5, 3.0)
    assert one(place, (1.0, 2.0, 0.5, math.pi)) == (1.0, 0.25)
    assert one(place, (1.0, 2.0, 0.5, 0.0), tree=1) == (5.0, 0.25)
    assert one(place, (1.0, 2.0, 0.5, 0.0), tree=0) == (1.5, 3.0)
    assert one(place, (1.0, 2.0, 0.5, math.pi), tree=0) == (math.inf, 0.0)
    assert one(place, (1.0, 2.0, 0.5, 0.0), range_max=1.4) == (math.inf, 0.0)
    place.remove_body(body)
    assert one(place, (1.0, 2.0, 0.5, 0.0)) == (5.0, 0.25)


def test_heights_belong_to_faces_and_rays_see_no_others() -> None:
    low, high = faces([(2, -1, 2, 1)], (0.0, 0.3)), faces([(3, -1, 3, 1)], (0.3, 1.0))
    place = arena(np.concatenate([low, high, faces([(5, -1, 5, 1)], (0.0, 2.0))]), np.array([1.0, 2.0, 3.0]))
    body = add(place, faces([(0, -1, 0, 1)], (0.1, 0.2)), tree=1, returns=9.0)
    place.set_poses(np.array([body]), np.array([[1.0, 0.0, 0.5, 0.0]]))
    seen = [one(place, (0.0, 0.0, z, 0.0)) for z in (-0.1, 0.0, 0.2, 0.3, 0.4, 0.6, 0.65, 0.7, 1.0, 1.5, 2.0, 2.1)]
    nothing, top = (math.inf, 0.0), (5.0, 3.0)
    assert seen[:5] == [nothing, (2.0, 1.0), (2.0, 1.0), (2.0, 1.0), (3.0, 2.0)]
    assert seen[5:] == [(1.0, 9.0), (1.0, 9.0), (1.0, 9.0), (3.0, 2.0), top, top, nothing]


def test_a_return_of_0_is_seen_and_one_below_is_not() -> None:
    walls = faces([(2, -1, 2, 1), (3, -1, 3, 1), (4, -1, 4, 1)])
    place = arena(walls, np.array([-1.0, 0.0, 7.0]))
    assert one(place, (0.0, 0.0, 0.5, 0.0)) == (3.0, 0.0)
    body = add(place, faces([(0, -1, 0, 1)]), tree=1, returns=-1.0)
    place.set_poses(np.array([body]), np.array([[1.0, 0.0, 0.0, 0.0]]))
    assert one(place, (0.0, 0.0, 0.5, 0.0)) == (3.0, 0.0)


def test_a_sensor_inside_a_body_of_another_tree_sees_its_inside() -> None:
    place = arena(faces(ROOM))
    body = add(place, box(2.0, 2.0), tree=1)
    place.set_poses(np.array([body]), np.array([[3.0, 2.5, 0.0, math.pi / 2]]))
    fan = np.array([[-math.pi, math.pi / 2, 5, 8.0]])  # the whole turn: first and last beam are one
    origin = np.array([[3.25, 2.5, 0.5, 0.0]])
    np.testing.assert_allclose(place.scan(origin, np.array([2]), fan)[0], [1.25, 1.0, 0.75, 1.0, 1.25], rtol=1e-12)
    np.testing.assert_allclose(place.scan(origin, np.array([1]), fan)[0], [3.25, 2.5, 2.75, 2.5, 3.25], rtol=1e-12)


def test_a_sensor_on_an_outline_sees_it_at_0() -> None:
    place = arena(faces([]))
    body = add(place, box(2.0, 2.0), tree=1)
    place.set_poses(np.array([body]), np.array([[1.0, 0.0, 0.0, 0.0]]))
    many = np.array([[-3.0, 0.03, 200, 8.0]])
    np.testing.assert_allclose(place.scan(np.array([[0.0, 0.3, 0.5, 0.0]]), np.array([FREE]), many)[0], 0, atol=1e-9)


@pytest.mark.parametrize("corners", [4, 5, 200])
@pytest.mark.parametrize("increment", [0.003, -0.003])
def test_no_beam_slips_between_the_faces_of_a_body(corners: int, increment: float) -> None:
    angles = np.linspace(0, 2 * math.pi, corners, endpoint=False)
    points = np.stack([2 * np.cos(angles), 1.5 * np.sin(angles)], axis=1)
    ring = np.concatenate([points, np.roll(points, -1, axis=0)], axis=1)
    place = arena(faces([]))
    body = add(place, faces([tuple(line) for line in ring]), tree=1)
    rng = np.random.default_rng(5)
    for x, y, heading in rng.uniform(-4, 4, (30, 3)):
        place.set_poses(np.array([body]), np.array([[x, y, 0.0, heading]]))
        inside = np.array([[x, y, 0.5, heading]])
        whole = place.scan(inside, np.array([FREE]), np.array([[heading, increment, 2100, 9.0]]))[0]
        assert np.isfinite(whole).all()
        bearings = angles if increment > 0 else -angles  # at the very corners, where neighbours meet
        rays = np.tile(inside, (corners, 1))
        rays[:, 3] += bearings
        assert np.isfinite(place.cast(rays, np.full(corners, FREE), 9.0)[0]).all()


def test_turning_everything_changes_no_range() -> None:
    rng = np.random.default_rng(6)
    place, _ = random_arena(rng, 10)
    origin = np.array([[0.5, -0.5, 0.3, 0.0]])
    first, own = place.scan(origin, np.array([FREE]), np.array([[0.0, 0.01, 629, 9.0]]))[0], np.array([FREE])
    for turns in (-3, 1, 1000):
        origin[0, 3] = turns * 2 * math.pi
        again = place.scan(origin, own, np.array([[-turns * 2 * math.pi, 0.01, 629, 9.0]]))[0]
        np.testing.assert_allclose(again, first, rtol=1e-8)


@pytest.mark.parametrize("threads", [2, 3, 8])
def test_threads_change_no_bit(threads: int) -> None:
    results = []
    for count in (1, threads):
        rng = np.random.default_rng(7)
        place, _ = random_arena(rng, 40, count)
        origins = rng.uniform([-8, -8, 0, -3], [8, 8, 1.5, 3], (300, 4))
        fans = np.stack([rng.uniform(-3, 0, 300), np.full(300, 0.02), rng.integers(0, 200, 300), np.full(300, 7.0)], 1)
        trees = rng.integers(-1, 12, 300)
        for _ in range(20):  # threads that are woken again and again
            seen = place.scan(origins, trees, fans)
        results.append([*seen, *place.cast(origins, trees, 7.0)])
    for one_thread, several in zip(*results, strict=True):
        np.testing.assert_array_equal(one_thread, several)


def test_many_sensors_answer_as_one_by_one() -> None:
    rng = np.random.default_rng(8)
    place, _ = random_arena(rng, 20, 2)
    origins, trees = rng.uniform([-8, -8, 0, -3], [8, 8, 1, 3], (50, 4)), rng.integers(-1, 12, 50)
    fans = np.stack([rng.uniform(-3, 0, 50), rng.normal(0, 0.1, 50), rng.integers(0, 60, 50), np.full(50, 7.0)], 1)
    together = place.scan(origins, trees, fans)
    singly = [place.scan(origins[i : i + 1], trees[i : i + 1], fans[i : i + 1]) for i in range(50)]
    np.testing.assert_array_equal(together, np.concatenate(singly, axis=1))


def test_far_away_bodies_are_found_and_those_far_from_them_are_not() -> None:
    place = arena(faces([]))
    body, wide = add(place, box(1.0, 1.0), tree=1), add(place, box(200.0, 0.2), tree=2)
    for x in (-1e6, -128.0, 0.0, 127.9, 128.0, 1e6):
        place.set_poses(np.array([body, wide]), np.array([[x, 5.0, 0, 0], [x + 90, 2.0, 0.0, 0]]))
        assert one(place, (x, 0.0, 0.5, math.pi / 2))[0] == pytest.approx(1.9)
        assert one(place, (x, 0.0, 0.5, math.pi / 2), tree=2)[0] == pytest.approx(4.5)
        assert one(place, (x + 128, 0.0, 0.5, math.pi / 2), tree=2)[0] == math.inf


# Bad input


NAN = math.nan
WALL = faces([(0, 0, 1, 0)])


@pytest.mark.parametrize(
    ("walls", "returns", "threads", "message"),
    [
        (np.zeros((3, 4)), 3, 1, r"walls must have shape \(n, 6\)"),
        (np.zeros(6), 1, 1, r"walls must have shape \(n, 6\)"),
        (WALL, 2, 1, r"returns must have shape \(1,\)"),
        (np.full((2, 6), NAN), 2, 1, "wall 0: its ends are not finite"),
        (faces([(0, 0, 1e9, 0)]), 1, 1, "wall 0: its ends"),
        (faces([(0, 0, 1, 0)], (1.0, 0.5)), 1, 1, "wall 0: z_low 1.0.* must not be above z_high 0.5"),
        (faces([(0, 0, 1, 0)], (0.0, NAN)), 1, 1, "wall 0: z_low"),
        (WALL, 1, 0, "threads .* not 0"),
        (WALL, 1, 10**6, "threads .* not 1000000"),
    ],
)
def test_bad_walls(walls: np.ndarray, returns: int, threads: int, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        Arena(walls, np.ones(returns), np.ones(returns, bool), np.zeros(returns, int), threads)


@pytest.mark.parametrize(
    ("origin", "tree", "fan", "message"),
    [
        ([0, 0, NAN, 0], 0, [0, 0.1, 5, 1], "origin 0 is not finite"),
        ([0, 0, 0, 1e300], 0, [0, 0.1, 5, 1], "origin 0 is not finite, or beyond"),
        ([0, 0, 0], 0, [0, 0.1, 5, 1], r"origins must have shape \(n, 4\)"),
        ([0, 0, 0, 0], 0, [0, 0.1, 5], r"fans must have shape \(1, 4\)"),
        ([0, 0, 0, 0], 0, [0, 0.1, -1, 1], "fan 0: samples .* not -1"),
        ([0, 0, 0, 0], 0, [0, 0.1, 2.5, 1], "fan 0: samples .* not 2.5"),
        ([0, 0, 0, 0], 0, [0, 0.1, NAN, 1], "fan 0: samples"),
        ([0, 0, 0, 0], 0, [0, 0.1, 2e6, 1], "fan 0: 2000000 samples"),
        ([0, 0, 0, 0], 0, [0, 0.1, 1, 0], "fan 0: range_max must be positive, not 0"),
        ([0, 0, 0, 0], 0, [0, 0.1, 1, NAN], "fan 0: range_max must be positive, not nan"),
        ([0, 0, 0, 0], 0, [0, math.inf, 1, 1], "fan 0: its increment"),
        ([0, 0, 0, 0], 0, [NAN, 0.1, 1, 1], "fan 0: its first bearing"),
        ([0, 0, 0, 0], 0.5, [0, 0.1, 1, 1], "trees must be integers"),
        ([0, 0, 0, 0], 2**40, [0, 0.1, 1, 1], "trees: 1099511627776"),
    ],
)
def test_bad_sensors(origin: list[float], tree: float, fan: list[float], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        arena(WALL).scan(np.array([origin]), np.array([tree]), np.array([fan]))


@pytest.mark.parametrize("range_max", [0.0, -1.0, NAN])
def test_bad_rays(range_max: float) -> None:
    with pytest.raises(ValueError, match="range_max must be positive"):
        arena(WALL).cast(np.zeros((1, 4)), np.array([0]), range_max)
    with pytest.raises(ValueError, match="origin 1"):
        arena(WALL).cast(np.array([[0, 0, 0, 0], [0, 0, 0, NAN]]), np.array([0, 0]), 1.0)


def test_nothing_to_see_and_nobody_to_look() -> None:
    place = arena(faces([]))
    none = np.empty((0, 4))
    assert place.scan(none, np.empty(0, int), none)[0].shape == (0,)
    assert place.cast(none, np.empty(0, int), 1.0)[1].shape == (0,)
    assert one(place, (0.0, 0.0, 0.0, 0.0), range_max=math.inf) == (math.inf, 0.0)
    add(place, faces([]), tree=0)
    assert one(place, (0.0, 0.0, 0.0, 0.0)) == (math.inf, 0.0)
