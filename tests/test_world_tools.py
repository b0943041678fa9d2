# SPDX-License-Identifier: BSD-3-Clause
"""check-world and export-world: what they find, and maps against a point-in-polygon oracle."""

import re
import sys
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import numpy as np
import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image
from shapely import affinity
from shapely import geometry as shapely

from kurumaisu.errors import Error
from kurumaisu.params import load_model, shipped
from kurumaisu.sim.robots.check_world import check_world
from kurumaisu.world import load_world
from kurumaisu.world.check import findings
from kurumaisu.world.cli import export_world
from kurumaisu.world.layout import beam_height
from kurumaisu.world.model import Ranger
from kurumaisu.world.occupancy import occupancy, rasterise

WORLDS = sorted(shipped("worlds/room.world").parent.glob("*.world"))
CELL = 0.05  # [m]


def ring(corners: np.ndarray) -> np.ndarray:
    return np.hstack([corners, np.roll(corners, -1, axis=0)])


def read(folder: Path, text: str):
    path = folder / "t.world"
    path.write_text(text)
    return load_world(path)


@settings(max_examples=40)
@given(
    st.tuples(*[st.floats(-3, 3)] * 2),
    st.tuples(*[st.floats(0.001, 0.6)] * 2),
    st.floats(-np.pi, np.pi),
)
def test_a_map_covers_a_box_and_no_cell_that_it_does_not_enter(middle, size, angle):
    solid = affinity.rotate(shapely.box(-size[0] / 2, -size[1] / 2, size[0] / 2, size[1] / 2), angle, (0, 0), True)
    solid = affinity.translate(solid, *middle)
    grid = rasterise([ring(np.array(solid.exterior.coords)[:-1])], solid.bounds, CELL, 2)
    for (row, column), value in np.ndenumerate(grid.cells):
        x, y = grid.x + column * CELL, grid.y + row * CELL
        overlap = shapely.box(x, y, x + CELL, y + CELL).intersection(solid).area / CELL**2
        # a corner's tip between two lines may be missed, never a real part of a cell
        assert overlap > 1e-9 if value else overlap < 0.26


def test_walls_along_the_axes_are_found_however_thin():
    thin = ring(np.array([[0.01, 0.512], [2.0, 0.512], [2.0, 0.5121], [0.01, 0.5121]]))
    grid = rasterise([thin], (0, 0, 2, 1), CELL, 0)
    assert (grid.cells == 100).sum() == 40
    assert (grid.cells[10] == 100).all()


def test_a_wall_that_ends_at_a_cell_does_not_enter_the_next():
    square = ring(np.array([[0.1, 0.1], [0.3, 0.1], [0.3, 0.3], [0.1, 0.3]]))
    assert (rasterise([square], (0, 0, 1, 1), 0.1, 0).cells == 100).sum() == 4


def test_a_bitmap_comes_back_as_itself(tmp_path):
    pixels = np.where(np.random.default_rng(3).random((30, 40)) < 0.3, 0, 255).astype(np.uint8)
    pixels[[0, -1]] = pixels[:, [0, -1]] = 0
    Image.fromarray(pixels).save(tmp_path / "map.png")
    world = read(tmp_path, 'model ( bitmap "map.png" size [4.0 3.0 1.0] pose [2.0 1.5 0 0] )')
    grid = occupancy(world, 0.1, 0.5)
    inner = grid.cells[4:-4, 4:-4]
    np.testing.assert_array_equal(inner[::-1] == 100, pixels == 0)


def test_a_map_cuts_at_its_height(tmp_path):
    world = read(tmp_path, "model ( size [1 1 0.3] )\nmodel ( pose [3 0 0 0] size [1 1 1] )")
    low, high = occupancy(world, 0.1, 0.2), occupancy(world, 0.1, 0.5)
    assert (low.cells == 100).sum() == 200
    assert (high.cells == 100).sum() == 100
    with pytest.raises(Error, match=r"t\.world: nothing is 2 m above"):
        occupancy(world, 0.1, 2.0)


def test_a_map_too_large_is_refused(tmp_path):
    world = read(tmp_path, "model ( size [30000 30000 1] )")
    with pytest.raises(Error, match="coarser"):
        occupancy(world, 0.05, 0.4)


ROBOT = "position ( %s size [0.4 0.4 0.2] velocity_bounds [-2 2 0 0 0 0 -90 90] %s )\n"
LASER = "ranger ( %s sensor ( range [0 8] fov 180 samples 181 ) )"
WALL = "model ( pose [3 0 0 0] size [0.2 4 %s] %s )\n"

