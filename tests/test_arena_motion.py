# SPDX-License-Identifier: BSD-3-Clause
"""Where bodies may go: Stage's rules on paper, and anything against shapely."""

import math

import numpy as np
import pytest
from arenas import ROOM, Everything, add, arena, box, faces, in_map, random_arena
from shapely.geometry import LineString

from kurumaisu import _core
from kurumaisu._core import Arena
from kurumaisu.types import FloatArray

NAN = math.nan


def put(place: Arena, body: int, *pose: float) -> None:
    place.set_poses(np.array([body]), np.array([pose]))


def go(place: Arena, body: int, *pose: float) -> bool:
    """Return whether the body went."""
    return not place.move(np.array([body]), np.array([pose]))[0]


def touches(place: Arena, body: int) -> bool:
    return bool(place.touches(np.array([body]))[0])


def test_a_step_is_taken_as_a_whole_or_not_at_all() -> None:
    place = arena(faces(ROOM))
    body = add(place, box(1.0, 0.5), tree=1)
    put(place, body, 3.0, 2.0, 0.0, 0.0)
    assert go(place, body, 5.4, 2.0, 0.0, 0.0)
    assert not go(place, body, 5.6, 2.1, 0.0, 0.3)
    scan = place.scan(np.array([[5.4, 1.0, 0.5, math.pi / 2]]), np.array([2]), np.array([[0.0, 0.0, 1, 9.0]]))
    assert scan[0][0] == 0.75  # neither moved nor turned
    assert not touches(place, body)
    assert go(place, body, 5.45, 2.0, 0.0, 0.0)
    assert not go(place, body, 5.45, 2.0, 0.0, 0.46)  # a corner would turn into the wall
    assert go(place, body, 5.4, 2.0, 0.0, math.pi / 2)


def test_only_the_end_of_the_way_counts() -> None:
    place = arena(faces(ROOM))
    body = add(place, box(1.0, 1.0), tree=1)
    put(place, body, 3.0, 2.0, 0.0, 0.0)
    assert go(place, body, 8.0, 2.0, 0.0, 0.0)


def test_outlines_are_hollow() -> None:
    place = arena(faces(ROOM))
    big, small = add(place, box(4.0, 4.0), tree=1), add(place, box(0.5, 0.5), tree=2)
    put(place, big, 3.0, 2.5, 0.0, 0.0)
    put(place, small, 10.0, 2.5, 0.0, 0.0)
    assert go(place, small, 3.0, 2.5, 0.0, 0.0)
    assert not go(place, small, 1.0, 2.5, 0.0, 0.0)


def test_touching_counts() -> None:
    place = arena(faces(ROOM))
    body, other = add(place, box(1.0, 1.0), tree=1), add(place, box(1.0, 1.0), tree=2)
    put(place, other, 2.0, 3.0, 0.0, 0.0)
    put(place, body, 5.5, 2.0, 0.0, 0.0)
    assert touches(place, body)
    assert not touches(place, other)
    assert not go(place, body, 3.0, 3.0, 0.0, 0.0)  # side on side
    assert not go(place, body, 3.0, 4.0, 0.0, 0.0)  # corner on corner
    assert not go(place, body, 3.0, 3.999, 0.0, math.pi / 2)
    assert go(place, body, 3.001, 3.0, 0.0, 0.0)


def test_heights_that_only_meet_overlap() -> None:
    place = arena(faces([(2, -1, 2, 1)], (0.5, 1.0)))
    body = add(place, box(1.0, 1.0, (0.0, 0.3)), tree=1)
    assert go(place, body, 2.0, 0.0, 0.0, 0.0)  # below it
    assert go(place, body, 2.0, 0.0, 0.125, 0.0)
    assert not go(place, body, 2.0, 0.0, 0.25, 0.0)
    put(place, body, 2.0, 0.0, 0.2, 0.0)
    assert touches(place, body)
    assert go(place, body, 2.0, 0.0, 1.125, 0.0)  # above it
    other = add(place, box(3.0, 0.1, (0.0, 1.0)), tree=2)
    assert go(place, other, 2.0, 0.0, 3.0, 0.0)
    assert not go(place, other, 2.0, 0.0, 1.25, 0.0)


