# SPDX-License-Identifier: BSD-3-Clause
"""rosbag record as long as something lasts."""

from __future__ import annotations

import signal
import subprocess
import time
import xmlrpc.client
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import rosgraph
import rospy

from kurumaisu.errors import Error
from kurumaisu.ros.experiment_ground import publishers

_GLANCE = 0.05  # [s] of wall time
_PATIENCE = 20.0  # [s] of wall time for a process to start or to end


class Recorder:
    """Records topics from when it is made until it is closed."""

    def __init__(self, path: Path, topics: Sequence[str]) -> None:
        """Return when all topics are heard. Raise Error when that does not come about."""
        if path.exists():
            raise Error(f"{path}: is there already")
        path.parent.mkdir(parents=True, exist_ok=True)
        self._path = path
        node = f"record_{path.stem}_{time.monotonic_ns()}"
        command = ["rosbag", "record", "-O", str(path), *topics, f"__name:={node}"]
        # In a group of its own: Ctrl-C at the terminal must not end it before the chair has stopped.
        self._process = subprocess.Popen(command, start_new_session=True, stdout=subprocess.DEVNULL)
        self._wait_until_heard([rospy.resolve_name(topic) for topic in topics], f"/{node}")

    def close(self) -> None:
        """End the bag. Raise Error when it was not written."""
        if self._process.poll() is None:
            self._process.send_signal(signal.SIGINT)
        try:
            self._process.wait(_PATIENCE)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        # `rosbag` is a wrapper, which may end before the recorder itself has given the bag its name.
        deadline = time.monotonic() + _PATIENCE
        while Path(f"{self._path}.active").exists() and time.monotonic() < deadline:
            time.sleep(_GLANCE)
        if not self._path.exists():
            raise Error(f"{self._path}: was not written")

    def _wait_until_heard(self, topics: Sequence[str], node: str) -> None:
        deadline = time.monotonic() + _PATIENCE
        while self._process.poll() is None and time.monotonic() < deadline:
            if _connected(node) >= {topic for topic in topics if publishers(topic)}:
                return
            time.sleep(_GLANCE)
        self._process.kill()
        self._process.wait()
        raise Error(f"{self._path}: rosbag record does not start")


def _connected(node: str) -> set[str]:
    """Return the topics from which a node receives; the master knows only what it asked for."""
    try:
        uri = rosgraph.Master(rospy.get_name()).lookupNode(node)
        answer: Any = xmlrpc.client.ServerProxy(uri).getBusInfo(rospy.get_name())
    except (OSError, rosgraph.MasterException, xmlrpc.client.Error):
        return set()  # not yet
    return {str(link[4]) for link in answer[2] if link[2] == "i" and link[5]}
