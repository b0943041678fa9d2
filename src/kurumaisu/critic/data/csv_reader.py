# SPDX-License-Identifier: BSD-3-Clause
"""Runs as folders of CSV tables, each with one header line, or trajectories of the TUM benchmark: read and written."""

from __future__ import annotations

import csv
import io
import math
from array import array
from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from kurumaisu.bounded_files import MOST_TABLE, read_text
from kurumaisu.critic.data.clean import Faults, Table, clean, clean_part
from kurumaisu.critic.data.odometry import with_wheels
from kurumaisu.critic.rates.yaw_rate import ACCELERATIONS, RATE, RATES
from kurumaisu.critic.values.recording import Run, Series, run_of_parts
from kurumaisu.errors import Error, told
from kurumaisu.params import Robot
from kurumaisu.plausible import yaw_or_nan
from kurumaisu.types import FloatArray
from kurumaisu.whole_files import write_whole

if TYPE_CHECKING:
    from _csv import Reader

# Columns beside t that a table must have; scan and covariate have as many as there are.
REQUIRED: dict[str, tuple[str, ...]] = {
    "command": ("v", "w"),
    "voltage": ("v_f", "v_s"),
    "pose": ("x", "y"),
    "odom": ("x", "y", "theta"),
    "wheels": ("left", "right"),
    "wheel_rates": ("left", "right"),
    "imu": (),
    "scan": (),
    "covariate": (),
}
# Columns that belong to a table when it has them; any other one is a covariate.
OPTIONAL: dict[str, tuple[str, ...]] = {
    "voltage": ("v", "w"),
    "pose": ("theta",),
    "odom": ("v", "w"),
    "imu": (*RATE, *RATES, *ACCELERATIONS),
}
IMU = (RATE, RATES, (*RATES, *ACCELERATIONS))  # columns that it may have
QUERY = "query"
_TRAJECTORIES = ("pose", "odom")  # which may also be trajectories
_HEADINGS = frozenset({"yaw", "heading", "th", "phi", "psi", "angle", "orientation", "rotation", "bearing"})
_MOST_COLUMNS = 20_000  # of a table; a laser has some thousand beams
_LONGEST_NAME = 200  # characters of a column's name
_MOST_LISTED = 20  # names of columns in a message
SUFFIX = ".tum"
_NUMBERS = 8


def is_csv_run(folder: Path) -> bool:
    """Tell whether a folder holds a table of a run."""
    tables = any((folder / f"{name}.csv").is_file() for name in (*REQUIRED, QUERY))
    return tables or any((folder / f"{name}{SUFFIX}").is_file() for name in _TRAJECTORIES)


def read_csv_run(folder: Path, name: str, faults: Faults, robot: Robot | None = None) -> Run:
    """Read the tables of a folder; a table that is not there is a missing part. robot: whose wheels they tell of.

    Raise Error naming file, line and column for what cannot be read.
    """
    for path in sorted(folder.glob("*.csv")):
        if path.stem not in (*REQUIRED, QUERY):
            known = ", ".join(f"{table}.csv" for table in (*REQUIRED, QUERY))
            faults.add(f"{name}/{path.name}: not read: its name is none of {known}")
    parts: dict[str, Series | None] = {}
    covariates: dict[str, Series] = {}
    for part in REQUIRED:
        path = folder / f"{part}.csv"
        if path.exists():
            parts[part], more = _part(path, f"{name}/{path.name}", part, faults)
            for column in more.keys() & covariates.keys():
                raise Error(f"{path}:1: column {column!r} is a covariate that another table of the run has too")
            covariates |= more
    for part in _TRAJECTORIES:
        path = folder / f"{part}{SUFFIX}"
        if path.exists():
            if part in parts:
                raise Error(f"{path}: there is a {part}.csv, too: one or the other")
            t, rows = read_tum(path)
            parts[part] = clean(Table(f"{name}/{path.name}", t, rows, ("x", "y", "theta"), "row", 1), faults)
    lost = with_wheels(str(folder), name, parts, robot, faults)
    query = folder / f"{QUERY}.csv"
    queries = read_queries(query) if query.exists() else None
    return replace(run_of_parts(name, parts, covariates), queries=queries, aside=lost)


def read_queries(path: Path) -> FloatArray:
    """Read query.csv into (q, 2) of t0, t1 [s]. Raise Error naming file and line for t1 before t0."""
    columns, rows, _ = read_table(path, ("t0", "t1"))
    return check_queries(str(path), rows[:, [columns.index("t0"), columns.index("t1")]], first=2)


