# SPDX-License-Identifier: BSD-3-Clause
"""A room about the drives: made of shapes, drawn in pixels, and rays that end at the pixels."""

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image
from scipy.ndimage import distance_transform_edt

from .model import F


@dataclass
class Shape:
    """An outline of half planes seen from inside, a box, or a pillar."""

    sort: str
    a: F  # outline: angles; else x, y, turn, half length, half width (pillar: radius)
    b: F  # outline: distances
    grey: int = 0

    def near(self, x: F, y: F) -> tuple[F, F]:
        """Distance from the surface, at most 0 inside, and the way that the surface faces."""
        if self.sort == "outline":
            top, way = np.full(np.broadcast_shapes(x.shape, y.shape), -1e9), np.zeros(1)
            for k, q in zip(self.a, self.b, strict=True):
                d = np.cos(k) * x + np.sin(k) * y - q
                top, way = np.maximum(top, d), np.where(d > top, k, way)
            return np.where(top < 0.2, -top, 1.0), way + np.pi
        x, y = x - self.a[0], y - self.a[1]
        if self.sort == "pillar":
            return np.hypot(x, y) - self.a[3], np.arctan2(y, x)
        c, s = np.cos(self.a[2]), np.sin(self.a[2])
        p, q = c * x + s * y, -s * x + c * y
        ep, eq = np.abs(p) - self.a[3], np.abs(q) - self.a[4]
        face = np.where(ep > eq, np.where(p > 0, 0.0, np.pi), np.where(q > 0, np.pi / 2, -np.pi / 2))
        return np.maximum(ep, eq), face + self.a[2]


@dataclass
class Room:
    """Pixels, row 0 at the least y."""

    res: float
    x0: float
    y0: float
    solid: NDArray[np.bool_]
    face: NDArray[np.float32]
    which: NDArray[np.int16]
    shapes: list[Shape]
    free: NDArray[np.float32] = field(default_factory=lambda: np.zeros((0, 0), np.float32))

    def grey(self) -> NDArray[np.float64]:
        """Grey of each shape, 0 to 1."""
        return np.array([s.grey / 255 for s in self.shapes])

    def cast(self, x: F, y: F, a: F, far: float = 5.0) -> tuple[F, NDArray[np.int64]]:
        """Ranges of rays up to the first solid pixel, and that pixel; inf and -1 where there is none."""
        res, (ny, nx) = self.res, self.solid.shape
        flat, free = self.solid.ravel(), self.free.ravel()
        px, py, c, s = (x - self.x0) / res, (y - self.y0) / res, np.cos(a), np.sin(a)
        c, s = np.where(np.abs(c) < 1e-12, 1e-12, c), np.where(np.abs(s) < 1e-12, 1e-12, s)
        out, hit = np.full(len(px), np.inf), np.full(len(px), -1, np.int64)
        live, d = np.arange(len(px)), np.zeros(len(px))
        while len(live):
            qx, qy, cc, ss = px[live] + c[live] * d, py[live] + s[live] * d, c[live], s[live]
            ix, iy = np.floor(qx).astype(np.int64), np.floor(qy).astype(np.int64)
            ok = (ix >= 0) & (iy >= 0) & (ix < nx) & (iy < ny) & (d < far / res)
            live, d, qx, qy, cc, ss, ix, iy = (k[ok] for k in (live, d, qx, qy, cc, ss, ix, iy))
            cell = iy * nx + ix
            done = flat[cell]
            out[live[done]], hit[live[done]] = d[done] * res, cell[done]
            go = ~done
            live, d, qx, qy, cc, ss, ix, iy, cell = (k[go] for k in (live, d, qx, qy, cc, ss, ix, iy, cell))
            one = np.minimum((ix + (cc > 0) - qx) / cc, (iy + (ss > 0) - qy) / ss) + 1e-7
            d = d + np.maximum(one, free[cell] - 1.5)
        return out, hit

    def write(self, folder: Path, name: str) -> None:
        """The map as a Stage world and a picture."""
        grey = np.full(self.solid.shape, 255, np.uint8)
        shades = np.array([s.grey for s in self.shapes], np.uint8)
        grey[self.solid] = shades[self.which[self.solid]]
        Image.fromarray(grey[::-1]).save(folder / f"{name}.png")
        ny, nx = self.solid.shape
        w, h = nx * self.res, ny * self.res
        text = f"""# a room
define floorplan model
(
  color "gray30"
  boundary 0
  gui_nose 0
  gui_grid 0
  gui_outline 0
  gripper_return 0
  fiducial_return 0
  ranger_return 1
)

resolution {self.res:g}

floorplan
(
  name "{name}"
  bitmap "{name}.png"
  size [{w:.6f} {h:.6f} 1.0]
  pose [{self.x0 + w / 2:.6f} {self.y0 + h / 2:.6f} 0 0]
)
"""
        (folder / f"{name}.world").write_text(text)


