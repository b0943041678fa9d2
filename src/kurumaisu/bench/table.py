# SPDX-License-Identifier: BSD-3-Clause
"""Tables on a terminal, printed row by row as the results come, and kept for a page of docs/."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar

from scipy.stats import beta

_NUMBER = re.compile(r"[-+<>=~]*\s*(\d|\.\d|inf|nan)|-?$")  # what a cell of a column of numbers begins with


class Table:
    """A table whose first column is text, the others numbers or short text, all as wide as their headings."""

    def __init__(self, title: str, *columns: str, page: bool = True) -> None:
        """Print the title and the columns' headings; a heading carries its unit: 'error [mm]'.

        page: whether a page has it; False for details, which a page has only if there is nothing else.
        """
        self.title, self.columns, self.page = title, columns, page
        self.rows: list[list[str]] = []
        self.notes: list[str] = []
        self._widths = [max(len(columns[0]), 28), *(max(len(column), 8) for column in columns[1:])]
        kept = _kept.get()
        if kept is not None:
            kept.append(self)
        self._begin()

    def row(self, *cells: str | float) -> None:
        """Print a row; numbers with four digits."""
        assert len(cells) == len(self._widths)
        self.rows.append([cell if isinstance(cell, str) else f"{cell:.4g}" for cell in cells])
        self._print(self.rows[-1])

    def note(self, text: str) -> None:
        """Print a line that belongs to the table: what is beside it, a limit, a sum."""
        self.notes.append(text)
        print(text, flush=True)

    def markdown(self) -> str:
        """Return title, table and notes for a page; columns of numbers are on the right."""
        cells = [[column.strip() for column in self.columns], *([cell.strip() for cell in row] for row in self.rows)]
        numbers = [all(_NUMBER.match(cell) for cell in column) for column in zip(*cells[1:], strict=True)]
        right = [bool(self.rows) and number and i > 0 for i, number in enumerate(numbers or [False] * len(cells[0]))]
        lines = [_line(cells[0]), _line(["---:" if each else "---" for each in right]), *map(_line, cells[1:])]
        parts = ([f"{self.title}:"] if self.title else []), lines, self.notes
        return "\n\n".join("\n".join(part) for part in parts if part)

    def _begin(self) -> None:
        print(f"\n{self.title}")
        self._print(self.columns)
        print("-" * (sum(self._widths) + 2 * (len(self.columns) - 1)))

    def _print(self, cells: Sequence[str]) -> None:
        first, *others = zip(cells, self._widths, strict=True)
        text = [f"{first[0]:<{first[1]}}", *(f"{cell:>{width}}" for cell, width in others)]
        print("  ".join(text).rstrip(), flush=True)


class MarkdownTable(Table):
    """A table of long texts, printed as it stands in a page."""

    def _begin(self) -> None:
        if self.title:
            print(f"\n{self.title}\n")
        self._print(self.columns)
        self._print(["---"] * len(self.columns))

    def _print(self, cells: Sequence[str]) -> None:
        print(_line(cells), flush=True)


_kept: ContextVar[list[Table] | None] = ContextVar("_kept", default=None)


@contextmanager
def collected() -> Iterator[list[Table]]:
    """Collect the tables that are made within it."""
    tables: list[Table] = []
    before = _kept.set(tables)
    try:
        yield tables
    finally:
        _kept.reset(before)


def share(k: int, n: int, digits: int = 2) -> str:
    """Return a share with its exact (Clopper-Pearson) 90 % interval, or a dash of none."""
    if n == 0:
        return "-"
    low = beta.ppf(0.05, k, n - k + 1) if k else 0.0
    high = beta.ppf(0.95, k + 1, n - k) if k < n else 1.0
    return f"{k / n:.{digits}f} ({low:.2f}-{high:.2f})"


def _line(cells: Sequence[str]) -> str:
    return "| " + " | ".join(cell.replace("|", "/") for cell in cells) + " |"
