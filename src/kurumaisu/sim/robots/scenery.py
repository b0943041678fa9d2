# SPDX-License-Identifier: BSD-3-Clause
"""What there is to draw of a simulation: pieces with their outlines from above."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from kurumaisu.geometry import cos_sin, relative
from kurumaisu.sim.motion.partition import is_robot
from kurumaisu.sim.robots.machinery import Machinery
from kurumaisu.types import FloatArray
from kurumaisu.world.layout import placed
from kurumaisu.world.model import Model

_LARGEST_THING = 2.0  # [m] what stands and is longer or higher is a wall, which nobody drags by mistake
WALLS = "walls"  # id of the walls as effects have moved them


@dataclass(frozen=True)
class Piece:
    """Models that move, or stand, together.

    id: its model's key, as set_pose takes it; kind: robot, obstacle, person or wall; row: its place among the bodies
    that move, -1: it stands; pose (4,) in the map at the start; polygons (k, 2) and segments (m, 4) [m] in its frame.
    """

    id: str
    name: str
    kind: str
    color: tuple[float, float, float, float]
    movable: bool
    row: int
    pose: FloatArray
    polygons: tuple[FloatArray, ...]
    segments: FloatArray


def scenery(machinery: Machinery) -> tuple[Piece, ...]:
    """Return all pieces, what stands first: walls that effects have moved are one, which nobody moves by hand."""
    population, bodies = machinery.population, machinery.bodies
    still: dict[int, list[int]] = {}
    moving: list[list[int]] = [[] for _ in range(len(bodies))]
    for model, body in zip(population.models, bodies.body_of.tolist(), strict=True):
        (moving[body] if body >= 0 else still.setdefault(model.root, [])).append(model.index)
    if machinery.distort is None:
        pieces = [_piece(machinery, head, members, -1) for head, members in still.items()]
    else:
        pieces = [_walls(machinery)]
    pieces += [_piece(machinery, int(bodies.heads[row]), members, row) for row, members in enumerate(moving)]
    return tuple(piece for piece in pieces if piece.polygons or len(piece.segments))


def bounds(pieces: Iterable[Piece]) -> tuple[float, float, float, float] | None:
    """Return the smallest x, y, largest x, y [m] of pieces at their starts; None: there are none."""
    points = [np.empty((0, 2))]
    for piece in pieces:
        corners = np.concatenate([piece.segments.reshape(-1, 2), *piece.polygons])
        points.append(_turned(corners, piece.pose))
    together = np.concatenate(points)
    if not len(together):
        return None
    (x0, y0), (x1, y1) = together.min(axis=0).tolist(), together.max(axis=0).tolist()
    return x0, y0, x1, y1


def _piece(machinery: Machinery, head: int, members: list[int], row: int) -> Piece:
    population = machinery.population
    model, pose = population.models[head], population.poses[head]
    polygons: list[FloatArray] = []
    segments = [np.empty((0, 4))]
    for index in members:
        member = population.models[index]
        place = relative(pose, population.poses[index])
        polygons += [_turned(polygon.corners, place) for polygon in member.shape.polygons]
        if not member.shape.polygons:
            segments.append(placed(member.shape.segments, place))
    solid = [np.empty((0, 2)), *polygons]
    extent = np.ptp(np.concatenate(solid), axis=0).max() if polygons else np.inf
    kind = _kind(
        model, row, max(float(extent), float(np.ptp(model.shape.heights)) if len(model.shape.heights) else 0.0)
    )
    key = int(population.keys[head])
    if kind == "wall" and key >= population.home and polygons:
        kind = "obstacle"  # who has added it may take it away again
    return Piece(
        id=f"#{key}",
        name=model.name or f"{model.type} {key}",
        kind=kind,
        color=model.color,
        movable=kind != "wall",
        row=row,
        pose=pose,
        polygons=tuple(polygons),
        segments=np.concatenate(segments),
    )


def _walls(machinery: Machinery) -> Piece:
    faces = machinery.walls.faces[:, :4]
    return Piece(WALLS, "walls", "wall", (0.3, 0.3, 0.3, 1.0), False, -1, np.zeros(4), (), faces)


def _kind(model: Model, row: int, extent: float) -> str:
    if is_robot(model):
        return "robot"
    if model.walk is not None:
        return "person"
    return "obstacle" if row >= 0 or extent <= _LARGEST_THING else "wall"  # a bitmap is one, too


def _turned(corners: FloatArray, pose: FloatArray) -> FloatArray:
    """Return corners (k, 2) of a pose's (4,) frame in the frame that the pose is in."""
    c, s = cos_sin(pose[3:4])
    x, y = corners[:, 0], corners[:, 1]
    return np.stack([pose[0] + c * x - s * y, pose[1] + s * x + c * y], axis=-1)
