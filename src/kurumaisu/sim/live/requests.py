# SPDX-License-Identifier: BSD-3-Clause
"""Things that other threads want done between two steps of a loop."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable
from typing import Any


class Requests:
    """A queue of calls; who asks waits for the answer, the loop serves when it can."""

    def __init__(self) -> None:
        self._waiting: deque[_Request] = deque()
        self._arrived = threading.Event()
        self._closed = False

    def __bool__(self) -> bool:
        return bool(self._waiting)

    def ask(self, action: Callable[[], Any]) -> Any:
        """Return what the action returns when the loop has run it; what it raises is raised here.

        Raise RuntimeError if the loop has ended.
        """
        request = _Request(action)
        self._waiting.append(request)
        self._arrived.set()
        if self._closed:
            self.close()
        request.done.wait()
        if request.problem is not None:
            raise request.problem
        return request.result

    def wait(self, timeout: float) -> None:
        """Wait until something is asked for, at most so long [s]."""
        self._arrived.wait(timeout)

    def serve(self) -> None:
        """Run what has been asked for."""
        self._arrived.clear()
        while self._waiting:
            request = self._waiting.popleft()
            try:
                request.result = request.action()
            except Exception as problem:  # belongs to who asked, not to the loop
                request.problem = problem
            request.done.set()

    def close(self) -> None:
        """Refuse what is waiting and all that comes."""
        self._closed = True
        while self._waiting:
            request = self._waiting.popleft()
            request.problem = RuntimeError("the simulation has ended")
            request.done.set()


class _Request:
    """A call and its answer."""

    def __init__(self, action: Callable[[], Any]) -> None:
        self.action = action
        self.done = threading.Event()
        self.result: Any = None
        self.problem: Exception | None = None
