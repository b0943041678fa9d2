# SPDX-License-Identifier: BSD-3-Clause
"""Reading Stage worlds: what they mean, and what is said about bad ones."""

import contextlib
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

from kurumaisu.errors import Error
from kurumaisu.params import shipped
from kurumaisu.types import FloatArray
from kurumaisu.world import World, load_world


def read(folder: Path, text: str) -> World:
    path = folder / "t.world"
    path.write_text(text)
    return load_world(path)


def box(segments: FloatArray) -> list[float]:
    points = segments.reshape(-1, 2)
    return [*points.min(axis=0), *points.max(axis=0)]


def perimeter(segments: FloatArray) -> float:
    return float(np.hypot(segments[:, 2] - segments[:, 0], segments[:, 3] - segments[:, 1]).sum())


def test_a_model_is_a_box_of_its_size(tmp_path: Path) -> None:
    world = read(tmp_path, "model ( pose [3 2 0 90] size [2 1 5] )")
    np.testing.assert_allclose(box(world.segments), [2.5, 1, 3.5, 3], atol=1e-12)
    assert len(world.segments) == 4
    np.testing.assert_allclose(world.bounds, [2.5, 1, 3.5, 3], atol=1e-12)


def test_default_size_is_stages(tmp_path: Path) -> None:
    np.testing.assert_allclose(box(read(tmp_path, "model ( )").segments), [-0.2, -0.2, 0.2, 0.2])


def test_origin_moves_the_body_and_not_the_children(tmp_path: Path) -> None:
    text = "model ( pose [1 0 0 90] origin [2 0 0 0] size [2 2 1] model ( pose [5 0 0 0] size [1 1 1] ) )"
    world = read(tmp_path, text)
    np.testing.assert_allclose(box(world.segments[:4]), [0, 1, 2, 3], atol=1e-12)
    np.testing.assert_allclose(box(world.segments[4:]), [0.5, 4.5, 1.5, 5.5], atol=1e-12)


def test_blocks_together_fill_the_size(tmp_path: Path) -> None:
    text = (
        """model ( size [8 2 1] pose [4 1 0 0]
      block ( points 3 point[0] [0 0] point[1] [1 0] point[2] [0 1] z [0 1] )
      block ( points 4 point[0] [1 0] point[1] [2 0] point[2] [2 1] point[3] [1 1] ) )""".replace("] point", "]\npoint")
        .replace("points 3 ", "points 3\n")
        .replace("points 4 ", "points 4\n")
    )
    world = read(tmp_path, text)
    assert len(world.segments) == 7
    np.testing.assert_allclose(world.segments[0], [0, 0, 4, 0], atol=1e-12)
    np.testing.assert_allclose(box(world.segments), [0, 0, 8, 2], atol=1e-12)


def test_a_boundary_is_a_wall_1_cm_thick(tmp_path: Path) -> None:
    world = read(tmp_path, "model ( size [6 5 1] boundary 1 )")
    assert len(world.segments) == 8
    np.testing.assert_allclose(box(world.segments[:4]), [-3, -2.5, 3, 2.5])
    np.testing.assert_allclose(box(world.segments[4:]), [-2.99, -2.49, 2.99, 2.49])


def test_bitmap_walls_fill_the_size(tmp_path: Path) -> None:
    pixels = np.full((8, 10), 255, dtype=np.uint8)
    pixels[2:5, 3:7] = 0  # 4 x 3 pixels, with a hole of 1 x 1
    pixels[3, 4] = 200
    Image.fromarray(pixels).save(tmp_path / "map.png")
    world = read(tmp_path, 'model ( bitmap "map.png" size [4 3 1] pose [2 1.5 0 0] )')
    assert len(world.segments) == 8
    np.testing.assert_allclose(box(world.segments), [0, 0, 4, 3])
    assert perimeter(world.segments) == pytest.approx(14 + 4)
    hole = [s for s in world.segments if not np.isin(s, [0, 3, 4]).any()]
    np.testing.assert_allclose(box(np.array(hole)), [1, 1, 2, 2])


