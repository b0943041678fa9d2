# SPDX-License-Identifier: BSD-3-Clause
"""Numbers as people read them: sensible digits, and a unit that suits."""

from __future__ import annotations

import math
from collections.abc import Sequence

MINUS = "\N{MINUS SIGN}"
NBSP = "\N{NO-BREAK SPACE}"
# Units that are read in thousandths when a row's largest number is below a tenth.
MILLI = {"m": "mm", "s": "ms", "rad": "mrad", "V": "mV", "m/s": "mm/s", "rad/s": "mrad/s"}
_PURE = ("", "1")
_SMALL = 0.1


def scaled(largest: float, unit: str) -> tuple[float, str]:
    """Return the factor and the unit in which numbers up to a largest one are read best."""
    if unit in MILLI and 0 < largest < _SMALL:
        return 1000.0, MILLI[unit]
    return 1.0, "" if unit in _PURE else unit.replace("^2", "²")


def quantities(values: Sequence[float], unit: str) -> list[str]:
    """Return numbers of one row to three digits, with one unit that suits the largest; nan becomes a dash."""
    largest = max((abs(value) for value in values if math.isfinite(value)), default=0.0)
    factor, shown = scaled(largest, unit)
    # One digit more than three of the largest would claim precision, one fewer would hide a difference.
    decimals = 2 - math.floor(math.log10(largest * factor)) if largest > 0 else 0
    suffix = f"{NBSP}{shown}" if shown else ""
    return [_number(value * factor, max(0, decimals)) + suffix for value in values]


def bare(quantity: str) -> str:
    """Return a quantity without its unit."""
    return quantity.split(NBSP)[0]


def with_interval(estimate: float, low: float, high: float, unit: str) -> str:
    """Return an estimate and its 90 % interval, in one unit."""
    cells = quantities([estimate, low, high], unit)
    return f"{cells[0]} (90 %: {bare(cells[1])} to {cells[2]})"


def moment(t: float) -> str:
    """Return a time by a run's clock to the millisecond, so that its row can be found: of a Unix time, too."""
    return f"{f'{t:.3f}'.rstrip('0').rstrip('.')} s"


def times(count: int) -> str:
    """Return how often something was, in words."""
    return "once" if count == 1 else f"{count} times"


def odds(nats: float) -> str:
    """Return how many times as probable a log evidence makes something, to one digit or as a power of ten."""
    if nats < math.log(1e4):
        factor = math.exp(max(nats, 0.0))
        return f"{factor:.1f}" if factor < 3 else f"{float(f'{factor:.1g}'):,.0f}".replace(",", " ")
    return "more than 10 000"


def _number(value: float, decimals: int) -> str:
    if not math.isfinite(value):
        return "–"
    text = f"{value:.{decimals}f}" if decimals <= 6 else f"{value:.3g}"
    if not any(digit in text for digit in "123456789"):
        text = text.lstrip("-")  # -0.00 is 0.00
    return text.replace("-", MINUS)
