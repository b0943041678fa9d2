# SPDX-License-Identifier: BSD-3-Clause
"""The tree of models: poses, defaults, devices, bodies, colours and what is warned of."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from kurumaisu.world import World, load_world
from kurumaisu.world.colors import named
from kurumaisu.world.model import Bumper, Camera, Fan, Fiducial, Gripper, Position, Ranger


def read(folder: Path, text: str) -> World:
    path = folder / "t.world"
    path.write_text(text)
    return load_world(path)


def test_children_stand_on_top(tmp_path: Path) -> None:
    text = """position ( pose [1 2 0.5 90] size [1 1 0.3] origin [9 9 9 9]
      ranger ( pose [0.1 0.2 0.05 10] model ( pose [1 0 0 0] ) )
      model ( stack_children 0 model ( pose [0 0 0.01 0] ) ) )
    model ( pose [0 0 0 450] )"""
    world = read(tmp_path, text)
    expected = [
        [1, 2, 0.5, 90],
        [0.8, 2.1, 0.85, 100],
        [0.8 - np.sin(np.deg2rad(10)), 2.1 + np.cos(np.deg2rad(10)), 1.05, 100],  # rangers are 0.2 m high
        [1, 2, 0.8, 90],
        [1, 2, 0.81, 90],
        [0, 0, 0, 90],
    ]
    poses = world.poses.copy()
    poses[:, 3] = np.rad2deg(poses[:, 3])
    np.testing.assert_allclose(poses, expected, atol=1e-9)
    assert [model.parent for model in world.models] == [-1, 0, 1, 0, 3, -1]
    assert [model.root for model in world.models] == [0, 0, 0, 0, 0, 5]
    assert [model.index for model in world.models] == list(range(6))


@given(st.lists(st.tuples(*[st.floats(-9, 9)] * 3, st.floats(-400, 400)), min_size=1, max_size=6))
def test_poses_compose_as_matrices(tmp_path_factory: pytest.TempPathFactory, poses: list[tuple[float, ...]]) -> None:
    text = "".join(f"model ( size [1 1 0.25] pose [{x:.9f} {y:.9f} {z:.9f} {a:.9f}]\n" for x, y, z, a in poses)
    world = read(tmp_path_factory.getbasetemp(), text + ")" * len(poses))
    matrix, height = np.eye(3), -0.25
    for (x, y, z, degrees), pose in zip(poses, world.poses, strict=True):
        a = np.deg2rad(degrees)
        matrix = matrix @ [[np.cos(a), -np.sin(a), x], [np.sin(a), np.cos(a), y], [0, 0, 1]]
        height += z + 0.25
        np.testing.assert_allclose(pose[:3], [matrix[0, 2], matrix[1, 2], height], atol=1e-6)
        np.testing.assert_allclose([np.cos(pose[3]), np.sin(pose[3])], matrix[:2, 0], atol=1e-6)


def test_stages_defaults(tmp_path: Path) -> None:
    types = "position ranger camera fiducial bumper gripper blobfinder actuator blinkenlight lightindicator model"
    world = read(tmp_path, " ".join(f"{kind} ( )" for kind in types.split()))
    assert (world.resolution, world.interval, world.quit_time, world.speedup) == (0.02, 0.1, 0, 1)
    base, ranger, camera, fiducial, bumper, gripper, *rest = world.models
    assert isinstance(base.device, Position)
    assert (base.device.drive, base.device.localization, base.device.wheelbase) == ("diff", "gps", 1)
    half = np.pi / 2
    np.testing.assert_allclose(base.device.velocity_bounds, [[-1, 1]] * 3 + [[-half, half]])
    assert base.device.odom_error is base.device.localization_origin is base.device.acceleration_bounds is None
    assert (base.mass, base.friction, base.update_interval, base.hinge) == (0, None, 0.1, None)
    assert (base.ranger_return, base.obstacle_return, base.stack_children) == (1, True, True)
    assert (base.fiducial_return, base.fiducial_key, base.gripper_return, base.name) == (0, 0, False, None)
    assert ranger.device == Ranger(())
    assert camera.device == Camera(32, 32, np.deg2rad(70), np.deg2rad(40), 0.2, 8, 0, 0)
    assert fiducial.device == Fiducial(0, 8, 5, np.pi, False, 0)
    assert isinstance(bumper.device, Bumper)
    assert len(bumper.device.poses) == 0
    assert isinstance(gripper.device, Gripper)
    np.testing.assert_allclose(gripper.device.paddle_size, [0.66, 0.1, 0.4])
    assert (gripper.device.open, gripper.device.autosnatch) == (True, False)
    sizes = [model.size.tolist() for model in world.models]
    assert sizes[:6] == [[0.4, 0.4, 1], [0.15, 0.15, 0.2], [0.1, 0.07, 0.05], [0, 0, 0], [0.4, 0.4, 1], [0.2, 0.3, 0.2]]
    bodies = [len(model.shape.segments) for model in world.models]
    assert bodies == [4, 0, 4, 0, 4, 12, 0, 4, 4, 4, 4]  # a gripper is a box and two paddles
    assert all(model.device is None for model in rest)
    fan = read(tmp_path, "ranger ( sensor ( ) )").models[0].device
    assert isinstance(fan, Ranger)
    (fan,) = fan.fans
    assert isinstance(fan, Fan)
    assert (fan.range_min, fan.range_max, fan.fov, fan.samples, fan.height) == (0, 5, pytest.approx(0.1), 1, 0.02)


def test_position_and_ranger(tmp_path: Path) -> None:
    text = """position ( drive "car" localization "odom" localization_origin [1 2 3 90] odom_error [0.1 0.2 0.3 90]
      velocity_bounds [-1 2 -3 4 -5 6 -90 180] acceleration_bounds [-1 1 -1 1 -1 1 -90 90] wheelbase 0.6
      velocity [1 2 3 90] mass 20 friction 0.5 update_interval 40
      ranger ( sensor ( pose [0.1 0.2 0.3 90] size [1 1 0.4] range [0.5 30] fov 180 samples 361 noise [0.01 0.02 90] )
        sensor ( samples 3.9 ) ) )"""
    base, ranger = read(tmp_path, text).models
    half = np.pi / 2
    assert isinstance(base.device, Position)
    assert (base.device.drive, base.device.localization, base.device.wheelbase) == ("car", "odom", 0.6)
    np.testing.assert_allclose(base.device.localization_origin, [1, 2, 3, half])
    np.testing.assert_allclose(base.device.odom_error, [0.1, 0.2, 0.3, half])
    np.testing.assert_allclose(base.device.velocity, [1, 2, 3, half])
    np.testing.assert_allclose(base.device.velocity_bounds, [[-1, 2], [-3, 4], [-5, 6], [-half, np.pi]])
    assert base.device.acceleration_bounds is not None
    assert (base.mass, base.friction, base.update_interval) == (20, 0.5, 0.04)
    assert isinstance(ranger.device, Ranger)
    first, second = ranger.device.fans
    np.testing.assert_allclose(first.pose, [0.1, 0.2, 0.3, half])
    np.testing.assert_allclose(first.noise, [0.01, 0.02, half])
    assert (first.height, first.range_min, first.range_max, first.samples) == (0.4, 0.5, 30, 361)
    assert second.samples == 3
    assert second.place.line == 5


@pytest.mark.parametrize(
    ("heights", "expected"),
    [
        (["[0 2]", "[1 3]"], [[0, 2], [1, 3]]),  # scaled by 3 to 3
        (["[0 1]", "[1 3]"], [[0, 1], [1, 3]]),
        (["[1 2]", "[2 4]"], [[1, 2], [2, 4]]),  # the lowest is not moved to 0
        (["[0 1]", "[0 1]"], [[0, 3], [0, 3]]),
        (["[-1 0]", "[0 0.5]"], [[-2, 0], [0, 1]]),
    ],
)
def test_heights_of_blocks(tmp_path: Path, heights: list[str], expected: list[list[float]]) -> None:
    points = "points 3\npoint[0] [0 0]\npoint[1] [0 1]\npoint[2] [1 0]"
    text = "".join(f"block ( {points} z {height} )\n" for height in heights)
    (model,) = read(tmp_path, f"model ( size [2 2 3] origin [0 0 10 0] color_rgba [0 1 0 0.5] {text} )").models
    np.testing.assert_allclose([polygon.heights for polygon in model.shape.polygons], np.add(expected, 10))
    np.testing.assert_allclose(model.shape.polygons[0].corners, [[1, -1], [-1, 1], [-1, -1]])  # counter-clockwise
    assert model.shape.polygons[0].color == (0, 1, 0, 0.5)
    np.testing.assert_allclose(model.shape.heights[::3], np.add(expected, 10))


def test_bodies(tmp_path: Path) -> None:
    block = "block ( points 3\npoint[0] [0 0]\npoint[1] [0 1]\npoint[2] [1 0]\nz [0 1] )"
    text = f"""model ( noblocks 1 ) ranger ( {block} ) model ( boundary 1 {block} ) model ( boundary 1 noblocks 1 )
    model ( block ( ) ) gripper ( paddle_size [0.5 0.2 0.4] paddle_state ["closed" "down"] ) fiducial ( boundary 1 )
    model ( size [0 2 1] ) model ( size [1 1 0] )
    """
    world = read(tmp_path, text)
    shapes = [model.shape for model in world.models]
    assert [len(shape.segments) for shape in shapes] == [0, 3, 3, 8, 0, 12, 4, 4, 4]
    assert [len(shape.polygons) for shape in shapes] == [0, 1, 1, 4, 0, 3, 4, 1, 1]
    paddle = shapes[5].polygons[1]
    np.testing.assert_allclose(paddle.corners[:2], [[0, -0.06], [0.1, -0.06]])  # closed: they meet in the middle
    np.testing.assert_allclose(paddle.heights, [0, 0.08])
    assert np.ptp(shapes[7].segments[:, [0, 2]]) == 0
    assert (shapes[8].heights == 0).all()
    assert sum("a size of 0" in warning for warning in world.warnings) == 2


def test_hinge(tmp_path: Path) -> None:
    hinge = read(tmp_path, "model ( hinge [0.4 0 -90 30] )").models[0].hinge
    assert hinge is not None
    np.testing.assert_allclose([*hinge.anchor, hinge.lowest, hinge.highest], [0.4, 0, -np.pi / 2, np.pi / 6])
    stiff = read(tmp_path, "model ( hinge [0.4 0 30 30] )").models[0].hinge
    assert stiff is not None
    assert stiff.lowest == stiff.highest


@pytest.mark.parametrize(
    ("name", "colour"),
    [
        ("red", (255, 0, 0)),
        ("green", (0, 255, 0)),  # not CSS' dark one
        ("gray", (190, 190, 190)),
        ("gray30", (77, 77, 77)),
        ("grey80", (204, 204, 204)),
        ("DarkSlateGray", (47, 79, 79)),
        ("dark slate gray", (47, 79, 79)),
        ("PaleGreen3", (124, 205, 124)),
        ("red1", (255, 0, 0)),
        ("hotpink3", (205, 96, 144)),
        ("gray101", None),
        ("greenblue", None),
        ("5", None),
        ("1", None),
        ("", None),
    ],
)
def test_colours_are_those_of_x11(name: str, colour: tuple[int, int, int] | None) -> None:
    found = named(name)
    assert (found and tuple(round(part * 255) for part in found)) == colour


def test_colours_of_models(tmp_path: Path) -> None:
    text = 'model ( color "blue" color_rgba [1 1 1 1] ) model ( color_rgba [0.1 0.2 0.3 4] ) model ( color "mud" )'
    text += ' model ( color "random" ) model ( color "random" ) model ( )'
    world = read(tmp_path, text)
    colours = [model.color for model in world.models]
    assert colours[:3] == [(0, 0, 1, 1), (0.1, 0.2, 0.3, 1), (1, 0, 0, 1)]
    assert colours[3] != colours[4]
    assert colours == [model.color for model in read(tmp_path, text).models]
    assert world.warnings == (f"{tmp_path}/t.world:1:90: unknown color 'mud': red is used, as in Stage",)


def test_what_is_warned_of(tmp_path: Path) -> None:
    text = """threads 4 interval_real 100
    model ( laser_return 1 gui_nose 1 colour 3 ctrl "wander" driver 3 )
    model ( laser_return 1 colour 3 ctrl "wander" )
    position ( driver 3 drive "tank" localization "gps" odom [1 1 1 1] )
    ranger ( sensor ( range_max 30 range_min 1 update_interval 3 color "red" ) range_max 5 )
    blobfinder ( ) window ( anything 3 ) sensor1 5
    """
    warnings = [warning.split("t.world:")[1] for warning in read(tmp_path, text).warnings]
    assert sorted(warnings) == sorted(
        [
            "1:1: threads is accepted and has no effect here",
            "6:42: sensor1 is not a property of the world: ignored, as Stage does",
            "2:13: laser_return has no effect: Stage 4 uses ranger_return instead",
            "2:39: colour is not a property of a model: ignored, as Stage does",
            "2:48: ctrl is accepted and has no effect here",
            "2:62: driver is not a property of a model: ignored, as Stage does",
            "4:57: odom has no effect: Stage 4 uses localization_origin instead",
            "5:80: range_max is not a property of a ranger: ignored, as Stage does",
            "5:23: range_max has no effect: Stage 4 uses range [MIN MAX] instead",
            "5:36: range_min has no effect: Stage 4 uses range [MIN MAX] instead",
            "5:48: update_interval has no effect: Stage 4 uses that of the ranger",
            "6:5: blobfinder: only its body is simulated here",
            "4:25: drive must be one of diff, omni, car, not 'tank': diff is used",
        ]
    )


def test_what_is_in_no_model_stands_on_the_ground(tmp_path: Path) -> None:
    world = read(tmp_path, "position ( pose [5 5 0 0] block ( points 3 model ( pose [1 1 0 0] ) ) )")
    assert [model.parent for model in world.models] == [-1, -1]
    np.testing.assert_allclose(world.poses[1], [1, 1, 0, 0])
    assert "stands on the ground" in world.warnings[0]


def test_for_a_chair_positions_are_no_walls(tmp_path: Path) -> None:
    world = read(tmp_path, "position ( model ( ) ) model ( pose [3 0 0 0] position ( pose [1 0 0 90] ) )")
    np.testing.assert_allclose(world.bounds, [2.8, -0.2, 3.2, 0.2])
    np.testing.assert_allclose(world.starts[1].pose, [4, 0, np.pi / 2])
