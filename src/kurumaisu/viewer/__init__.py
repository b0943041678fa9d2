# SPDX-License-Identifier: BSD-3-Clause
"""A page for any browser: shows a simulation, a chair or a recording, and what may be done to them. Knows no ROS."""

from kurumaisu.viewer.hub import Hub
from kurumaisu.viewer.protocol import (
    Body,
    Estimate,
    Fan,
    Goal,
    Group,
    MapPicture,
    Note,
    PlaybackState,
    State,
    Value,
    World,
)
from kurumaisu.viewer.server import Server
from kurumaisu.viewer.settings import ViewerSettings, read_settings
from kurumaisu.viewer.source import Outcome, Source

__all__ = [
    "Body",
    "Estimate",
    "Fan",
    "Goal",
    "Group",
    "Hub",
    "MapPicture",
    "Note",
    "Outcome",
    "PlaybackState",
    "Server",
    "Source",
    "State",
    "Value",
    "ViewerSettings",
    "World",
    "read_settings",
]
