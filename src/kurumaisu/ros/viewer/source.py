# SPDX-License-Identifier: BSD-3-Clause
"""Whatever runs behind ROS, for the viewer's server: its parts make a moment together, and obey a page."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import rospy
from geometry_msgs.msg import PoseWithCovarianceStamped

from kurumaisu.errors import Error
from kurumaisu.params import load_model
from kurumaisu.ros.rotation import quaternion_of
from kurumaisu.ros.viewer import simulation
from kurumaisu.ros.viewer.chair import Chair
from kurumaisu.ros.viewer.effects import EffectSwitches
from kurumaisu.ros.viewer.frames import Frames
from kurumaisu.ros.viewer.goal import DrivenGoals, Goals
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
        self._goals: Goals | None = None
        if settings.control:
            self._goals = Goals(settings.frames[0])
            hub.new_token = f"rosservice call {rospy.get_name()}/new_token"
            self._initial = rospy.Publisher("initialpose", PoseWithCovarianceStamped, queue_size=1)
        if settings.control and driving.topic != NONE:
            self._sticks = Sticks(driving, self._scene.drives)
            self.limits = {"v": driving.v, "w": driving.w}
            if isinstance(
                self._scene, SimulationSource
            ):  # a real robot has somebody in it, and walls that nobody knows
                self._goals = DrivenGoals(settings.frames[0], settings.manner, driving, self._sticks)
        self._map_frame, _, self._base_frame = settings.frames
        self._does = self._own_commands()
        self.abilities = frozenset(self._does)
        if isinstance(self._scene, SimulationSource):
            self.abilities |= simulation.ABILITIES
        self._watched = threading.Event()
        self._open = False
        self._shown: Any = None  # of the scene, last

    def watch(self, watched: bool) -> None:
        """Hear whether anybody looks; the loop opens and closes the topics."""
        if watched:
            self._watched.set()
        else:
            self._watched.clear()
            if self._goals is not None:
                self._goals.stop("ended: nobody looked")
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
            now = time.monotonic()  # once: on a busy machine it is later when it is asked again
            due = max(due + period, now + _BREATH)  # what is late is left out, not made up for
            time.sleep(due - now)

    def close(self) -> None:
        """End what is being recorded."""
        self._bags.close()

    def command(self, name: str, arguments: Mapping[str, Any]) -> Outcome:
        """Obey. Raise Error where it cannot be done."""
        if name in self._does:
            return self._does[name](**arguments)
        if isinstance(self._scene, SimulationSource):
            return self._scene.command(name, dict(arguments))
        raise Error(f"{name}: cannot be done here")

    def _own_commands(self) -> dict[str, Callable[..., Outcome]]:
        """Return what obeys each command that is not the scene's."""
        does: dict[str, Callable[..., Outcome]] = {"record": self._bags.record, "frames": Frames().list}
        if self._initial is not None:
            does["initial_pose"] = self._guess
        if self._goals is not None:
            does |= {"goal": self._aim, "forget_goal": self._goals.forget}
        if isinstance(self._goals, DrivenGoals):
            does["go"] = self._go
        if self._sticks is not None:
            does["drive"] = self._drive
        if self._chair is not None:
            does["estop"] = self._chair.estop
        if self._effects is not None:
            does |= {"effect": self._effects.switch, "save_model": self._effects.model}
        return does

    def _drive(self, v: float, w: float, body: str | None = None) -> Outcome:
        assert self._sticks is not None
        if isinstance(self._goals, DrivenGoals):
            self._goals.by_hand(body)
        return self._sticks.drive(v, w, body)

    def _aim(self, x: float, y: float, yaw: float) -> Outcome:
        """Tell of a goal."""
        assert self._goals is not None
        pose = np.array([x, y, yaw])
        return self._goals.publish(pose, self._maps.in_map(pose), self._heard("goal"))

    def _go(self, body: str | None = None) -> Outcome:
        """Let a body drive to the goal, None: the first one. Raise Error if there is none."""
        assert isinstance(self._goals, DrivenGoals)
        found = next(iter(self._scene.drives()), None) if body is None else body
        if found is None:
            raise Error("go: there is no robot that can be driven")
        return self._goals.drive(found, self._scene.run)

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
        new, self._shown = parts is not self._shown, parts
        truth = None if parts.get("truth") is None else np.array(parts["truth"])
        odom = self._odom(truth)
        chair = {} if self._chair is None else self._chair.parts()
        if new and isinstance(self._goals, DrivenGoals):
            self._goals.moment(parts, self._scene.run, bool(chair.get("estop")))
        state = State(
            **parts,
            **chair,
            wall=time.time(),
            odom=None if odom is None else tuple(odom.tolist()),
            estimate=self._maps.estimate(truth),
            recording=self._bags.recording,
            starting=self._bags.starting,
            notes=self._notes.now(),
            goal=None if self._goals is None else self._goals.shown(),
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

    def _heard(self, command: str) -> float:
        """Return the time of the last moment [s]. Raise Error before the first."""
        if self._shown is None:
            raise Error(f"{command}: no robot has been heard yet")
        return float(self._shown["t"])

    def _guess(self, x: float, y: float, yaw: float) -> Outcome:
        """Tell whoever localises where the robot is."""
        message = PoseWithCovarianceStamped()
        message.header.stamp = rospy.Time.from_sec(self._heard("initial_pose"))
        message.header.frame_id = self._map_frame
        message.pose.pose.position.x, message.pose.pose.position.y = x, y
        message.pose.pose.orientation = quaternion_of(yaw)
        for place, variance in ((0, 0.25), (7, 0.25), (35, 0.07)):  # [m^2, rad^2] as rviz has them
            message.pose.covariance[place] = variance
        self._initial.publish(message)
        return Outcome("told")
