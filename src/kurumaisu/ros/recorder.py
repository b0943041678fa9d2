# SPDX-License-Identifier: BSD-3-Clause
"""rosbag record as long as something lasts."""

from __future__ import annotations

import shutil
import subprocess
import time
import xmlrpc.client
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import rosgraph
import rospy

from kurumaisu import children
from kurumaisu.critic.bags.parts import numbered
from kurumaisu.errors import Error
from kurumaisu.ros.graph import publishers

_GLANCE = 0.05  # [s] of wall time
_PATIENCE = 20.0  # [s] of wall time for a process to start or to end
_LEAST_FREE = 2**30  # bytes: rosbag record's own limit


class Recorder:
    """Records topics from when it is made until it is closed; packed, and where asked for split, as record.launch."""

    def __init__(self, path: Path, topics: Sequence[str], *, split: int = 0) -> None:
        """Return when all topics are heard. Raise Error when that does not come about.

        split [s]: after which a new bag begins, NAME_0.bag, NAME_1.bag, ...; 0: one bag, NAME.bag.
        """
        self._path = path
        self._first = path.with_name(f"{path.stem}_0{path.suffix}") if split else path
        if self._first.exists():
            raise Error(f"{self._first}: exists already")
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise Error(f"{path.parent}: {error.strerror}") from error
        self._check_space()
        node = f"record_{path.stem}_{time.monotonic_ns()}"
        parts = ["--split", "--repeat-latched", f"--duration={split}"] if split else []
        how = ["--lz4", "--buffsize=256", *parts]
        command = ["rosbag", "record", "-O", str(path), *how, *topics, f"__name:={node}"]
        # In a group of its own: Ctrl-C at the terminal must not end it before the chair has stopped.
        self._process = children.start(command, start_new_session=True, stdout=subprocess.DEVNULL)
        self._wait_until_heard([rospy.resolve_name(topic) for topic in topics], f"/{node}")

    def check(self) -> None:
        """Raise Error when nothing is being written any more."""
        if self._process.poll() is not None:
            raise Error(f"{self._path}: rosbag record ended by itself; what it wrote: rosbag reindex *.bag.active")
        self._check_space()

    def close(self) -> None:
        """End the bag. Raise Error when it was not written."""
        if self._process.poll() is not None:
            self.check()
        children.interrupt(self._process, _PATIENCE)
        # `rosbag` is a wrapper, which may end before the recorder itself has given the bag its name.
        deadline = time.monotonic() + _PATIENCE
        while self._named(".active") and time.monotonic() < deadline:
            time.sleep(_GLANCE)
        if not self._first.exists():
            raise Error(f"{self._path}: was not written")

    @property
    def bags(self) -> list[Path]:
        """Return what was written, in order."""
        return self._named("")

    def _named(self, ending: str) -> list[Path]:
        """Return the bag, or its parts in order, of those that are there, with an ending behind .bag."""
        if self._first == self._path:
            path = Path(f"{self._path}{ending}")
            return [path] if path.exists() else []
        return numbered(self._path, ending)

    def _check_space(self) -> None:
        """Raise Error where rosbag record would write nothing, of which it tells only its log."""
        free = shutil.disk_usage(self._path.parent).free
        if free < _LEAST_FREE:
            raise Error(
                f"{self._path.parent}: {free / 2**30:.2f} GiB are free: below 1 GiB rosbag record writes nothing"
            )

    def _wait_until_heard(self, topics: Sequence[str], node: str) -> None:
        deadline = time.monotonic() + _PATIENCE
        while self._process.poll() is None and time.monotonic() < deadline:
            if connected(node) >= {topic for topic in topics if publishers(topic)}:
                return
            time.sleep(_GLANCE)
        self._process.kill()
        self._process.wait()
        raise Error(f"{self._path}: rosbag record does not start")


def connected(node: str) -> set[str]:
    """Return the topics from which a node receives; the master knows only what it asked for."""
    try:
        uri = rosgraph.Master(rospy.get_name()).lookupNode(node)
        answer: Any = xmlrpc.client.ServerProxy(uri).getBusInfo(rospy.get_name())
    except (OSError, rosgraph.MasterException, xmlrpc.client.Error):
        return set()  # not yet
    return {str(link[4]) for link in answer[2] if link[2] == "i" and link[5]}
