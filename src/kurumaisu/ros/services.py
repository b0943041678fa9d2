# SPDX-License-Identifier: BSD-3-Clause
"""Services that any simulation behind ROS has: what they do is done between two of its steps."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, Protocol

import rospy
from std_srvs.srv import (
    Empty,
    EmptyRequest,
    EmptyResponse,
    SetBool,
    SetBoolRequest,
    SetBoolResponse,
    Trigger,
    TriggerRequest,
    TriggerResponse,
)

from kurumaisu.errors import Error
from kurumaisu.ros.rotation import pose_of
from kurumaisu.sim.live.pacing import Pacer
from kurumaisu.sim.live.requests import Requests
from kurumaisu.sim.robots.saved_world import Scene, world_file
from kurumaisu.sim.robots.state_folder import StateFolder
from kurumaisu.srv import (
    Delete,
    DeleteRequest,
    SaveWorld,
    SaveWorldRequest,
    Seed,
    SeedRequest,
    SetPose,
    SetPoseRequest,
    Spawn,
    SpawnRequest,
    Speed,
    SpeedRequest,
    StateFile,
    StateFileRequest,
)
from kurumaisu.types import FloatArray


class Simulation(Protocol):
    """What the services act on, all by the thread that steps it. Every method may raise Error."""

    paused: bool

    @property
    def time(self) -> float:
        """What its clock says [s]."""

    def step(self) -> None:
        """Go on by one step."""

    def reset(self, seed: int | None = None) -> None:
        """Start again, with the same or another seed; the clock runs on."""

    def set_pose(self, name: str, pose: FloatArray) -> None:
        """Put a model to a pose (4,)."""

    def spawn(self, like: str, name: str, pose: FloatArray) -> str:
        """Add a copy of a model, or what a text describes, at a pose (4,); return `#` and its key."""

    def delete(self, name: str) -> None:
        """Take a model away."""

    def restore(self, name: str) -> None:
        """Bring back a model that was deleted."""

    def scene(self) -> Scene:
        """Return what there is now."""

    def save(self) -> bytes:
        """Return the whole state."""

    def load(self, saved: bytes) -> None:
        """Go back to a state; the clock runs on."""


class Services:
    """Advertises reset, pause, step, speed, seed, set_pose, spawn, delete, restore, save_world, save and load."""

    def __init__(
        self, simulation: Simulation, requests: Requests, pacer: Pacer, states: StateFolder, prefix: str
    ) -> None:
        """states: where they are saved; prefix: of the names, `~` for private ones."""
        self._simulation = simulation
        self._pacer = pacer
        self._states = states
        self._requests = requests
        self._services = [
            rospy.Service(prefix + "reset", Empty, self._reset),
            rospy.Service(prefix + "pause", SetBool, self._pause),
            rospy.Service(prefix + "step", Trigger, self._step),
            rospy.Service(prefix + "speed", Speed, self._speed),
            rospy.Service(prefix + "seed", Seed, self._seed),
            rospy.Service(prefix + "set_pose", SetPose, self._set_pose),
            rospy.Service(prefix + "spawn", Spawn, self._spawn),
            rospy.Service(prefix + "delete", Delete, self._delete),
            rospy.Service(prefix + "restore", Delete, self._restore),
            rospy.Service(prefix + "save_world", SaveWorld, self._save_world),
            rospy.Service(prefix + "save", StateFile, self._save),
            rospy.Service(prefix + "load", StateFile, self._load),
        ]

    def _reset(self, _request: EmptyRequest) -> EmptyResponse:
        self._requests.ask(self._simulation.reset)
        return EmptyResponse()

    def _pause(self, request: SetBoolRequest) -> SetBoolResponse:
        def pause() -> None:
            self._simulation.paused = request.data

        return SetBoolResponse(*self._outcome(pause))

    def _step(self, _request: TriggerRequest) -> TriggerResponse:
        def step() -> None:
            if not self._simulation.paused:
                raise Error("step: works only while paused")
            self._simulation.step()

        return TriggerResponse(*self._outcome(step))

    def _speed(self, request: SpeedRequest) -> tuple[bool, str]:
        def pace() -> None:
            self._pacer.speed = request.speed

        return self._outcome(pace)

    def _seed(self, request: SeedRequest) -> tuple[bool, str]:
        return self._outcome(lambda: self._simulation.reset(request.seed))

    def _set_pose(self, request: SetPoseRequest) -> tuple[bool, str]:
        return self._outcome(lambda: self._simulation.set_pose(request.name, pose_of(request.pose)))

    def _spawn(self, request: SpawnRequest) -> tuple[bool, str, str]:
        key = ""

        def spawn() -> None:
            nonlocal key
            key = self._simulation.spawn(request.like, request.name, pose_of(request.pose))

        success, message = self._outcome(spawn)
        return success, message, key

    def _delete(self, request: DeleteRequest) -> tuple[bool, str]:
        return self._outcome(lambda: self._simulation.delete(request.name))

    def _restore(self, request: DeleteRequest) -> tuple[bool, str]:
        return self._outcome(lambda: self._simulation.restore(request.name))

    def _save_world(self, _request: SaveWorldRequest) -> tuple[bool, str, str]:
        scenes: list[Scene] = []
        success, message = self._outcome(lambda: scenes.append(self._simulation.scene()))
        if not success:
            return False, message, ""
        try:  # by this thread: the simulation need not wait for it
            return True, f"{message}: {len(scenes[0].models)} models", world_file(scenes[0])
        except Error as error:
            return False, str(error), ""

    def _save(self, request: StateFileRequest) -> tuple[bool, str]:
        return self._outcome(lambda: self._states.write(request.file, self._simulation.save()))

    def _load(self, request: StateFileRequest) -> tuple[bool, str]:
        return self._outcome(lambda: self._simulation.load(self._states.read(request.file)))

    def _outcome(self, action: Callable[[], Any]) -> tuple[bool, str]:
        """Return whether it was done, and when, and into which file, or why not."""
        try:
            result = self._requests.ask(action)
        except Error as error:
            return False, str(error)
        return True, f"{self._done()}: {result}" if isinstance(result, Path) else self._done()

    def _done(self) -> str:
        """Return what is said of a thing that was done."""
        return f"at {self._simulation.time:.3f} s"
