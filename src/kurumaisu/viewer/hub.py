# SPDX-License-Identifier: BSD-3-Clause
"""The newest of everything, for whoever looks: a slot for each kind of message, and of it one more for each client.

A slow client loses what it has not fetched in time, and nobody waits for it; memory is bounded by what there are slots.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping
from typing import Any

from kurumaisu.viewer import protocol

Payload = str | bytes
Slot = tuple[str, int | protocol.Ranger]  # kind of message, and which of them: whose scan, or 0

_KEPT_MAPS = 2  # a page may still be fetching the last but one
_FRAME: Slot = ("state", 0)  # which every frame has one of
_OF_THE_WORLD = ("scan", "particles")  # slots that make no sense with other bodies


class Mailbox:
    """What one client has yet to be sent; filled by any thread, emptied by the server's."""

    def __init__(self, notify: Callable[[], None], start: Mapping[Slot, Payload]) -> None:
        self._notify = notify
        self._lock = threading.Lock()
        self._waiting: dict[Slot, Payload] = dict(start)
        self.dropped = 0  # messages that a newer one replaced before they were sent
        self.missed = 0  # frames among them
        self.shown = 0  # frames that were taken

    def offer(self, news: Mapping[Slot, Payload], forget: tuple[str, ...]) -> None:
        """Put newer messages in the place of older ones; forget: kinds that no longer hold."""
        with self._lock:
            for slot in [slot for slot in self._waiting if slot[0] in forget]:
                del self._waiting[slot]
            self.dropped += len(self._waiting.keys() & news.keys())
            self.missed += _FRAME in self._waiting and _FRAME in news
            self._waiting.update(news)
        self._notify()

    def take(self) -> list[Payload]:
        """Return what is waiting, oldest slots first; they are empty then."""
        with self._lock:
            waiting, self._waiting = self._waiting, {}
        self.shown += _FRAME in waiting
        return list(waiting.values())


class Hub:
    """Takes what a source has to show, from any thread, without ever waiting."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._newest: dict[Slot, Payload] = {}
        self._clients: list[Mailbox] = []
        self._map_number = 0
        self.maps: dict[int, bytes] = {}  # PNG files by number
        self.dropped = 0  # messages that clients who have gone lost
        self.report: str | None = None  # address of the critic's report, if there is one
        self.new_token: str | None = None  # command that prints an address with a token, if there is one

    def world(self, world: protocol.World) -> None:
        """Show other bodies; their scans are to come."""
        self._put({("world", 0): protocol.text(world)}, forget=_OF_THE_WORLD)

    def state(self, state: protocol.State, scans: Mapping[protocol.Ranger, protocol.Fan] | None = None) -> None:
        """Show a moment, with the scans that are new, by whose they are."""
        news: dict[Slot, Payload] = {("state", 0): protocol.text(state)}
        for ranger, fan in (scans or {}).items():
            news["scan", ranger] = protocol.scan(fan, ranger)
        self._put(news)

    def effects(self, groups: tuple[protocol.Group, ...]) -> None:
        """Show which effects act."""
        self._put({("effects", 0): protocol.text(protocol.Effects(groups))})

    def paths(self, paths: protocol.Paths) -> None:
        """Show the ways of a recorded run."""
        self._put({("paths", 0): protocol.text(paths)})

    def particles(self, poses: Any) -> None:
        """Show particles (n, 3)."""
        self._put({("particles", 0): protocol.particles(poses)})

    def map(self, png: bytes, width: int, height: int, resolution: float, origin: protocol.Pose) -> None:
        """Show a map's picture; its first row is the map's upper edge."""
        with self._lock:
            self._map_number += 1
            number = self._map_number
            self.maps[number] = png
            for old in [n for n in self.maps if n <= number - _KEPT_MAPS]:
                del self.maps[old]
        picture = protocol.MapPicture(number, f"/map/{number}.png", width, height, resolution, origin)
        self._put({("map", 0): protocol.text(picture)})

    def join(self, notify: Callable[[], None]) -> Mailbox:
        """Return the mailbox of a new client, with all that there is to show; notify: called by any thread."""
        with self._lock:
            mailbox = Mailbox(notify, self._newest)
            self._clients.append(mailbox)
        return mailbox

    def leave(self, mailbox: Mailbox) -> None:
        """Forget a client."""
        with self._lock:
            self._clients.remove(mailbox)
            self.dropped += mailbox.dropped

    @property
    def clients(self) -> int:
        """How many there are."""
        return len(self._clients)

    def _put(self, news: Mapping[Slot, Payload], forget: tuple[str, ...] = ()) -> None:
        with self._lock:
            for slot in [slot for slot in self._newest if slot[0] in forget]:
                del self._newest[slot]
            self._newest.update(news)
            for client in self._clients:
                client.offer(news, forget)
