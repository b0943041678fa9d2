# SPDX-License-Identifier: BSD-3-Clause
"""What an experiment must know of its surroundings: who publishes what, and whether there is space."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import rosgraph
import rospy

from kurumaisu.errors import Error
from kurumaisu.experiments import Script, obstructed, reach
from kurumaisu.experiments.supervisor import Care
from kurumaisu.params import Chassis
from kurumaisu.types import FloatArray
from kurumaisu.world import load_world

TRUTH, ODOM = "ground_truth", "odom"
_GLANCE = 0.1  # [s] of wall time between questions to the master


class Ground:
    """The ROS graph, and the walls of a world if there is one."""

    def __init__(self, script: Script, chassis: Chassis, care: Care, world: str | None) -> None:
        """world: a file, 'none', or None for the simulator's. Raise Error when it cannot be read."""
        self._script = script
        self._margin = reach(chassis) + care.margin
        # What is started together with this comes up at its own pace.
        _until(lambda: bool(publishers(TRUTH) or publishers(ODOM)), care.patience)
        file = world if world is not None else self._simulated()
        self._walls = load_world(Path(file)).obstacles if file not in (None, "none") else None

    def sources(self) -> list[str]:
        """Return the topics that bring poses, the reference first. Raise Error when there is none."""
        found = [topic for topic in (TRUTH, ODOM) if publishers(topic)]
        if not found:
            raise Error(f"no node publishes {TRUTH} or {ODOM}: the pose of the chair must be known")
        if self._walls is not None and found[0] != TRUTH:
            raise Error(f"space cannot be checked in a world without {TRUTH}; with --world none it is up to you")
        return found

    def refusal(self, pose: FloatArray) -> str:
        """Return why the script cannot begin at a pose (3,) in the map, or ''."""
        if self._walls is None:
            return ""
        met = obstructed(self._script.box, pose, self._margin, self._walls)
        if not len(met):
            return ""
        x, y, *_ = met[0]
        return f"not enough space here: {len(met)} walls reach into it, one from x {x:.2f}, y {y:.2f} m"

    @staticmethod
    def _simulated() -> str | None:
        """Return the world of the simulator that publishes the ground truth, if one does."""
        found = (rospy.get_param(f"{node}/world", None) for node in publishers(TRUTH))
        return next((world for world in found if isinstance(world, str)), None)


def hearers(topic: str, patience: float) -> Sequence[str]:
    """Return the nodes that hear a topic, as soon as one does; after so many seconds of wall time none may."""
    _until(lambda: bool(_nodes(topic, 1)), patience)
    return _nodes(topic, 1)


def _until(condition: Callable[[], bool], patience: float) -> None:
    deadline = time.monotonic() + patience
    while not condition() and time.monotonic() < deadline:
        time.sleep(_GLANCE)


def publishers(topic: str) -> Sequence[str]:
    """Return the nodes that publish a topic. Raise Error when the master does not answer."""
    return _nodes(topic, 0)


def wait_until_gone(patience: float) -> None:
    """Return when the master knows nothing of this node any more, or after so many seconds of wall time."""
    _until(lambda: not any(rospy.get_name() in nodes for side in _state() for _, nodes in side), patience)


def _nodes(topic: str, side: int) -> Sequence[str]:
    name = rospy.resolve_name(topic)
    return [node for known, nodes in _state()[side] if known == name for node in nodes if node != rospy.get_name()]


def _state() -> Any:
    try:
        return rosgraph.Master(rospy.get_name()).getSystemState()
    except (OSError, rosgraph.MasterException) as error:
        raise Error(f"the ROS master does not answer: {error}") from error
