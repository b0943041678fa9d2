# SPDX-License-Identifier: BSD-3-Clause
"""The worlds that ship, in motion: people walk through nothing, doors open, ramps are climbed, a run repeats."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from shapely import affinity
from shapely import geometry as shapely

from kurumaisu.params import load_model, shipped
from kurumaisu.sim import Simulator, load_options
from kurumaisu.sim.chair.simulator import ChairSimulator, Command
from kurumaisu.sim.settings import load_dynamics
from kurumaisu.types import FloatArray
from kurumaisu.world import World, load_world
from kurumaisu.world.model import Model

OPTIONS = load_options(shipped("launch/simulator.yaml"))
WORLDS = sorted(shipped("worlds/room.world").parent.glob("*.world"))
PEOPLED = [shipped(f"worlds/{name}.world") for name in ("corridor", "plaza")]
MODEL = load_model(shipped("launch/md100.yaml"))
DYNAMICS = load_dynamics(shipped("launch/physical.yaml"))
STEP = 0.1  # [s] of all worlds here


def fleet(world: World, semantics: str) -> Simulator:
    return Simulator(world, replace(OPTIONS, semantics=semantics, timing="consistent"))


def run(sim: Simulator, seconds: float) -> FloatArray:
    """Return poses (steps, models, 4) while robots stand."""
    poses = []
    for _ in range(round(seconds / STEP)):
        sim.step(np.zeros((len(sim.robots), 3)))
        poses.append(sim.model_poses)
    return np.array(poses)


def solid(model: Model, pose: FloatArray) -> list[tuple[shapely.Polygon, FloatArray]]:
    """Return the parts of a model in the map with their heights."""
    placed = []
    for part in model.shape.polygons:
        turned = affinity.rotate(shapely.Polygon(part.corners), pose[3], (0, 0), use_radians=True)
        placed.append((affinity.translate(turned, pose[0], pose[1]), part.heights + pose[2]))
    return placed


def overlap(a: list[tuple[shapely.Polygon, FloatArray]], b: list[tuple[shapely.Polygon, FloatArray]]) -> float:
    """Return the area [m^2] that two models have in common at the same height."""
    return max((p.intersection(q).area for p, pz in a for q, qz in b if pz[0] < qz[1] and qz[0] < pz[1]), default=0.0)


@pytest.mark.parametrize("semantics", ["physical", "stage"])
@pytest.mark.parametrize("path", WORLDS, ids=lambda path: path.stem)
def test_a_run_repeats_bit_for_bit(path: Path, semantics: str) -> None:
    world = load_world(path)
    hashes = []
    for _ in range(2):
        sim = fleet(world, semantics)
        before = sim.state_hash()
        run(sim, 5.0)
        hashes.append(sim.state_hash())
        assert hashes[-1] != before
    assert hashes[0] == hashes[1]


@pytest.mark.parametrize("path", PEOPLED, ids=lambda path: path.stem)
def test_people_walk_through_nothing_and_get_on(path: Path) -> None:
    """A minute of it: another library looks at all they pass; they keep up most of their speed."""
    world = load_world(path)
    poses = run(fleet(world, "physical"), 60.0)
    people = [model for model in world.models if model.walk is not None]
    others = [model for model in world.models if model.obstacle_return and model.parent < 0]
    assert len(people) == {"corridor": 2, "plaza": 6}[path.stem]
    for person in people:
        walk = person.walk
        assert walk is not None
        way = np.hypot(*np.diff(poses[:, person.index, :2], axis=0).T).sum()
        assert way > 0.9 * walk.speed * 60
        near = [o for o in others if (o is not person and o.walk is not None) or _is_near(o, poses[:, person.index])]
        for pose in poses[::4]:
            body = solid(person, pose[person.index])
            assert all(overlap(body, solid(o, pose[o.index])) < 1e-3 for o in near if o is not person)


def _is_near(model: Model, way: FloatArray) -> bool:
    """Return whether a way (n, 4) leads by a model that stands still."""
    corners = np.concatenate([np.array(p.exterior.coords) for p, _ in solid(model, model.pose)])
    low, high = corners.min(axis=0) - 0.4, corners.max(axis=0) + 0.4
    return bool(((way[:, :2] > low) & (way[:, :2] < high)).all(axis=1).any())


@pytest.mark.parametrize("path", PEOPLED, ids=lambda path: path.stem)
def test_people_are_in_no_map(path: Path) -> None:
    world = load_world(path)
    ends = world.segments.reshape(-1, 2)
    for person in (model for model in world.models if model.walk is not None):
        assert np.hypot(*(ends - person.pose[:2]).T).min() > 0.25


def moving(v: float) -> Command:
    return Command(float(MODEL.translation.volts(v)), float(MODEL.steering.volts(0.0)), float(np.sign(v)), 0.0)


def find(world: World, name: str) -> Model:
    return next(model for model in world.models if model.name == name)


DOORS = {"bedroom_door": (3.0, -1), "bath_door": (5.3, 1)}  # x of the doorway's middle [m], sense of opening


@pytest.mark.parametrize("name", DOORS)
def test_the_chair_pushes_a_door_open_goes_in_and_comes_out_again(name: str) -> None:
    world = load_world(shipped("worlds/flat.world"))
    sim = ChairSimulator(MODEL, world, DYNAMICS)
    x, sense = DOORS[name]
    door = find(world, name).index
    sim.set_pose("chair", (x, 4.1, 0.0, -np.pi / 2))
    start = sim.model_poses[door]
    inside = [sim.step(moving(0.4)) for _ in range(500)][-1]
    np.testing.assert_allclose(inside.pose[:2], [x, 2.1], atol=0.03)
    opened = sim.model_poses[door]
    assert np.degrees(sense * (opened[3] - start[3])) > 35
    np.testing.assert_allclose(opened[:2], start[:2], atol=1e-6)  # the pose is at the hinge
    outside = [sim.step(moving(-0.4)) for _ in range(500)][-1]
    np.testing.assert_allclose(outside.pose[:2], [x, 4.1], atol=0.03)


def test_a_robot_of_the_fleet_pushes_a_door_open_and_in_stages_semantics_it_cannot() -> None:
    world = load_world(shipped("worlds/flat.world"))
    ends = {}
    for semantics in ("physical", "stage"):
        sim = fleet(world, semantics)
        sim.set_pose("chair", (3.0, 4.1, 0.0, -np.pi / 2))
        for _ in range(50):
            last = sim.step(np.array([[0.4, 0.0, 0.0]]))
        ends[semantics] = float(last.poses[0, 1])
    assert ends["physical"] == pytest.approx(2.1, abs=0.03)
    assert ends["stage"] > 3.0


def test_the_chair_goes_up_to_the_balcony() -> None:
    world = load_world(shipped("worlds/flat.world"))
    sim = ChairSimulator(MODEL, world, DYNAMICS)
    sim.set_pose("chair", (9.6, 6.0, 0.0, 0.0))
    rises = np.array([sim.step(moving(0.4)).rates[0] for _ in range(600)])
    slow = 0.4 - 0.075 * DYNAMICS.slope_speed
    np.testing.assert_allclose(np.unique(np.round(rises, 6)), [slow, 0.4], atol=1e-6)
    assert (rises < 0.4 - 1e-6).sum() * DYNAMICS.contacts.step == pytest.approx(0.8 / slow, abs=0.02)


def test_the_ramp_of_the_plaza_leads_past_its_steps() -> None:
    sim = ChairSimulator(MODEL, load_world(shipped("worlds/plaza.world")), DYNAMICS)
    sim.set_pose("chair", (13.5, 3.75, 0.0, 0.0))
    observations = [sim.step(moving(0.6)) for _ in range(1000)]
    assert not any(o.contact for o in observations)
    assert observations[-1].pose[0] > 18.5
    sim.set_pose("chair", (13.0, 6.0, 0.0, 0.0))
    assert any(sim.step(moving(0.6)).contact for _ in range(100))
