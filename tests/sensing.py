# SPDX-License-Identifier: BSD-3-Clause
"""What the tests of the sensors share: models made by hand, and rays cast one by one against every wall."""

from pathlib import Path

import numpy as np

from kurumaisu.types import BoolArray, FloatArray, IntArray
from kurumaisu.world.model import Device, Model, Place, Polygon, Shape

PLACE = Place(Path("by_hand.world"), 1, 1)
GREY = (0.5, 0.5, 0.5, 1.0)


def rectangle(length: float, width: float) -> FloatArray:
    return np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]]) * [length / 2, width / 2]


def make_model(
    index: int,
    corners: FloatArray | None = None,
    heights: tuple[float, float] = (0.0, 1.0),
    *,
    color: tuple[float, float, float, float] = GREY,
    segments: FloatArray | None = None,
    root: int | None = None,
    fiducial: tuple[int, int] = (0, 0),
    device: Device | None = None,
) -> Model:
    """A model with one prism (corners (k, 2)), or sheets (segments (m, 4)), or nothing."""
    z = np.array(heights)
    polygons = () if corners is None else (Polygon(corners, z, color),)
    if corners is not None:
        segments = np.hstack([corners, np.roll(corners, -1, axis=0)])
    segments = np.empty((0, 4)) if segments is None else segments
    return Model(
        index=index,
        parent=-1,
        root=index if root is None else root,
        type="model",
        name=None,
        place=PLACE,
        pose=np.zeros(4),
        origin=np.zeros(4),
        size=np.array([1.0, 1.0, heights[1]]),
        color=color,
        shape=Shape(segments, np.tile(z, (len(segments), 1)), polygons),
        stack_children=True,
        ranger_return=1.0,
        obstacle_return=True,
        fiducial_return=fiducial[0],
        fiducial_key=fiducial[1],
        gripper_return=False,
        mass=0.0,
        friction=None,
        update_interval=0.1,
        hinge=None,
        device=device,
    )


class BruteRays:
    """Every ray against every wall: walls (m, 6) as Arena takes them, returns (m,), tree (m,)."""

    def __init__(self, walls: FloatArray, returns: FloatArray | None = None, trees: IntArray | None = None) -> None:
        self.walls = np.asarray(walls, dtype=float).reshape(-1, 6)
        m = len(self.walls)
        self.returns = np.ones(m) if returns is None else np.asarray(returns, dtype=float)
        self.trees = np.full(m, -1) if trees is None else np.asarray(trees)

    def cast(self, origins: FloatArray, trees: IntArray, range_max: float) -> tuple[FloatArray, FloatArray]:
        w = self.walls
        if not len(w):
            return np.full(len(origins), np.inf), np.zeros(len(origins))
        d = np.stack([np.cos(origins[:, 3]), np.sin(origins[:, 3])], axis=-1)[:, None]
        e = (w[:, 2:4] - w[:, :2])[None]
        to_a = w[None, :, :2] - origins[:, None, :2]
        with np.errstate(all="ignore"):
            cross = d[..., 0] * e[..., 1] - d[..., 1] * e[..., 0]
            t = (to_a[..., 0] * e[..., 1] - to_a[..., 1] * e[..., 0]) / cross
            f = (to_a[..., 0] * d[..., 1] - to_a[..., 1] * d[..., 0]) / cross
        met: BoolArray = (t >= 0) & (f >= 0) & (f <= 1) & (t <= range_max) & (self.returns >= 0)
        met &= (w[:, 4] <= origins[:, 2:3]) & (origins[:, 2:3] <= w[:, 5]) & (self.trees != np.asarray(trees)[:, None])
        ranges = np.where(met, t, np.inf)
        nearest = ranges.argmin(axis=1)
        found = np.take_along_axis(ranges, nearest[:, None], axis=1)[:, 0]
        return found, np.where(np.isfinite(found), self.returns[nearest], 0.0)

    def scan(self, origins: FloatArray, trees: IntArray, fans: FloatArray) -> tuple[FloatArray, FloatArray]:
        out = []
        for origin, tree, (first, increment, samples, range_max) in zip(origins, trees, fans, strict=True):
            beams = np.tile(origin, (int(samples), 1))
            beams[:, 3] += first + increment * np.arange(int(samples))
            out.append(self.cast(beams, np.full(len(beams), tree), range_max))
        return np.concatenate([r for r, _ in out]), np.concatenate([i for _, i in out])
