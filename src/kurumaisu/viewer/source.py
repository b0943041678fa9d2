# SPDX-License-Identifier: BSD-3-Clause
"""What a server needs of whatever it shows."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Protocol


@dataclass(frozen=True)
class Outcome:
    """What became of a command: words for a person, and what it made: a text to be downloaded, the id of a body."""

    message: str
    result: str | None = None


class Source(Protocol):
    """A simulation, a robot or a recording; it puts what there is to see into a Hub.

    mode: sim, robot or bag; abilities: names of the commands that it obeys; limits: v [m/s] and w [rad/s] of a full
    stick, None where nothing can be driven.
    """

    title: str
    mode: str
    abilities: frozenset[str]
    limits: Mapping[str, float] | None

    def watch(self, watched: bool) -> None:
        """Hear that the first client has come, or the last one gone; work that nobody sees need not be done."""

    def command(self, name: str, arguments: Mapping[str, Any]) -> Outcome:
        """Do what a client asks for; arguments are checked as commands.py has them. May take a while, in any thread.

        Raise Error where it cannot be done; the client is told why.
        """
