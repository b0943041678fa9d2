# SPDX-License-Identifier: BSD-3-Clause
"""Who publishes and who hears a topic, as the ROS master knows it."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import Any

import rosgraph
import rospy

from kurumaisu.errors import Error

_GLANCE = 0.1  # [s] of wall time between questions to the master


def hearers(topic: str, patience: float) -> Sequence[str]:
    """Return the nodes that hear a topic, as soon as one does; after so many seconds of wall time none may."""
    wait_until(lambda: bool(_nodes(topic, 1)), patience)
    return _nodes(topic, 1)


def wait_until(condition: Callable[[], bool], patience: float) -> None:
    """Return when a condition holds, after so many seconds of wall time, or when this node is to end."""
    deadline = time.monotonic() + patience
    while not condition() and time.monotonic() < deadline and not rospy.core.is_shutdown_requested():
        time.sleep(_GLANCE)


def publishers(topic: str) -> Sequence[str]:
    """Return the nodes that publish a topic. Raise Error when the master does not answer."""
    return _nodes(topic, 0)


def _nodes(topic: str, side: int) -> Sequence[str]:
    name = rospy.resolve_name(topic)
    return [node for known, nodes in _state()[side] if known == name for node in nodes if node != rospy.get_name()]


def _state() -> Any:
    try:
        return rosgraph.Master(rospy.get_name()).getSystemState()
    except (OSError, rosgraph.MasterException) as error:
        raise Error(f"the ROS master does not answer: {error}") from error
