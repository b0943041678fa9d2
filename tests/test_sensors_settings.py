# SPDX-License-Identifier: BSD-3-Clause
"""launch/sensors.yaml: what ships loads; whatever is left out, misspelt or senseless is named."""

import copy
from typing import Any

import numpy as np
import pytest
import yaml

from kurumaisu.errors import Error
from kurumaisu.params import load_model, shipped
from kurumaisu.settings import Section
from kurumaisu.sim.sensors.battery import BatterySettings
from kurumaisu.sim.sensors.settings import load_sensors, read_sensors

FILE = shipped("launch/sensors.yaml")
SHIPPED = yaml.safe_load(FILE.read_text(encoding="utf-8"))


def paths(node: Any, path: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    """Every key of the tree."""
    items = node.items() if isinstance(node, dict) else enumerate(node) if isinstance(node, list) else ()
    return [
        found
        for key, value in items
        for found in ([(*path, key)] if isinstance(key, str) else []) + paths(value, (*path, key))
    ]


def at(node: Any, path: tuple[Any, ...]) -> Any:
    for key in path:
        node = node[key]
    return node


def test_what_ships_is_one_of_each() -> None:
    sensors = load_sensors(FILE)
    assert [sensor.name for sensor in sensors] == ["imu", "battery", "sonar", "bumper", "camera", "fiducial"]
    assert len({type(sensor.parameters) for sensor in sensors}) == 6


def test_the_battery_carries_the_chair() -> None:
    battery = next(s.parameters for s in load_sensors(FILE) if isinstance(s.parameters, BatterySettings))
    chassis = load_model(shipped("launch/md100.yaml")).chassis
    assert battery.load.mass == chassis.mass
    assert battery.load.inertia == pytest.approx(chassis.mass * (chassis.length**2 + chassis.width**2) / 12, rel=0.01)


@pytest.mark.parametrize("path", paths(SHIPPED), ids=lambda path: ".".join(map(str, path)))
def test_every_key_is_required_and_every_other_is_refused(path: tuple[Any, ...]) -> None:
    values = copy.deepcopy(SHIPPED)
    parent = at(values, path[:-1])
    value = parent.pop(path[-1])
    with pytest.raises(Error, match=rf"sensors\.yaml.*{path[-1]}: is missing"):
        read_sensors(Section(values, "sensors.yaml"))
    parent = at(values := copy.deepcopy(SHIPPED), path[:-1])
    parent[f"{path[-1]}_"] = value
    with pytest.raises(Error, match=rf"{path[-1]}_: is not a known key"):
        read_sensors(Section(values, "sensors.yaml"))


@pytest.mark.parametrize(
    ("path", "value", "message"),
    [
        ((0, "type"), "wifi", "must be one of"),
        ((0, "rate"), 0.0, "above 0"),
        ((0, "parameters", "gyroscope", "noise_density"), -1.0, "at least 0"),
        ((0, "parameters", "gyroscope", "correlation_time"), 0.0, "above 0"),
        ((0, "parameters", "gyroscope", "limit"), float("nan"), "finite"),
        ((0, "parameters", "heading"), "compass", "must be one of"),
        ((0, "mount", "x"), "left", "must be a number"),
        ((1, "parameters", "charge"), 1.1, "must not exceed 1"),
        ((1, "parameters", "load", "efficiency"), 0.0, "above 0"),
        ((1, "parameters", "curve"), [{"charge": 0.0, "voltage": 24.0}], "must rise"),
        ((1, "parameters", "curve", 1, "voltage"), 30.0, "must rise"),
        ((2, "parameters", "mounts"), [], "one sonar at least"),
        ((2, "parameters", "rays"), 0, "of 1 to 10000"),
        ((2, "parameters", "range_min"), 5.0, "must be less than range_max"),
        ((2, "parameters", "field_of_view"), 7.0, "must not exceed"),
        ((3, "parameters", "strips", 0, "length"), 0.0, "above 0"),
        ((4, "parameters", "width"), 100_000, "10 million pixels"),
        ((4, "parameters", "far"), 0.1, "near < far"),
        ((4, "parameters", "tilt"), 2.0, "tilt"),
        ((4, "name"), "imu", "taken by another"),
        ((5, "parameters", "key"), 0.5, "must be an integer"),
    ],
)
def test_senseless_values(path: tuple[Any, ...], value: Any, message: str) -> None:
    values = copy.deepcopy(SHIPPED)
    at(values["sensors"], path[:-1])[path[-1]] = value
    with pytest.raises(Error, match=rf"sensors\.yaml: sensors\[{path[0]}\].*{message}"):
        read_sensors(Section(values, "sensors.yaml"))


def test_names_may_be_equal_on_different_robots() -> None:
    values = {"sensors": [{**copy.deepcopy(SHIPPED["sensors"][0]), "robot": robot} for robot in ("a", "b")]}
    assert [sensor.robot for sensor in read_sensors(Section(values, "file"))] == ["a", "b"]
    values["sensors"][1]["robot"] = "every"
    with pytest.raises(Error, match="taken"):
        read_sensors(Section(values, "file"))


def test_places_of_a_ring_are_relative_to_its_mount() -> None:
    values = {"sensors": [copy.deepcopy(SHIPPED["sensors"][2])]}
    values["sensors"][0]["mount"] = {"x": 1.0, "y": 0.0, "z": 0.5, "yaw": np.pi / 2}
    mounts = read_sensors(Section(values, "file"))[0].parameters.mounts
    np.testing.assert_allclose(mounts[0], [1.0 - 0.2, -0.3, 0.5, np.pi / 2 + 3.1416])


def test_no_sensors() -> None:
    assert read_sensors(Section({"sensors": []}, "file")) == ()
