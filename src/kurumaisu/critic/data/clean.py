# SPDX-License-Identifier: BSD-3-Clause
"""Turn rows as they were recorded into a Series, and say in words whatever was wrong with them.

Mended: rows out of order are sorted, repeated rows and rows that are not numbers are dropped. It is always
noted; and where there is more of it than a delivery hiccup explains, the recording is unfit for a verdict.
"""

from __future__ import annotations

from bisect import bisect_right
from dataclasses import dataclass, field

import numpy as np

from kurumaisu.critic.values.digits import moment, times
from kurumaisu.critic.values.recording import Series
from kurumaisu.types import BoolArray, FloatArray, IntArray

# More than this share of rows out of order, contradictory or not numbers is no hiccup [1].
HICCUP_SHARE = 0.05
# Stamps that are further back than this, and fill no hole that a late row left, are of a clock that was set [s].
HICCUP_TIME = 0.5
# Rows that came late leave steps of at least this share of the usual one beside them.
HOLE = 0.75
# Rows further from all others than this, and than so many usual steps, have stamps of another time [s].
FURTHEST_STEP = 86_400.0
_USUAL_STEPS = 1e4
# No chair, and no room, has larger numbers than this; squares of larger ones are not numbers any more [m, rad, V, s].
LARGEST = 1e12
_LARGEST_COVARIATE = 1e30
_KNOWN = frozenset({"x", "y", "theta", "v", "w", "v_f", "v_s"})
# Between two samples, a turn above this may as well have been one the other way round [rad].
LARGEST_TURN = 2.5


@dataclass(frozen=True)
class Faults:
    """What was found wrong, in words: notes holds all, invalid those that forbid a verdict on causes."""

    notes: list[str] = field(default_factory=list)
    invalid: list[str] = field(default_factory=list)

    def add(self, message: str, *, fatal: bool = False) -> None:
        """Record one finding."""
        self.notes.append(message)
        if fatal:
            self.invalid.append(message)


@dataclass(frozen=True)
class Table:
    """Rows in the order of the file: t (n,) [s], values (n, m).

    where: file or topic; rows are called `row` and counted from `first`, as an editor would show them.
    """

    where: str
    t: FloatArray
    values: FloatArray
    columns: tuple[str, ...]
    row: str
    first: int

    def place(self, index: int) -> str:
        """Return where a row is, in words."""
        return f"{self.row} {index + self.first}, t = {moment(self.t[index])}"


def clean(table: Table, faults: Faults, *, ranges: bool = False) -> Series | None:
    """Return the rows in the order of time, or None when none is left.

    ranges: values are laser ranges, for which nan and inf have a meaning; any other value must be finite.
    """
    keep = np.isfinite(table.t) & (ranges | np.isfinite(table.values).all(axis=1))
    _report(table, np.flatnonzero(~keep), faults, "not a number: dropped", "has no number in most rows", 0.5)
    sane = _of_sane_size(table, ranges=ranges)
    _report(
        table, np.flatnonzero(keep & ~sane), faults, "too large to be true: dropped", "has numbers too large to be true"
    )
    kept = np.flatnonzero(keep & sane)
    kept = kept[~_stamp_outliers(table, kept, faults)]
    kept = kept[~_repeated(table, kept, faults)]
    kept = kept[~_of_wrong_order(table, kept, faults)]
    if not len(kept):
        faults.add(f"{table.where}: has no rows")
        return None
    series = Series(table.t, table.values, table.columns).rows(kept[np.argsort(table.t[kept], kind="stable")])
    if ranges:
        return _ranges(table.where, series, faults)
    return _unwrapped(table.where, series, faults) if "theta" in table.columns else series


def clean_part(part: str, table: Table, faults: Faults) -> Series | None:
    """Return the rows of a part of a run, cleaned as it needs; faults gets what was wrong."""
    return _spared(table, faults) if part == "imu" else clean(table, faults, ranges=part == "scan")


def _spared(table: Table, faults: Faults) -> Series | None:
    """Return the rows of a part that nobody need have, as clean does: where most are of no use, it is left out."""
    own = Faults()
    series = clean(table, own)
    for note in own.notes:
        faults.add(f"{note}: not used" if note in own.invalid else note)
    return None if own.invalid else series


def _of_sane_size(table: Table, *, ranges: bool) -> BoolArray:
    """Return which rows have no number that is beyond all that there is, (n,); inf and nan are none."""
    largest = _LARGEST_COVARIATE if _KNOWN.isdisjoint(table.columns) else LARGEST
    size = np.abs(table.values)
    sane: BoolArray = ~((size > largest) & np.isfinite(size)).any(axis=1) | ranges  # a range is left out by itself
    return sane


