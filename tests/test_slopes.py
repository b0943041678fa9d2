# SPDX-License-Identifier: BSD-3-Clause
"""Ramps: speeds up, down and across them against the law of base.slope, in both simulators; none in Stage's."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from shapely import geometry as shapely
from sim_worlds import drive, robot, simulator

from kurumaisu import effects
from kurumaisu.errors import Error
from kurumaisu.params import EffectSetting, load_model, shipped
from kurumaisu.sim.chair.simulator import NEUTRAL, ChairSimulator, Command
from kurumaisu.sim.motion.slopes import Slopes
from kurumaisu.sim.plant import Plant
from kurumaisu.sim.settings import load_dynamics
from kurumaisu.types import FloatArray
from kurumaisu.world import load_world
from kurumaisu.world.check import findings
from kurumaisu.world.model import Polygon, Shape

COST = load_dynamics(shipped("launch/physical.yaml")).slope_speed  # [m/s] at a rise of 1 m per metre
RISE = 0.1
FLAT = "obstacle_return 0 ranger_return -1"
WALL = 'model ( name "far" pose [30 0 0 0] size [0.1 60 2] )\n'
MODEL = load_model(shipped("launch/md100.yaml"))


def ramp(pose: str = "0 0 0 0", size: str = "4 4 0.1", slope: str = f"{RISE} 0", extra: str = FLAT) -> str:
    return f"model ( pose [{pose}] size [{size}] slope [{slope}] {extra} )\n"


def way(folder: Path, text: str, command: list[float], steps: int = 10, semantics: str = "physical") -> FloatArray:
    """Where (x, y, heading) a robot is after some steps of 0.1 s, seen from where it began."""
    sim = simulator(folder, WALL + text, semantics=semantics)
    start = sim.observe().poses[0]
    return (drive(sim, command, steps)[-1].poses[0] - start)[[0, 1, 3]]


@pytest.mark.parametrize(
    ("pose", "heading", "along"),
    [("0 0 0 0", 0, -1), ("0 0 0 0", 180, 1), ("0 0 0 0", 90, 0), ("0 0 0 90", 90, -1), ("0 0 0 60", 0, -0.5)],
    ids=["up", "down", "across", "a turned ramp", "askew"],
)
def test_speed_changes_by_the_rise_along_the_heading(tmp_path: Path, pose: str, heading: float, along: float) -> None:
    moved = way(tmp_path, ramp(pose) + robot(pose=f"0 0 0 {heading}"), [0.5, 0, 0])
    speed = 0.5 + along * RISE * COST
    direction = np.radians(heading)
    np.testing.assert_allclose(moved, [speed * np.cos(direction), speed * np.sin(direction), 0], atol=1e-9)


@pytest.mark.parametrize("command", [[0.5, 0, 0], [0.5, 0, 0.4]])
def test_there_is_no_slope_beside_a_ramp_nor_in_stages_semantics(tmp_path: Path, command: list[float]) -> None:
    beside = ramp("3.5 0 0 0", "4 4 0.1")
    assert way(tmp_path, beside + robot(), command).tolist() == way(tmp_path, robot(), command).tolist()
    stage = way(tmp_path, ramp() + robot(), command, semantics="stage")
    assert stage.tolist() == way(tmp_path, robot(), command, semantics="stage").tolist()


def test_the_ramp_begins_where_its_outline_does(tmp_path: Path) -> None:
    """1 m on the floor at 0.5 m/s, then a second on the ramp."""
    moved = way(tmp_path, ramp("3.01 0 0 0") + robot(), [0.5, 0, 0], 31)
    assert moved[0] == pytest.approx(1.05 + 1.0 * (0.5 - RISE * COST), abs=1e-9)


def test_one_that_stands_is_held(tmp_path: Path) -> None:
    assert way(tmp_path, ramp() + robot(), [0, 0, 0]).tolist() == [0, 0, 0]


def test_wheels_that_drive_sideways_give_way_sideways_and_others_hold(tmp_path: Path) -> None:
    text = ramp(slope=f"0 {RISE}")
    omni = way(tmp_path, text + robot('drive "omni" velocity_bounds [-1 1 -1 1 0 0 -90 90]'), [0.5, 0.2, 0])
    np.testing.assert_allclose(omni, [0.5, 0.2 - RISE * COST, 0], atol=1e-9)
    np.testing.assert_allclose(way(tmp_path, text + robot(), [0.5, 0.2, 0]), [0.5, 0, 0], atol=1e-9)


def test_rises_of_ramps_on_each_other_add_up(tmp_path: Path) -> None:
    moved = way(tmp_path, ramp() + ramp(slope="0.05 0") + robot(), [0.5, 0, 0])
    assert moved[0] == pytest.approx(0.5 - (RISE + 0.05) * COST)


def test_a_ramp_that_is_moved_takes_its_slope_along(tmp_path: Path) -> None:
    sim = simulator(tmp_path, WALL + 'model ( name "ramp" ' + ramp()[len("model ( ") :] + robot(), semantics="physical")
    sim.set_pose("ramp", (10, 0, 0, 0))
    assert drive(sim, [0.5, 0, 0], 10)[-1].poses[0, 0] == pytest.approx(0.5)
    sim.set_pose("ramp", (0, 0, 0, np.pi))
    assert drive(sim, [0.5, 0, 0], 10)[-1].poses[0, 0] == pytest.approx(1.0 + RISE * COST)


def chair(folder: Path, text: str) -> ChairSimulator:
    path = folder / "t.world"
    path.write_text('position ( name "chair" pose [0 0 0 0] )\n' + text)
    return ChairSimulator(MODEL, load_world(path), load_dynamics(shipped("launch/physical.yaml")))


@pytest.mark.parametrize("others", ["", "model ( pose [0 5 0 0] mass 3 )\nposition ( pose [0 9 0 0] )\n"])
def test_the_chair_climbs_as_its_effect_base_slope_has_it(tmp_path: Path, others: str) -> None:
    """The same law in two places: a ramp under it, and the effect on a level floor, while it turns and drives."""
    sim = chair(tmp_path, ramp(size="8 8 0.1", slope="0.05 -0.03") + others)
    command = Command(float(MODEL.translation.volts(0.5)), float(MODEL.steering.volts(0.3)), 1.0, 1.0)
    values = {"climb_x": 0.05 * COST, "climb_y": -0.03 * COST}
    sloped = replace(MODEL, effects=(EffectSetting("base.slope", values),))
    plant = Plant(sloped, sim.step_time, np.random.default_rng(0))
    for _ in range(200):
        heading = float(sim._world.pose[2])
        truth = plant.from_voltages(effects.Volts(*np.array([[c] for c in vars(command).values()])), heading)
        observed = sim.step(command)
        np.testing.assert_allclose(observed.rates, [truth.v[0], 0.0, truth.w[0]], atol=1e-9)
    pose = observed.pose.tolist()
    assert sim.step(NEUTRAL).pose.tolist() == pose


points = st.floats(-2, 2)


@given(places=st.lists(st.tuples(points, points), min_size=1, max_size=5), turn=st.floats(-4, 4))
def test_inside_is_inside_as_another_library_has_it(places: list[tuple[float, float]], turn: float) -> None:
    ring = np.array([(-1, -1), (1.5, -1), (0.2, 0), (1.5, 1.2), (-1, 1)])  # not convex
    shape = Shape(np.empty((0, 4)), np.empty((0, 2)), (Polygon(ring, np.array([0, 0.1]), (0, 0, 0, 1)),))
    flat = replace(load_world(shipped("worlds/wall.world")).models[0], index=0, shape=shape, slope=np.array([0.1, 0.0]))
    pose = np.array([0.5, -0.2, 0.0, turn])
    slopes = Slopes([flat], pose[None], 1.0)
    c, s = np.cos(turn), np.sin(turn)
    placed = shapely.Polygon(ring @ np.array([[c, s], [-s, c]]) + pose[:2])
    robots = np.array([(x, y, 0.0, turn) for x, y in places])
    ahead = np.broadcast_to([1.0, 0.0, 0.0], (len(robots), 3))
    after = slopes.slowed(ahead, robots, np.zeros(len(robots), dtype=np.bool_), 0.1)
    for place, (v, u, w) in zip(places, after.tolist(), strict=True):
        if placed.exterior.distance(shapely.Point(place)) > 1e-9:
            assert v == pytest.approx(0.9 if placed.contains(shapely.Point(place)) else 1.0)
        assert (u, w) == (0.0, 0.0)


def test_a_bitmaps_walls_are_outlines_too(tmp_path: Path) -> None:
    from PIL import Image

    Image.fromarray(np.zeros((20, 20), dtype=np.uint8)).save(tmp_path / "ramp.png")
    text = f'model ( bitmap "ramp.png" size [4 4 0.1] slope [{RISE} 0] {FLAT} )\n'
    assert way(tmp_path, text + robot(), [0.5, 0, 0])[0] == pytest.approx(0.5 - RISE * COST)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("model ( slope [0.1] )", "slope needs 2 numbers, not 1"),
        ("model ( slope [0.9 0.9] )", "slope must be of at most 1 m per metre, not 1.27279"),
        ("position ( slope [0.1 0] )", "a slope belongs to a model, not to a position"),
    ],
)
def test_slopes_that_make_no_sense_are_refused(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "t.world"
    path.write_text(text)
    with pytest.raises(Error, match=rf"t\.world:1:\d+: {message}"):
        load_world(path)


LASER = "ranger ( size [0 0 0.1] sensor ( range [0 8] fov 180 samples 9 ) )"
BASE = f"position ( pose [-8 0 0 0] size [0.4 0.4 0.2] velocity_bounds [-2 2 0 0 0 0 -90 90] {LASER} )\n"


@pytest.mark.parametrize(
    ("text", "messages"),
    [
        (ramp(), []),
        (ramp(extra="obstacle_return 0"), []),  # lower than the beams
        (ramp(extra="ranger_return -1"), ["stops robots but lasers do not see it", "has a slope, but stops robots"]),
        (ramp(size="4 4 0.3", extra="obstacle_return 0"), ["is a wall to lasers"]),
        (ramp(extra=FLAT + " mass 3"), ["no effect on what can move"]),
    ],
)
def test_check_world_says_what_is_no_ramp(tmp_path: Path, text: str, messages: list[str]) -> None:
    path = tmp_path / "t.world"
    path.write_text(WALL + BASE + text)
    found = [str(finding) for finding in findings(load_world(path))]
    assert len(found) == len(messages)
    for message in messages:
        assert any(message in text for text in found), found
