# SPDX-License-Identifier: BSD-3-Clause
"""The camera against geometry worked out by hand, and against one ray per pixel through solid prisms."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from sensing import make_model, rectangle

from kurumaisu.errors import Error
from kurumaisu.sim.sensors import camera as c
from kurumaisu.types import FloatArray
from kurumaisu.world.bitmaps import outline
from kurumaisu.world.model import Camera, Model

CAMERA = Camera(width=64, height=48, fov_h=1.2, fov_v=0.9, near=0.1, far=20.0, pan=0.0, tilt=0.0)
RED, BLUE = (1.0, 0.0, 0.0, 1.0), (0.0, 0.0, 1.0, 1.0)
NOBODY = -1


def take(models: list[Model], poses: FloatArray, eye: FloatArray, camera: Camera = CAMERA) -> c.Picture:
    return c.CameraSensor(camera).take(c.Scenery(models), poses, eye, NOBODY)


def pixel_rays(camera: Camera, heading: float) -> FloatArray:
    """Directions (h, w, 3) in the map whose part along the optical axis is 1."""
    fx, fy = camera.width / 2 / math.tan(camera.fov_h / 2), camera.height / 2 / math.tan(camera.fov_v / 2)
    right = (np.arange(camera.width) + 0.5 - camera.width / 2) / fx
    down = (np.arange(camera.height) + 0.5 - camera.height / 2)[:, None] / fy
    co, si = math.cos(camera.tilt), math.sin(camera.tilt)
    ahead, left, up = np.broadcast_arrays(co - down * si, -right, -si - down * co)
    ch, sh = math.cos(heading), math.sin(heading)
    return np.stack([ch * ahead - sh * left, sh * ahead + ch * left, up], axis=-1)


def solid_depth(rays: FloatArray, eye: FloatArray, prism: Model, pose: FloatArray) -> FloatArray:
    """Depth at which rays enter a convex prism from outside: the slabs between its planes, one after the other."""
    polygon = prism.shape.polygons[0]
    co, si = math.cos(pose[3]), math.sin(pose[3])
    corners = polygon.corners @ np.array([[co, si], [-si, co]]) + pose[:2]
    enter, leave = np.full(rays.shape[:2], -np.inf), np.full(rays.shape[:2], np.inf)
    planes = [
        (np.array([0, 0, 1.0]), pose[2] + polygon.heights[1]),
        (np.array([0, 0, -1.0]), -pose[2] - polygon.heights[0]),
    ]
    for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        normal = np.array([b[1] - a[1], a[0] - b[0], 0.0])  # outward of a counter-clockwise outline
        planes.append((normal, float(normal[:2] @ a)))
    for normal, offset in planes:
        speed, gap = rays @ normal, offset - normal @ eye[:3]
        with np.errstate(divide="ignore", invalid="ignore"):
            t = gap / speed
        enter = np.where(speed < 0, np.maximum(enter, t), enter)
        leave = np.where(speed > 0, np.minimum(leave, t), leave)
        leave = np.where((speed == 0) & (gap < 0), -np.inf, leave)
    return np.where((enter < leave) & (enter >= 0), enter, np.inf)


def expected_depth(models: list[Model], poses: FloatArray, eye: FloatArray, camera: Camera) -> FloatArray:
    rays = pixel_rays(camera, eye[3])
    with np.errstate(divide="ignore"):
        ground = np.where(rays[..., 2] < 0, -eye[2] / rays[..., 2], np.inf)
    depth = np.min([ground, *(solid_depth(rays, eye, m, p) for m, p in zip(models, poses, strict=True))], axis=0)
    return np.where(depth >= camera.far, np.inf, np.where(depth <= camera.near, -np.inf, depth))


def share_of_differences(found: FloatArray, expected: FloatArray) -> float:
    with np.errstate(invalid="ignore"):
        same = np.isclose(found, expected, rtol=1e-4, atol=1e-4) | (found == expected)
    return float((~same).mean())


boxes = st.lists(
    st.tuples(
        st.floats(-4, 4), st.floats(-4, 4), st.floats(0, 1.5), st.floats(-3, 3),  # pose
        st.floats(0.1, 2), st.floats(0.1, 2), st.floats(0.1, 2),  # size
    ),
    min_size=0,
    max_size=8,
)  # fmt: skip


def _inside(eye: FloatArray, box: tuple[float, ...]) -> bool:
    near = math.hypot(box[0] - eye[0], box[1] - eye[1]) < math.hypot(box[4], box[5]) / 2 + 0.01
    return near and box[2] - 0.01 < eye[2] < box[2] + box[6] + 0.01


@settings(max_examples=60)
@given(boxes=boxes, height=st.floats(0.05, 3), heading=st.floats(-4, 4))
def test_any_boxes_agree_with_a_ray_per_pixel(boxes: list[tuple[float, ...]], height: float, heading: float) -> None:
    models = [make_model(i, rectangle(b[4], b[5]), (0.0, b[6])) for i, b in enumerate(boxes)]
    poses = np.array([b[:4] for b in boxes]).reshape(-1, 4)
    eye = np.array([0.013, 0.017, height, heading])
    if any(_inside(eye, box) for box in boxes):
        return  # a solid seen from within: the oracle sees nothing
    found = take(models, poses, eye)
    assert share_of_differences(found.depth, expected_depth(models, poses, eye, CAMERA)) < 0.002  # edges, by rounding


@settings(max_examples=40)
@given(boxes=boxes, height=st.floats(0.3, 3), heading=st.floats(-4, 4), tilt=st.floats(-1.5, 1.5))
def test_tilted_agrees_but_for_edges(
    boxes: list[tuple[float, ...]], height: float, heading: float, tilt: float
) -> None:
    eye = np.array([0.013, 0.017, height, heading])
    boxes = [box for box in boxes if not _inside(eye, box)]
    models = [make_model(i, rectangle(b[4], b[5]), (0.0, b[6])) for i, b in enumerate(boxes)]
    poses = np.array([b[:4] for b in boxes]).reshape(-1, 4)
    camera = replace(CAMERA, tilt=tilt)
    found, expected = take(models, poses, eye, camera).depth, expected_depth(models, poses, eye, camera)
    with np.errstate(invalid="ignore"):
        same = np.isclose(found, expected, rtol=0.02, atol=1e-3) | (found == expected)
    assert (~same).mean() < 0.02 + 0.01 * len(boxes)  # upright edges are up to 1 / 8 pixel beside their place


def test_a_wall_ahead_by_hand() -> None:
    """A wall 2 m high at 4 m, seen from 1 m: slopes of +-1/4, ground before it, sky above."""
    wall = make_model(0, rectangle(0.2, 40.0), (0.0, 2.0), color=RED)
    picture = take([wall], np.array([[4.1, 0, 0, 0]]), np.array([0.0, 0, 1.0, 0]))
    fy = CAMERA.height / 2 / math.tan(CAMERA.fov_v / 2)
    down = (np.arange(CAMERA.height) + 0.5 - CAMERA.height / 2) / fy
    for row in range(CAMERA.height):
        if abs(down[row]) < 0.25:
            np.testing.assert_allclose(picture.depth[row], 4.0, rtol=1e-6)
            assert (picture.rgba[row] == [255, 0, 0, 255]).all()
        elif down[row] > 0:
            np.testing.assert_allclose(picture.depth[row], 1 / down[row], rtol=1e-5)
            assert (picture.rgba[row] == [*c.GROUND, 255]).all()
        else:
            assert (picture.depth[row] == np.inf).all()
            assert (picture.rgba[row] == [*c.SKY, 255]).all()


def test_too_far_is_sky_and_too_near_says_so() -> None:
    wall = make_model(0, rectangle(0.2, 40.0), (0.0, 2.0), color=RED)
    eye, at = np.array([0.0, 0, 1.0, 0]), np.array([[4.1, 0, 0, 0]])
    far = take([wall], at, eye, replace(CAMERA, far=3.9))
    assert np.isinf(far.depth[20:28]).all()
    assert (far.rgba[20:28] == [*c.SKY, 255]).all()
    near = take([wall], at, eye, replace(CAMERA, near=4.1))
    assert (near.depth[20:28] == -np.inf).all()
    assert (near.rgba[20:28] == [255, 0, 0, 255]).all()


def test_looking_straight_down_on_a_box() -> None:
    box = make_model(0, rectangle(0.5, 0.5), (0.0, 0.5), color=BLUE)
    camera = replace(CAMERA, tilt=math.pi / 2)
    picture = take([box], np.array([[2.0, 3.0, 0, 0]]), np.array([2.0, 3.0, 1.5, 0.0]), camera)
    top = (picture.rgba == [0, 0, 255, 255]).all(axis=-1)
    fx, fy = camera.width / 2 / math.tan(camera.fov_h / 2), camera.height / 2 / math.tan(camera.fov_v / 2)
    assert top.sum() == pytest.approx(0.5 * fx * 0.5 * fy, rel=0.1)
    np.testing.assert_allclose(picture.depth[top], 1.0, rtol=1e-4)
    np.testing.assert_allclose(picture.depth[~top], 1.5, rtol=1e-4)


def test_a_lintel_a_gap_and_a_floating_slab() -> None:
    """Under a lintel one sees on; a slab above the eye shows its bottom."""
    lintel = make_model(0, rectangle(0.2, 40.0), (1.2, 2.0), color=RED)
    slab = make_model(0, rectangle(2.0, 40.0), (1.5, 1.6), color=BLUE)
    picture = take([lintel], np.array([[4.1, 0, 0, 0]]), np.array([0.0, 0, 1.0, 0]))
    fy = CAMERA.height / 2 / math.tan(CAMERA.fov_v / 2)
    up = -(np.arange(CAMERA.height) + 0.5 - CAMERA.height / 2) / fy
    assert (picture.rgba[(up < -1 / 15) & (up > -1 / 4), :, :3] == c.GROUND).all()  # behind it and under it
    assert (picture.rgba[(up > 0.2 / 4) & (up < 1 / 4)] == [255, 0, 0, 255]).all()
    below = take([slab], np.array([[4.0, 0, 0, 0]]), np.array([0.0, 0, 1.0, 0]))
    bottom = (up > 0.5 / 5) & (up < 0.5 / 3)
    assert bottom.any()
    np.testing.assert_allclose(below.depth[bottom, 32], 0.5 / up[bottom], rtol=1e-5)


def test_the_occupied_parts_of_a_bitmap_are_solid() -> None:
    """A courtyard: segments in no order, as runs of pixels come. One sees its top, and the ground within."""
    rings = [np.hstack([c_ := rectangle(a, a), np.roll(c_, -1, axis=0)]) for a in (3.0, 1.0)]
    segments = np.concatenate([rings[0], rings[1][:, [2, 3, 0, 1]]])[[3, 0, 6, 5, 1, 7, 4, 2]]
    yard = [make_model(0, segments=segments, heights=(0.0, 0.5), color=BLUE)]
    camera = replace(CAMERA, tilt=math.pi / 2)
    for x, y in ((0.001, 0.002), (1.0, 0.003)):
        picture = take(yard, np.zeros((1, 4)), np.array([x, y, 3.0, 0.0]), camera)
        pixels = [(row, column) for row in range(0, 48, 5) for column in range(0, 64, 7)]
        rays = pixel_rays(camera, 0.0)
        for row, column in pixels:
            at = np.abs(np.array([x, y]) + 2.5 * rays[row, column, :2])
            if np.abs(at.max() - np.array([0.5, 1.5])).min() > 0.25:  # the walls themselves are seen beside the lids
                top = 0.5 < at.max() < 1.5
                assert picture.depth[row, column] == pytest.approx(2.5 if top else 3.0, rel=1e-3), (row, column, at)


@pytest.mark.parametrize("seed", range(5))
def test_any_bitmap_seen_from_above_is_the_bitmap(seed: int) -> None:
    """Runs of pixels that end, bend and cross wherever they like; flat walls, so that only lids are seen."""
    rng = np.random.default_rng(seed)
    occupied = rng.random((16, 16)) < 0.5
    models = [make_model(0, segments=outline(occupied), heights=(0.0, 1e-3), color=BLUE)]
    camera = Camera(width=120, height=120, fov_h=1.5, fov_v=1.5, near=0.1, far=50.0, pan=0.0, tilt=math.pi / 2)
    eye = np.array([*rng.uniform(6, 10, 2), 5.0, rng.uniform(-3, 3)])
    picture = take(models, np.zeros((1, 4)), eye, camera)
    x, y = np.moveaxis(eye[:2] + (eye[2] - 1e-3) * pixel_rays(camera, eye[3])[..., :2], -1, 0)
    edge = np.minimum(np.abs(x - np.round(x)), np.abs(y - np.round(y))) < 0.03
    within = (x > 0) & (x < 16) & (y > 0) & (y < 16)
    row, column = np.clip(y, 0, 15.5).astype(int), np.clip(x, 0, 15.5).astype(int)
    expected = within & occupied[row, column]
    blue = (picture.rgba == [0, 0, 255, 255]).all(axis=-1)
    assert expected[~edge].mean() > 0.1
    np.testing.assert_array_equal(blue[~edge], expected[~edge])


def test_outlines_may_run_either_way() -> None:
    eye, at = np.array([0.0, 0, 1.5, 0]), np.array([[3.0, 0, 0, 0.3]])
    pictures = [take([make_model(0, corners)], at, eye) for corners in (rectangle(1, 1), rectangle(1, 1)[::-1])]
    np.testing.assert_array_equal(pictures[0].rgba, pictures[1].rgba)
    np.testing.assert_array_equal(pictures[0].depth, pictures[1].depth)


def test_its_own_tree_is_invisible_and_bodies_move() -> None:
    models = [make_model(0, rectangle(1, 1), (0, 2)), make_model(1, rectangle(1, 1), (0, 2), root=0, color=RED)]
    at, eye = np.array([[0.0, 0, 0, 0], [3.0, 0, 0, 0]]), np.array([0.0, 0, 1.0, 0])
    sensor, scenery = c.CameraSensor(CAMERA), c.Scenery(models)
    assert not np.isfinite(sensor.take(scenery, at, eye, 0).depth[23]).any()
    outside = np.array([[9.0, 9, 0, 0], [3.0, 0, 0, 0]])
    assert sensor.take(scenery, outside, eye, NOBODY).depth[23, 32] == pytest.approx(2.5)
    assert sensor.take(scenery, outside + np.array([0, 0, 0, math.pi]), eye, NOBODY).depth[23, 32] == pytest.approx(2.5)
    assert sensor.take(scenery, outside + np.array([1, 0, 0, 0]), eye, NOBODY).depth[23, 32] == pytest.approx(3.5)


def test_on_top_of_a_platform_one_sees_the_platform() -> None:
    platform = make_model(0, rectangle(8, 8), (0.0, 0.5), color=BLUE)
    picture = take([platform], np.array([[0.0, 0, 0, 0]]), np.array([0.3, 0.1, 1.5, 0.7]))
    assert (picture.rgba[-1] == [0, 0, 255, 255]).all()
    rays = pixel_rays(CAMERA, 0.7)
    np.testing.assert_allclose(picture.depth[-1], -1.0 / rays[-1, :, 2], rtol=1e-5)


def test_an_empty_world() -> None:
    picture = c.CameraSensor(CAMERA).take(c.Scenery([]), np.empty((0, 4)), np.array([0.0, 0, 1, 0]), NOBODY)
    assert (picture.rgba[0, :, :3] == c.SKY).all()
    assert (picture.rgba[-1, :, :3] == c.GROUND).all()


def test_an_eye_on_a_corner_or_in_a_wall_makes_a_picture() -> None:
    box = make_model(0, rectangle(1.0, 1.0))
    for x, y in ((0.5, 0.5), (0.5, 0.0), (0.0, 0.0)):
        picture = take([box], np.zeros((1, 4)), np.array([x, y, 0.5, 0.0]))
        assert not np.isnan(picture.depth).any()


def test_camera_info_is_a_pinhole() -> None:
    info = c.camera_info(replace(CAMERA, width=100, height=50, fov_h=math.pi / 2, fov_v=math.pi / 3))
    np.testing.assert_allclose(info.k, [[50, 0, 50], [0, 25 * math.sqrt(3), 25], [0, 0, 1]])
    np.testing.assert_array_equal(info.p[:, :3], info.k)
    np.testing.assert_array_equal(info.p[:, 3], 0)


def test_where_it_looks_from() -> None:
    camera = replace(CAMERA, pan=0.25)
    parent, pose = np.array([1.0, 2, 0, 0.5]), np.array([1.3, 2.1, 0.4, 0.7])
    np.testing.assert_allclose(c.mounted_eye(camera, pose), [1.3, 2.1, 0.4, 0.45])
    np.testing.assert_allclose(c.stage_eye(camera, parent, pose), [1.0, 2.0, 0.4, 0.25])


def test_millimetres() -> None:
    depth = np.array([[0.5, 1.2345, 7.9, 8.5, np.inf, -np.inf, 0.2]], dtype=np.float32)
    picture = c.Picture(np.zeros((1, 7, 4), np.uint8), depth)
    camera = replace(CAMERA, near=0.2, far=8.0)
    np.testing.assert_array_equal(c.millimetres(picture, camera), [[500, 1234, 7900, 0, 0, 0, 0]])
    assert c.millimetres(c.Picture(picture.rgba, depth * 10), replace(CAMERA, far=100.0))[0, 2] == 0  # above 65.5 m


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"width": 0}, "pixels"),
        ({"height": 10**7}, "pixels"),
        ({"fov_h": 3.2}, "fields of view"),
        ({"fov_v": math.nan}, "fields of view"),
        ({"near": 20.0}, "near < far"),
        ({"far": math.inf}, "near < far"),
        ({"tilt": 1.6}, "tilt"),
        ({"tilt": math.nan}, "tilt"),
    ],
)
def test_what_makes_no_camera(change: dict[str, float], message: str) -> None:
    with pytest.raises(Error, match=message):
        c.CameraSensor(replace(CAMERA, **change))


def test_places_that_are_none() -> None:
    box = make_model(0, rectangle(1.0, 1.0))
    with pytest.raises(ValueError, match="eye is not finite"):
        take([box], np.zeros((1, 4)), np.array([0.0, math.nan, 1, 0]))
    with pytest.raises(ValueError, match="poses is not finite"):
        take([box], np.full((1, 4), math.inf), np.zeros(4))
    with pytest.raises(ValueError, match="wrong shape"):
        take([box], np.zeros((1, 4)), np.zeros(3))
    with pytest.raises(ValueError, match="wrong shape"):
        take([box], np.zeros((2, 4)), np.zeros(4))
