# SPDX-License-Identifier: BSD-3-Clause
"""What Stage world files may say, and what of it is heeded here."""

from __future__ import annotations

from kurumaisu.world.syntax import Entity

BODIES = ("model", "position")

# Heeded, or without an effect on walls and start poses (colours, decoration of Stage's window).
_HEEDED = {
    "world": {"name"},
    "block": {"points", "z", "color", "color_rgba"},
    "model": {
        *("name", "pose", "size", "origin", "bitmap", "boundary", "obstacle_return", "ranger_return"),
        *("color", "color_rgba", "gui_nose", "gui_grid", "gui_outline", "gui_move"),
    },
}

# Part of Stage's language, not heeded: a warning says so.
_IGNORED_TYPES = (
    *("window", "ranger", "sensor", "camera", "fiducial", "blobfinder", "bumper", "gripper"),
    *("actuator", "blinkenlight", "lightindicator"),
)
_IGNORED = {
    "world": {
        *("resolution", "interval_sim", "quit_time", "speedup", "paused", "threads", "show_clock"),
        *("show_clock_interval", "confirm_on_quit", "interval_real"),
    },
    "block": set[str](),
    "model": {
        *("noblocks", "laser_return", "fiducial_return", "fiducial_key", "gripper_return", "blob_return"),
        *("stack_children", "update_interval", "alwayson", "mass", "friction", "map_resolution", "ctrl"),
        *("joules", "kjoules", "joules_capacity", "kjoules_capacity", "watts", "give_watts", "take_watts"),
        *("trail_length", "trail_interval", "say", "debug", "event_queue"),
    },
    "position": {
        *("drive", "localization", "localization_origin", "odom_error", "velocity_bounds"),
        *("acceleration_bounds", "wheelbase", "velocity", "size", "origin", "bitmap", "boundary"),
        *("obstacle_return", "ranger_return"),
    },
}
_POSITION_HEEDED = {"name", "pose", "color", "color_rgba", "gui_nose", "gui_grid", "gui_outline", "gui_move"}


def check(world: Entity) -> tuple[str, ...]:
    """Return one warning for all that is known but not heeded. Raise Error at what Stage does not know."""
    ignored: dict[str, int] = {}
    _check_properties(world, ignored)
    for child in world.children:
        _check(child, world, ignored)
    if not ignored:
        return ()
    places = ", ".join(f"{name} (line {line})" for name, line in ignored.items())
    return (f"{world.name.file}: known to Stage, not heeded here: {places}",)


def _check(entity: Entity, parent: Entity, ignored: dict[str, int]) -> None:
    if entity.type in _IGNORED_TYPES:
        ignored.setdefault(entity.type, entity.name.line)
        return
    if entity.type not in (*BODIES, "block"):
        raise entity.name.error(f"{entity.type} is not a type of model")
    if entity.type == "block" and parent.type == "world":
        raise entity.name.error("block belongs into a model")
    _check_properties(entity, ignored)
    for child in entity.children:
        _check(child, entity, ignored)


def _check_properties(entity: Entity, ignored: dict[str, int]) -> None:
    heeded, known = _names(entity.type)
    for name, value in entity.properties.items():
        if name in heeded or (entity.type == "block" and name.startswith("point[")):
            continue
        if name not in known:
            raise value.name.error(f"{name} is not a property of {entity.type}")
        ignored.setdefault(name, value.name.line)


def _names(kind: str) -> tuple[set[str], set[str]]:
    """Return the heeded and the ignored properties of a type."""
    if kind == "position":
        return _POSITION_HEEDED, _IGNORED["position"] | _IGNORED["model"] | _HEEDED["model"]
    return _HEEDED[kind], _IGNORED[kind]
