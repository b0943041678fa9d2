# SPDX-License-Identifier: BSD-3-Clause
"""Rooms made of boxes, and the Stage world file that maps them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kurumaisu.types import FloatArray

_THICK = 0.1  # [m] of walls


@dataclass(frozen=True)
class Box:
    """A box on the floor: middle x, y [m], yaw [rad], length and width [m], reflectance [1]."""

    name: str
    x: float
    y: float
    yaw: float
    length: float
    width: float
    reflectance: float = 1.0

    def corners(self) -> FloatArray:
        """Return the corners (4, 2), counter-clockwise."""
        local = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * [self.length / 2, self.width / 2]
        c, s = np.cos(self.yaw), np.sin(self.yaw)
        return np.asarray(local @ np.array([[c, s], [-s, c]]) + [self.x, self.y])


Room = tuple[Box, ...]


def edges(corners: FloatArray) -> FloatArray:
    """Return the edges (4 boxes, 4) of boxes' corners (boxes, 4, 2)."""
    return np.asarray(np.concatenate([corners, np.roll(corners, -1, axis=1)], axis=2).reshape(-1, 4))


def corners(room: Room) -> FloatArray:
    """Return all corners (boxes, 4, 2)."""
    return np.stack([box.corners() for box in room])


def draw_room(rng: np.random.Generator) -> Room:
    """Return a room of about 6 by 5 m with walls of different materials, a pillar, a cupboard and a slanted board."""
    width, depth = rng.uniform(5.4, 6.4), rng.uniform(4.4, 5.4)

    def material() -> float:
        return float(rng.choice([1.0, 1.0, 0.7, 0.4]))

    half = _THICK / 2
    walls = (
        Box("south", 0.0, -depth / 2 - half, 0.0, width + 0.2, _THICK, material()),
        Box("north", 0.0, depth / 2 + half, 0.0, width + 0.2, _THICK, material()),
        Box("west", -width / 2 - half, 0.0, np.pi / 2, depth, _THICK, material()),
        Box("east", width / 2 + half, 0.0, np.pi / 2, depth, _THICK, material()),
    )
    board = rng.uniform(0.3, 1.2)
    return (
        *walls,
        Box("pillar", rng.uniform(1.7, 2.2), rng.uniform(1.2, 1.6), rng.uniform(0, 1.5), 0.3, 0.3, material()),
        Box("cupboard", -width / 2 + 0.3, rng.uniform(-0.8, 0.8), 0.0, 0.6, 1.2, material()),
        Box("board", rng.uniform(-1.0, 1.0), -depth / 2 + 0.4, board, 1.0, 0.05, material()),
    )


def one_wall(rng: np.random.Generator) -> Room:
    """Return a single long wall at x = 0."""
    return (Box("wall", _THICK / 2, 0.0, np.pi / 2, 12.0, _THICK, 1.0),)


def world_text(name: str, room: Room) -> str:
    """Return a Stage world file of a room; its boxes are higher than any laser."""
    lines = [f'name "{name}"', "define wall model ( gui_move 0 )"]
    for box in room:
        pose = f"{box.x:.9g} {box.y:.9g} 0 {np.degrees(box.yaw):.9g}"
        size = f"{box.length:.9g} {box.width:.9g} 2"
        look = f"ranger_return {box.reflectance:.9g}"
        lines.append(f'wall ( name "{box.name}" pose [{pose}] size [{size}] {look} )')
    return "\n".join(lines) + "\n"
