# SPDX-License-Identifier: BSD-3-Clause
"""What a page draws of a simulation, on topics `~world` and `~view`; costs nothing while nobody listens."""

from __future__ import annotations

import json
import time
from collections import deque
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import rospy
from std_msgs.msg import String

from kurumaisu.geometry import PLANAR
from kurumaisu.msg import View
from kurumaisu.ros.outlet import Outlet
from kurumaisu.ros.view.fans import Fans, Looks
from kurumaisu.ros.view.wire import Lengths, ViewWire
from kurumaisu.sim.robots.machinery import Machinery
from kurumaisu.sim.robots.scenery import Piece, bounds, scenery
from kurumaisu.types import IntArray

_NS = 1_000_000_000
_OF_LATE = 16  # views over which the real-time factor is taken
_NEWEST = 1  # views kept for a viewer that does not take them
_BREATH = 0.002  # [s] after which what a socket did not take is offered again


class ViewTopics:
    """Publishes at a rate of wall time, whatever the pace of the simulated one."""

    def __init__(
        self,
        rate: float,
        frame: str,
        machinery: Callable[[], Machinery],
        fans: Fans,
        drives: Callable[[], Mapping[int, str]],
        seed: Callable[[], int],
    ) -> None:
        """Advertise; rate [Hz] at most; machinery: tells what runs now; drives: topics of commands by bodies' rows."""
        self._period, self._frame = 1 / rate, frame
        self._machinery, self._fans, self._drives, self._seed = machinery, fans, drives, seed
        self._view = Outlet("~view", View, _NEWEST)
        self._world = rospy.Publisher("~world", String, queue_size=1, latch=True)
        self._known: tuple[Machinery, int] | None = None  # with the seed
        self._number = 0
        self._run = 0
        self._due = 0.0  # [s] of wall time
        self._offered = 0.0  # [s] likewise
        self._late: deque[tuple[float, int]] = deque(maxlen=_OF_LATE)
        self._sent: IntArray | None = None  # stamps of the scans that were
        self._wires: dict[Lengths, ViewWire] = {}
        self._looked = False  # somebody did, when last asked
        self._stalled = b""  # as of the last step
        self._contacts = np.zeros(0, dtype=np.uint32)

    @property
    def due(self) -> bool:
        """Whether somebody looks and should see something new; asked in every step, so there is no more to it."""
        wall = time.monotonic()
        if self._view.behind and wall >= self._offered + _BREATH:
            self._view.flush()
            self._offered = wall
        if wall < self._due:
            return False
        if self._view.wanted:
            return True
        self._sent = None  # who comes next wants the scans, too
        self._looked = False
        self._due = wall + self._period
        return False

    def carried(self) -> None:
        """Note that a robot was put elsewhere: its odometry does not know."""
        self._run += 1

    def show(self, now: int, paused: bool, speed: float) -> None:
        """Publish if a view is due and wanted; to be called after every step and change; now [ns] of /clock."""
        if self._looked:
            self._count_contacts()
        if not self.due:
            return
        wall = time.monotonic()
        if not (self._fans.fresh or paused or wall >= self._due + self._period):
            return  # the next step may bring scans
        machinery = self._machinery()
        if self._known is None or machinery is not self._known[0] or self._seed() != self._known[1]:
            self._describe(machinery)
        self._due = wall + self._period
        self._looked = True
        looks = self._new_looks()
        wire = self._wire(machinery, looks)
        wire.head(self._view.next_number(), divmod(now, _NS), self._number, self._run)
        wire.pace(paused, speed, 0.0 if paused else self._factor(wall, now))
        wire.poses[:] = machinery.frames[:-1, PLANAR]
        wire.hit[:] = machinery.stalled
        wire.contacts[:] = self._contacts
        wire.odometry[:] = machinery.localization.believed()
        if looks is not None:
            wire.fill(looks)
        self._view.send(wire.data)

    def _count_contacts(self) -> None:
        """Note what has begun in a step; in most nothing has, and bytes compare fastest."""
        stalled = self._machinery().stalled
        if (said := stalled.tobytes()) != self._stalled:
            before = np.frombuffer(self._stalled, np.bool_)
            if len(before) == len(stalled) == len(self._contacts):
                self._contacts += stalled & ~before
            self._stalled = said

    def _factor(self, wall: float, now: int) -> float:
        if self._late and (now < self._late[-1][1] or wall - self._late[-1][0] > 1.0):
            self._late.clear()  # nobody has looked in between
        self._late.append((wall, now))
        (began, then), passed = self._late[0], wall - self._late[0][0]
        return (now - then) / _NS / passed if passed > 0 and began else 0.0

    def _new_looks(self) -> Looks | None:
        """Return the newest scans if they have not been shown."""
        looks = self._fans.looks()
        if looks is None or (self._sent is not None and np.array_equal(looks.stamps, self._sent)):
            return None
        self._sent = looks.stamps
        return looks

    def _wire(self, machinery: Machinery, looks: Looks | None) -> ViewWire:
        """Return what has room for this, made once: shapes change with the world only."""
        bodies, robots = len(machinery.stalled), len(machinery.robots)
        if looks is None:
            shape = Lengths(bodies, robots, 0, 0, 0, 0)
        else:
            truths = 0 if looks.truths is None else len(looks.truths)
            shape = Lengths(bodies, robots, len(looks.stamps), len(looks.ranges), truths, len(looks.intensities))
        if shape not in self._wires:
            self._wires[shape] = ViewWire(self._frame, shape)
        return self._wires[shape]

    def _describe(self, machinery: Machinery) -> None:
        """Tell of other bodies, or another seed."""
        self._known = machinery, self._seed()
        self._number += 1
        self._sent = None
        self._wires.clear()
        self._stalled = machinery.stalled.tobytes()
        self._contacts = np.zeros(len(machinery.stalled), dtype=np.uint32)
        pieces = scenery(machinery)
        drives = self._drives()
        content = {
            "world": self._number,
            "seed": self._seed(),
            "bounds": bounds(pieces),
            "bodies": [{**_described(piece), "drive": drives.get(piece.row)} for piece in pieces],
            "robots": machinery.robot_rows.tolist(),  # rows of those whose odometry a View has
            "fans": self._fans.places(machinery),
        }
        self._world.publish(json.dumps(content))


def _described(piece: Piece) -> dict[str, Any]:
    return {
        "id": piece.id,
        "name": piece.name,
        "kind": piece.kind,
        "color": "#" + "".join(f"{round(255 * share):02x}" for share in piece.color[:3]),
        "movable": piece.movable,
        "row": piece.row,
        "pose": piece.pose[PLANAR].tolist(),
        "z": float(piece.pose[2]),
        "polygons": [np.round(polygon, 4).tolist() for polygon in piece.polygons],
        "segments": np.round(piece.segments, 4).tolist(),
    }