def check_queries(where: str, queries: FloatArray, first: int = 0) -> FloatArray:
    """Return queries (q, 2). Raise Error naming where, and the row counted from `first`, for t1 before t0."""
    if queries.shape[1] != 2:
        raise Error(f"{where}: must have the columns t0, t1; it has {queries.shape[1]} columns")
    bad = np.flatnonzero(~(queries[:, 1] >= queries[:, 0]) | ~np.isfinite(queries).all(axis=1))
    if len(bad):
        t0, t1 = queries[bad[0]]
        raise Error(f"{where}:{bad[0] + first}: t1 must not be before t0: {t0:g}, {t1:g}")
    return queries


def _part(path: Path, where: str, part: str, faults: Faults) -> tuple[Series | None, dict[str, Series]]:
    """Return the part itself and the covariates among its columns."""
    columns, rows, dropped = read_table(path, ("t", *REQUIRED[part]), OPTIONAL.get(part, ()))
    other = next((name for name in columns if name.lower() in _HEADINGS), None) if part == "pose" else None
    if "theta" not in columns and other is not None:  # which would pass for a covariate
        raise Error(f"{path}:1: column 'theta' is missing: rename column {other!r} if it is the heading [rad]")
    for column in dropped:
        faults.add(f"{where}: column {column!r} is not read: it has no numbers")
    optional = tuple(name for name in OPTIONAL.get(part, ()) if name in columns)
    own = (*REQUIRED[part], *optional)
    if part == "imu" and set(own).isdisjoint((*RATE, *RATES)):
        raise Error(f"{path}:1: a rate is missing: w of the robot, or wx, wy, wz about the axes of the sensor [rad/s]")
    if part == "scan":
        own = tuple(f"r{i}" for i in range(sum(_is_beam(name) for name in columns)))
        missing = [name for name in own if name not in columns]
        if missing or not own:
            raise Error(f"{path}:1: column {missing[0] if missing else 'r0'!r} is missing")
    t = rows[:, columns.index("t")]
    series = None
    if own:
        values = rows[:, [columns.index(name) for name in own]]
        table = Table(where, t, values, own, "line", 2)
        series = clean_part(part, table, faults)
    covariates = {}
    for name in columns:
        if name not in ("t", *own):
            one = rows[:, columns.index(name)]
            given = ~np.isnan(one)
            # Line numbers would be off by the empty cells, so rows are counted instead.
            covariate = clean(Table(f"{where}: {name}", t[given], one[given, None], (name,), "value", 1), faults)
            if covariate is not None:
                covariates[name] = covariate
    return series, covariates


def _is_beam(name: str) -> bool:
    return name.startswith("r") and name[1:].isdecimal()


def read_table(
    path: Path, required: tuple[str, ...], optional: tuple[str, ...] = ()
) -> tuple[list[str], FloatArray, list[str]]:
    """Return column names, rows (n, columns), and the names of columns without any number, left out.

    optional: columns that have a number in each row, where they are there.
    """
    stream = io.StringIO(read_text(path, MOST_TABLE, "utf-8-sig"), newline="")
    try:
        columns = [name.strip() for name in next(csv.reader(stream), [])]
        _check_header(path, columns, required)
        begin = stream.tell()
        if not stream.read().strip():
            return columns, np.empty((0, len(columns))), []
        stream.seek(begin)
        try:
            rows = np.loadtxt(stream, delimiter=",", comments=None, ndmin=2)
        except ValueError:
            rows = np.empty((0, 0))
        if rows.shape[1] == len(columns):
            return columns, rows, []
        stream.seek(0)
        return _read_cells(path, csv.reader(stream), columns, (*required, *optional))
    except csv.Error as error:
        raise Error(f"{path}: is not a table: {error}") from error


def _check_header(path: Path, columns: list[str], required: tuple[str, ...]) -> None:
    if len(columns) > _MOST_COLUMNS:
        raise Error(f"{path}:1: has {len(columns)} columns, and at most {_MOST_COLUMNS} are read")
    for name in required:
        if name not in columns:
            more = f" and {len(columns) - _MOST_LISTED} more" if len(columns) > _MOST_LISTED else ""
            listed = (", ".join(each[:_LONGEST_NAME] for each in columns[:_MOST_LISTED]) or "none") + more
            raise Error(f"{path}:1: column {name!r} is missing; there are: {listed}")
    seen: set[str] = set()
    for name in columns:
        if not name or name in seen:
            raise Error(f"{path}:1: column {told(name)} {'occurs twice' if name else 'has no name'}")
        if len(name) > _LONGEST_NAME:
            raise Error(f"{path}:1: column {told(name)} has a name of more than {_LONGEST_NAME} characters")
        seen.add(name)