def raster(shapes: list[Shape], res: float) -> Room:
    """Draw shapes; the first that covers a pixel has it."""
    k, q = shapes[0].a, shapes[0].b
    corners = []
    for i in range(len(k)):
        for j in range(i):
            m = np.array([[np.cos(k[i]), np.sin(k[i])], [np.cos(k[j]), np.sin(k[j])]])
            if abs(np.linalg.det(m)) > 0.05:
                p = np.linalg.solve(m, [q[i], q[j]])
                if all(np.cos(k) * p[0] + np.sin(k) * p[1] <= q + 1e-9):
                    corners.append(p)
    low, high = np.min(corners, axis=0) - 0.4, np.max(corners, axis=0) + 0.4
    if res <= 0:  # walls askew: as fine as may be
        res = max(0.0025, float(np.ceil(np.sqrt(np.prod(high - low) / 7e6) * 2000) / 2000))
    low = np.floor(low / res + 1e-6) * res
    nx, ny = (int(n) for n in np.ceil((high - low) / res))
    x, y = low[0] + (np.arange(nx) + 0.5) * res, low[1] + (np.arange(ny) + 0.5) * res
    solid, face = np.zeros((ny, nx), bool), np.zeros((ny, nx), np.float32)
    which = np.full((ny, nx), -1, np.int16)
    for i, s in enumerate(shapes):
        far = 1e9 if s.sort == "outline" else float(s.a[3] + s.a[4]) + 0.05
        cx, cy = (0.0, 0.0) if s.sort == "outline" else (s.a[0], s.a[1])
        v, u = np.flatnonzero(np.abs(y - cy) < far), np.flatnonzero(np.abs(x - cx) < far)
        if len(v) == 0 or len(u) == 0:
            continue
        part = (slice(v[0], v[-1] + 1), slice(u[0], u[-1] + 1))
        d, f = s.near(x[None, u], y[v, None])
        new = (d <= 0) & ~solid[part]
        solid[part] |= new
        face[part][new], which[part][new] = np.broadcast_to(f, new.shape)[new], i
    rows, cols = np.flatnonzero(solid.any(1)), np.flatnonzero(solid.any(0))
    cut = (slice(rows[0], rows[-1] + 1), slice(cols[0], cols[-1] + 1))
    x0, y0 = float(low[0] + cols[0] * res), float(low[1] + rows[0] * res)
    room = Room(res, x0, y0, solid[cut], face[cut], which[cut], shapes)
    room.free = distance_transform_edt(~room.solid).astype(np.float32)
    return room


def make_room(x: F, y: F, rng: np.random.Generator, grey: bool = False) -> Room:
    """A room that leaves room for the places of some drives: along the pixels, or askew in fine pixels."""
    square, narrow = rng.random() < 0.7, rng.random() < 0.3
    first, n = (0.0 if square else rng.uniform(0, np.pi)), 4 if square or narrow else int(rng.integers(5, 8))
    k = first + (np.arange(n) + (0.0 if n == 4 else rng.uniform(-0.25, 0.25, n))) * 2 * np.pi / n
    reach = np.array([(np.cos(q) * x + np.sin(q) * y).max() for q in k])
    res = float(rng.choice([0.005, 0.01])) if np.prod(reach[:2] + reach[-2:] + 3) < 150 else 0.01
    margin = rng.uniform(0.5, 1.1, n) if narrow else rng.uniform(0.6, 1.8, n)
    edge = np.ceil((reach + margin) / res) * res if square else reach + margin
    shapes = [Shape("outline", k, edge)]
    spots = np.unique(np.round(np.stack([x, y], 1) / 0.1), axis=0) * 0.1
    low, high = spots.min(0) - 1.2, spots.max(0) + 1.2
    for _ in range(int(rng.integers(60, 160))):
        p, kind = rng.uniform(low, high), rng.choice(["box", "pillar", "wall"])
        size = rng.uniform(0.08, 0.6, 2) if kind != "wall" else rng.uniform([0.3, 0.02], [1.2, 0.06])
        a = first if square else rng.choice([first, first, rng.uniform(0, np.pi)])
        if square:  # edges on edges of pixels
            p, size = np.round(p / res) * res, np.maximum(np.round(size / res), 1) * res
            size = size[::-1] if rng.random() < 0.5 else size
        s = Shape("pillar" if kind == "pillar" and not square else "box", np.array([*p, a, *size]), np.zeros(0))
        if s.near(spots[:, 0], spots[:, 1])[0].min() > 0.55 and len(shapes) < 16:
            s.grey = int(rng.choice([0, 40, 80, 110])) if grey else 0
            shapes.append(s)
    return raster(shapes, res if square else 0.0)
