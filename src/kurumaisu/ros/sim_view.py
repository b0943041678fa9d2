# SPDX-License-Identifier: BSD-3-Clause
"""What a page draws of a simulation, on topics `~world` and `~view`; costs nothing while nobody listens."""

from __future__ import annotations

import json
import time
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
import rospy
from rospy.numpy_msg import numpy_msg
from std_msgs.msg import String

from kurumaisu.geometry import PLANAR, attached
from kurumaisu.msg import View
from kurumaisu.params import Laser
from kurumaisu.ros.messages import stamp_of
from kurumaisu.sim.chair import Observation as ChairObservation
from kurumaisu.sim.fans import spread
from kurumaisu.sim.machinery import Machinery
from kurumaisu.sim.scans import Scans
from kurumaisu.sim.scenery import Piece, bounds, scenery
from kurumaisu.sim.simulator import Simulator
from kurumaisu.types import FloatArray

_NS = 1_000_000_000
_View = numpy_msg(View)  # a plain View would be packed number by number, on any topic
_OF_LATE = 16  # views over which the real-time factor is taken


@dataclass(frozen=True)
class Looks:
    """The newest scans of all fans: stamps (f,) [ns], poses (f, 3) of the sensors; rows of all beams, as in View."""

    stamps: Sequence[int]
    poses: FloatArray
    ranges: FloatArray
    truths: FloatArray | None
    intensities: FloatArray


class Fans(Protocol):
    """The fans of a simulation."""

    def places(self, machinery: Machinery) -> list[dict[str, Any]]:
        """Return for each fan its body's row, bearings and gate."""

    @property
    def fresh(self) -> bool:
        """Whether there may be no newer ones in the next step."""

    def looks(self) -> Looks | None:
        """Return the newest scans, None before the first."""


