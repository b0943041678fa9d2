# SPDX-License-Identifier: BSD-3-Clause
"""Whatever runs behind ROS, for the viewer's server: its parts make a moment together, and obey a page."""

from __future__ import annotations

import threading
import time
from collections.abc import Mapping
from typing import Any

import numpy as np
import rospy
from geometry_msgs.msg import PoseWithCovarianceStamped

from kurumaisu.errors import Error
from kurumaisu.params import load_model
from kurumaisu.ros.rotation import quaternion_of
from kurumaisu.ros.viewer import effects, simulation
from kurumaisu.ros.viewer.chair import Chair
from kurumaisu.ros.viewer.effects import EffectSwitches
from kurumaisu.ros.viewer.maps import Maps
from kurumaisu.ros.viewer.notes import RosoutNotes
from kurumaisu.ros.viewer.record import BagRecorder
from kurumaisu.ros.viewer.robot import Robot
from kurumaisu.ros.viewer.settings import NONE, NodeSettings
from kurumaisu.ros.viewer.simulation import SimulationSource
from kurumaisu.ros.viewer.stick import Sticks
from kurumaisu.ros.viewer.topics import Alignment, PlanarTransforms
from kurumaisu.types import FloatArray
from kurumaisu.viewer.hub import Hub
from kurumaisu.viewer.protocol import State
from kurumaisu.viewer.source import Outcome

_BREATH = 0.002  # [s] between moments at least
_PREFIX = {"sim_node": "", "stageros": "stageros/"}  # of the services


