# SPDX-License-Identifier: BSD-3-Clause
"""Questions to the ROS master that are given up after a moment: it may hang, and takes whoever asks with it."""

from __future__ import annotations

import http.client
import xmlrpc.client
from typing import Any
from xml.parsers.expat import ExpatError

import rosgraph

from kurumaisu.errors import Error

_ANSWER = 2.0  # [s] that a master may take to answer


class MasterMissingError(Error):
    """Nobody answers as a master does."""


class MasterSlowError(Error):
    """Somebody is there, who does not answer in time."""


class _Impatient(xmlrpc.client.Transport):
    def make_connection(self, host: Any) -> http.client.HTTPConnection:
        connection = super().make_connection(host)
        connection.timeout = _ANSWER
        return connection


def ask(what: str, *arguments: Any) -> Any:
    """Return the answer to a call of the master's API.

    Raise MasterMissingError or MasterSlowError; Error for an address that is none.
    """
    uri = rosgraph.get_master_uri()
    try:
        _, _, answer = getattr(xmlrpc.client.ServerProxy(uri, _Impatient()), what)("/kurumaisu", *arguments)
    except TimeoutError as error:
        raise MasterSlowError(f"the master at {uri} is slow to answer: waiting for it") from error
    except http.client.InvalidURL as error:
        raise Error(f"ROS_MASTER_URI: must be http://HOST:PORT, not {uri}") from error
    except (OSError, xmlrpc.client.Error, http.client.HTTPException, ExpatError, ValueError, TypeError) as error:
        raise MasterMissingError(f"no master at {uri}: start roscore, or use roslaunch") from error
    return answer
