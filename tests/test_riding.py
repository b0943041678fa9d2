# SPDX-License-Identifier: BSD-3-Clause
"""Robots on robots in physical semantics: they keep their places on what carries them, blocked or not."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from physics_scene import DYNAMICS
from sim_worlds import OPTIONS, simulator

from kurumaisu.geometry import relative
from kurumaisu.sim import Simulator
from kurumaisu.sim.robots.machinery import Machinery
from kurumaisu.sim.robots.population import Population
from kurumaisu.types import FloatArray
from kurumaisu.world import load_world

WALL = 'model ( name "far" pose [30 0 0 0] size [0.1 60 2] )\n'
BOUNDS = "velocity_bounds [-2 2 0 0 0 0 -180 180]"
LAST = f"position ( pose [0.05 0.05 0 -90] size [0.2 0.2 0.2] {BOUNDS} mass 5 )"
RIDER = f"position ( pose [0.3 0.1 0 30] size [0.4 0.3 0.2] {BOUNDS} mass 20 %s )"
CARRIER = f"position ( pose [0 0 0 0] size [1.2 1 0.3] {BOUNDS} mass 80 {RIDER} )\n"


def stack(folder: Path, more: str = "", inside: str = "") -> Simulator:
    return simulator(folder, WALL + CARRIER % inside + more, semantics="physical")


def seen(poses: FloatArray, row: int, below: int) -> FloatArray:
    place = relative(poses[below], poses[row])
    place[3] = np.remainder(place[3] + np.pi, 2 * np.pi) - np.pi
    return place


rate = st.floats(-1.5, 1.5)


@settings(max_examples=10, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(v=rate, w=rate)
def test_all_that_stand_on_a_robot_keep_their_places(tmp_path: Path, v: float, w: float) -> None:
    sim = stack(tmp_path, inside=LAST)
    start = sim.observe().poses
    for _ in range(30):
        poses = sim.step(np.array([[v, 0, w], [0, 0, 0], [0, 0, 0]])).poses
    for row, below in ((1, 0), (2, 1)):
        np.testing.assert_allclose(seen(poses, row, below), seen(start, row, below), atol=1e-9)
    assert np.hypot(*(poses[0, :2] - start[0, :2])) > 0 or abs(v) < 1e-9


def test_a_rider_drives_on_its_carrier(tmp_path: Path) -> None:
    """0.2 m along its own heading of 30 degrees, whatever the carrier does meanwhile."""
    sim = stack(tmp_path)
    for _ in range(10):
        poses = sim.step(np.array([[0.7, 0, 0.5], [0.2, 0, 0]])).poses
    expected = [0.3 + 0.2 * np.cos(np.pi / 6), 0.1 + 0.2 * np.sin(np.pi / 6), 0.3, np.pi / 6]
    np.testing.assert_allclose(seen(poses, 1, 0), expected, atol=1e-9)


def test_what_stops_the_carrier_stops_its_rider(tmp_path: Path) -> None:
    sim = stack(tmp_path, "model ( pose [1.65 0 0 0] size [0.1 4 0.2] )\n")  # lower than the rider
    start = sim.observe().poses
    for _ in range(40):
        observed = sim.step(np.array([[0.8, 0, 0], [0, 0, 0]]))
    assert observed.stalled[0]
    assert observed.poses[0, 0] == pytest.approx(1.0, abs=0.005)
    np.testing.assert_allclose(seen(observed.poses, 1, 0), seen(start, 1, 0), atol=1e-9)


def test_a_rider_that_meets_something_slides_on_its_carrier(tmp_path: Path) -> None:
    sim = stack(tmp_path, "model ( pose [1.65 0 0.3 0] size [0.1 4 0.2] )\n")  # the carrier passes under it
    for _ in range(40):
        observed = sim.step(np.array([[0.5, 0, 0], [0, 0, 0]]))
    assert observed.poses[0, 0] == pytest.approx(2.0, abs=1e-6)
    corners = np.array([(x, y) for x in (-0.2, 0.2) for y in (-0.15, 0.15)])
    heading = observed.poses[1, 3]
    front = (corners @ np.array([np.cos(heading), -np.sin(heading)])).max() + observed.poses[1, 0]
    assert front == pytest.approx(1.6, abs=0.005)


def test_a_robot_on_something_that_is_pushed_goes_along(tmp_path: Path) -> None:
    platform = (
        f"model ( pose [2 0 0 0] size [1 1 0.3] mass 10 position ( pose [0 0.2 0 90] size [0.3 0.3 0.3] {BOUNDS} ) )"
    )
    pusher = f"\nposition ( pose [0 0 0 0] size [1 0.6 0.3] mass 100 {BOUNDS} )\n"
    sim = simulator(tmp_path, WALL + platform + pusher, semantics="physical")
    start = sim.model_poses
    for _ in range(40):
        sim.step(np.array([[0, 0, 0], [0.5, 0, 0]]))
    poses = sim.model_poses
    assert poses[1, 0] > 2.8
    np.testing.assert_allclose(seen(poses, 2, 1), seen(start, 2, 1), atol=1e-9)


def test_riders_keep_their_places_where_wheels_slip(tmp_path: Path) -> None:
    path = tmp_path / "t.world"
    path.write_text(WALL + CARRIER % LAST)
    world = load_world(path)
    machinery = Machinery(Population.first(world.models, world.poses), OPTIONS, 0.1, replace(DYNAMICS, slip=True))
    start = machinery.robot_poses
    machinery.drive.velocities[0] = 1.5, 0.0, 1.0
    for _ in range(20):
        machinery.move()
    assert np.hypot(*machinery.robot_poses[0, :2]) > 1
    for row, below in ((1, 0), (2, 1)):
        np.testing.assert_allclose(seen(machinery.robot_poses, row, below), seen(start, row, below), atol=1e-9)


def test_states_of_stacks_go_on_bit_for_bit(tmp_path: Path) -> None:
    sim = stack(tmp_path, "model ( pose [1.65 0 0 0] size [0.1 4 0.2] )\n")
    command = np.array([[0.8, 0, 0.2], [0.1, 0, 0]])
    for _ in range(12):
        sim.step(command)
    saved = sim.save()
    hashes = []
    for _ in range(2):
        sim.load(saved)
        for _ in range(12):
            sim.step(command)
        hashes.append(sim.state_hash())
    assert hashes[0] == hashes[1]