class RosSource:
    """A simulation or a robot; listens only while somebody looks."""

    def __init__(self, hub: Hub, settings: NodeSettings) -> None:
        """Raise Error for a model that does not load."""
        self._hub = hub
        simulator, model = settings.simulator, load_model(settings.model)
        self.mode = "robot" if simulator == NONE else "sim"
        self.title = model.name if simulator != "stageros" else simulator
        self._transforms = PlanarTransforms()
        self._scene: SimulationSource | Robot
        if simulator == NONE:
            self._scene = Robot(hub, model, self._transforms, settings.frames)
        else:
            self._scene = SimulationSource(hub, simulator, _PREFIX[simulator])
        self._chair = None if settings.base == NONE else Chair(settings.base)
        self._effects = EffectSwitches(hub, simulator, settings.model) if simulator == "sim_node" else None
        self._maps = Maps(hub, self._transforms, settings.frames[0], settings.frames[2])
        self._notes = RosoutNotes(settings.notes)
        self._bags = BagRecorder(settings.bags)
        self._start = Alignment()  # of the odometry
        self._run: int | None = None
        self._sticks: Sticks | None = None
        driving = settings.driving
        self.limits: Mapping[str, float] | None = None
        self._initial: Any = None
        if settings.control:
            hub.new_token = f"rosservice call {rospy.get_name()}/new_token"
            self._initial = rospy.Publisher("initialpose", PoseWithCovarianceStamped, queue_size=1)
        if settings.control and driving.topic != NONE:
            self._sticks = Sticks(driving, self._scene.drives)
            self.limits = {"v": driving.v, "w": driving.w}
        self._map_frame, _, self._base_frame = settings.frames
        self.abilities = self._can()
        self._watched = threading.Event()
        self._open = False
        self._shown: Any = None  # of the scene, last

    def watch(self, watched: bool) -> None:
        """Hear whether anybody looks; the loop opens and closes the topics."""
        if watched:
            self._watched.set()
        else:
            self._watched.clear()
            if self._sticks is not None:
                self._sticks.rest()

    def run(self, rate: float, asked: threading.Event) -> None:
        """Show a moment at a rate [Hz], while somebody looks, until asked to end."""
        period, due = 1 / rate, time.monotonic()
        while not asked.is_set():
            if self._watched.is_set() != self._open:
                self._turn(self._watched.is_set())
            if not self._open:
                self._watched.wait(0.2)
                continue
            self._show()
            due = max(due + period, time.monotonic() + _BREATH)  # what is late is left out, not made up for
            time.sleep(due - time.monotonic())

    def close(self) -> None:
        """End what is being recorded."""
        self._bags.close()

    def command(self, name: str, arguments: Mapping[str, Any]) -> Outcome:
        """Obey. Raise Error where it cannot be done."""
        match name:
            case "drive" if self._sticks is not None:
                return self._sticks.drive(**arguments)
            case "estop" if self._chair is not None:
                return self._chair.estop(**arguments)
            case "effect" if self._effects is not None:
                return self._effects.switch(**arguments)
            case "save_model" if self._effects is not None:
                return self._effects.model()
            case "record":
                return self._bags.record(**arguments)
            case "initial_pose" if self._initial is not None:
                return self._guess(**arguments)
            case _ if isinstance(self._scene, SimulationSource):
                return self._scene.command(name, dict(arguments))
        raise Error(f"{name}: cannot be done here")

    def _can(self) -> frozenset[str]:
        able = {"record", "initial_pose"}
        if self._sticks is not None:
            able.add("drive")
        if self._chair is not None:
            able.add("estop")
        if isinstance(self._scene, SimulationSource):
            able |= simulation.ABILITIES
        if self._effects is not None:
            able |= effects.ABILITIES
        return frozenset(able)

    def _turn(self, on: bool) -> None:
        """Listen, or no longer."""
        parts: list[Any] = [self._scene, self._maps, self._notes, self._chair, self._effects]
        for part in parts:
            if part is not None:
                part.open() if on else part.close()
        self._transforms.listen(on and isinstance(self._scene, Robot))
        self._open, self._run, self._shown = on, None, None

    def _show(self) -> None:
        moment = self._scene.moment()
        if self._effects is not None:
            self._effects.show()
        if moment is None:
            return
        parts, scans = moment
        if isinstance(self._scene, SimulationSource):
            self._transforms.listen(self._maps.there)  # flat out, a simulator sends thousands a second
        if parts is self._shown and self._chair is None:
            return  # nothing is new
        self._shown = parts
        truth = None if parts.get("truth") is None else np.array(parts["truth"])
        odom = self._odom(truth)
        chair = {} if self._chair is None else self._chair.parts()
        state = State(
            **parts,
            **chair,
            wall=time.time(),
            odom=None if odom is None else tuple(odom.tolist()),
            estimate=self._maps.estimate(truth),
            recording=self._bags.recording,
            starting=self._bags.starting,
            notes=self._notes.now(),
        )
        self._hub.state(state, scans)

    def _odom(self, truth: FloatArray | None) -> FloatArray | None:
        """Return where odometry has the robot, laid on the truth, or on the map, where it began."""
        pose = self._scene.odometry if self._chair is None else self._chair.pose()
        if pose is None:
            return None
        if self._run != self._scene.run:
            self._run = self._scene.run
            self._start.begin()
        if isinstance(self._scene, Robot):
            truth = self._transforms.lookup(self._map_frame, self._base_frame)
            return self._start.laid(pose, pose if truth is None else truth)
        return self._start.laid(pose, truth)

    def _guess(self, x: float, y: float, yaw: float) -> Outcome:
        """Tell whoever localises where the robot is."""
        if self._shown is None:
            raise Error("initial_pose: no robot has been heard yet")
        message = PoseWithCovarianceStamped()
        message.header.stamp, message.header.frame_id = rospy.Time.from_sec(self._shown["t"]), self._map_frame
        message.pose.pose.position.x, message.pose.pose.position.y = x, y
        message.pose.pose.orientation = quaternion_of(yaw)
        for place, variance in ((0, 0.25), (7, 0.25), (35, 0.07)):  # [m^2, rad^2] as rviz has them
            message.pose.covariance[place] = variance
        self._initial.publish(message)
        return Outcome("told")
