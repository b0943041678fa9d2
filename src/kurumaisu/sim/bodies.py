# SPDX-License-Identifier: BSD-3-Clause
"""What moves as one piece, and what never moves, from the models of a world."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pymunk
from pymunk.autogeometry import convex_decomposition

from kurumaisu.geometry import between, compose
from kurumaisu.sim.settings import Dynamics
from kurumaisu.types import FloatArray, IntArray
from kurumaisu.world.model import Model, Position, Shape

GRAVITY = 9.81  # [m/s^2]
_LIGHTEST = 1.0e-3  # [kg] of what has no size to guess its mass from
_SLIVER = 1.0e-9  # [m^2] polygons of less area are no bodies
# Mean distance of a uniform disc's or square's points from its centre, over its radius of gyration: 0.943 and 0.937.
_MEAN_OVER_GYRATION = 0.94


@dataclass(frozen=True)
class Part:
    """A convex prism, or, of two corners, an upright sheet: corners (k, 2), heights (2,) [m], in the body's frame."""

    corners: FloatArray
    heights: FloatArray


@dataclass(frozen=True)
class Rigid:
    """A piece that moves: what it looks like about its centre, and how it resists.

    driven: motors impose its rates about the frame's origin, else the floor brakes it; edges (k, 6): ax, ay, bx, by,
    z_low, z_high [m]; tree: pieces of one tree never touch each other; mass [kg], moment [kg m^2] about the centre;
    centre (2,) [m] in the frame of the model; grip [N], twist_grip [N m]: largest force and torque of the floor.
    """

    driven: bool
    parts: tuple[Part, ...]
    edges: FloatArray
    tree: int
    mass: float
    moment: float
    centre: FloatArray
    grip: float
    twist_grip: float


@dataclass(frozen=True)
class Ground:
    """What never moves: walls (m, 6): ax, ay, bx, by, z_low, z_high [m]; trees (m,)."""

    walls: FloatArray
    trees: IntArray


def movable(models: Sequence[Model]) -> list[int]:
    """Return the indices of the models that are pieces of their own: positions, and what has mass on the ground."""
    return [m.index for m in models if isinstance(m.device, Position) or (m.parent < 0 and m.mass > 0)]


def assemble(models: Sequence[Model], poses: FloatArray, dynamics: Dynamics) -> tuple[list[Rigid], Ground]:
    """Return a piece for each movable model, in their order, and the ground; poses (n, 4) are the models' in the map.

    A model that is not movable belongs to the nearest ancestor that is, or to the ground. A piece's mass is the sum
    of its models' masses; a robot without any has dynamics.density times its size.
    """
    owners = _owners(models)
    pieces = []
    for index in movable(models):
        members = [m for m in models if owners[m.index] == index]
        pieces.append(_rigid(models[index], members, poses, dynamics))
    still = [m for m in models if owners[m.index] < 0 and m.obstacle_return]
    walls = [_placed(m.shape, poses[m.index]) for m in still]
    trees = [np.full(len(w), m.root) for m, w in zip(still, walls, strict=True)]
    return pieces, Ground(np.concatenate([np.empty((0, 6)), *walls]), np.concatenate([np.empty(0, np.int64), *trees]))


def rigid(parts: Sequence[Part], edges: FloatArray, *, driven: bool, tree: int, mass: float, friction: float) -> Rigid:
    """Return a piece of uniform density whose floor gives at most friction times its weight.

    Motors turn a driven one about its frame's origin, so contacts see its mass there as well.
    """
    centre = np.zeros(2) if driven else _centroid(parts)
    moment = _moment(parts, mass) - mass * float(centre @ centre)
    grip = friction * mass * GRAVITY
    return Rigid(
        driven=driven,
        parts=tuple(Part(part.corners - centre, part.heights) for part in parts),
        edges=edges - [*centre, *centre, 0, 0],
        tree=tree,
        mass=mass,
        moment=moment,
        centre=centre,
        grip=grip,
        twist_grip=grip * _MEAN_OVER_GYRATION * math.sqrt(moment / mass),
    )


def _owners(models: Sequence[Model]) -> list[int]:
    """Return for each model the movable one it belongs to, or -1. Parents come before children."""
    pieces = set(movable(models))
    owners: list[int] = []
    for m in models:
        owners.append(m.index if m.index in pieces else owners[m.parent] if m.parent >= 0 else -1)
    return owners


