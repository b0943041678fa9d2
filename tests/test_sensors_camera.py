# SPDX-License-Identifier: BSD-3-Clause
"""The camera against geometry worked out by hand, and against one ray per pixel through solid prisms."""

import math

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from sensing import make_model, rectangle

from kurumaisu.sim.sensors import camera as c
from kurumaisu.types import FloatArray
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
        st.floats(-6, 6), st.floats(-6, 6), st.floats(0, 1.5), st.floats(-3, 3),  # pose
        st.floats(0.1, 2), st.floats(0.1, 2), st.floats(0.1, 2),  # size
    ),
    min_size=0,
    max_size=8,
)  # fmt: skip


@settings(max_examples=60, deadline=None)
@given(boxes=boxes, height=st.floats(0.05, 3), heading=st.floats(-4, 4))
def test_any_boxes_agree_with_a_ray_per_pixel(boxes: list[tuple[float, ...]], height: float, heading: float) -> None:
    models = [make_model(i, rectangle(b[4], b[5]), (0.0, b[6])) for i, b in enumerate(boxes)]
    poses = np.array([b[:4] for b in boxes]).reshape(-1, 4)
    eye = np.array([0.013, 0.017, height, heading])
    around = [max(abs(b[0]) - b[4], abs(b[1]) - b[5]) for b in boxes]
    if any(gap < 0.3 + b[4] + b[5] for gap, b in zip(around, boxes, strict=True)):
        return  # the eye stands in, over or under a box: tested apart
    found = take(models, poses, eye)
    assert share_of_differences(found.depth, expected_depth(models, poses, eye, CAMERA)) < 0.002  # edges, by rounding