SURPRISES = {
    "pass above all walls": (WALL % ("0.1", "") + ROBOT % ("", LASER % ""), "beam above the map"),
    "pass below all walls": ("model ( pose [3 0 1 0] size [0.2 4 1] )\n" + ROBOT % ("", LASER % ""), "beam below"),
    "5 mm thin": ("model ( pose [3 0 0 0] size [0.005 4 1] )\n" + ROBOT % ("", LASER % ""), "thin wall"),
    "touches something solid": (WALL % ("1", "") + ROBOT % ("pose [2.8 0 0 0]", LASER % ""), "robot in a wall"),
    "limited to 1 m/s": (WALL % ("1", "") + f"position ( size [0.4 0.4 0.2] {LASER % ''} )", "clamped speed"),
    "odom_error has no effect": (WALL % ("1", "") + ROBOT % ("odom_error [0.1 0 0 0]", LASER % ""), "gps"),
    "adds up only 20 %": (
        "interval_sim 20\n" + WALL % ("1", "") + ROBOT % ('localization "odom"', LASER % "update_interval 20"),
        "slow odometry",
    ),
    "the same scan is published again": (
        "interval_sim 20\n" + WALL % ("1", "") + ROBOT % ("update_interval 20", LASER % ""),
        "slow laser",
    ),
    "has no laser, but": (WALL % ("1", "") + ROBOT % ("", LASER % "") + ROBOT % ("pose [0 2 0 0]", ""), "sensorless"),
    "has the name r of the robot at": (
        WALL % ("1", "") + ROBOT % ('name "r"', LASER % "") + ROBOT % ('name "r" pose [0 2 0 0]', LASER % ""),
        "one name twice",
    ),
    "first one only": (
        WALL % ("1", "") + ROBOT % ("", "ranger ( sensor ( range [0 8] ) sensor ( range [0 8] ) )"),
        "ring",
    ),
    "first and the last beam": (
        WALL % ("1", "") + ROBOT % ("", "ranger ( sensor ( range [0 8] fov 360 samples 8 ) )"),
        "full circle",
    ),
    "lasers do not see it": (WALL % ("1", "ranger_return -1") + WALL % ("1", "") + ROBOT % ("", LASER % ""), "glass"),
    "drive through it": (WALL % ("1", "obstacle_return 0") + ROBOT % ("", LASER % ""), "ghost"),
    "stands inside": ("model ( size [5 5 1] stack_children 0 " + ROBOT % ("", LASER % "") + ")", "own tree"),
}


@pytest.mark.parametrize("message", SURPRISES, ids=lambda m: SURPRISES[m][1])
def test_says_what_will_surprise(tmp_path, message):
    found = findings(read(tmp_path, SURPRISES[message][0]))
    told = [str(finding) for finding in found if message in finding.words]
    assert len(told) == 1, found
    assert told[0].startswith(f"{tmp_path}/t.world:")


def checked(folder: Path, capsys, text: str, *options: str):
    (folder / "t.world").write_text(text)
    code = check_world([str(folder / "t.world"), *options])
    lines = capsys.readouterr().out.splitlines()
    return code, [line.removeprefix(f"{folder}/t.world:") for line in lines[lines.index("") + 1 :]]


def test_what_hurts_most_is_told_first_and_alike_things_once(tmp_path, capsys):
    text = 'semantics "physical" threads 2\n' + WALL % ("1", "lase_return 1")
    text += "".join(f'position ( name "r{i}" size [0.4 0.4 0.2] pose [0 {i} 0 0] {LASER % ""} )\n' for i in range(5))
    text += ROBOT % ('name "in_wall" pose [2.8 0 0 0]', LASER % "")
    code, lines = checked(tmp_path, capsys, text)
    assert code == 3
    assert lines == [
        "2 surprises:",
        "8:1: in_wall: touches something solid at its start",
        "2:39: lase_return is not a property of a model: ignored, as Stage does",
        "2 more with -v",
    ]
    code, more = checked(tmp_path, capsys, text, "-v")
    assert code == 3
    assert more[:3] == lines[:3]
    assert more[-2].startswith("3:1: r0 ... r4 (5): is limited to 1 m/s")
    assert more[-1] == "1:22: threads is accepted and has no effect here"


def test_what_most_worlds_have_is_no_surprise(tmp_path, capsys):
    text = "threads 2\nposition ( localization_origin [0 0 0 0] )\n"
    assert checked(tmp_path, capsys, text) == (0, ["no surprises", "3 more with -v"])  # and no walls
    assert checked(tmp_path, capsys, text, "-v")[0] == 0
    assert checked(tmp_path, capsys, "") == (0, ["no surprises"])


def test_an_unnamed_robot_and_one_of_its_name_are_twins(tmp_path):
    world = read(
        tmp_path, WALL % ("1", "") + ROBOT % ("", LASER % "") + ROBOT % ('name "robot_0" pose [0 2 0 0]', LASER % "")
    )
    (twin,) = findings(world)
    assert "has the name robot_0" in twin.words