def test_what_is_in_the_ground_stalls() -> None:
    place = arena(faces([]))
    sunk = add(place, box(1.0, 1.0, (-0.1, 0.3)), tree=1)
    assert touches(place, sunk)
    assert not go(place, sunk, 1.0, 0.0, 0.05, 0.0)
    assert go(place, sunk, 1.0, 0.0, 0.1 + 0.2 - 0.2, 0.0)  # rounding is no ground
    assert not touches(place, add(place, box(1.0, 1.0, (-0.1, 0.3)), tree=1, solid=False))


def test_one_tree_never_collides_and_neither_does_what_is_not_solid() -> None:
    place = arena(faces(ROOM), tree=7)
    own, ghost = add(place, box(1.0, 1.0), tree=7), add(place, box(1.0, 1.0), tree=8, solid=False)
    assert go(place, own, 0.0, 2.0, 0.0, 0.0)
    assert go(place, ghost, 0.0, 2.0, 0.0, 0.0)
    assert go(place, own, 0.1, 2.0, 0.0, 0.0)
    loose = [add(place, box(1.0, 1.0), tree=-1) for _ in range(2)]
    assert place.touches(np.array(loose)).all()  # a negative tree is none, not one


def test_who_comes_first_gets_the_place() -> None:
    target = np.array([[0.0, 0.0, 0.0, 0.0], [0.4, 0.0, 0.0, 0.0]])
    for order in ([0, 1], [1, 0]):
        place = arena(faces([]))
        bodies = np.array([add(place, box(0.5, 0.5), tree=tree) for tree in (1, 2)])
        place.set_poses(bodies, np.array([[-3.0, 0, 0, 0], [3.0, 0, 0, 0]]))
        assert place.move(bodies[order], target[order]).tolist() == [False, True]


def test_a_group_goes_together_or_not_at_all() -> None:
    place = arena(faces(ROOM))
    base, arm, other = (add(place, box(1.0, 0.2), tree=tree) for tree in (1, 1, 2))
    bodies = np.array([base, arm, other])
    poses = np.array([[2.0, 2.0, 0, 0], [3.0, 2.0, 0, 0], [2.0, 4.0, 0, 0]])
    place.set_poses(bodies, poses)
    ahead = poses + np.array([2.6, 0, 0, 0])
    assert place.move(bodies, ahead, np.array([5, 5, 6])).tolist() == [True, True, False]
    assert place.move(bodies, poses, np.array([5, 5, 6])).tolist() == [False, False, False]
    assert place.move(bodies, ahead).tolist() == [False, True, False]


def test_a_removed_body_is_in_nobodys_way_and_has_no_name() -> None:
    place = arena(faces([]))
    body, other = (add(place, box(1.0, 1.0), tree=tree) for tree in (1, 2))
    assert touches(place, body)
    place.remove_body(other)
    assert not touches(place, body)
    for call in (
        lambda: place.remove_body(other),
        lambda: put(place, other, 0, 0, 0, 0),
        lambda: touches(place, other),
    ):
        with pytest.raises(ValueError, match="there is no body 1"):
            call()
    assert add(place, box(1.0, 1.0), tree=2) == 2


@pytest.mark.parametrize(
    ("bodies", "poses", "message"),
    [
        ([0], [[NAN, 0, 0, 0]], "pose 0 is not finite"),
        ([0, 0], [[0, 0, 0, 0], [0, 0, 0, math.inf]], "pose 1 is not finite"),
        ([0], [[1e300, 0, 0, 0]], "pose 0 is not finite, or beyond"),
        ([0], [[0, 0, 0]], r"poses must have shape \(1, 4\)"),
        ([0, 0], [[0, 0, 0, 0]], r"poses must have shape \(2, 4\)"),
        ([[0]], [[0, 0, 0, 0]], r"bodies must have shape \(n,\)"),
        ([1], [[0, 0, 0, 0]], "there is no body 1"),
        ([-1], [[0, 0, 0, 0]], "there is no body -1"),
        ([0.0], [[0, 0, 0, 0]], "bodies must be integers"),
    ],
)
def test_bad_poses_change_nothing(bodies: list[int], poses: list[list[float]], message: str) -> None:
    place = arena(faces([]))
    body = add(place, box(1.0, 1.0), tree=1)
    put(place, body, 3.0, 0.0, 0.0, 0.0)
    for act in (place.set_poses, place.move):
        with pytest.raises(ValueError, match=message):
            act(np.array(bodies), np.array(poses))
    ray = place.cast(np.zeros((1, 4)), np.array([2]), 9.0)
    assert ray[0][0] == 2.5


