# SPDX-License-Identifier: BSD-3-Clause
"""Pedestrians and other models that walk by themselves: from the world file to the laser that sees them."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from sim_worlds import LASER, drive, robot, simulator

from kurumaisu.errors import Error
from kurumaisu.sim.robots import social_force
from kurumaisu.types import FloatArray
from kurumaisu.world import load_world

BODY = "size [0.4 0.4 1.7] mass 70"
WALL = 'model ( name "far" pose [30 0 0 0] size [0.1 60 2] )\n'


def walker(pose: str, points: list[str], extra: str = "walk_speed 1") -> str:
    waypoints = " ".join(f"waypoint[{i}] [{point}]" for i, point in enumerate(points))
    return f"model ( pose [{pose}] {BODY} {waypoints} {extra} )\n"


def ways(folder: Path, text: str, steps: int, semantics: str = "physical") -> FloatArray:
    """Return x, y (steps, models, 2) of all models."""
    sim = simulator(folder, WALL + text, semantics=semantics)
    places = []
    for _ in range(steps):
        sim.step(np.zeros((len(sim.robots), 3)))
        places.append(sim.model_poses[:, :2])
    return np.array(places)


@pytest.mark.parametrize("semantics", ["physical", "stage"])
@pytest.mark.parametrize(
    ("mode", "then"),
    [("loop", [(2, 0), (0, 0), (2, 0)]), ("yoyo", [(2, 0), (2, 2), (2, 0)]), ("once", [(2, 2), (2, 2), (2, 2)])],
)
def test_waypoints_are_met_on_time(tmp_path: Path, semantics: str, mode: str, then: list[tuple[int, int]]) -> None:
    """0 -> (2, 0) -> (2, 2) at 1 m/s: 2 s each; then as the mode says."""
    points = ["2 0", "2 2", "0 0"] if mode == "loop" else ["2 0", "2 2"]
    text = walker("0 0 0 0", points, f'walk_speed 1 walk_mode "{mode}"')
    way = ways(tmp_path, text, 130, semantics)[:, 1]
    np.testing.assert_allclose(way[19], [2, 0], atol=1e-9)
    np.testing.assert_allclose(way[9], [1, 0], atol=1e-9)
    np.testing.assert_allclose(way[39], [2, 2], atol=1e-9)
    visited = [tuple(p) for p in np.round(way[40:], 9).tolist()]
    if mode == "once":
        assert set(visited) == {(2.0, 2.0)}
    elif mode == "yoyo":
        assert visited[19] == (2.0, 0.0)
        assert visited[39] == (2.0, 2.0)
    else:
        assert min(np.hypot(*np.array(p)) for p in visited) < 1e-9


@pytest.mark.parametrize(
    ("extra", "message"),
    [
        ("waypoint[0] [1 0]", "waypoints need a walk_speed above 0, not 0"),
        ("waypoint[0] [1 0] walk_speed -1", "waypoints need a walk_speed above 0, not -1"),
        ('waypoint[0] [1 0] walk_speed 1 walk_mode "hop"', "walk_mode must be one of loop, yoyo, once, not 'hop'"),
        ("waypoint[0] [1] walk_speed 1", r"waypoint\[0\] needs 2 numbers, not 1"),
    ],
)
def test_walks_that_make_no_sense_are_refused(tmp_path: Path, extra: str, message: str) -> None:
    path = tmp_path / "t.world"
    path.write_text(f"model ( {extra} )")
    with pytest.raises(Error, match=rf"t\.world:1:\d+: {message}"):
        load_world(path)
    path.write_text("position ( waypoint[0] [1 0] walk_speed 1 )")
    with pytest.raises(Error, match="a position is driven by commands"):
        load_world(path)


def test_a_laser_sees_a_walker_come(tmp_path: Path) -> None:
    sim = simulator(
        tmp_path,
        WALL + robot(LASER) + walker("5 0 0 180", ["1 0"], 'walk_speed 1 walk_mode "once"'),
        semantics="physical",
    )
    seen = [float(o.scans[0].ranges[90]) for o in drive(sim, [0, 0, 0], 30)]
    np.testing.assert_allclose(np.diff(seen), -0.1, atol=1e-9)


def test_a_walker_and_a_robot_bump_into_each_other(tmp_path: Path) -> None:
    sim = simulator(
        tmp_path,
        WALL + robot("mass 20") + walker("2 0 0 0", ["-3 0"], 'walk_speed 1 walk_mode "once"'),
        semantics="physical",
    )
    last = drive(sim, [0, 0, 0], 40)[-1]
    assert last.poses[0, 0] < -0.5  # 70 kg push 20 kg
    assert last.stalled[0]


def test_walkers_who_give_way_pass_each_other(tmp_path: Path) -> None:
    extra = 'walk_speed 1.34 walk_mode "once" social 1'
    text = walker("0 0.05 0 0", ["12 0"], extra) + walker("12 -0.05 0 0", ["0 0"], extra)
    way = ways(tmp_path, text, 120)
    apart = np.hypot(*(way[:, 1] - way[:, 2]).T)
    assert apart.min() > 0.55  # their bodies did not touch: 0.57 m corner to corner
    assert np.hypot(*(way[-1, 1] - [12, 0])) < 1.0
    assert np.hypot(*(way[-1, 2] - [0, 0])) < 1.0


def test_walkers_who_give_way_keep_off_walls(tmp_path: Path) -> None:
    wall = "model ( pose [5 0.35 0 0] size [20 0.1 2] )\n"
    way = ways(tmp_path, wall + walker("0 0 0 0", ["8 0"], 'walk_speed 1.34 walk_mode "once" social 1'), 50)
    assert way[:, 2, 1].min() < -0.2
    assert way[-1, 2, 0] > 4


def test_states_remember_the_walks(tmp_path: Path) -> None:
    extra = 'walk_speed 1.2 walk_mode "yoyo" social 1'
    text = WALL + robot(LASER) + walker("2 0 0 0", ["4 1", "-3 0"], extra) + walker("3 3 0 0", ["0 -3", "1 1"], extra)
    sim = simulator(tmp_path, text, semantics="physical")
    drive(sim, [0.3, 0, 0.2], 30)
    saved = sim.save()
    drive(sim, [0.3, 0, 0.2], 30)
    other = simulator(tmp_path, text, semantics="physical")
    other.load(saved)
    drive(other, [0.3, 0, 0.2], 30)
    assert sim.state_hash() == other.state_hash()


place = st.tuples(st.floats(-4, 4), st.floats(-4, 4))


@given(a=place, b=place, velocity=place)
def test_the_force_is_the_gradient_of_the_papers_potential(
    a: tuple[float, float], b: tuple[float, float], velocity: tuple[float, float]
) -> None:
    me, other, v = np.array(a), np.array(b), np.array(velocity)
    if np.hypot(*(me - other)) < 0.05:
        return

    def half_axis(r: FloatArray) -> float:
        s = v * 2.0
        return 0.5 * float(np.sqrt(max((np.hypot(*r) + np.hypot(*(r - s))) ** 2 - s @ s, 0.0)))

    if half_axis(me - other) < 0.05:  # the potential has a kink on the other's way
        return
    h = 1e-6
    steps = np.array([[h, 0], [0, h]])
    potential = [[2.1 * np.exp(-half_axis(me - other + sign * step) / 0.3) for sign in (1, -1)] for step in steps]
    gradient = np.array([(up - down) / (2 * h) for up, down in potential])
    force = social_force.repulsion(me[None], (other - me)[None], other[None], v[None])[0]
    in_sight = (other - me) @ gradient >= np.cos(np.deg2rad(100)) * np.hypot(*gradient) * np.hypot(*(other - me))
    np.testing.assert_allclose(force, -gradient * (1.0 if in_sight else 0.5), atol=1e-5)


def test_alone_a_walker_takes_up_his_speed_exponentially() -> None:
    velocity, wanted = np.zeros((1, 2)), np.array([[1.34, 0.0]])
    for _ in range(1000):
        velocity += social_force.drive(velocity, wanted) * 0.001
    assert velocity[0, 0] == pytest.approx(1.34 * (1 - np.exp(-1.0 / 0.5)), rel=2e-3)


def test_a_wall_pushes_away_from_its_nearest_point() -> None:
    walls = np.array([[0.0, 1.0, 10.0, 1.0], [0.0, 5.0, 10.0, 5.0]])
    np.testing.assert_allclose(social_force.wall_repulsion(np.array([5.0, 0.6]), walls), [0, -50 * np.exp(-2)])
    assert not social_force.wall_repulsion(np.zeros(2), np.empty((0, 4))).any()


def test_a_gripper_works_from_the_simulator(tmp_path: Path) -> None:
    hand = "gripper ( pose [0.3 0 -0.4 0] size [0.2 0.3 0.2] )"
    parcel = "model ( pose [0.34 0 0 0] size [0.06 0.1 0.1] mass 1 gripper_return 1 )\n"
    sim = simulator(tmp_path, WALL + robot(hand) + parcel, semantics="physical")
    assert sim.grip(0, True)
    drive(sim, [0.5, 0, 0], 10)
    np.testing.assert_allclose(sim.model_poses[-1, :2], [0.84, 0], atol=1e-9)
    assert not sim.grip(0, False)
    drive(sim, [-0.5, 0, 0], 10)
    np.testing.assert_allclose(sim.model_poses[-1, :2], [0.84, 0], atol=1e-6)
    with pytest.raises(Error, match="grip: needs semantics physical"):
        simulator(tmp_path, WALL + robot(hand) + parcel).grip(0, True)
