# SPDX-License-Identifier: BSD-3-Clause
"""A bag begun and ended from a page: record.launch in a process of its own."""

from __future__ import annotations

import subprocess
import threading
import time
from collections.abc import Callable
from pathlib import Path

import rospy

from kurumaisu import children
from kurumaisu.errors import Error
from kurumaisu.ros.recorder import connected
from kurumaisu.viewer.source import Outcome

_GLANCE = 0.05  # [s]
_PATIENCE = 20.0  # [s] for the recorder to begin, and to end


class BagRecorder:
    """Records one bag at a time."""

    def __init__(self, folder: Path) -> None:
        """folder: of the bags, made when the first one is."""
        self._folder = folder.expanduser()
        self._lock = threading.Lock()
        self._process: subprocess.Popen[bytes] | None = None
        self._bag = Path()
        self._receives = False

    @property
    def recording(self) -> str | None:
        """Name of the bag that is being written, once it receives."""
        return self._bag.name if self._runs and self._receives else None

    @property
    def starting(self) -> bool:
        """Whether a bag was begun that receives nothing yet."""
        return self._runs and not self._receives

    @property
    def _runs(self) -> bool:
        process = self._process
        return process is not None and process.poll() is None

    def record(self, on: bool) -> Outcome:
        """Begin or end a bag. Raise Error where that fails."""
        with self._lock:
            return self._begin() if on else self._end()

    def close(self) -> None:
        """End what is being written."""
        with self._lock:
            if self._process is not None:
                self._end()

    def _begin(self) -> Outcome:
        if self._runs:
            raise Error(f"record: {self._bag} is being written already")
        try:
            self._folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise Error(f"{self._folder}: {error.strerror}") from error
        self._bag = self._folder.resolve() / time.strftime("%Y-%m-%d-%H-%M-%S.bag")
        self._receives = False
        # In a session of its own: Ctrl-C at the terminal reaches it by our close only, which waits for the bag.
        self._process = children.start(
            ["roslaunch", "kurumaisu", "record.launch", f"bag:={self._bag}"],
            start_new_session=True,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        active, node = Path(f"{self._bag}.active"), rospy.resolve_name("record")
        self._wait(lambda: not self._runs or (active.exists() and bool(connected(node))))
        if not self._runs or not active.exists() or not connected(node):
            self._stop()
            raise Error(f"{self._bag}: rosbag record does not start, or nothing that it records is published")
        self._receives = True
        return Outcome(f"recording {self._bag}")

    def _end(self) -> Outcome:
        if self._process is None:
            raise Error("record: nothing is being recorded")
        self._stop()
        if not self._bag.exists():
            raise Error(f"{self._bag}: was not written")
        return Outcome(f"{self._bag}: {self._bag.stat().st_size / 1e6:.1f} MB")

    def _stop(self) -> None:
        process, self._process = self._process, None
        if process is not None:
            children.interrupt(process, _PATIENCE)

    def _wait(self, condition: Callable[[], bool]) -> None:
        deadline = time.monotonic() + _PATIENCE
        while not condition() and time.monotonic() < deadline:
            time.sleep(_GLANCE)
