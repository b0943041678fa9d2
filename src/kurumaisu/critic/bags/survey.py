# SPDX-License-Identifier: BSD-3-Clause
"""What is in a bag, and what each topic could serve as."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from kurumaisu.critic.bags import messages
from kurumaisu.critic.bags.containers import opened
from kurumaisu.critic.bags.limits import LATEST
from kurumaisu.critic.bags.parts import parts_of
from kurumaisu.critic.bags.topics import absolute

# What the names of topics say about what they are, the likelier first; a name that none fits is the least likely.
_LIKELY = {
    "command": (r"cmd_vel$", r"cmd|command", r"vel"),
    "voltage": (),
    "pose": (
        r"truth|mocap|vicon|opti|vrpn|qualisys|motive|marker|tracker|reference",
        r"rtk|gps|gnss|fix",
        r"amcl|slam|locali|map|pose",
    ),
    "odom": (
        r"odom$",
        r"odom|wheel",
    ),
    "scan": (r"scan$", r"scan|laser|lidar"),
}
_UNLIKELY = {
    "command": r"odom|joy|teleop|nav|limit|twist_mux|measured",
    "pose": r"goal|target|initial|plan|cmd|setpoint|waypoint|click|odom(?!.*truth)",
    "odom": r"truth|gps|visual|vio|icp",
}
_MOST_LISTED = 20


@dataclass(frozen=True)
class Found:
    """A topic: name, type as ROS 1 writes it, how many messages, and how many in a second of the bag [Hz]."""

    name: str
    type: str
    count: int
    rate: float

    @property
    def serves(self) -> list[str]:
        """The parts that it could serve as."""
        return messages.serves_as(self.type.replace("/", "/msg/"))

    @property
    def told(self) -> str:
        """The topic in words."""
        return f"{self.name} ({self.type}, {self.count} at {self.rate:.3g} Hz)"


def survey(path: Path) -> list[Found]:
    """Return the topics of a bag, or of all parts of one that was split, by name. Raise Error naming a broken file."""
    counts = Counter[tuple[str, str]]()
    start, end = LATEST, 0
    for bag in parts_of(path):
        with opened(bag) as opened_bag:
            for connection in opened_bag.connections:
                counts[absolute(connection.topic), messages.shown(connection.msgtype)] += connection.msgcount
            start, end = min(start, opened_bag.start_time), max(end, opened_bag.end_time)
    seconds = max((end - start) / 1e9, 1e-9)
    return [Found(name, kind, count, count / seconds) for (name, kind), count in sorted(counts.items())]


def proposal(found: Sequence[Found], own: Mapping[str, str]) -> dict[str, str]:
    """Return a likely topic for each part whose own, by part, is not there or of no use."""
    proposed: dict[str, str] = {}
    for part, likely in _LIKELY.items():
        fitting = [topic for topic in found if part in topic.serves and topic.count]
        if part not in own or any(topic.name == own[part] for topic in fitting):
            continue
        taken = {*proposed.values(), *own.values()}
        ranked = sorted(
            (rank, -topic.count, topic.name)
            for topic in fitting
            if topic.name not in taken and (rank := _rank(part, likely, topic)) is not None
        )
        if ranked:
            proposed[part] = ranked[0][2]
    return proposed


def listed(found: Sequence[Found]) -> str:
    """Return topics in words, those first that could serve as something."""
    ordered = sorted(found, key=lambda topic: (not topic.serves, topic.name))
    more = f" and {len(ordered) - _MOST_LISTED} more" if len(ordered) > _MOST_LISTED else ""
    return (", ".join(topic.told for topic in ordered[:_MOST_LISTED]) or "no topic") + more


def _rank(part: str, likely: Sequence[str], topic: Found) -> int | None:
    """Return how likely a topic is what it could serve as, 0 the most, None: it is hardly so."""
    name = topic.name.lower()
    if part in _UNLIKELY and re.search(_UNLIKELY[part], name):
        return None
    rank = next((i for i, pattern in enumerate(likely) if re.search(pattern, name)), len(likely))
    # Odometry says where a robot thinks it is, and a pose is measured, unless their names say otherwise.
    usual = topic.type == "nav_msgs/Odometry"
    doubtful = rank == len(likely) and ((part == "pose" and usual) or (part == "odom" and not usual))
    return None if doubtful else rank
