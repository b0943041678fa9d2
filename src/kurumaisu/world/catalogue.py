# SPDX-License-Identifier: BSD-3-Clause
"""What Stage world files may say: what is heeded here, what only accepted, and what even Stage does not heed."""

from __future__ import annotations

import re

from kurumaisu.world.notes import Notes
from kurumaisu.world.syntax import Entity

MODELS = (
    *("model", "position", "ranger", "camera", "fiducial", "bumper", "gripper"),
    *("blobfinder", "actuator", "blinkenlight", "lightindicator"),
)
_OTHERS = ("world", "window", "block", "sensor")
_BODY_ONLY = ("blobfinder", "actuator", "blinkenlight", "lightindicator")

_NUMBERED = re.compile(r"(point|bpose|blength|waypoint)\[\d+\]")

# Heeded. gui_* and windows are not warned of either: there is no such window, and nearly every file has them.
_MODEL = {
    *("name", "pose", "origin", "size", "bitmap", "boundary", "noblocks", "color", "color_rgba", "hinge"),
    *("obstacle_return", "ranger_return", "fiducial_return", "fiducial_key", "gripper_return", "stack_children"),
    *("update_interval", "mass", "friction", "gui_nose", "gui_grid", "gui_outline", "gui_move"),
    *("waypoint", "walk_speed", "walk_mode", "social", "slope"),
}
_HEEDED: dict[str, set[str]] = {
    "world": {
        "name",
        "resolution",
        "interval_sim",
        "quit_time",
        "speedup",
        "unit_length",
        "unit_angle",
        "test",
        "semantics",
    },
    "block": {"points", "point", "z"},
    "sensor": {"pose", "size", "range", "fov", "samples", "noise"},
    "position": {
        *("drive", "localization", "localization_origin", "odom_error", "velocity_bounds", "acceleration_bounds"),
        *("wheelbase", "velocity"),
    },
    "camera": {"resolution", "fov", "range", "pantilt"},
    "fiducial": {"range_min", "range_max", "range_max_id", "fov", "ignore_zloc"},
    "bumper": {"bcount", "bpose", "blength"},
    "gripper": {"autosnatch", "paddle_size", "paddle_state"},
}

# Stage heeds it, this reader does not: one warning each.
_ACCEPTED: dict[str, set[str]] = {
    "world": {"paused", "threads", "show_clock", "show_clock_interval", "confirm_on_quit"},
    "model": {
        *("alwayson", "map_resolution", "ctrl", "blob_return", "joules", "kjoules", "joules_capacity"),
        *("kjoules_capacity", "watts", "give_watts", "take_watts", "trail_length", "trail_interval", "say", "debug"),
        "event_queue",
    },
    "blobfinder": {"colors_count", "colors", "image", "range", "fov", "pan"},
    "actuator": {"type", "axis", "min_position", "max_position", "max_speed", "start_position"},
    "blinkenlight": {"period", "dutycycle", "enabled"},
}

_MISSED = ("ctrl",)  # of these, what a robot does not move without

# Without an effect in Stage 4 either, and well known from old files: silence.
_DEAD: dict[str, set[str]] = {
    "world": {
        *("interval_real", "thread", "size", "gui_interval", "gui_disable", "lightpos", "interval_log", "threadpool"),
    },
    "block": {"color", "color_rgba"},
    "sensor": {"color", "color_rgba"},
    "position": {"driver", "polygons", "watchdog_timeout", "edge_color"},
}

# Without an effect in Stage 4, although one might rely on it.
_TRAPS: dict[str, dict[str, str]] = {
    "model": {"laser_return": "Stage 4 uses ranger_return instead"},
    "sensor": {
        "range_max": "Stage 4 uses range [MIN MAX] instead",
        "range_min": "Stage 4 uses range [MIN MAX] instead",
        "update_interval": "Stage 4 uses that of the ranger",
    },
    "position": {"odom": "Stage 4 uses localization_origin instead"},
}


def check(world: Entity, notes: Notes) -> None:
    """Note what is not heeded. Raise Error at what Stage would not load: an unknown type, or one in a wrong place."""
    _check_properties(world, notes)
    done: set[int] = set()
    waiting = [(child, world) for child in reversed(world.children)]
    while waiting:
        entity, parent = waiting.pop()
        _check_type(entity, parent, notes)
        if id(entity) not in done:  # the instances of a macro have their children in common
            done.add(id(entity))
            if entity.type != "window":
                _check_properties(entity, notes)
            waiting += [(child, entity) for child in reversed(entity.children)]


def _check_type(entity: Entity, parent: Entity, notes: Notes) -> None:
    kind = entity.type
    if (kind not in MODELS and kind not in _OTHERS) or kind == "world":
        raise entity.name.error(f"{kind} is not a type of model")
    if kind == "block" and parent.type not in MODELS:
        raise entity.name.error(f"a block belongs in a model, not in {_article(parent.type)}")
    if kind == "sensor" and parent.type != "ranger":
        raise entity.name.error(f"a sensor belongs in a ranger, not in {_article(parent.type)}")
    if kind in MODELS and parent.type not in (*MODELS, "world"):
        notes.add(entity.name, f"a {kind} in a {parent.type} stands on the ground, as in Stage")
    if kind in _BODY_ONLY:
        notes.add(entity.name, f"{kind}: only its body is simulated here", kind, routine=True)


def _article(kind: str) -> str:
    return f"the {kind}" if kind == "world" else f"{'an' if kind[0] in 'aeiou' else 'a'} {kind}"


def _check_properties(entity: Entity, notes: Notes) -> None:
    kinds = (entity.type, "model") if entity.type in MODELS else (entity.type,)
    heeded = _HEEDED.get(entity.type, set[str]())
    for word, given in entity.properties.items():
        name = word.split("[")[0] if _NUMBERED.fullmatch(word) else word
        if name in heeded or (len(kinds) == 2 and name in _MODEL):
            continue
        trap = next((traps[name] for kind in kinds if name in (traps := _TRAPS.get(kind, {}))), None)
        if trap:
            notes.add(given.name, f"{name} has no effect: {trap}", f"{entity.type} {name}")
        elif any(name in _ACCEPTED.get(kind, ()) for kind in kinds):
            text = f"{name} is accepted and has no effect here"
            notes.add(given.name, text, name, routine=name not in _MISSED)
        elif not any(name in _DEAD.get(kind, ()) for kind in kinds):
            text = f"{name} is not a property of {_article(entity.type)}: ignored, as Stage does"
            notes.add(given.name, text, f"{entity.type} {name}")
