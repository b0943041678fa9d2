# SPDX-License-Identifier: BSD-3-Clause
"""A simulator that clocks what its own thread does for the viewer: a figure that a busy machine changes little."""

from __future__ import annotations

import functools
import json
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from kurumaisu.ros.sim import node as sim_node
from kurumaisu.ros.stageros import node as stageros
from kurumaisu.ros.view.fans import ChairFan, FleetFans
from kurumaisu.ros.view.topics import ViewTopics
from kurumaisu.ros.view.wire import ViewWire
from kurumaisu.whole_files import write_whole

_NODES = {"stageros": stageros.main, "sim_node": sim_node.main}


class _Clock:
    """CPU time [s] of the thread that simulates, from the first view to the last, and what of it went into views.

    The clock itself costs about as much as what is done in a step without a view.
    """

    def __init__(self) -> None:
        self.frames = 0
        self.calls = 0
        self.in_frames = self.in_calls = 0.0  # [s] in calls that made a view, and in those that did not
        self._sums = (0, 0.0, 0, 0.0, 0.0)
        self._first: tuple[float, ...] | None = None
        self._made = self._inside = False

    @property
    def sums(self) -> list[float]:
        """Views, time in them, other calls, time in them, time in all, between the first view and the last."""
        return [] if self._first is None else [b - a for a, b in zip(self._first, self._sums, strict=True)]

    def clocked(self, function: Callable[..., Any]) -> Callable[..., Any]:
        """Return the same, but clocked; one that another one calls is clocked with that."""

        @functools.wraps(function)
        def call(*arguments: Any) -> Any:
            if self._inside:
                return function(*arguments)
            self._inside, start = True, time.thread_time()
            try:
                return function(*arguments)
            finally:
                self._inside = False
                self._note(start, time.thread_time())

        return call

    def _note(self, start: float, end: float) -> None:
        if not self._made:
            self.calls += 1
            self.in_calls += end - start
            return
        self._made = False
        self.frames += 1
        self.in_frames += end - start
        self._sums = self.frames, self.in_frames, self.calls, self.in_calls, end
        self._first = self._first or self._sums

    def count(self, function: Callable[..., Any]) -> Callable[..., Any]:
        """Return the same, but counted as a view."""

        @functools.wraps(function)
        def call(*arguments: Any) -> Any:
            self._made = True
            return function(*arguments)

        return call


def main() -> None:
    """Run the node that the first argument names, with the arguments after the second; that is where the figures go."""
    node, file = sys.argv[1:3]
    sys.argv[1:3] = []
    clock = _Clock()
    ViewTopics.due = property(clock.clocked(ViewTopics.due.fget))  # type: ignore[method-assign,assignment,attr-defined]
    for kind, name in ((ViewTopics, "show"), (ChairFan, "note"), (FleetFans, "note")):
        setattr(kind, name, clock.clocked(getattr(kind, name)))
    ViewWire.head = clock.count(ViewWire.head)  # type: ignore[method-assign]
    try:
        _NODES[node]()
    finally:
        write_whole({Path(file): json.dumps(clock.sums)})


if __name__ == "__main__":
    main()
