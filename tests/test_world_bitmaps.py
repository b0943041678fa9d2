# SPDX-License-Identifier: BSD-3-Clause
"""Images as walls: outlines against pixels, trim and stretch, whole images, ROS maps, and what is refused."""

import contextlib
import struct
import zlib
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays
from PIL import Image

from kurumaisu.errors import Error
from kurumaisu.types import BoolArray, FloatArray
from kurumaisu.world import World, load_world
from kurumaisu.world.bitmaps import outline, read_bitmap


def save(path: Path, walls: BoolArray, dark: int = 0, light: int = 255) -> None:
    Image.fromarray(np.where(walls, dark, light).astype(np.uint8)).save(path)


def read(folder: Path, text: str, image_extents: bool = False) -> World:
    path = folder / "t.world"
    path.write_text(text)
    return load_world(path, image_extents=image_extents)


def box(segments: FloatArray) -> list[float]:
    points = segments.reshape(-1, 2)
    return [*points.min(axis=0), *points.max(axis=0)]


def unit_borders(walls: BoolArray) -> set[tuple[int, int, int, int]]:
    """Return from and to (x, y) of all borders of length 1, the wall to the right, pixel by pixel as Stage goes."""
    borders = set()
    for y, x in np.argwhere(walls).tolist():
        corners = [(x, y), (x, y + 1), (x + 1, y + 1), (x + 1, y)]
        for one, other in zip(corners, [*corners[1:], corners[0]], strict=True):
            if (*other, *one) in borders:
                borders.remove((*other, *one))
            else:
                borders.add((*one, *other))
    return borders


@given(arrays(np.bool_, array_shapes(min_dims=2, max_dims=2, max_side=9)))
def test_outline_is_that_of_the_pixels(walls: BoolArray) -> None:
    cut = []
    for x0, y0, x1, y1 in outline(walls).astype(int).tolist():
        assert (x0 == x1) != (y0 == y1)
        dx, dy = np.sign([x1 - x0, y1 - y0]).tolist()
        ways = [(x0 + i * dx, y0 + i * dy) for i in range(abs(x1 - x0) + abs(y1 - y0))]
        cut += [(x, y, x + dx, y + dy) for x, y in ways]
    assert len(cut) == len(set(cut))  # nothing twice
    assert set(cut) == unit_borders(walls)


@given(arrays(np.bool_, array_shapes(min_dims=2, max_dims=2, max_side=9)))
def test_outline_is_of_the_longest_runs(walls: BoolArray) -> None:
    runs = outline(walls).astype(int).tolist()
    ends = {(x1, y1, x0 == x1) for x0, y0, x1, y1 in runs}
    assert not any((x0, y0, x0 == x1) in ends for x0, y0, x1, y1 in runs)  # borders of opposite sense meet head on


def test_trim_and_stretch(tmp_path: Path) -> None:
    walls = np.zeros((20, 40), dtype=bool)
    walls[5:15, 10:30] = True  # 20 x 10 pixels in 40 x 20, not in the middle in y
    walls[10, 15] = False
    save(tmp_path / "map.png", walls)
    text = 'model ( bitmap "map.png" size [8 2 3] pose [1 1 0 0] )'
    world = read(tmp_path, text)
    np.testing.assert_allclose(box(world.segments), [-3, 0, 5, 2])
    hole = [s for s in world.segments if not np.isin(s, [-3, 0, 5, 2]).any()]
    np.testing.assert_allclose(box(np.array(hole)), [-1, 0.8, -0.6, 1.0])  # 5 from the left, 4 from below
    np.testing.assert_allclose(world.models[0].shape.heights, [[0, 3]] * 8)
    (warning,) = world.warnings
    assert "t.world:1:9: map.png: trimmed to its walls" in warning
    assert "2.000 times as wide and 2.000 times as high" in warning
    whole = read(tmp_path, text, image_extents=True)
    np.testing.assert_allclose(box(whole.segments), [-1, 0.5, 3, 1.5])
    assert whole.warnings == ()


def test_boundary_is_drawn_after_the_trim(tmp_path: Path) -> None:
    walls = np.zeros((8, 10), dtype=bool)
    walls[2:4, 1:9] = True
    save(tmp_path / "map.png", walls)
    text = 'model ( bitmap "map.png" size [6 5 1] boundary 1 )'
    for extents in (False, True):
        shape = read(tmp_path, text, extents).models[0].shape
        np.testing.assert_allclose(box(shape.segments), [-3, -2.5, 3, 2.5])
        np.testing.assert_allclose(box(shape.segments[4:8]), [-3, -2.5, 3, 2.5])
        np.testing.assert_allclose(box(shape.segments[8:]), [-2.99, -2.49, 2.99, 2.49])
        assert len(shape.polygons) == 4
    np.testing.assert_allclose(box(shape.segments[:4]), [-2.4, 0, 2.4, 1.25])


