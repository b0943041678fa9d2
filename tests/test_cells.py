# SPDX-License-Identifier: BSD-3-Clause
"""Stage's collisions: its rules on paper, and its cells against another way to find them."""

import math
from fractions import Fraction
from typing import Any

import numpy as np
import pytest
from arenas import ROOM, box, faces
from hypothesis import given, settings
from hypothesis import strategies as st

from kurumaisu._core import Cells
from kurumaisu.types import FloatArray

CELL = 0.02
NAN = math.nan
HERE = np.zeros((1, 9))  # a model at its parent's place
ALONE = np.array([-1])


def cells(walls: FloatArray, layers: int = 1, tree: int = 0, resolution: float = CELL) -> Cells:
    place = Cells(resolution, layers)
    place.add_walls(ALONE, HERE, walls, np.zeros(len(walls), int), tree)
    return place


def add(place: Cells, outline: FloatArray, tree: int) -> int:
    return place.add_body(ALONE, HERE, outline, np.zeros(len(outline), int), tree)


def put(place: Cells, body: int, *pose: float) -> None:
    place.set_poses(np.array([body]), np.array([pose]))


def go(place: Cells, body: int, *pose: float) -> bool:
    """Return whether the body went."""
    return not place.move(np.array([body]), np.array([pose]))[0]


def touches(place: Cells, body: int) -> bool:
    return bool(place.touches(np.array([body]))[0])


# Rules


def test_outlines_collide_that_share_a_cell_though_they_do_not_cross() -> None:
    place = cells(faces(ROOM))  # the right wall is x = 6, the cells from 6.00 to 6.02
    body = add(place, box(1.0, 0.5), tree=1)
    put(place, body, 3.01, 2.01, 0.0, 0.0)
    assert go(place, body, 5.495, 2.01, 0.0, 0.0)  # its edge is in the last cell before
    assert not go(place, body, 5.51, 2.01, 0.0, 0.0)
    assert not touches(place, body)
    put(place, body, 6.515, 2.01, 0.0, 0.0)  # outside, 15 mm off the wall
    assert touches(place, body)
    put(place, body, 6.525, 2.01, 0.0, 0.0)
    assert not touches(place, body)


def test_a_step_is_taken_as_a_whole_or_not_at_all() -> None:
    place = cells(faces(ROOM))
    body = add(place, box(1.0, 0.5), tree=1)
    put(place, body, 3.0, 2.0, 0.0, 0.0)
    assert not go(place, body, 5.6, 2.1, 0.0, 0.3)
    assert place.drawn(np.array([body]), 0).tolist() == [[3.0, 2.0, 0.0, 0.0]]
    assert go(place, body, 9.0, 2.0, 0.0, 0.0)  # only the end of the way counts


def test_outlines_are_hollow_and_one_within_a_cell_is_nothing() -> None:
    place = cells(faces(ROOM))
    big, small = add(place, box(4.0, 4.0), tree=1), add(place, box(0.5, 0.5), tree=2)
    speck = add(place, box(0.015, 0.015), tree=3)
    put(place, big, 3.0, 2.5, 0.0, 0.0)
    put(place, small, 10.0, 2.5, 0.0, 0.0)
    assert go(place, small, 3.0, 2.5, 0.0, 0.0)
    assert not go(place, small, 1.0, 2.5, 0.0, 0.0)
    put(place, speck, 1.01, 2.51, 0.0, 0.0)
    assert not touches(place, speck)  # on big's edge
    put(place, speck, 1.02, 2.51, 0.0, 0.0)  # across cells
    assert touches(place, speck)


def test_heights_that_meet_overlap_and_the_ground_stops_everything() -> None:
    place = cells(faces(ROOM, z=(0.0, 0.5)))
    body = add(place, box(1.0, 0.5), tree=1)
    put(place, body, 6.0, 2.0, 0.5, 0.0)
    assert touches(place, body)
    put(place, body, 6.0, 2.0, 0.5001, 0.0)
    assert not touches(place, body)
    put(place, body, 60.0, 2.0, -1e-12, 0.0)
    assert touches(place, body)


