# SPDX-License-Identifier: BSD-3-Clause
"""A world that was written as a file says the same when it is read again, models where they are."""

from __future__ import annotations

from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from kurumaisu.params import shipped
from kurumaisu.world import World, load_world, read_snippet
from kurumaisu.world.model import Model
from kurumaisu.world.writing import written

WORLDS = sorted(shipped("worlds").glob("*.world"))
ALL = """
name "all" resolution 0.01 interval_sim 50 unit_length "cm" unit_angle "radians" paused 1 semantics "physical"
define cart position (
  size [40 30 20] origin [5 0 0 0] drive "car" wheelbase 30 velocity [1 0 0 0.1] localization "odom"
  velocity_bounds [-50 50 0 0 0 0 -1 1] acceleration_bounds [-50 50 0 0 0 0 -1 1] odom_error [0.1 0.1 0 0.1]
  localization_origin [1 2 0 0.5]
  ranger ( pose [10 0 5 0.1]
    sensor ( range [1 500] samples 3 fov 1.5 noise [1 0.1 0.01] pose [1 0 0 0.1] size [1 2 3] ) )
  camera ( fov [70 40] range [20 800] resolution [32 16] pantilt [5 6] )
  fiducial ( range_min 1 range_max 800 range_max_id 500 fov 3 )
  bumper ( bcount 2 bpose[0] [1 2 3 0.5] bpose[1] [1 2 3 1] blength 5 )
  gripper ( paddle_size [0.6 0.1 0.4] )
)
cart ( name "one" pose [100 50 0 1.5] )
cart ( pose [300 50 0 -3] size [50 30 20] )
model ( name "door" pose [400 0 0 0] hinge [10 0 -0.9 0.8] mass 15 size [90 5 200]
  model ( name "knob" pose [1 2 3 0.1] ) )
model ( name "ramp" slope [0.08 0] obstacle_return 0 stack_children 0 model ( name "on" pose [0 0 5 0] ) )
model ( name "walker" walk_speed 120 waypoint[0] [10 20] waypoint[1] [300 0.0001] social 1
  block ( points 3 point[0] [0 0] point[1] [1 0] point[2] [0 1] z [0 2] )
  block ( points 3 point[0] [5 5] point[1] [9 5] point[2] [5 9] z [0 1] ) color_rgba [0.1 0.2 0.3 1] )
"""


def again(folder: Path, world: World, poses: np.ndarray | None = None, **options: bool) -> World:
    """Return a world that was written, with other poses perhaps, and read from another folder."""
    (folder / "again").mkdir(exist_ok=True)
    path = folder / "again/again.world"
    path.write_text(written(world.setting, world.models, world.poses if poses is None else poses))
    return load_world(path, **options)


def agree(one: object, two: object, where: str = "") -> None:
    """Compare what two files say; what floats say may differ in the last digits, as other units make them do."""
    assert type(one) is type(two), where
    if isinstance(one, np.ndarray):
        np.testing.assert_allclose(one, two, rtol=1e-12, atol=1e-12, err_msg=where)
    elif isinstance(one, float):
        assert one == pytest.approx(two, rel=1e-12, abs=1e-12), where
    elif isinstance(one, tuple):
        assert len(one) == len(two), where
        for i, pair in enumerate(zip(one, two, strict=True)):
            agree(*pair, f"{where}[{i}]")
    elif hasattr(one, "__dataclass_fields__"):
        for field in fields(one):
            if field.name not in ("place", "source", "edges") and not (isinstance(one, Model) and field.name == "pose"):
                agree(getattr(one, field.name), getattr(two, field.name), f"{where}.{field.name}")
    else:
        assert one == two, where


def compare(one: World, two: World) -> None:
    assert [m.name for m in one.models] == [m.name for m in two.models]
    for name in ("models", "poses", "resolution", "interval", "quit_time", "speedup", "semantics", "segments"):
        agree(getattr(one, name), getattr(two, name), name)


@pytest.mark.parametrize("path", WORLDS, ids=lambda path: path.stem)
def test_shipped_worlds(tmp_path: Path, path: Path) -> None:
    world = load_world(path)
    compare(world, again(tmp_path, world))


def test_everything_that_a_file_can_say_in_other_units(tmp_path: Path) -> None:
    (tmp_path / "all.world").write_text(ALL)
    world = load_world(tmp_path / "all.world")
    compare(world, again(tmp_path, world))


def test_what_came_from_a_text_in_units_of_its_own(tmp_path: Path) -> None:
    (tmp_path / "all.world").write_text(ALL)
    world = load_world(tmp_path / "all.world")
    text = 'unit_length "m" unit_angle "degrees" model ( name "new" size [1 2 3] walk_speed 1 waypoint[0] [1 2] )'
    (new,) = read_snippet(text, world.vocabulary).models
    count = len(world.models)
    more = replace(world, models=(*world.models, replace(new, index=count, root=count)))
    loaded = again(tmp_path, more, np.vstack([world.poses, [1.0, 2.0, 0.0, -0.5]]))
    model: Model = loaded.models[-1]
    np.testing.assert_allclose(model.size, [1, 2, 3])
    np.testing.assert_allclose(model.walk.waypoints, [[1, 2]])
    np.testing.assert_allclose(loaded.poses[-1], [1, 2, 0, -0.5])


@settings(max_examples=20, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.tuples(*[st.floats(-1e4, 1e4)] * 3, st.floats(-10, 10)))
def test_poses_come_back_to_the_last_digits(tmp_path: Path, pose: tuple[float, ...]) -> None:
    (tmp_path / "all.world").write_text(ALL)
    world = load_world(tmp_path / "all.world")
    poses = world.poses.copy()
    poses[0] = pose
    loaded = again(tmp_path, world, poses)
    np.testing.assert_allclose(loaded.poses[:, :3], poses[:, :3], rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(np.exp(1j * loaded.poses[:, 3]), np.exp(1j * poses[:, 3]), atol=1e-11)


def test_a_map_is_written_with_what_it_needs_to_be_read(tmp_path: Path) -> None:
    path = next(shipped("worlds/maps").glob("*.yaml"))
    world = load_world(path)
    assert "load it with image_extents" in written(world.setting, world.models, world.poses)
    compare(world, again(tmp_path, world, image_extents=True))