def test_blocks_beside_a_bitmap_are_fitted_with_it(tmp_path: Path) -> None:
    save(tmp_path / "map.png", np.ones((4, 4), dtype=bool))
    block = "block ( points 4\npoint[0] [1 -1]\npoint[1] [3 -1]\npoint[2] [3 1]\npoint[3] [1 1]\nz [0 2] )"
    world = read(tmp_path, f'model ( bitmap "map.png" size [2 2 1] {block} )')
    np.testing.assert_allclose(box(world.segments[:4]), [-1, -1, 0, 1])  # from 2 x 2 m at the middle
    np.testing.assert_allclose(box(world.segments[4:]), [0, -1, 1, 1])
    np.testing.assert_allclose(world.models[0].shape.heights, [[0, 0.5]] * 4 + [[0, 1]] * 4)


@pytest.mark.parametrize(("shade", "wall"), [(0, True), (127, True), (128, False), (205, False), (255, False)])
def test_the_first_channel_decides(tmp_path: Path, shade: int, wall: bool) -> None:
    for name, colour in {"a.png": (shade, 255 - shade, 0), "b.bmp": (shade, 0, 0), "c.png": (shade, 9, 9, 0)}.items():
        image = Image.new("RGBA" if len(colour) == 4 else "RGB", (3, 2), colour)
        image.save(tmp_path / name)
        assert (len(read_bitmap(tmp_path / name).runs) == 4) == wall
    image.convert("RGB").quantize(4).save(tmp_path / "d.png")
    assert (len(read_bitmap(tmp_path / "d.png").runs) == 4) == wall
    Image.fromarray(np.full((2, 3), shade * 257, dtype=np.uint16)).save(tmp_path / "e.png")
    assert (len(read_bitmap(tmp_path / "e.png").runs) == 4) == wall
    Image.new("LA", (3, 2), (shade, 0)).save(tmp_path / "f.png")
    assert (len(read_bitmap(tmp_path / "f.png").runs) == 4) == wall
    Image.new("1", (3, 2), shade > 127).save(tmp_path / "g.pbm")
    assert (len(read_bitmap(tmp_path / "g.pbm").runs) == 4) == wall


def test_an_empty_image_has_no_body(tmp_path: Path) -> None:
    save(tmp_path / "map.png", np.zeros((4, 4), dtype=bool))
    world = read(tmp_path, 'model ( bitmap "map.png" )')
    assert not len(world.segments)
    assert "has no wall pixels" in world.warnings[0]


MAP = "image: map.pgm\nresolution: 0.5\norigin: [-3.0, 2.0, {yaw}]\nnegate: {negate}\noccupied_thresh: {thresh}\n"


def save_map(folder: Path, negate: int = 0, thresh: float = 0.65, yaw: float = 0.0) -> Path:
    shades = np.full((4, 6), 254, dtype=np.uint8)
    shades[3, 0], shades[0, 0], shades[1, 1] = 0, 100, 205  # lower left wall, upper left grey, unknown
    Image.fromarray(255 - shades if negate else shades).save(folder / "map.pgm")
    path = folder / "map.yaml"
    path.write_text(MAP.format(negate=negate, thresh=thresh, yaw=yaw) + "free_thresh: 0.196\n")
    return path


@pytest.mark.parametrize("negate", [0, 1])
def test_a_ros_map_is_a_world(tmp_path: Path, negate: int) -> None:
    world = load_world(save_map(tmp_path, negate))
    np.testing.assert_allclose(box(world.segments), [-3, 2, -2.5, 2.5])
    assert world.starts == ()
    (model,) = world.models
    assert (model.type, model.name) == ("model", "map")
    np.testing.assert_allclose(model.size, [3, 2, 2.5])
    world = load_world(save_map(tmp_path, negate, thresh=0.6))  # (255 - 100) / 255 = 0.608
    np.testing.assert_allclose(box(world.segments), [-3, 2, -2.5, 4])
    world = load_world(save_map(tmp_path, negate, yaw=np.pi / 2))
    np.testing.assert_allclose(box(world.segments), [-3.5, 2, -3, 2.5], atol=1e-12)
    with pytest.raises(Error, match="no parameters"):
        load_world(save_map(tmp_path), values={"a": "1"})