def _read_cells(
    path: Path, reader: Reader, names: list[str], full: tuple[str, ...]
) -> tuple[list[str], FloatArray, list[str]]:
    """Read cell by cell: slow, but finds the fault, takes quotes, and empty cells where columns may have them.

    full: columns that have a number in each row, as beams do.
    """
    next(reader)
    blank = [name not in full and not _is_beam(name) for name in names]
    cells, bad = array("d"), dict[int, tuple[int, str]]()  # bad: line and cell of a column's first that is no number
    for row in reader:
        if row and len(row) != len(names):
            raise Error(f"{path}:{reader.line_num}: {len(row)} cells under {len(names)} columns")
        for i, cell in enumerate(row):
            try:
                cells.append(float(cell))
            except ValueError:
                cells.append(math.nan)
                if cell.strip() or not blank[i]:
                    bad.setdefault(i, (reader.line_num, cell.strip()))
    rows = np.asarray(cells, dtype=np.float64).reshape(-1, len(names))
    dropped = [i for i in sorted(bad) if blank[i] and np.isnan(rows[:, i]).all()]
    for i in sorted(bad.keys() - dropped):
        line, cell = bad[i]
        raise Error(f"{path}:{line}: column {names[i]!r}: is not a number: {told(cell)}")
    kept = [name for i, name in enumerate(names) if i not in dropped]
    return kept, np.delete(rows, dropped, axis=1), [names[i] for i in dropped]


def read_tum(path: Path) -> tuple[FloatArray, FloatArray]:
    """Return times (n,) [s] and poses (n, 3) of x, y [m], theta [rad], nan for a quaternion without a yaw.

    Raise Error naming file and line for what is no such row.
    """
    rows = []
    for number, line in enumerate(read_text(path, MOST_TABLE, "utf-8-sig").splitlines(), 1):
        cells = line.split("#")[0].split()
        if cells and len(cells) != _NUMBERS:
            raise Error(f"{path}:{number}: has {len(cells)} numbers, and not the 8 of t x y z qx qy qz qw")
        try:
            rows += [list(map(float, cells))] if cells else []
        except ValueError:
            raise Error(f"{path}:{number}: is not a row of numbers: {told(' '.join(cells))}") from None
    table = np.array(rows, dtype=np.float64).reshape(-1, _NUMBERS)
    theta = [yaw_or_nan(*row[4:]) for row in table.tolist()]
    return table[:, 0], np.column_stack([table[:, 1:3], theta])


def write_csv_run(folder: Path, run: Run) -> None:
    """Write a run into folder, which is made; reading it back gives the same arrays to the last bit.

    The fan of a bag has no place in CSV: put it into meta.yaml. Raise Error naming what cannot be written.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise Error(f"{folder}: {error.strerror}") from error
    tables = {}  # Python floats print with as many digits as it takes to read them back exactly
    for part, series in run.parts().items():
        tables[part] = csv_text(("t", *series.columns), np.column_stack([series.t, series.values]).tolist())
    if run.covariates:
        rows = _side_by_side(list(run.covariates.values()))
        tables["covariate"] = csv_text(("t", *run.covariates), rows.tolist())
    if run.queries is not None:
        tables["query"] = csv_text(("t0", "t1"), run.queries.tolist())
    write_whole({folder / f"{name}.csv": text for name, text in tables.items()})


def _side_by_side(covariates: Sequence[Series]) -> FloatArray:
    """Return rows (n, 1 + covariates), one per time of any sample, nan where a covariate has none."""
    t = np.unique(np.concatenate([series.t for series in covariates]))
    rows = np.full((len(t), 1 + len(covariates)), np.nan)
    rows[:, 0] = t
    for i, series in enumerate(covariates):
        rows[np.searchsorted(t, series.t), i + 1] = series.values[:, 0]
    return rows


def csv_text(columns: Iterable[str], rows: Iterable[Iterable[object]]) -> str:
    """Return a table with a line for the names of its columns."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(columns)
    writer.writerows(rows)
    return text.getvalue()
