# SPDX-License-Identifier: BSD-3-Clause
"""What a world consists of, in words."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator

from kurumaisu.types import FloatArray
from kurumaisu.world.layout import beam_height
from kurumaisu.world.model import Model, Position, Ranger
from kurumaisu.world.world import World

_MOST_ROBOTS = 10  # that contents() tells of one by one


def contents(world: World) -> Iterator[str]:
    """Yield lines that say what the world consists of."""
    if world.has_walls:
        x0, y0, x1, y1 = world.bounds
        yield f"{world.name}: {x1 - x0:.2f} x {y1 - y0:.2f} m, x {x0:.2f} to {x1:.2f}, y {y0:.2f} to {y1:.2f}"
    else:
        yield f"{world.name}: no walls"
    yield f"step {1000 * world.interval:g} ms, resolution {world.resolution:g} m, {len(world.segments)} wall segments"
    kinds = {kind: sum(model.type == kind for model in world.models) for kind in {m.type for m in world.models}}
    yield "models: " + (", ".join(f"{count} {kind}" for kind, count in sorted(kinds.items())) or "none")
    robots = [(model, model.device) for model in world.models if isinstance(model.device, Position)]
    for model, position in robots[:_MOST_ROBOTS]:
        yield _robot(world, model, position)
        for other in world.models:
            if isinstance(other.device, Ranger) and other.parent == model.index:
                yield from _fans(world, other, other.device)
    if len(robots) > _MOST_ROBOTS:
        yield f"... and {len(robots) - _MOST_ROBOTS} more robots"


def _fans(world: World, model: Model, ranger: Ranger) -> Iterator[str]:
    alike = Counter(
        f"{fan.samples} beam{'s' if fan.samples > 1 else ''} over {math.degrees(fan.fov):g} deg, {fan.range_max:g} m, "
        f"{beam_height(model, world.poses[model.index], fan):.2f} m high"
        for fan in ranger.fans
    )
    for text, count in alike.items():
        yield f"  ranger: {f'{count} x ' if count > 1 else ''}{text}"


def _robot(world: World, model: Model, position: Position) -> str:
    x, y, _, heading = world.poses[model.index]
    size: FloatArray = model.size
    name = model.name or model.type
    return (
        f"robot {name}: at {x:.2f} {y:.2f}, {math.degrees(heading):.0f} deg; {size[0]:.2f} x {size[1]:.2f} m, "
        f"{position.drive}, {position.localization}"
    )