class ViewTopics:
    """Publishes at a rate of wall time, whatever the pace of the simulated one."""

    def __init__(
        self,
        rate: float,
        frame: str,
        machinery: Callable[[], Machinery],
        fans: Fans,
        drives: Callable[[], Mapping[int, str]],
    ) -> None:
        """Advertise; rate [Hz] at most; machinery: tells what runs now; drives: topics of commands by bodies' rows."""
        self._period, self._frame = 1 / rate, frame
        self._machinery, self._fans, self._drives = machinery, fans, drives
        self._view = rospy.Publisher("~view", _View, queue_size=1, tcp_nodelay=True)
        self._world = rospy.Publisher("~world", String, queue_size=1, latch=True)
        self._known: Machinery | None = None
        self._number = 0
        self._run = 0
        self._due = 0.0  # [s] of wall time
        self._late: deque[tuple[float, int]] = deque(maxlen=_OF_LATE)
        self._sent: Sequence[int] = ()  # stamps of the scans that were
        self._looked = False  # somebody did, when last asked
        self._stalled = b""  # as of the last step
        self._contacts = np.zeros(0, dtype=np.uint32)

    @property
    def due(self) -> bool:
        """Whether somebody looks and should see something new; asked in every step, so there is no more to it."""
        if time.monotonic() < self._due:
            return False
        if self._view.get_num_connections():
            return True
        self._sent = ()  # who comes next wants the scans, too
        self._looked = False
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
        if machinery is not self._known:
            self._describe(machinery)
        self._due = wall + self._period
        self._looked = True
        view = _View(world=self._number, run=self._run, paused=paused, speed=speed)
        view.header.stamp, view.header.frame_id = stamp_of(now), self._frame
        view.real_time_factor = 0.0 if paused else self._factor(wall, now)
        view.poses = np.ascontiguousarray(machinery.frames[:-1, PLANAR]).reshape(-1)
        view.hit = machinery.stalled.tobytes()
        view.contacts = self._contacts.copy()  # another thread may be sending it
        self._add_scans(view)
        self._view.publish(view)

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

    def _add_scans(self, view: Any) -> None:
        looks = self._fans.looks()
        empty = np.empty(0, dtype=np.float32)
        view.ranges = view.truths = view.intensities = empty
        view.sensors = np.empty(0)
        if looks is None or looks.stamps == self._sent:
            return
        self._sent = looks.stamps
        view.stamps = [stamp_of(stamp) for stamp in looks.stamps]
        view.sensors = np.ascontiguousarray(looks.poses, dtype=np.float64).reshape(-1)
        view.ranges = looks.ranges.astype(np.float32)
        view.truths = empty if looks.truths is None else looks.truths.astype(np.float32)
        view.intensities = looks.intensities.astype(np.float32)

    def _describe(self, machinery: Machinery) -> None:
        """Tell of other bodies."""
        self._known = machinery
        self._number += 1
        self._sent = ()
        self._stalled = machinery.stalled.tobytes()
        self._contacts = np.zeros(len(machinery.stalled), dtype=np.uint32)
        pieces = scenery(machinery)
        drives = self._drives()
        content = {
            "world": self._number,
            "bounds": bounds(pieces),
            "bodies": [{**_described(piece), "drive": drives.get(piece.row)} for piece in pieces],
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


class ChairFan:
    """The chair's laser."""

    def __init__(self, laser: Laser, chair: Callable[[], int]) -> None:
        """chair: tells its row among the bodies."""
        self._laser, self._chair = laser, chair
        mount = laser.mount
        self._mount = np.array([mount.x, mount.y, mount.z, mount.yaw])
        self._looks: Looks | None = None

    def note(self, observation: ChairObservation, epoch: int) -> None:
        """Hear of a step; epoch [ns]: what the clock said at the simulation's time 0."""
        scan = observation.scan
        if scan is None:
            return
        x, y, heading = scan.pose.tolist()
        place = attached(np.array([x, y, 0.0, heading]), self._mount)[None, PLANAR]
        stamp = epoch + round(scan.time * _NS)
        self._looks = Looks((stamp,), place, scan.ranges, scan.truths, scan.returns)

    def places(self, _machinery: Machinery) -> list[dict[str, Any]]:
        """Return the one."""
        laser = self._laser
        return [
            {
                "row": self._chair(),
                "beams": laser.beams,
                "angle_min": laser.angle_min,
                "angle_increment": laser.angle_increment,
                "range_min": laser.range_min,
                "range_max": laser.range_max,
            }
        ]

    @property
    def fresh(self) -> bool:
        """A scan keeps the place where it was made."""
        return True

    def looks(self) -> Looks | None:
        """Return its newest scan."""
        return self._looks


class FleetFans:
    """All fans of the robots of a world file."""

    def __init__(self, simulator: Simulator) -> None:
        self._simulator = simulator
        self.fresh = False
        self._newest: tuple[int, Scans, FloatArray] | None = None  # [ns], and the bodies' frames then

    def note(self, now: int) -> None:
        """Hear of a step at the end of which a view is due; now [ns]. Only now is it known where the fans measured."""
        scans, time = self._simulator.scans, self._simulator.time
        self.fresh = not len(scans) or any(sweep.time == time for sweep in scans.sweeps)
        if self.fresh and len(scans):
            self._newest = now, scans, self._simulator.machinery.frames.copy()

    def places(self, machinery: Machinery) -> list[dict[str, Any]]:
        """Return those of the models that there are now."""
        self._newest = None
        return [
            {
                "row": fan.body,
                "beams": fan.fan.samples,
                "angle_min": spread(fan.fan)[0],
                "angle_increment": spread(fan.fan)[1],
                "range_min": fan.fan.range_min,
                "range_max": fan.fan.range_max,
            }
            for fan in machinery.fans
        ]

    def looks(self) -> Looks | None:
        """Return their newest scans."""
        if self._newest is None:
            return None
        self.fresh = False
        stamp, scans, frames = self._newest
        machinery = self._simulator.machinery
        bodies, mounts = [fan.body for fan in machinery.fans], np.array([fan.mount for fan in machinery.fans])
        poses = attached(frames[bodies], mounts)[:, PLANAR]
        returns = np.concatenate([scan.returns for scan in scans])
        return Looks((stamp,) * len(bodies), poses, scans.ranges, machinery.rangers.truths, returns)