def test_says_where_cells_matter(tmp_path, capsys):
    sides = "".join(f"model ( pose [4 {y} 0 0] size [12 0.3 1] )\n" for y in (-0.75, 0.75))
    coarse = "resolution 0.2\n" + sides + ROBOT % ("", LASER % "")  # a corridor, where most beams graze a wall
    code, lines = checked(tmp_path, capsys, coarse)
    assert code == 3
    assert re.fullmatch(
        r"1:1: lasers: from the start poses \d+ % of the beams .* 0\.4 m .*ray_casting: cells .*", lines[1]
    )
    assert checked(tmp_path, capsys, 'semantics "physical"\n' + coarse)[0] == 0
    assert checked(tmp_path, capsys, coarse.replace("0.2", "0.01", 1))[0] == 0


def test_says_nothing_of_a_world_without_surprises(tmp_path):
    assert findings(read(tmp_path, WALL % ("1", "") + ROBOT % ("", LASER % ""))) == ()


@pytest.mark.parametrize("path", WORLDS, ids=lambda path: path.stem)
def test_our_own_worlds_have_no_surprises(path, capsys):
    assert check_world([str(path)]) == 0, capsys.readouterr().out
    assert "no surprises" in capsys.readouterr().out


@pytest.mark.parametrize("path", WORLDS, ids=lambda path: path.stem)
def test_the_maps_that_ship_are_those_of_the_worlds(path, tmp_path):
    assert export_world([str(path), "-o", str(tmp_path), "--png"]) == 0
    ours = shipped(f"worlds/maps/{path.stem}.yaml")
    assert ours.read_text() == (tmp_path / ours.name).read_text()
    with Image.open(tmp_path / f"{path.stem}.png") as new, Image.open(ours.with_suffix(".png")) as old:
        np.testing.assert_array_equal(np.asarray(new), np.asarray(old))
    ElementTree.parse(tmp_path / f"{path.stem}.svg")


def test_a_shipped_map_is_a_world_again():
    world, again = load_world(shipped("worlds/room.world")), load_world(shipped("worlds/maps/room.yaml"))
    np.testing.assert_allclose(again.bounds, world.bounds, atol=1e-6)
    settings_ = yaml.safe_load(shipped("worlds/maps/room.yaml").read_text())
    assert settings_["resolution"] == pytest.approx(0.05)


def test_the_chair_of_the_worlds_is_the_one_of_the_model_file():
    model, world = load_model(shipped("launch/md100.yaml")), load_world(shipped("worlds/room.world"))
    chair = next(m for m in world.models if m.type == "position")
    corners = chair.shape.segments.reshape(-1, 2)
    chassis = model.chassis
    np.testing.assert_allclose(corners.max(axis=0), [chassis.axle_to_front, chassis.width / 2], atol=1e-9)
    np.testing.assert_allclose(corners.min(axis=0)[0], chassis.axle_to_front - chassis.length, atol=1e-9)
    assert chair.size[2] == chassis.height
    assert chair.mass == chassis.mass
    ranger = next(m for m in world.models if isinstance(m.device, Ranger))
    fan, laser = ranger.device.fans[0], model.laser
    assert (fan.samples, fan.range_min, fan.range_max) == (laser.beams, laser.range_min, laser.range_max)
    assert beam_height(ranger, world.poses[ranger.index], fan) == pytest.approx(laser.mount.z)
    first, last = ranger.pose[3] - fan.fov / 2, ranger.pose[3] + fan.fov / 2
    np.testing.assert_allclose([first, last], laser.mount.yaw + laser.bearings[[0, -1]], atol=2e-5)
    np.testing.assert_allclose(ranger.pose[:2], [laser.mount.x, laser.mount.y])


def test_a_bad_world_is_said_with_its_place(tmp_path, capsys):
    path = tmp_path / "bad.world"
    path.write_text("model ( size [1 2\n 3] )\n")
    assert check_world([str(path)]) == 1
    assert f"{path}:1:" in capsys.readouterr().err
    assert export_world([str(path)]) == 1
    with pytest.raises(SystemExit, match="2"):
        check_world([str(path), "speed"])
    assert "NAME=VALUE" in capsys.readouterr().err


@pytest.mark.parametrize(("option", "code"), [("--resolution=0", 2), ("--resolution=nan", 2), ("--height=99", 1)])
def test_export_refuses_what_makes_no_map(tmp_path, option, code, capsys):
    with pytest.raises(SystemExit, match=str(code)):  # argparse's way, and what the script does
        sys.exit(export_world([str(shipped("worlds/room.world")), "-o", str(tmp_path), option]))
    assert "export-world: " in capsys.readouterr().err


def test_the_manuals_examples_are_worlds_without_surprises(tmp_path):
    manual = Path(__file__).resolve().parents[1] / "docs/worlds.md"
    text = manual.read_text().split("## In motion")[1].split("\n## ")[0]
    examples = re.findall(r"(?:^    .*\n)+", text, re.MULTILINE)
    assert len(examples) == 5
    for example in examples:
        world = read(tmp_path, example)
        assert world.warnings == ()
        assert findings(world) == ()