def test_bad_outlines() -> None:
    place = arena(faces([]))
    with pytest.raises(ValueError, match="face 1: its ends are not finite"):
        add(place, faces([(0, 0, 1, 0), (0, NAN, 1, 0)]), tree=1)
    with pytest.raises(ValueError, match=r"outline must have shape \(n, 6\)"):
        add(place, np.zeros((2, 5)), tree=1)
    with pytest.raises(ValueError, match="tree: 9999999999"):
        add(place, box(1, 1), tree=9999999999)


# Anything against shapely


class Oracle:
    """Every solid face against every other; unsure where outlines nearly touch."""

    def __init__(self, everything: Everything) -> None:
        self.everything = everything
        self.lines = [LineString(face[:4].reshape(2, 2)) for face in everything.faces]

    def touches(self, moved: FloatArray, number: int, owner: np.ndarray) -> tuple[bool, bool]:
        e, mine = self.everything, owner == number
        if (moved[e.solid[mine], 4] < 0).any():
            return True, False
        found = unsure = False
        for i in np.flatnonzero(e.solid[mine]):
            line = LineString(moved[i, :4].reshape(2, 2))
            others = e.solid & ~mine & (e.tree != e.tree[mine][0])
            others &= (e.faces[:, 4] <= moved[i, 5]) & (moved[i, 4] <= e.faces[:, 5])
            for j in np.flatnonzero(others):
                found = found or line.intersects(self.lines[j])
                unsure = unsure or self.barely(line, self.lines[j])
        return found, unsure

    @staticmethod
    def barely(one: LineString, other: LineString) -> bool:
        if not one.intersects(other):
            return one.distance(other) < 1e-9
        return min(LineString(p.coords).boundary.distance(q) for p, q in ((one, other), (other, one))) < 1e-9


@pytest.mark.parametrize("seed", range(12))
def test_motion_agrees_with_shapely(seed: int) -> None:
    rng = np.random.default_rng(seed)
    place, everything = random_arena(rng, 8)
    owner = everything.body
    oracle, stalls = Oracle(everything), []
    for _ in range(25):
        number = int(rng.integers(0, 8))
        pose = np.append(rng.uniform(-6, 6, 2), [rng.choice([0.0, 0.2, 0.5]), rng.uniform(-4, 4)])
        moved = in_map(everything.outlines[number], pose)
        expected, unsure = oracle.touches(moved, number, owner)
        if unsure:
            continue
        assert bool(place.move(np.array([number]), pose[None])[0]) == expected
        stalls.append(expected)
        if not expected:
            everything.faces[owner == number] = moved
            for i, face in zip(np.flatnonzero(owner == number), moved, strict=True):
                oracle.lines[i] = LineString(face[:4].reshape(2, 2))
    assert {True, False} == set(stalls)


def test_a_step_and_what_is_mounted_follow_the_old_heading() -> None:
    poses = np.array([[1.0, 2.0, 0.5, math.pi / 2], [0.0, 0.0, 0.0, 3.1]])
    moved = _core.step(poses, np.array([[2.0, 1.0, 0.3], [0.0, 0.0, 1.0]]), 0.1)
    np.testing.assert_allclose(
        moved, [[0.9, 2.2, 0.5, math.pi / 2 + 0.03], [0.0, 0.0, 0.0, 3.2 - math.tau]], atol=1e-15
    )
    mounts = np.array([[0.3, 0.1, 0.2, 1.0], [0.0, 0.0, 0.0, 0.0]])
    there = _core.mounted(poses, np.array([0, -1]), mounts)
    np.testing.assert_allclose(there, [[0.9, 2.3, 0.7, math.pi / 2 + 1.0], poses[1]], atol=1e-15)


def test_steps_and_mounts_of_other_shapes_are_refused() -> None:
    with pytest.raises(ValueError, match=r"velocities must have shape \(2, 3\)"):
        _core.step(np.zeros((2, 4)), np.zeros((1, 3)), 0.1)
    with pytest.raises(ValueError, match="there is no frame 2"):
        _core.mounted(np.zeros((2, 4)), np.array([2]), np.zeros((1, 4)))
    with pytest.raises(ValueError, match="there is no frame -3"):
        _core.mounted(np.zeros((2, 4)), np.array([-3]), np.zeros((1, 4)))
