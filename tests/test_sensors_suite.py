# SPDX-License-Identifier: BSD-3-Clause
"""All shipped sensors together in a shipped world: rates, robots, determinism, saved states."""

import copy
from collections import Counter
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from sensing import BruteRays

from kurumaisu.errors import Error
from kurumaisu.params import shipped
from kurumaisu.sim.sensors.settings import SensorSettings, load_sensors
from kurumaisu.sim.sensors.suite import Moment, Reading, SensorSuite
from kurumaisu.world import load_world

WORLD = load_world(shipped("worlds/building.world"))
SENSORS = load_sensors(shipped("launch/sensors.yaml"))
WALLS = np.concatenate(
    [
        np.hstack([m.shape.segments + np.tile(pose[:2], 2), m.shape.heights])
        for m, pose in zip(WORLD.models, WORLD.poses, strict=True)
        if m.device is None
    ]
)  # as if none were turned: something to see is enough here
CHAIR = next(m.index for m in WORLD.models if m.device is not None)


def moment(time: float) -> Moment:
    rays = BruteRays(WALLS)
    poses = WORLD.poses.copy()
    poses[CHAIR, :2] += [0.5 * time, 0.1]
    return Moment(time, rays, rays, poses, np.array([[0.5, 0.0, 0.1 * time]]))


def suite(seed: int, sensors: tuple[SensorSettings, ...] = SENSORS) -> SensorSuite:
    return SensorSuite(sensors, WORLD.models, moment(0.0), np.random.default_rng(seed))


def run(sensors: SensorSuite, first: int, last: int) -> list[Reading]:
    return [reading for step in range(first, last + 1) for reading in sensors.read(moment(step * 0.01))]


def flat(value: Any) -> list[Any]:
    """All numbers of a reading."""
    if isinstance(value, tuple):
        return [part for item in value for part in flat(item)]
    if isinstance(value, np.ndarray):
        return [value.tobytes()]
    return [part for item in vars(value).values() for part in flat(item)] if value is not None else []


def numbers(readings: list[Reading]) -> list[Any]:
    return [(reading.sensor.name, flat(reading.value)) for reading in readings]


def test_every_sensor_keeps_its_rate() -> None:
    count = Counter(reading.sensor.name for reading in run(suite(1), 1, 200))
    assert count == {"imu": 100, "battery": 2, "sonar": 20, "bumper": 100, "camera": 20, "fiducial": 20}


def test_shapes_and_sense() -> None:
    last = {reading.sensor.name: reading.value for reading in run(suite(1), 1, 100)}
    assert last["imu"].acceleration.shape == (1, 3)
    assert last["sonar"].shape == (1, 2)
    assert last["bumper"].tolist() == [[False, False]]
    assert 0.99 < last["battery"].percentage[0] < 1
    (picture,) = last["camera"]
    assert picture.rgba.shape == (240, 320, 4)
    assert np.isfinite(picture.depth).mean() > 0.5
    assert len(last["fiducial"].id) == 0


def test_one_seed_one_run() -> None:
    assert numbers(run(suite(7), 1, 30)) == numbers(run(suite(7), 1, 30))
    assert numbers(run(suite(7), 1, 30)) != numbers(run(suite(8), 1, 30))


def test_a_deep_copy_is_a_saved_state() -> None:
    one = suite(3)
    run(one, 1, 40)
    other = copy.deepcopy(one)
    rest = numbers(run(one, 41, 110))
    assert numbers(run(other, 41, 110)) == rest


def test_the_rate_of_one_does_not_change_the_noise_of_another() -> None:
    faster = tuple(replace(s, rate=100.0) if s.name == "sonar" else s for s in SENSORS)
    imus = [
        [entry for entry in numbers(run(suite(5, sensors), 1, 30)) if entry[0] == "imu"]
        for sensors in (SENSORS, faster)
    ]
    assert imus[0] == imus[1]


def test_robots_by_name() -> None:
    by_name = suite(1, (replace(SENSORS[0], robot="chair"),))
    assert numbers(run(by_name, 1, 2)) == numbers(run(suite(1, SENSORS[:1]), 1, 2))
    with pytest.raises(Error, match="sensor imu: robot: the world has no position of this name: tank"):
        suite(1, (replace(SENSORS[0], robot="tank"),))