def test_walls_of_several_heights_in_one_tile() -> None:
    place = cells(faces([(0, 0, 1, 0)], z=(0.0, 0.5)))
    place.add_walls(ALONE, HERE, faces([(0, 0, 1, 0)], z=(1.0, 1.5)), np.zeros(1, int), 5)
    body = add(place, box(0.3, 0.3, z=(0.0, 0.2)), tree=5)
    for z, expected in ((0.2, True), (0.7, False), (1.2, False)):  # the upper one is of its own tree
        put(place, body, 0.5, 0.0, z, 0.0)
        assert touches(place, body) == expected


def test_trees_do_not_collide_with_themselves_but_a_negative_one_is_none() -> None:
    place = cells(faces(ROOM), tree=4)
    own, loose, other = (add(place, box(1.0, 1.0), tree) for tree in (4, -1, -1))
    put(place, own, 6.0, 2.0, 0.0, 0.0)
    put(place, loose, 20.0, 2.0, 0.0, 0.0)
    put(place, other, 20.5, 2.0, 0.0, 0.0)
    assert place.touches(np.array([own, loose, other])).tolist() == [False, True, True]
    place.remove_body(other)
    assert not touches(place, loose)


def test_who_is_asked_first_goes_first() -> None:
    for order, expected in (((0, 1), [False, True]), ((1, 0), [False, True])):
        place = cells(faces(ROOM))
        for tree, x in enumerate((9.9, 12.1)):
            put(place, add(place, box(1.0, 1.0), tree + 1), x, 0.0, 0.0, 0.0)
        assert place.move(np.array(order), np.array([[11.0, 0.0, 0.0, 0.0]] * 2)).tolist() == expected


def test_a_group_goes_together_or_not_at_all() -> None:
    place = cells(faces(ROOM))
    low, high = add(place, box(1.0, 1.0), tree=1), add(place, box(2.0, 0.5), tree=1)
    both, there = np.array([low, high]), np.array([[10.0, 0.0, 0.0, 0.0]] * 2)
    place.set_poses(both, there)
    step = np.array([1.0, 0.0, 0.0, 0.0])
    assert not place.move(both, there + step, np.array([7, 7])).any()
    assert place.move(both, there - 3.2 * step, np.array([7, 7])).all()
    assert place.drawn(both, 0)[:, 0].tolist() == [11.0, 11.0]


def test_models_of_a_body_are_placed_by_their_chain() -> None:
    place = cells(faces(ROOM))
    parents = np.array([-1, 0, 1])
    turn = [1.0, 0.0, 0.0, math.pi / 2]
    places = np.array([[0.0] * 9, [*turn, 0.4, *[0.0] * 4], [*turn, 0.3, 0.5, 0.0, 0.1, 0.0]])
    body = place.add_body(parents, places, box(0.1, 0.1, z=(0.0, 0.1)), np.full(4, 2), 1)
    # the box is at (1, 1) and 0.5 m further along -x, 0.8 m above the floor
    for x, y, z, expected in ((5.5, 1.0, 0.19, True), (5.5, 1.0, 0.21, False), (5.0, 1.0, 0.19, False)):
        put(place, body, x, y, z, 0.0)
        assert touches(place, body) == expected
    for x, y, heading, expected in ((1.5, 5.5, -math.pi / 2, True), (1.5, 5.5, math.pi, False), (1, 6, math.pi, True)):
        put(place, body, x, y, 0.0, heading)  # at (2.5, 5), (1, 4.5), (0.5, 5)
        assert touches(place, body) == expected


# Two layers


