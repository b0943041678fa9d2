# SPDX-License-Identifier: BSD-3-Clause
"""How far the critic is: on a terminal a line for each recording that runs, elsewhere plain lines; or nothing."""

from __future__ import annotations

import shutil
import time
import unicodedata
from collections.abc import Sequence
from typing import TextIO

from kurumaisu.critic.app.job import Outcome
from kurumaisu.critic.values.digits import NBSP

_BAR = 24  # characters
_SHORTEST_BAR = 5  # characters; of less there is nothing to be seen
_REDRAW = 0.05  # [s] at least between two pictures
_AGAIN = 10.0  # [s] at least between two lines of a log that begin with the same word, such as fits of one search


def printable(text: str) -> str:
    """Return text without what would move a cursor: names of files may hold anything."""
    return "".join(c if c.isprintable() else "?" for c in text.replace(NBSP, " "))


def cells(text: str) -> int:
    """Return how many cells of a terminal a printable text takes: some characters take two, accents none."""
    return sum(_cells(c) for c in text)


def cut(text: str, most: int) -> str:
    """Return a printable text in at most so many cells, with a sign where it was longer."""
    if cells(text) <= most:
        return text
    used, kept = 1, []
    for c in text:
        used += _cells(c)
        if used > most:
            break
        kept.append(c)
    return "".join(kept) + "…" * (most > 0)


def aligned(rows: Sequence[Sequence[str]], right: int = -1) -> list[str]:
    """Return a line for each row, whose cells begin below each other; those of column `right` end below each other."""
    shown = [[printable(cell) for cell in row] for row in rows]
    widths = [max(cells(cell) for cell in column) for column in zip(*shown, strict=True)]

    def padded(cell: str, column: int) -> str:
        gap = " " * (widths[column] - cells(cell))
        return gap + cell if column == right else cell + gap

    return ["  ".join(padded(cell, i) for i, cell in enumerate(row)).rstrip() for row in shown]


def _cells(c: str) -> int:
    return 0 if unicodedata.combining(c) else 2 if unicodedata.east_asian_width(c) in "WF" else 1


class Display:
    """Told of jobs that start, go on and end; says nothing of it."""

    def start(self, name: str) -> None:
        """Hear that a recording runs."""

    def tell(self, name: str, message: str) -> None:
        """Hear how far it is."""

    def end(self, outcome: Outcome) -> None:
        """Hear what came of it."""

    def draw(self) -> None:
        """Show what time it is."""

    def close(self) -> None:
        """Leave the terminal as it was."""


class Plain(Display):
    """Lines that stay, for a log: each kind of step of a single recording, each end of many."""

    def __init__(self, stream: TextIO, total: int) -> None:
        self._stream = stream
        self._total = total
        self._done = 0
        self._kind, self._said = "", 0.0

    def tell(self, name: str, message: str) -> None:
        """Say the step; of hundreds of one kind one in a while."""
        kind, now = message.partition(" ")[0], time.monotonic()
        if self._total == 1 and (kind != self._kind or now - self._said > _AGAIN):
            self._kind, self._said = kind, now
            print(f"critic: {printable(message)}", file=self._stream, flush=True)

    def end(self, outcome: Outcome) -> None:
        """Say which of how many is done."""
        self._done += 1
        if self._total > 1:
            said = f"{outcome.job.name}: {outcome.word} ({outcome.seconds:.0f} s)"
            print(f"critic: {self._done} of {self._total}: {printable(said)}", file=self._stream, flush=True)


class Terminal(Display):
    """Lines that are drawn again in place."""

    def __init__(self, stream: TextIO, total: int) -> None:
        self._stream = stream
        self._total = total
        self._done = 0
        self._began = time.monotonic()
        self._running: dict[str, tuple[float, str]] = {}
        self._lines = 0
        self._drawn = 0.0

    def start(self, name: str) -> None:
        """Add its line."""
        self._running[name] = time.monotonic(), ""

    def tell(self, name: str, message: str) -> None:
        """Change its line."""
        since = self._running[name][0] if name in self._running else time.monotonic()
        self._running[name] = since, message
        if time.monotonic() - self._drawn > _REDRAW:
            self.draw()

    def end(self, outcome: Outcome) -> None:
        """Take its line away."""
        self._running.pop(outcome.job.name, None)
        self._done += 1
        self.draw()

    def draw(self) -> None:
        """Draw all lines."""
        self._drawn = time.monotonic()
        size = shutil.get_terminal_size()
        width = size.columns - 1
        lines = [self._line(name, *state, width) for name, state in self._running.items()]
        if self._total > 1:
            lines = [*lines[: max(size.lines - 2, 0)], self._bar(width)]
        self._put([cut(line, width) for line in lines])

    def close(self) -> None:
        """Wipe all lines out."""
        self._put([])

    def _line(self, name: str, since: float, message: str, width: int) -> str:
        seconds, message = f"{time.monotonic() - since:4.0f} s", printable(message)
        if self._total == 1:
            return f"{seconds}  {message}"
        return f"{seconds}  {cut(printable(name), width // 2)}: {message or 'starting'}"

    def _bar(self, width: int) -> str:
        left = ""
        if self._done:
            seconds = (time.monotonic() - self._began) / self._done * (self._total - self._done)
            left = f", {seconds / 60:.0f} min left" if seconds >= 90 else f", {seconds:.0f} s left"
        said = f"{self._done} of {self._total}{left}"
        bar = min(_BAR, width - len(said) - 3)
        if bar < _SHORTEST_BAR:
            return said
        full = bar * self._done // self._total
        return f"[{'#' * full}{'.' * (bar - full)}] {said}"

    def _put(self, lines: list[str]) -> None:
        # To the start of the first line, then down over the old ones; the cursor rests below the last.
        up = f"\033[{self._lines}A" if self._lines else ""
        text = "".join(f"\033[K{line}\n" for line in lines)
        if up or text:
            self._stream.write(f"{up}\r{text}\033[J")
            self._stream.flush()
        self._lines = len(lines)


def display(stream: TextIO, total: int, *, quiet: bool) -> Display:
    """Return the display that suits a stream."""
    if quiet:
        return Display()
    return Terminal(stream, total) if stream.isatty() else Plain(stream, total)