def test_bitmap_of_random_pixels_has_the_perimeter_of_its_pixels(tmp_path: Path) -> None:
    walls = np.random.default_rng(5).random((40, 60)) < 0.4
    walls[[0, -1]] = walls[:, [0, -1]] = True
    Image.fromarray(np.where(walls, 0, 255).astype(np.uint8)).save(tmp_path / "map.png")
    world = read(tmp_path, 'model ( bitmap "map.png" size [60 40 1] )')
    padded = np.pad(walls, 1)
    borders = sum(int((padded != np.roll(padded, 1, axis)).sum()) for axis in (0, 1))
    assert perimeter(world.segments) == pytest.approx(borders)


def test_what_a_laser_sees_and_what_a_chair_hits(tmp_path: Path) -> None:
    world = read(tmp_path, "model ( ranger_return -1 ) model ( pose [5 0 0 0]\nobstacle_return 0 )")
    assert box(world.segments)[0] == pytest.approx(4.8)
    assert box(world.obstacles)[2] == pytest.approx(0.2)


def test_macros_override_from_base_to_instance(tmp_path: Path) -> None:
    text = """
    define wall model ( size [1 1 1] pose [9 9 0 0] )
    define long wall ( size [4 1 1] )
    define wall model ( size [7 7 7] ) # the first definition wins
    long ( pose [2 0.5 0 0] )
    """
    np.testing.assert_allclose(box(read(tmp_path, text).segments), [0, 0, 4, 1], atol=1e-12)


def test_include_is_relative_to_the_first_file(tmp_path: Path) -> None:
    (tmp_path / "inc").mkdir()
    (tmp_path / "inc" / "a.inc").write_text('include "inc/b.inc"\ndefine tall wall ( size [2 2 9] )')
    (tmp_path / "inc" / "b.inc").write_text("define wall model ( pose [1 1 0 0] )")
    (tmp_path / "size.inc").write_text("size [4 4 1]")
    world = read(tmp_path, 'include "inc/a.inc"\ntall\n(\n)\nwall ( pose [9 9 0 0]\ninclude "size.inc"\n)')
    np.testing.assert_allclose(box(world.segments[:4]), [0, 0, 2, 2])
    np.testing.assert_allclose(box(world.segments[4:]), [7, 7, 11, 11])


def test_starts_in_file_order(tmp_path: Path) -> None:
    world = read(tmp_path, 'model ( )\nposition ( name "a" pose [1 2 0 90] )\nposition ( pose [5 5 0 0] )')
    assert [start.name for start in world.starts] == ["a", "chair"]
    np.testing.assert_allclose(world.start, [1, 2, np.pi / 2])


def test_known_but_unheeded_is_warned_of_once(tmp_path: Path) -> None:
    text = "paused 1\nwindow ( size [1 1] )\nmodel ( say 3 )\nmodel ( say 4 gui_nose 1 )\nposition ( ranger ( ) )"
    paused, say, empty = read(tmp_path, text).warnings
    assert paused.endswith("t.world:1:1: paused is accepted and has no effect here")
    assert say.endswith("t.world:3:9: say is accepted and has no effect here")
    assert empty.endswith("t.world:5:12: a ranger without a sensor measures nothing")


