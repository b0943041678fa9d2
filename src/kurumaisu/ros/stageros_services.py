# SPDX-License-Identifier: BSD-3-Clause
"""The services of stageros: stage_ros' reset_positions, and what its users asked for."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

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
from kurumaisu.ros.requests import Requests
from kurumaisu.ros.rotation import pose_of
from kurumaisu.ros.stageros_session import Session
from kurumaisu.srv import (
    Delete,
    DeleteRequest,
    Seed,
    SeedRequest,
    SetPose,
    SetPoseRequest,
    Spawn,
    SpawnRequest,
    StateFile,
    StateFileRequest,
)


class Services:
    """Advertises the services; what they do is done between two steps."""

    def __init__(self, session: Session, requests: Requests) -> None:
        self._session = session
        self._requests = requests
        self._services = [
            rospy.Service("reset_positions", Empty, self._reset_positions),
            rospy.Service("~reset", Empty, self._reset),
            rospy.Service("~pause", SetBool, self._pause),
            rospy.Service("~step", Trigger, self._step),
            rospy.Service("~seed", Seed, self._seed),
            rospy.Service("~set_pose", SetPose, self._set_pose),
            rospy.Service("~spawn", Spawn, self._spawn),
            rospy.Service("~delete", Delete, self._delete),
            rospy.Service("~save", StateFile, self._save),
            rospy.Service("~load", StateFile, self._load),
        ]

    def _reset_positions(self, _request: EmptyRequest) -> EmptyResponse:
        self._requests.ask(self._session.reset_positions)
        return EmptyResponse()

    def _reset(self, _request: EmptyRequest) -> EmptyResponse:
        self._requests.ask(self._session.reset)
        return EmptyResponse()

    def _pause(self, request: SetBoolRequest) -> SetBoolResponse:
        def pause() -> None:
            self._session.paused = request.data

        return SetBoolResponse(*self._outcome(pause))

    def _step(self, _request: TriggerRequest) -> TriggerResponse:
        def step() -> None:
            if not self._session.paused:
                raise Error("step: goes on from a pause, but nothing is paused")
            self._session.step()

        return TriggerResponse(*self._outcome(step))

    def _seed(self, request: SeedRequest) -> tuple[bool, str]:
        return self._outcome(lambda: self._session.reset(request.seed))

    def _set_pose(self, request: SetPoseRequest) -> tuple[bool, str]:
        return self._outcome(lambda: self._session.set_pose(request.name, pose_of(request.pose)))

    def _spawn(self, request: SpawnRequest) -> tuple[bool, str]:
        return self._outcome(lambda: self._session.spawn(request.like, request.name, pose_of(request.pose)))

    def _delete(self, request: DeleteRequest) -> tuple[bool, str]:
        return self._outcome(lambda: self._session.delete(request.name))

    def _save(self, request: StateFileRequest) -> tuple[bool, str]:
        return self._outcome(lambda: self._session.save(Path(request.file)))

    def _load(self, request: StateFileRequest) -> tuple[bool, str]:
        return self._outcome(lambda: self._session.load(Path(request.file)))

    def _outcome(self, action: Callable[[], Any]) -> tuple[bool, str]:
        """Return whether it was done, and when or why not."""
        try:
            self._requests.ask(action)
        except Error as error:
            return False, str(error)
        return True, f"at {self._session.time:.3f} s, {self._session.heard} commands heard"
