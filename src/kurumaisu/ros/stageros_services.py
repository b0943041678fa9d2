# SPDX-License-Identifier: BSD-3-Clause
"""The services of stageros: stage_ros' reset_positions, and what its users asked for."""

from __future__ import annotations

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

from kurumaisu.ros.requests import Requests
from kurumaisu.ros.stageros_session import Session


class Services:
    """Advertises the services."""

    def __init__(self, session: Session, requests: Requests) -> None:
        self._session = session
        self._requests = requests
        self._services = [
            rospy.Service("reset_positions", Empty, self._reset_positions),
            rospy.Service("~reset", Empty, self._reset),
            rospy.Service("~pause", SetBool, self._pause),
            rospy.Service("~step", Trigger, self._step),
        ]

    def _reset_positions(self, _request: EmptyRequest) -> EmptyResponse:
        self._ask(self._session.reset_positions)
        return EmptyResponse()

    def _reset(self, _request: EmptyRequest) -> EmptyResponse:
        self._ask(self._session.reset)
        return EmptyResponse()

    def _pause(self, request: SetBoolRequest) -> SetBoolResponse:
        def pause() -> str:
            self._session.paused = request.data
            return f"{'paused' if request.data else 'running'} at {self._session.time:.3f} s"

        return SetBoolResponse(True, self._ask(pause))

    def _step(self, _request: TriggerRequest) -> TriggerResponse:
        def step() -> tuple[bool, str]:
            if not self._session.paused:
                return False, "is not paused: step goes one interval further from a pause"
            self._session.step()
            return True, f"at {self._session.time:.3f} s"

        return TriggerResponse(*self._ask(step))

    def _ask(self, action: Any) -> Any:
        return self._requests.ask(action)
