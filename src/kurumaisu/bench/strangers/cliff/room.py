# SPDX-License-Identifier: BSD-3-Clause
"""A room of walls and furniture: its Stage file, and rays cast against it."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from .values import Array, Rng


@dataclass(frozen=True)
class Room:
    """Boxes: rows of x, y, theta, length, thickness, and how much each reflects."""

    boxes: Array
    shine: Array
    free: tuple[float, float]  # where drives begin

    def segments(self) -> tuple[Array, Array, Array]:
        """Sides of all boxes: start, end, and the box of each."""
        x, y, a, long, thick = self.boxes.T
        c, s = np.cos(a), np.sin(a)
        signs = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]]) / 2
        corners = [
            np.column_stack([x + c * i * long - s * j * thick, y + s * i * long + c * j * thick]) for i, j in signs
        ]
        start = np.concatenate(corners)
        end = np.concatenate([corners[1], corners[2], corners[3], corners[0]])
        return start, end, np.tile(np.arange(len(x)), 4)


def draw_room(rng: Rng, dull: bool) -> Room:
    """A room of 6 to 12 m with furniture near its walls; `dull`: some of it reflects little."""
    a, b = float(rng.uniform(6.5, 12.0)), float(rng.uniform(6.0, 9.0))
    t = 0.1
    walls = [
        [0, b / 2, 0, a + t, t],
        [0, -b / 2, 0, a + t, t],
        [a / 2, 0, np.pi / 2, b + t, t],
        [-a / 2, 0, np.pi / 2, b + t, t],
    ]
    for _ in range(int(rng.integers(5, 10))):
        long, deep = float(rng.uniform(0.3, 1.4)), float(rng.uniform(0.2, 0.6))
        side = int(rng.integers(4))
        along = float(rng.uniform(-0.42, 0.42))
        off = 0.5 * deep + float(rng.uniform(0.1, 0.5))
        x, y = [(along * a, b / 2 - off), (along * a, off - b / 2), (a / 2 - off, along * b), (off - a / 2, along * b)][
            side
        ]
        turn = (np.pi / 2 if side > 1 else 0.0) + float(rng.choice([0.0, rng.uniform(-0.5, 0.5)]))
        walls.append([x, y, turn, long, deep])
    boxes = np.array(walls, float)
    boxes[:, [0, 1, 3, 4]] = np.round(boxes[:, [0, 1, 3, 4]], 3)
    boxes[:, 2] = np.radians(np.round(np.degrees(boxes[:, 2]), 2))
    shine = np.ones(len(boxes))
    if dull:
        shine[rng.permutation(len(boxes))[: len(boxes) // 2]] = 0.4
    return Room(boxes, shine, (float(rng.uniform(-0.5, 0.5)), float(rng.uniform(-0.5, 0.5))))


def other_map(room: Room, scale: float, shift: Array) -> Room:
    """The room as it is where the map is not exact: scaled, and each box shifted along its normal."""
    boxes = room.boxes.copy()
    boxes[:, :2] *= 1.0 + scale
    boxes[:, 3] *= 1.0 + scale
    boxes[:, 0] -= np.sin(boxes[:, 2]) * shift
    boxes[:, 1] += np.cos(boxes[:, 2]) * shift
    return replace(room, boxes=boxes)


def clearance(room: Room, path: Array) -> float:
    """Least distance between a path (rows of x, y, ...) and a wall; negative inside a box."""
    x, y, a, long, thick = room.boxes.T[:, None, :]
    dx, dy = path[:, 0:1] - x, path[:, 1:2] - y
    u = np.abs(np.cos(a) * dx + np.sin(a) * dy) - long / 2
    v = np.abs(np.cos(a) * dy - np.sin(a) * dx) - thick / 2
    gap = np.hypot(np.maximum(u, 0), np.maximum(v, 0)) + np.minimum(np.maximum(u, v), 0)
    edge = np.abs(room.boxes[:4, :2]).max(axis=0)
    inside = np.minimum(edge[0] - np.abs(path[:, 0]), edge[1] - np.abs(path[:, 1]))
    return float(min(gap.min(), inside.min()))


def room_for(room: Room, path: Array) -> Room:
    """The room in which that path could be driven: walls further out, and without furniture that is in the way."""
    boxes = room.boxes.copy()
    reach = np.maximum(boxes[:4, :2].max(axis=0), np.abs(path[:, :2]).max(axis=0) + 0.5)
    boxes[0, 1], boxes[1, 1], boxes[2, 0], boxes[3, 0] = reach[1], -reach[1], reach[0], -reach[0]
    boxes[:2, 3], boxes[2:4, 3] = 2 * reach[0] + 0.1, 2 * reach[1] + 0.1
    keep = [k < 4 or clearance(replace(room, boxes=boxes[[0, 1, 2, 3, k]]), path) > 0.4 for k in range(len(boxes))]
    return replace(room, boxes=boxes[keep], shine=room.shine[keep])


def cast(room: Room, x: Array, y: Array, angle: Array) -> tuple[Array, Array]:
    """True range of each ray (rows: scans, columns: beams) and the side it meets (-1: none)."""
    p, q, _ = room.segments()
    e = q - p
    ranges = np.full(x.shape, np.inf)
    side = np.full(x.shape, -1)
    for k in range(len(x)):
        ux, uy = np.cos(angle[k])[:, None], np.sin(angle[k])[:, None]
        wx, wy = p[:, 0] - x[k][:, None], p[:, 1] - y[k][:, None]
        with np.errstate(divide="ignore", invalid="ignore"):
            det = ux * e[:, 1] - uy * e[:, 0]
            r = (wx * e[:, 1] - wy * e[:, 0]) / det
            share = (wx * uy - wy * ux) / det
        r = np.where((r > 1e-6) & (share >= 0) & (share <= 1), r, np.inf)
        side[k] = r.argmin(axis=1)
        ranges[k] = r[np.arange(len(r)), side[k]]
    side[~np.isfinite(ranges)] = -1
    return ranges, side


def world_text(room: Room) -> str:
    """The Stage file."""
    lines = ["# a room, one box per wall or piece of furniture", ""]
    for k, (x, y, a, long, thick) in enumerate(room.boxes):
        pose = f"{x:.4f} {y:.4f} 0 {np.degrees(a):.5f}"
        size = f"{long:.4f} {thick:.4f} 1.0"
        lines.append(f'model ( name "w{k + 1}" pose [ {pose} ] size [ {size} ] ranger_return {room.shine[k]:g} )')
    return "\n".join(lines) + "\n"
