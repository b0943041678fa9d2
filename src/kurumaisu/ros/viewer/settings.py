# SPDX-License-Identifier: BSD-3-Clause
"""Private parameters of the viewer's node: launch/viewer.yaml and the arguments of viewer.launch."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from kurumaisu._core import frame_of
from kurumaisu.driving import Manner
from kurumaisu.settings import Section
from kurumaisu.viewer.settings import ViewerSettings
from kurumaisu.viewer.settings import read_settings as read_server

NONE = "none"


@dataclass(frozen=True)
class Driving:
    """How a page drives: topic, rate [Hz], dead_man [s], v [m/s] and w [rad/s] of a full stick."""

    topic: str
    rate: float
    dead_man: float
    v: float
    w: float


@dataclass(frozen=True)
class NodeSettings:
    """What the viewer's node needs to know; see launch/viewer.yaml for units and meaning."""

    server: ViewerSettings
    control: bool
    simulator: str  # sim_node, stageros or none
    base: str  # name of the base controller, or none
    model: Path
    driving: Driving
    manner: Manner
    bags: Path
    notes: float
    frames: tuple[str, str, str]  # map, odom, base


def read_settings(values: Any, where: str) -> NodeSettings:
    """Return the settings of a parameter tree. Raise Error naming the key for anything wrong."""
    top = Section(values, where)
    driving, goal = top.section("drive"), top.section("goal")
    settings = NodeSettings(
        server=read_server(top),
        control=top.flag("control"),
        simulator=top.text("simulator", choices=("sim_node", "stageros", NONE)),
        base=top.text("base"),
        model=Path(top.text("model")),
        driving=Driving(
            topic=driving.text("topic"),
            rate=driving.number("rate", above=0),
            dead_man=driving.number("dead_man", above=0),
            v=driving.number("v", above=0),
            w=driving.number("w", above=0),
        ),
        manner=Manner(**{name: goal.number(name, above=0) for name in ("gain", "reach", "aim", "patience")}),
        bags=Path(top.text("bags")),
        notes=top.number("notes", above=0),
        frames=(frame_of(top.text("map_frame")), frame_of(top.text("odom_frame")), frame_of(top.text("base_frame"))),
    )
    driving.end()
    goal.end()
    top.end()
    return settings
