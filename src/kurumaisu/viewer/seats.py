# SPDX-License-Identifier: BSD-3-Clause
"""How many pages there may be: who may command has seats of his own, however many look."""

from __future__ import annotations

from collections.abc import Callable

from kurumaisu.errors import Error


class Seats:
    """So many for those who look, as many for those who command, and as many places to wait.

    Whoever finds all seats taken may still show that he may command; so he waits a moment, in a place that the next one
    can take from him.
    """

    def __init__(self, most: int) -> None:
        self._most = most
        self._looking: set[object] = set()
        self._commanding: set[object] = set()
        self._waiting: dict[object, Callable[[], None]] = {}  # in the order in which they came

    def look(self, who: object) -> bool:
        """Give a seat to somebody who looks, if one is free."""
        if len(self._looking) >= self._most:
            return False
        self._looking.add(who)
        return True

    def wait(self, who: object, leave: Callable[[], None]) -> None:
        """Give a place to wait; leave: sends away who has waited longest, for the next one."""
        if len(self._waiting) >= self._most:
            oldest = next(iter(self._waiting))
            self._waiting.pop(oldest)()
        self._waiting[who] = leave

    def command(self, who: object) -> None:
        """Give a seat to somebody who may command; his other one is free then. Raise Error if none is left."""
        if who not in self._commanding and len(self._commanding) >= self._most:
            raise Error(f"{self._most} pages that may command are open already; close one")
        self.leave(who)
        self._commanding.add(who)

    def leave(self, who: object) -> None:
        """Take the seat or place of somebody who has gone."""
        self._looking.discard(who)
        self._commanding.discard(who)
        self._waiting.pop(who, None)
