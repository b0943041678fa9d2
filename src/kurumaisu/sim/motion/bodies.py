# SPDX-License-Identifier: BSD-3-Clause
"""What moves as one piece, from the models of a world, and what never moves, from its walls."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from kurumaisu.geometry import relative
from kurumaisu.sim.motion.partition import Outline
from kurumaisu.sim.motion.rigid import Ground, Part, Pivot, Rigid, convex, moved, rigid
from kurumaisu.sim.settings import Dynamics
from kurumaisu.types import FloatArray
from kurumaisu.world.layout import outline
from kurumaisu.world.model import Gripper, Model, Position, Shape

_LIGHTEST = 1.0e-3  # [kg] of what has no size to guess its mass from


def movable(models: Sequence[Model]) -> list[int]:
    """Return the indices of the models that are pieces: what is driven, hangs on a hinge, or has mass on the ground."""
    return [m.index for m in models if _driven(m) or m.hinge is not None or (m.parent < 0 and m.mass > 0)]


def assemble(models: Sequence[Model], poses: FloatArray, dynamics: Dynamics) -> list[Rigid]:
    """Return a piece for each movable model, in their order; poses (n, 4) are the models' in the map.

    A model that is not movable belongs to the nearest ancestor that is, or to the ground. A piece's mass is the sum
    of its models' masses; a robot without any has dynamics.density times its size.
    """
    owners = _owners(models)
    pieces = []
    for index in movable(models):
        members = [m for m in models if owners[m.index] == index]
        pieces.append(_rigid(models[index], members, poses, dynamics))
    return pieces


def ground(walls: Outline) -> Ground:
    """Return what is solid of walls."""
    return Ground(walls.faces[walls.solid], walls.trees[walls.solid])


def _driven(model: Model) -> bool:
    return isinstance(model.device, Position) or model.walk is not None


def _owners(models: Sequence[Model]) -> list[int]:
    """Return for each model the movable one it belongs to, or -1. Parents come before children."""
    pieces = set(movable(models))
    owners: list[int] = []
    for m in models:
        owners.append(m.index if m.index in pieces else owners[m.parent] if m.parent >= 0 else -1)
    return owners


def _rigid(model: Model, members: Sequence[Model], poses: FloatArray, dynamics: Dynamics) -> Rigid:
    driven = _driven(model)
    given = sum(m.mass for m in members)
    mass = given or max(_LIGHTEST, dynamics.density * float(np.prod(model.size)))
    parts: list[Part] = []
    edges = [np.empty((0, 6))]
    for m in members:
        if m.obstacle_return:
            place = relative(poses[model.index], poses[m.index])
            parts += _parts(m.shape, place)
            edges.append(outline(m, place))
    own_friction = dynamics.wheel_friction if driven else dynamics.floor_friction
    piece = rigid(
        parts,
        np.concatenate(edges),
        driven=driven,
        tree=model.root,
        mass=mass,
        friction=own_friction if model.friction is None else model.friction,
    )
    jaws = [_jaws(m, relative(poses[model.index], poses[m.index])) for m in members if isinstance(m.device, Gripper)]
    piece = replace(piece, jaws=jaws[0] if jaws else None, grippable=model.gripper_return)
    return piece if model.hinge is None else _hung(piece, model, poses[model.index], dynamics)


def _hung(piece: Rigid, model: Model, pose: FloatArray, dynamics: Dynamics) -> Rigid:
    """Return a piece that hangs on its hinge where it is: on the map, whatever its model stands on."""
    assert model.hinge is not None
    pivot = Pivot(
        place=moved(model.hinge.anchor[None], pose)[0],
        anchor=model.hinge.anchor - piece.centre,
        lowest=float(pose[3] + model.hinge.lowest),
        highest=float(pose[3] + model.hinge.highest),
    )
    return replace(piece, pivot=pivot, grip=0.0, twist_grip=dynamics.hinge_torque)


def _jaws(model: Model, pose: FloatArray) -> Part:
    """Return what is between the open paddles of a gripper at a pose (4,): libstage/model_gripper.cc says where."""
    assert isinstance(model.device, Gripper)
    paddle = model.device.paddle_size * model.size
    x, y = model.size[0] / 2, model.size[1] / 2 - paddle[1]
    corners = np.array([(x, y), (x - paddle[0], y), (x - paddle[0], -y), (x, -y)])
    turned = moved(moved(corners, _flat(model.origin)), pose)
    return Part(turned, np.array([0.0, paddle[2]]) + pose[2] + model.origin[2])


def _flat(pose: FloatArray) -> FloatArray:
    return np.array([pose[0], pose[1], 0.0, pose[3]])


def _parts(shape: Shape, pose: FloatArray) -> list[Part]:
    """Return convex parts: of the polygons if there are any, else each segment by itself, as of a bitmap."""
    if not shape.polygons:
        ends = moved(shape.segments.reshape(-1, 2), pose).reshape(-1, 2, 2)
        return [Part(pair, heights + pose[2]) for pair, heights in zip(ends, shape.heights, strict=True)]
    return [
        Part(corners, polygon.heights + pose[2])
        for polygon in shape.polygons
        for corners in convex(moved(polygon.corners, pose))
    ]
