# SPDX-License-Identifier: BSD-3-Clause
"""What in a world will surprise its user, in words."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator

import numpy as np

from kurumaisu._core import Arena
from kurumaisu.world.findings import Finding
from kurumaisu.world.layout import beam_height, outline, travels
from kurumaisu.world.model import Model, Position, Ranger
from kurumaisu.world.world import World


def findings(world: World) -> tuple[Finding, ...]:
    """Return what the world says and its author may not mean: what hurts most first, then by place in its files."""
    return tuple(finding for rule in _RULES for finding in sorted(rule(world), key=_in_file))


def _in_file(finding: Finding) -> tuple[bool, str, int, int]:
    place = finding.place
    return finding.routine, str(place.file), place.line, place.column


def _beams(world: World) -> Iterator[Finding]:
    """Lasers whose plane misses every wall."""
    walls = [model for model in world.models if not travels(model, world.models) and model.ranger_return >= 0]
    heights = [model.shape.heights + world.poses[model.index, 2] for model in walls if len(model.shape.segments)]
    if not heights:
        return
    spans = np.concatenate(heights)
    for model in world.models:
        if not isinstance(model.device, Ranger):
            continue
        for fan in model.device.fans:
            z = beam_height(model, world.poses[model.index], fan)
            if not ((spans[:, 0] <= z) & (z <= spans[:, 1])).any():
                where = "above" if z > spans[:, 1].max() else "below" if z < spans[:, 0].min() else "between"
                words = f"its beams, {z:.2f} m above the ground, pass {where} all walls"
                yield Finding(fan.place, _name(model), words)


def _thin(world: World) -> Iterator[Finding]:
    for model in world.models:
        points = model.shape.segments.reshape(-1, 2)
        if not len(points):
            continue
        extent = points.max(axis=0) - points.min(axis=0)
        if extent.min() < world.resolution and model.type == "model":
            yield Finding(
                model.place,
                _name(model),
                f"is {1000 * extent.min():.0f} mm thin, less than the resolution of "
                f"{1000 * world.resolution:.0f} mm: Stage may ignore it; here it is solid",
            )


def _in_walls(world: World) -> Iterator[Finding]:
    """Robots that touch something solid at their start."""
    solid = [model for model in world.models if model.obstacle_return and len(model.shape.segments)]
    fixed = [model for model in solid if not travels(model, world.models)]
    outlines = [outline(model, world.poses[model.index]) for model in fixed]
    walls = np.concatenate([np.empty((0, 6)), *outlines])
    tree = np.repeat([model.root for model in fixed], [len(faces) for faces in outlines]).astype(np.int64)
    arena = Arena(walls, np.ones(len(walls)), np.ones(len(walls), dtype=np.bool_), tree, 1)
    bodies = {}
    for model in solid:
        if travels(model, world.models):
            faces = outline(model, world.poses[model.index])
            number = len(faces)
            body = arena.add_body(faces, np.ones(number), np.ones(number, dtype=np.bool_), model.root)
            arena.set_poses(np.array([body]), np.zeros((1, 4)))
            bodies[body] = model
    if bodies:
        for body, touches in zip(bodies, arena.touches(np.array(list(bodies))), strict=True):
            if touches:
                yield Finding(bodies[body].place, _name(bodies[body]), "touches something solid at its start")


def _speed(world: World) -> Iterator[Finding]:
    stage = np.array([[-1, 1]] * 3 + [[-math.pi / 2, math.pi / 2]])
    for model, position in _positions(world):
        if np.allclose(position.velocity_bounds, stage):
            words = "is limited to 1 m/s and 90 deg/s, because it has no velocity_bounds"
            yield Finding(model.place, _name(model), words, routine=True)


def _localization(world: World) -> Iterator[Finding]:
    for model, position in _positions(world):
        if position.localization == "gps":
            for name in ("odom_error", "localization_origin"):
                values = getattr(position, name)
                if values is not None:
                    words = f'{name} has no effect with localization "gps"'
                    yield Finding(model.place, _name(model), words, routine=not values.any())
        elif model.update_interval > world.interval:
            share = world.interval / model.update_interval
            yield Finding(
                model.place,
                _name(model),
                f"odometry adds up only {100 * share:.0f} % of the distance, as in Stage, because "
                "update_interval is longer than interval_sim",
            )


def _sensorless(world: World) -> Iterator[Finding]:
    robots = [model for model, _ in _positions(world)]
    if len(robots) < 2:
        return
    for robot in robots:
        if not any(isinstance(other.device, Ranger) and other.parent == robot.index for other in world.models):
            words = "has no laser, but as a position counts as a robot in topic names"
            yield Finding(robot.place, _name(robot), words)


def _twins(world: World) -> Iterator[Finding]:
    first: dict[str, Model] = {}
    for number, (robot, _) in enumerate(_positions(world)):
        prefix = robot.name or f"robot_{number}"  # as stageros -u calls it
        twin = first.setdefault(prefix, robot)
        if twin is not robot:
            words = (
                f"has the name {prefix} of the robot at {twin.place}: with -u stageros refuses it, because their "
                "topics and frames would be the same"
            )
            yield Finding(robot.place, _name(robot), words)


def _rangers(world: World) -> Iterator[Finding]:
    for model in world.models:
        if not isinstance(model.device, Ranger):
            continue
        fans = model.device.fans
        if len(fans) > 1:
            words = f"has {len(fans)} sensors; stage_ros publishes the first one only"
            yield Finding(model.place, _name(model), words)
        if model.update_interval > world.interval:
            yield Finding(
                model.place,
                _name(model),
                f"is updated every {model.update_interval:g} s, the world every {world.interval:g} s: "
                "the same scan is published again in between",
            )
        for fan in fans:
            if fan.samples > 1 and math.isclose(fan.fov, 2 * math.pi):
                words = "with fov 360 the first and the last beam are the same"
                yield Finding(fan.place, _name(model), words, routine=True)


def _intangible(world: World) -> Iterator[Finding]:
    for model in world.models:
        if travels(model, world.models) or not len(model.shape.segments):
            continue
        if model.ranger_return < 0 and model.obstacle_return:
            words = "stops robots but lasers do not see it (ranger_return below 0)"
            yield Finding(model.place, _name(model), words)
        if model.ranger_return >= 0 and not model.obstacle_return and model.slope is None:
            words = "is seen by lasers but robots drive through it (obstacle_return 0)"
            yield Finding(model.place, _name(model), words)


def _slopes(world: World) -> Iterator[Finding]:
    rangers = [(m, m.device) for m in world.models if isinstance(m.device, Ranger)]
    beams = [beam_height(m, world.poses[m.index], fan) for m, device in rangers for fan in device.fans]
    for model in world.models:
        if model.slope is None:
            continue
        if travels(model, world.models) or model.mass > 0 or model.hinge is not None:
            yield Finding(model.place, _name(model), "slope has no effect on what can move")
        if model.obstacle_return:
            words = "has a slope, but stops robots: it needs obstacle_return 0"
            yield Finding(model.place, _name(model), words)
        low, high = (model.shape.heights + world.poses[model.index, 2]).T
        if model.ranger_return >= 0 and any(((low <= z) & (z <= high)).any() for z in beams):
            words = "has a slope, but is a wall to lasers: it needs ranger_return -1"
            yield Finding(model.place, _name(model), words)


def _own_tree(world: World) -> Iterator[Finding]:
    for model, _ in _positions(world):
        if model.root != model.index and not isinstance(world.models[model.root].device, Position):
            yield Finding(
                model.place,
                _name(model),
                f"stands inside {_name(world.models[model.root])}: its lasers do not see it, "
                "and it does not collide with it",
            )


def _positions(world: World) -> Iterator[tuple[Model, Position]]:
    for model in world.models:
        if isinstance(model.device, Position):
            yield model, model.device


def _name(model: Model) -> str:
    return model.name or f"the {model.type}"


_RULES: tuple[Callable[[World], Iterator[Finding]], ...] = (
    _in_walls,
    _own_tree,
    _beams,
    _intangible,
    _twins,
    _sensorless,
    _localization,
    _slopes,
    _rangers,
    _thin,
    _speed,
)
