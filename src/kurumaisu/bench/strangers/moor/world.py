# SPDX-License-Identifier: BSD-3-Clause
"""A room of walls and blocks: as a Stage world, for distances, and for rays."""

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]
Flags = npt.NDArray[np.bool_]


@dataclass(frozen=True)
class Box:
    """A block or a wall: its middle, its size, how it is turned, whether its surface is dark."""

    x: float
    y: float
    length: float
    width: float
    yaw: float
    dark: bool = False


@dataclass(frozen=True)
class Room:
    """All boxes of a room."""

    boxes: tuple[Box, ...]

    def clearance(self, x: Array, y: Array) -> Array:
        """Distance of points to the nearest box."""
        best = np.full(np.shape(x), np.inf)
        for b in self.boxes:
            c, s = np.cos(b.yaw), np.sin(b.yaw)
            along, across = c * (x - b.x) + s * (y - b.y), c * (y - b.y) - s * (x - b.x)
            away = np.hypot(np.maximum(abs(along) - b.length / 2, 0), np.maximum(abs(across) - b.width / 2, 0))
            best = np.minimum(best, away)
        return best

    def faces(self) -> Array:
        """Each box as four faces: x, y of the first corner, then the way to the next."""
        rows = []
        for b in self.boxes:
            c, s = np.cos(b.yaw), np.sin(b.yaw)
            h, k = b.length / 2, b.width / 2
            corners = [(b.x + c * p - s * q, b.y + s * p + c * q) for p, q in ((-h, -k), (h, -k), (h, k), (-h, k))]
            for (x0, y0), (x1, y1) in zip(corners, corners[1:] + corners[:1], strict=True):
                rows.append((x0, y0, x1 - x0, y1 - y0))
        return np.array(rows)

    def cast(self, x: Array, y: Array, angle: Array) -> tuple[Array, Array, Ints]:
        """Range, angle of incidence and face (four to a box) that each ray meets; inf, 0, -1 where it meets none."""
        faces = self.faces()
        near = np.full(x.size, np.inf)
        hit = np.full(x.size, -1)
        with np.errstate(divide="ignore", invalid="ignore"):
            for i in range(0, x.size, 20000):
                part = slice(i, i + 20000)
                cx, cy = np.cos(angle[part])[:, None], np.sin(angle[part])[:, None]
                ox, oy = faces[:, 0] - x[part, None], faces[:, 1] - y[part, None]
                det = cx * faces[:, 3] - cy * faces[:, 2]
                along = (ox * faces[:, 3] - oy * faces[:, 2]) / det
                on = (ox * cy - oy * cx) / det
                along = np.where((on >= 0) & (on <= 1) & (along > 0), along, np.inf)
                hit[part] = np.argmin(along, axis=1)
                near[part] = np.take_along_axis(along, hit[part, None], 1)[:, 0]
        face = faces[hit]
        normal = np.arctan2(face[:, 3], face[:, 2]) - np.pi / 2
        incidence = np.arccos(np.clip(abs(np.cos(angle - normal)), 0, 1))
        return near, incidence, np.where(np.isfinite(near), hit, -1)

    def moved(self, rng: np.random.Generator, scale: float, sd: float, turn: float) -> "Room":
        """The room as it is, where its map has errors: scaled, each box shifted and turned a little."""
        boxes = []
        for b in self.boxes:
            dx, dy, a = rng.normal(0, 1, 3)
            new = replace(b, x=b.x * (1 + scale) + sd * dx, y=b.y * (1 + scale) + sd * dy, yaw=b.yaw + turn * a)
            boxes.append(replace(new, length=b.length * (1 + scale), width=b.width * (1 + scale)))
        return Room(tuple(boxes))

    def mirrored(self) -> "Room":
        """The room with left and right exchanged."""
        return Room(tuple(replace(b, x=-b.x, yaw=-b.yaw) for b in self.boxes))

    def stage(self) -> str:
        """The text of a Stage world."""
        lines = ["resolution 0.01", "", "define block model", "(", "  size [1.0 1.0 1.0]", "  gui_nose 0", ")", ""]
        for i, b in enumerate(self.boxes):
            look = f'color "{"black" if b.dark else "gray70"}" ranger_return {0.1 if b.dark else 1.0}'
            pose = f"pose [{b.x:.4f} {b.y:.4f} 0.0 {np.degrees(b.yaw):.4f}]"
            lines.append(f'block ( name "box_{i}" {pose} size [{b.length:.4f} {b.width:.4f} 1.0] {look} )')
        return "\n".join(lines) + "\n"


def draw_room(rng: np.random.Generator) -> Room:
    """A laboratory of 6 to 7.5 m with a partition and blocks along its walls."""
    w, h = rng.uniform(6.0, 7.5), rng.uniform(5.6, 7.0)
    x0, y0 = rng.uniform(-1, 1, 2)
    boxes = [Box(x0, y0 + s * (h / 2 + 0.05), w + 0.2, 0.1, 0.0) for s in (-1, 1)]
    boxes += [Box(x0 + s * (w / 2 + 0.05), y0, 0.1, h, 0.0) for s in (-1, 1)]
    boxes.append(Box(x0 + rng.uniform(-1, 1), y0 + h / 2 - 0.6, 0.08, 1.2, 0.0, bool(rng.random() < 0.5)))
    for i in range(rng.integers(6, 10)):
        length, width = rng.uniform(0.25, 0.8, 2)
        side, along = i % 4, rng.uniform(-0.42, 0.42)
        out = rng.uniform(0.2, 0.5)
        px, py = w / 2 - out, h / 2 - out
        place = [(along * w, -py), (along * w, py), (-px, along * h), (px, along * h)]
        yaw = rng.choice([0.0, rng.uniform(-0.7, 0.7)])
        boxes.append(Box(x0 + place[side][0], y0 + place[side][1], length, width, yaw, bool(i % 3 == 0)))
    return Room(tuple(replace(b, x=round(b.x, 3), y=round(b.y, 3), yaw=round(float(b.yaw), 3)) for b in boxes))
