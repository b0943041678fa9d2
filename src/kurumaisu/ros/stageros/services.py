# SPDX-License-Identifier: BSD-3-Clause
"""The services of stageros: stage_ros' reset_positions, and what its users asked for."""

from __future__ import annotations

import rospy
from std_srvs.srv import Empty, EmptyRequest, EmptyResponse

from kurumaisu.ros.services import Services
from kurumaisu.ros.stageros.session import Session
from kurumaisu.sim.live.pacing import Pacer
from kurumaisu.sim.live.requests import Requests
from kurumaisu.sim.robots.state_folder import StateFolder


class StagerosServices(Services):
    """Advertises the services; what they do is done between two steps."""

    def __init__(self, session: Session, requests: Requests, pacer: Pacer, states: StateFolder) -> None:
        super().__init__(session, requests, pacer, states, "~")
        self._session = session
        self._services += [
            rospy.Service("reset_positions", Empty, self._reset_positions),
        ]

    def _reset_positions(self, _request: EmptyRequest) -> EmptyResponse:
        self._requests.ask(self._session.reset_positions)
        return EmptyResponse()

    def _done(self) -> str:
        return f"{super()._done()}, {self._session.heard} commands heard"