def test_with_two_layers_a_body_that_goes_later_is_met_where_it_was() -> None:
    def follow(layers: int) -> list[bool]:
        place = cells(faces(ROOM), layers)
        first, second = (add(place, box(0.1, 0.1), tree) for tree in (1, 2))
        put(place, first, 10.0, 0.0, 0.0, 0.0)
        put(place, second, 10.22, 0.0, 0.0, 0.0)
        gone = []
        for step in range(1, 3):  # the one ahead goes last
            place.turn()
            gone.append(go(place, first, 10.0 + 0.09 * step, 0.0, 0.0, 0.0))
            assert go(place, second, 10.22 + 0.09 * step, 0.0, 0.0, 0.0)
        return gone

    assert follow(1) == [True, True]
    assert follow(2) == [True, False]  # the other layer still shows the start


def test_layers_are_taken_and_put_back() -> None:
    one, other = cells(faces(ROOM), 2), cells(faces(ROOM), 2)
    for place in (one, other):
        assert add(place, box(0.1, 0.1), tree=1) == 0
    one.turn()
    assert go(one, 0, 3.0, 2.0, 0.0, 0.3)
    both = np.array([0])
    assert one.drawn(both, 0).tolist() == [[3.0, 2.0, 0.0, 0.3]]
    assert one.drawn(both, 1).tolist() == [[0.0, 0.0, 0.0, 0.0]]
    for layer in (0, 1):
        other.draw(both, layer, one.drawn(both, layer))
        assert other.drawn(both, layer).tolist() == one.drawn(both, layer).tolist()


# Cells


def trace(edges: FloatArray) -> set[tuple[int, int]]:
    """Cells of edges (k, 6): steps along x and y in the order in which an even motion is half way through them."""
    found = set()
    for ax, ay, bx, by in np.floor(edges[:, :4] / CELL).astype(int).tolist():
        wide, high = abs(bx - ax), abs(by - ay)
        steps = [(Fraction(2 * i + 1, 2 * wide), 1) for i in range(wide)]
        steps += [(Fraction(2 * i + 1, 2 * high), 0) for i in range(high)]  # first of two at the same time
        x, y = ax, ay
        for _, along in sorted(steps):
            found.add((x, y))
            x, y = (x + (1 if bx > ax else -1), y) if along else (x, y + (1 if by > ay else -1))
    return found


def turned(outline: FloatArray, pose: FloatArray) -> FloatArray:
    c, s = math.cos(pose[3]), math.sin(pose[3])
    ends = outline[:, :4].reshape(-1, 2) @ np.array([[c, s], [-s, c]]) + pose[:2]
    return np.hstack([ends.reshape(-1, 4), outline[:, 4:]])


def test_cells_are_those_of_steps_in_the_order_of_time() -> None:
    rng = np.random.default_rng(4)
    met = 0
    for _ in range(300):
        lines = faces(rng.uniform(-1, 1, (6, 4)).round(3).tolist())
        outline = box(*rng.uniform(0.02, 0.5, 2))
        pose = np.array([*rng.uniform(-1, 1, 2), 0.0, rng.uniform(-4, 4)])
        place = cells(lines)
        body = add(place, outline, tree=1)
        put(place, body, *pose)
        expected = bool(trace(lines) & trace(turned(outline, pose)))
        assert touches(place, body) == expected
        met += expected
    assert 100 < met < 250


def test_bodies_meet_as_walls_do() -> None:
    rng = np.random.default_rng(5)
    outlines = [box(*rng.uniform(0.02, 0.5, 2)) for _ in range(12)]
    place = cells(np.empty((0, 6)))
    bodies = np.array([add(place, outline, tree) for tree, outline in enumerate(outlines)])
    met = 0
    for _ in range(40):
        poses = np.column_stack([rng.uniform(-2, 2, (12, 2)), np.zeros(12), rng.uniform(-4, 4, 12)])
        place.set_poses(bodies, poses)
        drawn = [trace(turned(outline, pose)) for outline, pose in zip(outlines, poses, strict=True)]
        expected = [any(drawn[i] & drawn[j] for j in range(12) if j != i) for i in range(12)]
        assert place.touches(bodies).tolist() == expected
        met += sum(expected)
    assert 50 < met < 450


