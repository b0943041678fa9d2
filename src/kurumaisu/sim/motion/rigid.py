# SPDX-License-Identifier: BSD-3-Clause
"""What moves as one piece: convex parts, edges, mass."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import pymunk
from pymunk.autogeometry import convex_decomposition

from kurumaisu.geometry import PLANAR, compose
from kurumaisu.types import FloatArray, IntArray

GRAVITY = 9.81  # [m/s^2], for friction, which is known to a few percent at best
_SLIVER = 1.0e-9  # [m^2] polygons of less area are no bodies
# Mean distance of a uniform disc's or square's points from its centre, over its radius of gyration: 0.943 and 0.937.
_MEAN_OVER_GYRATION = 0.94


@dataclass(frozen=True)
class Part:
    """A convex prism, or, of two corners, an upright sheet: corners (k, 2), heights (2,) [m], in the body's frame."""

    corners: FloatArray
    heights: FloatArray


@dataclass(frozen=True)
class Pivot:
    """What a piece turns about: a point (2,) of the map, the same (2,) from the piece's centre; headings [rad]."""

    place: FloatArray
    anchor: FloatArray
    lowest: float
    highest: float


@dataclass(frozen=True)
class Rigid:
    """A piece that moves: what it looks like about its centre, and how it resists.

    driven: motors impose its rates about the frame's origin, else the floor brakes it; edges (k, 6): ax, ay, bx, by,
    z_low, z_high [m]; tree: pieces of one tree never touch each other; mass [kg], moment [kg m^2] about the centre;
    centre (2,) [m] in the frame of the model; grip [N], twist_grip [N m]: largest force and torque of the floor.
    pivot: what it hangs on, if on anything, whose friction twist_grip then is; jaws: the prism between a gripper's
    paddles; grippable: that it can be taken.
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
    pivot: Pivot | None = None
    jaws: Part | None = None
    grippable: bool = False

    def without_body(self) -> Rigid:
        """Return it as something that nothing touches."""
        return replace(self, parts=(), edges=np.empty((0, 6)))


@dataclass(frozen=True)
class Ground:
    """What never moves: walls (m, 6): ax, ay, bx, by, z_low, z_high [m]; trees (m,)."""

    walls: FloatArray
    trees: IntArray


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


def joined(holder: Rigid, held: Sequence[tuple[Rigid, FloatArray]]) -> Rigid:
    """Return a piece with others attached, each at a pose (4,) of its centre from the holder's.

    The motors still turn it about the holder's centre and have the grip they had.
    """
    parts, edges, mass, moment = [*holder.parts], [holder.edges], holder.mass, holder.moment
    for piece, pose in held:
        parts += [Part(moved(part.corners, pose), part.heights + pose[2]) for part in piece.parts]
        ends = moved(piece.edges[:, :4].reshape(-1, 2), pose).reshape(-1, 4)
        edges.append(np.concatenate([ends, piece.edges[:, 4:] + pose[2]], axis=1))
        mass += piece.mass
        moment += piece.moment + piece.mass * float(pose[:2] @ pose[:2])
    return replace(holder, parts=tuple(parts), edges=np.concatenate(edges), mass=mass, moment=moment)


def moved(points: FloatArray, pose: FloatArray) -> FloatArray:
    """Return points (k, 2) of a frame at a pose (4,) in the frame that the pose is in."""
    corners = np.concatenate([points, np.zeros((len(points), 1))], axis=1)
    return compose(np.broadcast_to(pose[PLANAR], corners.shape), corners)[:, :2]


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
