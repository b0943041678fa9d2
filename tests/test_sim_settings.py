# SPDX-License-Identifier: BSD-3-Clause
"""The parameters of sim_node that choose the world: maps, start poses, values, sensors."""

from pathlib import Path

import numpy as np
import pytest
import yaml

from kurumaisu.errors import Error
from kurumaisu.params import shipped
from kurumaisu.ros.sim.settings import SimSettings, read_settings, start_outside
from kurumaisu.sim.chair.simulator import NEUTRAL, ChairSimulator

CHOSEN = {
    "seed": 1,
    "speed": 1.0,
    "effects": "none",
    "sensors": "none",
    "image_extents": False,
    "base_frame": "base_link",
}
LASER = {"laser": "direct", "laser_port": "urg", "laser_faults": "none"}
WORLD = {"world": shipped("worlds/room.world"), "world_values": "none", "start": "none"}


def settings(**changes: object) -> SimSettings:
    values = yaml.safe_load(shipped("launch/sim_node.yaml").read_text()) | CHOSEN | WORLD
    values |= LASER | {"laser_sensor": shipped("launch/urg/urg_04lx.yaml")}
    values |= {"dynamics": shipped("launch/physical.yaml"), "model": shipped("launch/md100.yaml")} | changes
    return read_settings({key: str(v) if isinstance(v, Path) else v for key, v in values.items()}, "/sim_node")


def test_a_map_is_a_world_with_a_start() -> None:
    chosen = settings(world=shipped("worlds/maps/room.yaml"), start="1.5 2.0 0.5")
    simulator = ChairSimulator(chosen.model, chosen.world, chosen.dynamics)
    np.testing.assert_array_equal(simulator.reset(1).pose, [1.5, 2.0, 0.5])
    scans = [o.scan for o in (simulator.step(NEUTRAL) for _ in range(10)) if o.scan is not None]
    same = ChairSimulator(chosen.model, settings(start="1.5 2.0 0.5").world, chosen.dynamics)
    same.reset(1)
    truth = [o.scan for o in (same.step(NEUTRAL) for _ in range(10)) if o.scan is not None]
    both = np.isfinite(scans[0].ranges) & np.isfinite(truth[0].ranges)
    assert np.median(np.abs(scans[0].ranges[both] - truth[0].ranges[both])) < 0.05  # a cell of the map


def test_a_map_without_a_start_is_refused() -> None:
    chosen = settings(world=shipped("worlds/maps/room.yaml"))
    with pytest.raises(Error, match=r"room\.yaml: has no position model"):
        ChairSimulator(chosen.model, chosen.world, chosen.dynamics)


@pytest.mark.parametrize("start", ["1 2", "1 2 x", "1 2 nan", "1 2 3 4"])
def test_a_bad_start_is_refused(start: str) -> None:
    with pytest.raises(Error, match=r"/sim_node: start: must be x y yaw"):
        settings(start=start)


def test_a_start_outside_of_the_walls_is_said() -> None:
    assert start_outside(settings(start="1.5 2.0 0.5").world) == ""
    assert start_outside(settings().world) == ""
    words = start_outside(settings(start="50 2 0").world)
    assert words.startswith("start: x 50, y 2 m lies outside of the walls of ")
    assert "room.world, which reach from x " in words


def test_values_of_the_world(tmp_path: Path) -> None:
    world = tmp_path / "t.world"
    world.write_text("model ( size [${width} 1 1] )\nposition ( pose [${x=-9} 0 0 0] )")
    chosen = settings(world=world, world_values="width=3 x=-5").world
    assert chosen.bounds == (-1.5, -0.5, 1.5, 0.5)
    assert chosen.start[0] == -5
    with pytest.raises(Error, match="width"):
        settings(world=world)
    with pytest.raises(Error, match="'width': a parameter is given as NAME=VALUE"):
        settings(world=world, world_values="width 3")


def test_sensors_and_flags() -> None:
    assert settings().sensors == ()
    assert len(settings(sensors=shipped("launch/sensors.yaml")).sensors) == 6
    with pytest.raises(Error, match="image_extents: must be true or false: 'no'"):
        settings(image_extents="no")


def test_the_scan_goes_through_a_driver_where_that_is_chosen() -> None:
    assert settings().driver is None
    driver = settings(laser="driver", laser_faults="corrupt@5 dup@7").driver
    assert driver is not None
    assert driver.faults == ("corrupt@5", "dup@7")
    with pytest.raises(Error, match="/sim_node: laser: must be one of direct, driver: 'drivr'"):
        settings(laser="drivr")
