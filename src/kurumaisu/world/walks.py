# SPDX-License-Identifier: BSD-3-Clause
"""Models that walk by themselves: waypoint[i] [x y], walk_speed, walk_mode, social; an addition to Stage's language."""

from __future__ import annotations

import numpy as np

from kurumaisu.world.model import Walk
from kurumaisu.world.values import Values

_MODES = ("loop", "yoyo", "once")
_MOST_WAYPOINTS = 10_000


def walk(values: Values) -> Walk | None:
    """Read a model's walk: waypoints in the map, speed in lengths per second. Raise Error with the place."""
    if not values.has("waypoint[0]"):
        return None
    count = 0
    while values.has(f"waypoint[{count}]"):
        count += 1
        if count > _MOST_WAYPOINTS:
            raise values.error(f"waypoint[{count - 1}]", f"more than {_MOST_WAYPOINTS} waypoints")
    if values.entity.type == "position":
        raise values.error("waypoint[0]", "a position is driven by commands: waypoints belong to a model")
    speed = values.length("walk_speed", 0.0)
    if not speed > 0:
        raise values.error("walk_speed", f"waypoints need a walk_speed above 0, not {speed:g}")
    mode = values.text("walk_mode", "loop")
    if mode not in _MODES:
        raise values.error("walk_mode", f"walk_mode must be one of {', '.join(_MODES)}, not {mode!r}")
    waypoints = np.array([values.several(f"waypoint[{i}]", "ll", ()) for i in range(count)])
    return Walk(waypoints, speed, mode, values.whole("social", 0) != 0)