def _stamp_outliers(table: Table, kept: IntArray, faults: Faults) -> BoolArray:
    """Return which of the kept rows have stamps far from those of most, (k,): some clock was not set yet."""
    order = np.argsort(table.t[kept], kind="stable")
    steps = np.diff(table.t[kept][order])
    usual = np.sort(steps)[(len(steps) - 1) // 2] if len(steps) else 0.0
    group = np.append(0, np.cumsum(steps > max(FURTHEST_STEP, _USUAL_STEPS * usual)))[: len(order)]
    outliers = np.zeros(len(kept), dtype=bool)
    outliers[order] = group != np.bincount(group).argmax() if len(group) else False
    if outliers.any():
        faults.add(
            f"{table.where}: {_rows(int(outliers.sum()))} more than a day from the others: dropped "
            f"(first: {table.place(int(kept[np.argmax(outliers)]))}): stamps are wrong",
            fatal=True,
        )
    return outliers


def _report(table: Table, bad: IntArray, faults: Faults, noted: str, fatal: str, share: float = HICCUP_SHARE) -> None:
    """Say which rows are bad, (k,), and that nothing can be trusted where they are more than a share of all."""
    if len(bad):
        faults.add(f"{table.where}: {_rows(len(bad))} {noted} (first: {table.place(int(bad[0]))})")
    if len(bad) > share * len(table.t):
        faults.add(f"{table.where}: {fatal} ({len(bad)} of {len(table.t)})", fatal=True)


def _repeated(table: Table, kept: IntArray, faults: Faults) -> BoolArray:
    """Return which of the kept rows repeat the time of an earlier one, (k,)."""
    _, first, group = np.unique(table.t[kept], return_index=True, return_inverse=True)
    origin = kept[first[group]]
    a, b = table.values[kept], table.values[origin]
    equal = ((a == b) | (np.isnan(a) & np.isnan(b))).all(axis=1)
    repeated = np.asarray(kept != origin)
    _report(table, kept[repeated & equal], faults, "repeated: the first is kept", "repeats its rows: drop the copies")
    conflict = kept[repeated & ~equal]
    _report(table, conflict, faults, "at a time already given: the first is kept", "has different rows for one time")
    return repeated


def _of_wrong_order(table: Table, kept: IntArray, faults: Faults) -> BoolArray:
    """Return which of the kept rows, (k,), cannot be put in order: their stamps are wrong.

    A row that came late fills a hole among the others; a single wrong stamp leaves one. Where neither is so, time
    began anew: the clock was set back.
    """
    t = table.t[kept]
    moved = ~_longest_rise(t)
    wrong = np.zeros(len(t), dtype=bool)
    if not moved.any():
        return wrong
    usual = float(np.median(np.diff(t[~moved]))) if (~moved).sum() > 1 else 0.0
    rest = np.r_[-np.inf, t[~moved], np.inf]
    hole = np.searchsorted(rest, t[moved])
    late = (rest[hole] - rest[hole - 1]) / (np.bincount(hole)[hole] + 1) > HOLE * usual
    around = np.r_[np.inf, t[2:] - t[:-2], np.inf][: len(t)]
    alone = ~(np.r_[False, moved[:-1]] | np.r_[moved[1:], False])
    wrong[moved] = ~late & (alone & (around > 2 * HOLE * usual))[moved]
    _report(table, kept[wrong], faults, "stamped out of turn: dropped", "is out of turn")
    back = np.flatnonzero(np.diff(t[~wrong]) < 0)
    if not len(back):
        return wrong
    setback = (np.maximum.accumulate(t) - t)[moved][~late & ~wrong[moved]]
    fatal = moved.sum() > HICCUP_SHARE * len(t) or bool((setback > HICCUP_TIME).any())
    ending = "the clock cannot be trusted" if fatal else "rows sorted"
    faults.add(
        f"{table.where}: time goes backward {times(len(back))}, by up to {-np.diff(t[~wrong]).min():.3g} s "
        f"(first: {table.place(int(kept[~wrong][back[0] + 1]))}): {ending}",
        fatal=fatal,
    )
    return wrong


def _longest_rise(t: FloatArray) -> BoolArray:
    """Return the most rows that are in the order of time as they stand, (n,)."""
    tails: list[float] = []
    last: list[int] = []
    before = np.empty(len(t), dtype=int)
    for i, value in enumerate(t.tolist()):
        at = bisect_right(tails, value)
        before[i] = last[at - 1] if at else -1
        tails[at : at + 1], last[at : at + 1] = [value], [i]
    rise = np.zeros(len(t), dtype=bool)
    i = last[-1] if last else -1
    while i >= 0:
        rise[i] = True
        i = before[i]
    return rise


def _ranges(where: str, series: Series, faults: Faults) -> Series:
    values = np.where(series.values == -np.inf, np.nan, series.values)
    for senseless, words in (
        (values <= 0, "0 or less"),
        ((values > LARGEST) & (values < np.inf), f"over {LARGEST:g} m"),
    ):
        if senseless.any():
            faults.add(f"{where}: {int(senseless.sum())} ranges of {words} are taken as invalid")
            values = np.where(senseless, np.nan, values)
    if not np.isfinite(values).any():
        faults.add(f"{where}: no reading is valid")
    return Series(series.t, values, series.columns)


def _unwrapped(where: str, series: Series, faults: Faults) -> Series:
    """Unwrap theta where it was wrapped; a column that goes past one turn counts the turns itself."""
    column = series.columns.index("theta")
    theta = series.values[:, column]
    steps = np.abs(np.diff(theta))
    if ((steps > 300) & (steps < 420)).any():
        faults.add(f"{where}: theta jumps by about 360: degrees, not radians", fatal=True)
        return series
    if np.abs(theta).max() <= 2 * np.pi + 1e-6:
        theta = np.unwrap(theta)
        turn = np.abs(np.diff(theta))
        doubtful = np.flatnonzero(turn > LARGEST_TURN)
        if len(doubtful):
            faults.add(
                f"{where}: theta turns by more than {LARGEST_TURN:g} rad between samples "
                f"{times(len(doubtful))} (first: t = {moment(series.t[doubtful[0]])}): the direction is a guess"
            )
        # The same heading reads the same whatever multiple of a turn the file started from.
        theta = theta - 2 * np.pi * np.floor((theta[0] + np.pi) / (2 * np.pi))
    values = series.values.copy()
    values[:, column] = theta
    return Series(series.t, values, series.columns)


def _rows(count: int) -> str:
    return "1 row is" if count == 1 else f"{count} rows are"
