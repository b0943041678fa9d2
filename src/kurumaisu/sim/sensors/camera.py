# SPDX-License-Identifier: BSD-3-Clause
"""The camera: colour, depth and intrinsics, drawn from the shapes of the models."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from kurumaisu import _core
from kurumaisu.errors import Error
from kurumaisu.types import BoolArray, ByteArray, FloatArray, IntArray
from kurumaisu.world.model import Camera, Model, Polygon

if TYPE_CHECKING:
    from numpy.typing import NDArray

GROUND = (255, 255, 255)  # Stage's floor
SKY = (179, 179, 204)  # what Stage clears its window to: 0.7, 0.7, 0.8


@dataclass(frozen=True)
class Picture:
    """One frame, rows from top to bottom: colours (h, w, 4) of bytes, red to alpha; depths (h, w) [m].

    A depth is along the optical axis, -inf nearer than the camera's near range, +inf where nothing is nearer than its
    far range (REP 118).
    """

    rgba: ByteArray
    depth: NDArray[np.float32]


@dataclass(frozen=True)
class CameraInfo:
    """Intrinsics as sensor_msgs/CameraInfo has them: K, R (3, 3), P (3, 4), without distortion."""

    width: int
    height: int
    k: FloatArray
    r: FloatArray
    p: FloatArray


def camera_info(camera: Camera) -> CameraInfo:
    """Return the intrinsics of a camera; the centre of the picture is its principal point."""
    fx = camera.width / (2 * math.tan(camera.fov_h / 2))
    fy = camera.height / (2 * math.tan(camera.fov_v / 2))
    k = np.array([[fx, 0, camera.width / 2], [0, fy, camera.height / 2], [0, 0, 1]])
    return CameraInfo(camera.width, camera.height, k, np.eye(3), np.hstack([k, np.zeros((3, 1))]))


def mounted_eye(camera: Camera, pose: FloatArray) -> FloatArray:
    """Return where a camera looks from, for the global pose (4,) of its model. Pan turns to the right, as in Stage."""
    return np.array([*pose[:3], pose[3] - camera.pan])


def stage_eye(camera: Camera, parent: FloatArray, pose: FloatArray) -> FloatArray:
    """Return where Stage looks from: above its parent's origin, whatever x, y and heading the camera's pose has."""
    return np.array([parent[0], parent[1], pose[2], parent[3] - camera.pan])


def millimetres(picture: Picture, camera: Camera) -> NDArray[np.uint16]:
    """Return the depths as 16UC1: whole millimetres, cut off, 0 outside the camera's range."""
    depth = np.where(np.isfinite(picture.depth), picture.depth, 0.0)
    values = (depth * 1000).astype(np.int64)
    near, far = int(camera.near * 1000), int(camera.far * 1000)
    inside = (values > near) & (values < min(far, 1 << 16))
    return np.where(inside, values, 0).astype(np.uint16)


def build(camera: Camera) -> _core.Camera:
    """Return the tables of a camera. Raise ValueError naming a value that makes no camera."""
    return _core.Camera(
        width=camera.width,
        height=camera.height,
        fov_h=camera.fov_h,
        fov_v=camera.fov_v,
        near=camera.near,
        far=camera.far,
        tilt=camera.tilt,
    )


class Scenery:
    """What cameras see of a world: the walls of all models, each in the frame of its model.

    Blocks, boxes and the occupied parts of a bitmap have a top and a bottom. Colours are flat, as in Stage.
    """

    def __init__(self, models: Sequence[Model]) -> None:
        """Collect the shapes of the models."""
        parts = [part for model in models for part in _parts(model)]
        counts = [len(part.walls) for part in parts]
        prisms = [i if part.closed else -1 for i, part in enumerate(parts)]
        colors = np.array([part.color for part in parts], dtype=np.uint8).reshape(-1, 4)
        self.panels = _core.Panels(
            np.concatenate([np.empty((0, 6)), *(part.walls for part in parts)]),
            np.repeat(colors, counts, axis=0),
            np.repeat(np.array(prisms, dtype=np.int64), counts),
            np.repeat(np.array([part.body for part in parts], dtype=np.int64), counts),
        )
        self._roots: IntArray = np.array([model.root for model in models], dtype=np.int64)

    def __deepcopy__(self, memo: object) -> Scenery:
        return self  # it never changes

    def hidden_from(self, root: int) -> BoolArray:
        """Return which models (n,) a camera in the tree of a top-level model does not see: its own."""
        return np.asarray(self._roots == root)


class CameraSensor:
    """Takes pictures."""

    def __init__(self, camera: Camera, ground: tuple[int, int, int] = GROUND, sky: tuple[int, int, int] = SKY) -> None:
        """Prepare for the camera's optics. Raise Error naming a value that makes no camera."""
        try:
            self._camera = build(camera)
        except ValueError as error:
            raise Error(f"camera: {error}: {camera}") from error
        self._ground = np.array([*ground, 255], dtype=np.uint8)
        self._sky = np.array([*sky, 255], dtype=np.uint8)

    def __deepcopy__(self, memo: object) -> CameraSensor:
        return self  # it has no state that a picture depends on

    def take(self, scenery: Scenery, poses: FloatArray, eye: FloatArray, root: int) -> Picture:
        """Return the picture from an eye (4,) on the tree of the model `root`, all models being at poses (n, 4)."""
        hidden = scenery.hidden_from(root)
        return Picture(*self._camera.render(scenery.panels, poses, hidden, eye, self._ground, self._sky))


@dataclass(frozen=True)
class _Part:
    walls: FloatArray  # (m, 6): x, y of both ends, lowest and highest z [m]
    color: tuple[int, ...]
    closed: bool
    body: int


def _parts(model: Model) -> Iterator[_Part]:
    prisms = [_prism(polygon) for polygon in model.shape.polygons]
    for polygon, walls in zip(model.shape.polygons, prisms, strict=True):
        yield _Part(walls, _bytes(polygon.color), True, model.index)
    segments = np.hstack([model.shape.segments, model.shape.heights])
    edges = np.concatenate([np.empty((0, 6)), *prisms])
    bitmap = len(segments) - len(edges)  # its outline comes first
    told_apart = bitmap >= 0 and np.allclose(segments[bitmap:], edges)
    if bitmap or not told_apart:
        yield _Part(segments[: bitmap if told_apart else None], _bytes(model.color), told_apart, model.index)


def _prism(polygon: Polygon) -> FloatArray:
    corners = polygon.corners
    return np.hstack([corners, np.roll(corners, -1, axis=0), np.tile(polygon.heights, (len(corners), 1))])


def _bytes(color: tuple[float, float, float, float]) -> tuple[int, ...]:
    return (*(round(255 * min(max(part, 0.0), 1.0)) for part in color[:3]), 255)
