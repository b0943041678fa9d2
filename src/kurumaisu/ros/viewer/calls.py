# SPDX-License-Identifier: BSD-3-Clause
"""Calls of services on behalf of a page: each ends, and says why it failed."""

from __future__ import annotations

from typing import Any

import rospy

from kurumaisu.errors import Error

_PATIENCE = 2.0  # [s] for a service to be there


def call(name: str, kind: type, *arguments: Any) -> Any:
    """Return a service's answer. Raise Error where there is none."""
    try:
        rospy.wait_for_service(name, _PATIENCE)
        return rospy.ServiceProxy(name, kind)(*arguments)
    except (rospy.ROSException, rospy.ServiceException) as error:
        raise Error(f"{name}: does not answer: {error}") from error


def done(name: str, kind: type, *arguments: Any) -> str:
    """Return the words of a service that answers with success and message. Raise Error with them if it refuses."""
    answer = call(name, kind, *arguments)
    if not answer.success:
        raise Error(answer.message)
    return str(answer.message)