@settings(max_examples=50, deadline=None)
@given(st.lists(st.tuples(*[st.floats(-3, 3)] * 3), min_size=1, max_size=15))
def test_nobody_ever_overlaps_who_did_not_at_first(steps: list[tuple[float, float, float]]) -> None:
    place = cells(faces(ROOM))
    bodies = np.array([add(place, box(0.5, 0.3), tree) for tree in (1, 2, 3)])
    poses = np.array([[1.0, 1.0, 0.0, 0.0], [3.0, 2.5, 0.0, 0.0], [5.0, 4.0, 0.0, 0.0]])
    place.set_poses(bodies, poses)
    for i, (x, y, heading) in enumerate(steps):
        body = bodies[i % 3 : i % 3 + 1]
        place.move(body, place.drawn(body, 0) + np.array([x, y, 0.0, heading]))
        assert not place.touches(bodies).any()


# Faults


@pytest.mark.parametrize(
    ("why", "resolution", "layers"), [("resolution", 0.0, 1), ("resolution", NAN, 1), ("layers", CELL, 3)]
)
def test_refuses_cells_that_cannot_be(why: str, resolution: float, layers: int) -> None:
    with pytest.raises(ValueError, match=why):
        Cells(resolution, layers)


@pytest.mark.parametrize(
    ("why", "change"),
    [
        ("edge 2 is not finite", {"edges": faces([(0, 0, 1, 0), (1, 0, 0, 0), (0, 0, NAN, 0)])}),
        ("edge 0: z_low", {"edges": box(1.0, 1.0, z=(1.0, 0.0))[:3]}),
        ("part 0: its parent", {"parents": np.array([0])}),
        ("part 0 is not finite", {"places": np.full((1, 9), math.inf)}),
        ("edge 1: there is no such part", {"parts": np.array([0, 1, 0])}),
        ("10.8 cells", {"edges": box(1e6, 1e6)[:3]}),
        ("2.30 cells", {"edges": faces([(3e7, 0, 3e7, 1)] * 3)}),
        (r"places must have shape \(1, 9\)", {"places": np.zeros((1, 8))}),
        ("parts must be integers", {"parts": np.zeros(3)}),
    ],
)
def test_refuses_outlines_that_cannot_be(why: str, change: dict[str, Any]) -> None:
    place = Cells(CELL, 1)
    given = {"parents": ALONE, "places": HERE, "edges": box(1.0, 1.0)[:3], "parts": np.zeros(3, int), "tree": 1}
    for method in (place.add_walls, place.add_body):
        with pytest.raises(ValueError, match=why):
            method(**(given | change))
    assert place.add_body(**given) == 0


def test_refuses_poses_that_cannot_be_and_changes_nothing() -> None:
    place = cells(faces(ROOM))
    both = np.array([add(place, box(1.0, 1.0), tree) for tree in (1, 2)])
    poses = np.array([[2.0, 2.0, 0.0, 0.0], [4.0, 3.0, 0.0, 0.0]])
    place.set_poses(both, poses)
    for bad in ([NAN, 0, 0, 0], [0, 0, 0, math.inf], [3e7, 0, 0, 0]):
        for method in (place.set_poses, place.move):
            with pytest.raises(ValueError, match="pose 1"):
                method(both, np.array([[3.0, 2.0, 0.0, 0.0], bad]))
    for unknown in (2, -1):
        with pytest.raises(ValueError, match=f"no body {unknown}"):
            place.move(np.array([0, unknown]), poses)
    with pytest.raises(ValueError, match="no layer 1"):
        place.draw(both, 1, poses)
    assert place.drawn(both, 0).tolist() == poses.tolist()