@pytest.mark.parametrize("line_end", ["\n", "\r\n", "\r"])
def test_line_ends(tmp_path: Path, line_end: str) -> None:
    path = tmp_path / "t.world"
    path.write_bytes(f"# comment{line_end}model{line_end}({line_end} size [1 1 1]{line_end})".encode())
    assert len(load_world(path).segments) == 4
    path.write_bytes(f"# comment{line_end}model ({line_end} size{line_end} 3 )".encode())
    with pytest.raises(Error, match=r"t\.world:3:2: size needs a value on its line"):
        load_world(path)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("model ( size [1, 1] )", "1:16: ',' is not allowed"),
        ("model\n( pose [0 0 0 0]", r"1:1: the '\(' of model is never closed"),
        (")", r"1:1: expected a property or an entity, not '\)'"),
        ("3", "1:1: expected a property or an entity, not a number 3"),
        ("model ( mass )", r"1:9: mass needs a value on its line, or '\(', not '\)'"),
        ("model", r"1:1: model needs a value on its line, or '\(', not the end of the file"),
        ("model ( mass 1e-3 )", "1:15: numbers have no exponent in Stage's language: 1e-3"),
        ('model ( name "a\n" )', "1:14: a string is not closed"),
        ("model ( size [1\n1] )", "1:16: size needs a number or a string on its line, not the end of the line"),
        ("model ( size [1 1 1 )", r"1:21: size needs .* not '\)'"),
        ("model ( size\n[1 1 1] )", "1:9: size needs a value on its line"),
        ("model ( size 3 )", "1:9: size needs 3 numbers, not 1"),
        ("model ( size [-1 1 1] )", "1:9: size must not be below 0"),
        ("model ( pose [1 2 3] )", "1:9: pose needs 4 numbers, not 3"),
        ("model ( mass [] )", "1:9: mass needs a value"),
        ("model ( define a model ( ) )", "1:9: define is allowed at the top level only"),
        ("define a model ( size [1 1 1]", r"1:16: the '\(' of define is never closed"),
        ("define a model model ( )", r"1:16: define needs a name, a type and '\(', not a word model"),
        ("define a ( )", r"1:10: define needs a name, a type and '\(', not '\('"),
        ("define a a ( )\na ( )", "1:10: macro a never ends"),
        ("define a model ( a ( ) )\na ( )", "1:18: more than 100 levels"),
        ("model ( )\nwifi ( )", "2:1: wifi is not a type of model"),
        ("world ( )", "1:1: world is not a type of model"),
        ("block ( )", "1:1: a block belongs in a model, not in the world"),
        ("model ( sensor ( ) )", "1:9: a sensor belongs in a ranger, not in a model"),
        ("model ( block ( points -1 ) )", "1:17: points must be 0 to"),
        ('model ( bitmap "none.png" )', "1:9: .*none.png: No such file"),
        ('include "none.inc"\n', "1:9: .*none.inc: No such file"),
        ("include none\n", "1:9: include needs a string, not a word none"),
        ('include "t.world"\n', "1:1: more than 64 levels"),
        ("test 1", "1:1: this is a test file"),
    ],
)
def test_bad_worlds_are_refused_with_their_place(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(Error, match=rf"t\.world:{message}"):
        read(tmp_path, text)


def test_other_bad_files(tmp_path: Path) -> None:
    with pytest.raises(Error, match="has no walls"):
        _ = read(tmp_path, "position ( )").bounds
    with pytest.raises(Error, match="has no position model"):
        _ = read(tmp_path, "model ( )").start
    with pytest.raises(Error, match=r"none\.world: No such file"):
        load_world(tmp_path / "none.world")
    (tmp_path / "t.world").write_bytes(b"name\n\xff")
    with pytest.raises(Error, match=r"t\.world:2:1: byte 0xff is not allowed"):
        load_world(tmp_path / "t.world")


@given(st.text(alphabet='modelpsizedefinclub 0123456789.-+()[]"#\n\r\t,:', max_size=80))
def test_any_text_loads_or_is_refused(tmp_path_factory: pytest.TempPathFactory, text: str) -> None:
    with contextlib.suppress(Error):  # anything else is a fault
        read(tmp_path_factory.getbasetemp(), text)


@pytest.mark.parametrize("path", sorted(shipped("worlds/room.world").parent.glob("*.world")), ids=str)
def test_shipped_worlds_load_without_a_warning(path: Path) -> None:
    world = load_world(path)
    assert world.warnings == ()
    assert world.name == path.stem
    assert world.starts
