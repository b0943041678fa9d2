# SPDX-License-Identifier: BSD-3-Clause
"""Tables on a terminal, printed row by row as the results come."""

from __future__ import annotations

from scipy.stats import beta


class Table:
    """A table whose first column is text, the others numbers or short text, all as wide as their headings."""

    def __init__(self, title: str, *columns: str) -> None:
        """Print the title and the columns' headings; a heading carries its unit: 'error [mm]'."""
        self._widths = [max(len(columns[0]), 28), *(max(len(column), 8) for column in columns[1:])]
        print(f"\n{title}")
        self._print(columns)
        print("-" * (sum(self._widths) + 2 * (len(columns) - 1)))

    def row(self, *cells: str | float) -> None:
        """Print a row; numbers with four digits."""
        assert len(cells) == len(self._widths)
        self._print([cell if isinstance(cell, str) else f"{cell:.4g}" for cell in cells])

    def _print(self, cells: tuple[str, ...] | list[str]) -> None:
        first, *others = zip(cells, self._widths, strict=True)
        text = [f"{first[0]:<{first[1]}}", *(f"{cell:>{width}}" for cell, width in others)]
        print("  ".join(text).rstrip(), flush=True)


def share(k: int, n: int, digits: int = 2) -> str:
    """Return a share with its exact (Clopper-Pearson) 90 % interval, or a dash of none."""
    if n == 0:
        return "-"
    low = beta.ppf(0.05, k, n - k + 1) if k else 0.0
    high = beta.ppf(0.95, k + 1, n - k) if k < n else 1.0
    return f"{k / n:.{digits}f} ({low:.2f}-{high:.2f})"
