# SPDX-License-Identifier: BSD-3-Clause
"""What an experiment must know of its surroundings: where its poses come from, and whether there is space."""

from __future__ import annotations

from pathlib import Path

import rospy

from kurumaisu.errors import Error
from kurumaisu.experiments import Script, obstructed, reach
from kurumaisu.experiments.supervisor import Care
from kurumaisu.params import Chassis
from kurumaisu.ros.graph import publishers, wait_until
from kurumaisu.types import FloatArray
from kurumaisu.world import load_world

TRUTH, ODOM = "ground_truth", "odom"


class ExperimentSpace:
    """The ROS graph, and the walls of a world if there is one."""

    def __init__(self, script: Script, chassis: Chassis, care: Care, world: str | None) -> None:
        """world: a file, 'none', or None for the simulator's. Raise Error when it cannot be read."""
        self._script = script
        self._margin = reach(chassis) + care.margin
        # What is started together with this comes up at its own pace.
        wait_until(lambda: bool(publishers(TRUTH) or publishers(ODOM)), care.patience)
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
