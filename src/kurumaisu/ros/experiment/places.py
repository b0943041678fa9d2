# SPDX-License-Identifier: BSD-3-Clause
"""Goes from place to place: the simulator puts the chair there, or a person is asked to. Nothing is commanded."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from pathlib import Path

import rospy
from geometry_msgs.msg import Point, Pose
from nav_msgs.msg import Odometry

from kurumaisu.errors import Error
from kurumaisu.experiments import Script
from kurumaisu.experiments.supervisor import Care, Rest
from kurumaisu.experiments.visit import Visit
from kurumaisu.ros.experiment.surroundings import TRUTH, ExperimentSpace
from kurumaisu.ros.inbox import subscribe
from kurumaisu.ros.recorder import Recorder
from kurumaisu.ros.rotation import planar, quaternion_of
from kurumaisu.srv import SetPose
from kurumaisu.types import FloatArray

_RECORDED = ("scan", "ground_truth")
_GLANCE = 0.01  # [s] of wall time


def run_places(
    script: Script, care: Care, ground: ExperimentSpace, stop: Callable[[], bool], folder: Path | None
) -> str:
    """Return why it was stopped, '' when it is done; one bag per place. Raise Error when it is refused."""
    if ground.sources()[0] != TRUTH:
        raise Error(f"no node publishes {TRUTH}: the places are measured from the start of the chair")
    walker = _Walker(care, stop)
    origin = walker.standing()
    if origin is None:
        return "interrupted"
    why = ground.refusal(origin)
    for number, place in enumerate(script.places if not why else (), 1):
        visit = Visit(place, origin, care)
        bag = None if folder is None else folder / f"place_{number}.bag"
        print(f"experiment: place {number} of {len(script.places)}: {_words(visit.target)}", flush=True)
        if not walker.stay(visit, bag):
            return "interrupted"
    return why


class _Walker:
    """Hears where the chair is."""

    def __init__(self, care: Care, stop: Callable[[], bool]) -> None:
        self._care = care
        self._stop = stop
        self._rest = Rest(care)
        self._pose: FloatArray | None = None
        self._visit: Visit | None = None
        subscribe(TRUTH, Odometry, self._see, "EXPERIMENT_BAD_POSE", queue_size=10)

    def standing(self) -> FloatArray | None:
        """Return the pose as soon as the chair has stood for rest_time; None when interrupted."""
        done = self._until(lambda: rospy.get_time() - self._rest.since >= self._care.rest_time)
        return self._pose if done else None

    def stay(self, visit: Visit, bag: Path | None) -> bool:
        """Return True when the chair has stood there long enough, False when interrupted."""
        self._visit = visit
        _put(visit.target)
        if not self._until(lambda: visit.stands(rospy.get_time(), rospy.get_time())):
            return False
        recorder = Recorder(bag, _RECORDED) if bag is not None else None
        try:
            begin = rospy.get_time()
            return self._until(lambda: self._stood(visit, begin))
        finally:
            if recorder is not None:
                recorder.close()

    @staticmethod
    def _stood(visit: Visit, begin: float) -> bool:
        now = rospy.get_time()
        if not visit.stands(now, begin):
            raise Error("the chair moved while it should stand")
        return bool(now - begin >= visit.seconds)

    def _until(self, condition: Callable[[], bool]) -> bool:
        while not self._stop():
            if condition():
                return True
            time.sleep(_GLANCE)
        return False

    def _see(self, message: Odometry) -> None:
        self._pose = planar(message.pose.pose)
        self._rest.see(rospy.get_time(), self._pose)
        if self._visit is not None:
            self._visit.see(rospy.get_time(), self._pose)


def _put(target: FloatArray) -> None:
    """Let the simulator put the chair there, if there is one."""
    if not _offered("set_pose"):
        return
    pose = Pose(position=Point(float(target[0]), float(target[1]), 0.0), orientation=quaternion_of(float(target[2])))
    answer = rospy.ServiceProxy("set_pose", SetPose)(name="chair", pose=pose)
    if not answer.success:
        raise Error(f"the simulator refuses the place: {answer.message}")


def _offered(name: str) -> bool:
    try:
        rospy.wait_for_service(name, timeout=0.1)
    except rospy.ROSException:
        return False
    return True


def _words(target: FloatArray) -> str:
    return f"x {target[0]:.2f}, y {target[1]:.2f} m, heading {math.degrees(target[2]):.0f} degrees"