def _rigid(model: Model, members: Sequence[Model], poses: FloatArray, dynamics: Dynamics) -> Rigid:
    driven = isinstance(model.device, Position)
    given = sum(m.mass for m in members)
    mass = given or max(_LIGHTEST, dynamics.density * float(np.prod(model.size)))
    own_friction = dynamics.wheel_friction if driven else dynamics.floor_friction
    parts: list[Part] = []
    edges = [np.empty((0, 6))]
    for m in members:
        if m.obstacle_return:
            place = _relative(poses[model.index], poses[m.index])
            parts += _parts(m.shape, place)
            edges.append(_placed(m.shape, place))
    return rigid(
        parts,
        np.concatenate(edges),
        driven=driven,
        tree=model.root,
        mass=mass,
        friction=own_friction if model.friction is None else model.friction,
    )


def _relative(base: FloatArray, pose: FloatArray) -> FloatArray:
    """Return a pose (4,) in the frame of another."""
    x, y, heading = between(base[[0, 1, 3]], pose[[0, 1, 3]])
    return np.array([x, y, pose[2] - base[2], heading])


def _moved(points: FloatArray, pose: FloatArray) -> FloatArray:
    corners = np.concatenate([points, np.zeros((len(points), 1))], axis=1)
    return compose(np.broadcast_to(pose[[0, 1, 3]], corners.shape), corners)[:, :2]


def _placed(shape: Shape, pose: FloatArray) -> FloatArray:
    """Return a shape's segments and heights, (m, 6), at a pose (4,)."""
    ends = _moved(shape.segments.reshape(-1, 2), pose).reshape(-1, 4)
    return np.concatenate([ends, shape.heights + pose[2]], axis=1)


def _parts(shape: Shape, pose: FloatArray) -> list[Part]:
    """Return convex parts: of the polygons if there are any, else each segment by itself, as of a bitmap."""
    if not shape.polygons:
        ends = _moved(shape.segments.reshape(-1, 2), pose).reshape(-1, 2, 2)
        return [Part(pair, heights + pose[2]) for pair, heights in zip(ends, shape.heights, strict=True)]
    return [
        Part(corners, polygon.heights + pose[2])
        for polygon in shape.polygons
        for corners in convex(_moved(polygon.corners, pose))
    ]


def convex(corners: FloatArray) -> list[FloatArray]:
    """Return a simple polygon (k, 2) as convex ones; none if it has no area."""
    area = _area(corners)
    if abs(area) < _SLIVER:
        return []
    ring = corners if area > 0 else corners[::-1]
    step = np.roll(ring, -1, axis=0) - ring
    after = np.roll(step, -1, axis=0)
    if (step[:, 0] * after[:, 1] - step[:, 1] * after[:, 0] >= 0).all():
        return [ring]
    closed = [*ring.tolist(), ring[0].tolist()]
    pieces = [np.array(piece[:-1]) for piece in convex_decomposition(closed, 0.0)]
    return [piece for piece in pieces if abs(_area(piece)) >= _SLIVER]


def _area(corners: FloatArray) -> float:
    x, y = corners.T
    return float(x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2


def _weights(parts: Sequence[Part]) -> FloatArray:
    """Return each part's share of the mass: by area, or by length if all are sheets."""
    areas = np.array([abs(_area(part.corners)) if len(part.corners) > 2 else 0.0 for part in parts])
    if not areas.sum():
        areas = np.array([np.hypot(*(part.corners[1] - part.corners[0])) for part in parts])
    return np.asarray(areas / areas.sum(), dtype=np.float64)


def _centroid(parts: Sequence[Part]) -> FloatArray:
    if not parts:
        return np.zeros(2)
    centres = [
        pymunk.Poly(None, part.corners.tolist()).center_of_gravity if len(part.corners) > 2 else part.corners.mean(0)
        for part in parts
    ]
    return np.asarray(_weights(parts) @ np.array(centres), dtype=np.float64)


def _moment(parts: Sequence[Part], mass: float) -> float:
    """Return the moment [kg m^2] about the frame's origin."""
    if not parts:
        return mass
    moments = [
        pymunk.moment_for_poly(mass * share, part.corners.tolist())
        if len(part.corners) > 2
        else pymunk.moment_for_segment(mass * share, tuple(part.corners[0]), tuple(part.corners[1]), 0.0)
        for part, share in zip(parts, _weights(parts).tolist(), strict=True)
    ]
    return float(sum(moments))
