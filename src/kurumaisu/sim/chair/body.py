# SPDX-License-Identifier: BSD-3-Clause
"""The chair among the models of a world: what the model file says instead of the world's first position."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from kurumaisu.params import Chassis
from kurumaisu.types import FloatArray
from kurumaisu.world import World
from kurumaisu.world.layout import family
from kurumaisu.world.model import Model, Place, Polygon, Position, Shape

_BLUE = (0.2, 0.3, 0.6, 1.0)
_NO_BODY = Shape(np.empty((0, 4)), np.empty((0, 2)), ())


@dataclass(frozen=True)
class Scene:
    """Models of a world with their poses (n, 4) in the map, and which of them is the chair."""

    models: tuple[Model, ...]
    poses: FloatArray
    chair: int


def seat(world: World, chassis: Chassis) -> Scene:
    """Return a world with the chair in place of its first position; what stands on that is left out.

    A world without any gets one more model at its start pose. Raise Error if it has neither.
    """
    x, y, heading = world.start
    models = list(world.models)
    first = next((m for m in models if m.type == "position"), None)
    index = len(models) if first is None else first.index
    z = 0.0 if first is None else float(world.poses[index, 2])
    pose = np.array([x, y, z, heading])
    for rider in family(models, index)[1:]:
        models[rider] = _bare(models[rider])
    models[index : index + 1] = [_chair(world, first, index, pose, chassis)]
    poses = np.concatenate([world.poses, np.zeros((len(models) - len(world.poses), 4))])
    poses[index] = pose
    return Scene(tuple(models), poses, index)


def outline(chassis: Chassis) -> FloatArray:
    """Return the corners (4, 2) [m] of the footprint in base_link, anticlockwise."""
    front, rear, half = chassis.axle_to_front, chassis.axle_to_front - chassis.length, chassis.width / 2
    return np.array([(front, half), (rear, half), (rear, -half), (front, -half)])


def _chair(world: World, first: Model | None, index: int, pose: FloatArray, chassis: Chassis) -> Model:
    corners, heights = outline(chassis), np.array([0.0, chassis.height])
    color = _BLUE if first is None else first.color
    return Model(
        index=index,
        parent=-1,
        root=index,
        type="position",
        name="chair" if first is None or first.name is None else first.name,
        place=Place(world.path, 1, 1) if first is None else first.place,
        pose=pose,
        origin=np.zeros(4),
        size=np.array([chassis.length, chassis.width, chassis.height]),
        color=color,
        shape=Shape(
            segments=np.concatenate([corners, np.roll(corners, -1, axis=0)], axis=1),
            heights=np.tile(heights, (4, 1)),
            polygons=(Polygon(corners, heights, color),),
        ),
        stack_children=True,
        ranger_return=1.0,
        obstacle_return=True,
        fiducial_return=0 if first is None else first.fiducial_return,
        fiducial_key=0 if first is None else first.fiducial_key,
        gripper_return=False,
        mass=chassis.mass,
        friction=None if first is None else first.friction,
        update_interval=world.interval,
        hinge=None,
        device=_base(),
        walk=None,
        source="" if first is None else first.source,
    )


def _base() -> Position:
    """Return a base that says nothing of itself: the model file does."""
    return Position(
        drive="diff",
        localization="gps",
        localization_origin=None,
        odom_error=None,
        velocity_bounds=np.array([[-np.inf, np.inf]] * 4),
        acceleration_bounds=None,
        wheelbase=1.0,
        velocity=np.zeros(4),
    )


def _bare(model: Model) -> Model:
    """Return a model that nothing meets and that does nothing."""
    return replace(
        model,
        type="model",
        shape=_NO_BODY,
        ranger_return=-1.0,
        obstacle_return=False,
        fiducial_return=0,
        mass=0.0,
        hinge=None,
        device=None,
        walk=None,
        slope=None,
    )
