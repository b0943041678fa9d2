# SPDX-License-Identifier: BSD-3-Clause
"""Warnings about what a file says and what will surprise."""

from __future__ import annotations

from dataclasses import dataclass, field

from kurumaisu.world.tokens import Token

_MOST = 200  # more are not read
_LONGEST = 300  # characters of one: a file's words have no limit


@dataclass
class Notes:
    """Warnings, each with its place, and each kind of them once."""

    texts: list[str] = field(default_factory=list)
    routine: set[str] = field(default_factory=set)  # those of the texts that most files give rise to
    _seen: set[str] = field(default_factory=set)

    def add(self, token: Token, text: str, kind: str | None = None, routine: bool = False) -> None:
        """Add a warning, unless there was one of this kind (by default: with the same text) before."""
        text = text if len(text) <= _LONGEST else f"{text[:_LONGEST]}..."
        if (kind or text) in self._seen or len(self.texts) > _MOST:
            return
        self._seen.add(kind or text)
        self.texts.append(f"{token.place}: {text}" if len(self.texts) < _MOST else "there are more warnings")
        if routine:
            self.routine.add(self.texts[-1])