def test_a_ros_map_as_a_bitmap(tmp_path: Path) -> None:
    save_map(tmp_path)
    text = 'model ( bitmap "map.yaml" size [2 2 1] pose [10 0 0 0] )'
    np.testing.assert_allclose(box(read(tmp_path, text).segments), [9, -1, 11, 1])
    world = read(tmp_path, text, image_extents=True)
    np.testing.assert_allclose(box(world.segments), [7, 2, 7.5, 2.5])
    np.testing.assert_allclose(world.models[0].size, [3, 2, 1])


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("image: map.pgm", "image: none.pgm", r"none\.pgm: No such file"),
        ("image: map.pgm", "picture: map.pgm", "names no image"),
        ("resolution: 0.5", "resolution: 0", "resolution must be above 0, not 0"),
        ("resolution: 0.5", "resolution: .nan", "resolution must be a number"),
        ("resolution: 0.5", "", "resolution must be a number, not None"),
        ("[-3.0, 2.0, 0.0]", "[-3.0, 2.0]", "origin must be"),
        ("[-3.0, 2.0, 0.0]", "[-3.0, x, 0.0]", "origin must be a number, not 'x'"),
        ("negate: 0", "negate: no idea", "negate must be a number"),
        ("negate: 0", "negate: 0\nmode: raw", "mode raw is not supported"),
        ("negate: 0", "negate: {", "is not a readable map"),
        ("negate: 0", "[" * 2000, "is not a readable map"),
    ],
)
def test_bad_ros_maps(tmp_path: Path, old: str, new: str, message: str) -> None:
    path = save_map(tmp_path)
    path.write_text(path.read_text().replace(old, new))
    with pytest.raises(Error, match=rf"map\.yaml:.*{message}"):
        load_world(path)
    with pytest.raises(Error, match=rf"t\.world:1:9: .*{message}"):
        read(tmp_path, 'model ( bitmap "map.yaml" )')


def chunk(name: bytes, data: bytes) -> bytes:
    return struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))


def test_images_that_are_refused(tmp_path: Path) -> None:
    header = chunk(b"IHDR", struct.pack(">IIBBBBB", 40000, 25000, 8, 0, 0, 0, 0))  # 10^9 pixels
    (tmp_path / "huge.png").write_bytes(b"\x89PNG\r\n\x1a\n" + header + chunk(b"IDAT", zlib.compress(b"")))
    (tmp_path / "large.pgm").write_bytes(b"P5 11000 10000 255\n")  # 1.1 10^8
    (tmp_path / "short.pgm").write_bytes(b"P5 1000 1000 255\n\0")
    (tmp_path / "text.png").write_text("no image")
    (tmp_path / "noise.png").write_bytes(b"\x89PNG\r\n\x1a\n" + bytes(range(256)))
    save(tmp_path / "checks.png", np.indices((2500, 2500)).sum(axis=0) % 2 == 0)
    for name in ("huge.png", "large.pgm", "short.pgm", "text.png", "noise.png", "checks.png", "none.png", ".", "\x01"):
        with pytest.raises(Error, match=r"t\.world:1:9: "):
            read(tmp_path, f'model ( bitmap "{name}" )')
    with pytest.raises(Error, match=r"large\.pgm: has 11000 x 10000 pixels, more than 100000000"):
        read(tmp_path, 'model ( bitmap "large.pgm" )')
    with pytest.raises(Error, match=r"checks\.png: has 1249\d{4} borders .* not a map"):
        read(tmp_path, 'model ( bitmap "checks.png" )')
    with pytest.raises(Error, match="bitmap needs the name of an image"):
        read(tmp_path, 'model ( bitmap "" )')


@settings(max_examples=100)
@given(data=st.data())
def test_damaged_images_are_read_or_refused(tmp_path_factory: pytest.TempPathFactory, data: st.DataObject) -> None:
    folder = tmp_path_factory.getbasetemp()
    kind = data.draw(st.sampled_from(["png", "bmp", "gif", "pgm", "tiff", "jpg"]))
    path = folder / f"damaged.{kind}"
    save(path, np.random.default_rng(3).random((12, 17)) < 0.5)
    content = bytearray(path.read_bytes())
    for _ in range(data.draw(st.integers(1, 6))):
        content[data.draw(st.integers(0, len(content) - 1))] = data.draw(st.integers(0, 255))
    path.write_bytes(content[: data.draw(st.integers(1, len(content)))])
    with contextlib.suppress(Error):  # anything else is a fault
        assert read_bitmap(path).runs.shape[1:] == (4,)


def test_edges_are_closed_loops_before_the_origin_with_all_four_sides_of_the_boundary(tmp_path: Path) -> None:
    walls = np.random.default_rng(2).random((12, 9)) < 0.4
    save(tmp_path / "map.png", walls)
    given = 'model ( bitmap "map.png" size [9 12 0.7] origin [1 2 0.3 45] boundary 1 )'
    (model,) = read(tmp_path, given).models
    edges = model.shape.edges
    assert edges is not None
    begun, ended = (sorted(map(tuple, ends.tolist())) for ends in (edges[:, :2], edges[:, 2:4]))
    assert begun == ended  # to the last bit, or a corner would be missing
    np.testing.assert_allclose(box(edges[:, :4]), [-4.5, -6, 4.5, 6])
    np.testing.assert_allclose(edges[:, 4:], np.broadcast_to([0, 0.7], (len(edges), 2)))
    sides = edges[-16:]  # 1 cm thick
    np.testing.assert_allclose(
        np.hypot(*(sides[:, 2:4] - sides[:, :2]).T), [0.01, 12] * 2 + [9, 0.01] * 4 + [0.01, 12] * 2
    )
