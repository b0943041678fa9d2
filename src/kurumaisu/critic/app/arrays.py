# SPDX-License-Identifier: BSD-3-Clause
"""The critic on arrays: no files, no bags, no ROS."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from kurumaisu.critic import pipeline
from kurumaisu.critic.data.clean import Faults, Table, clean_part
from kurumaisu.critic.data.completion import completed
from kurumaisu.critic.data.csv_reader import IMU, OPTIONAL, QUERY, REQUIRED, check_queries
from kurumaisu.critic.data.meta import Meta, recording_of_meta
from kurumaisu.critic.data.odometry import with_wheels
from kurumaisu.critic.data.reading import check_run, require_use, split
from kurumaisu.critic.data.reference import with_reference
from kurumaisu.critic.values.criticism import Criticism
from kurumaisu.critic.values.recording import Recording, Run, Series, run_of_parts
from kurumaisu.critic.values.selection import effect_ids
from kurumaisu.errors import Error
from kurumaisu.params import shipped
from kurumaisu.types import FloatArray

Tables = Mapping[str, ArrayLike]


def criticise_arrays(
    runs: Mapping[str, Tables],
    meta: Meta | None = None,
    *,
    only: Sequence[str] = (),
    without: Sequence[str] = (),
    seed: int = 1,
    progress: Callable[[str], None] = lambda _: None,
) -> Criticism:
    """Criticise a model by drives that are arrays; the same rows in CSV tables give the same verdict.

    runs: by name, tables whose first column is t [s]: command (n, 3) of t, v, w; voltage (n, 3) of t, v_f, v_s, or
    (n, 5) with the v, w that they stand for; pose (n, 4) of t, x, y, theta, or (n, 3) without theta; odom (n, 6) of t,
    x, y, theta, v, w, or (n, 4) without v, w; wheels or wheel_rates (n, 3) of t, left, right; imu (n, 2) of t, w, or
    (n, 4) of t, wx, wy, wz, or (n, 7) with ax, ay, az; scan (n, 1 + beams); query (n, 2) of t0, t1; any other name: a
    covariate, (n, 2). SI units, radians. meta: what meta.yaml would say.
    only, without: ids or patterns of effects; seed: of the particle filter that makes a missing reference.
    Raise Error naming run and table, or effect, for what cannot be used.
    """
    ids = effect_ids(only, without)
    recording = with_reference(recording_of("arrays", runs, meta or Meta()), seed, progress)
    return pipeline.criticise(recording, recording.model or shipped("launch/md100.yaml"), progress, ids=ids)


def recording_of(name: str, runs: Mapping[str, Tables], meta: Meta) -> Recording:
    """Return arrays as a recording, cleaned as tables are. Raise Error naming what does not fit."""
    faults = Faults()
    made = [run_of(run, tables, faults, meta) for run, tables in runs.items()]
    if not made:
        raise Error(f"{name}: no run is given")
    for run in made:
        check_run(run, meta.laser, faults)
    require_use(name, made, meta, faults)
    train, test = split(f"{name}: meta", meta, list(runs), partly=False)
    return recording_of_meta(name, made, meta, faults, train=train, test=test)


def run_of(name: str, tables: Tables, faults: Faults, meta: Meta | None = None) -> Run:
    """Return the tables of one drive as a run; faults gets what was found wrong; meta: of robot, imu and commands.

    Raise Error naming a misshapen table.
    """
    parts: dict[str, Series | None] = {}
    covariates: dict[str, Series] = {}
    queries = None
    for part, given in tables.items():
        where = f"{name}/{part}"
        rows = _rows(where, given)
        if part == QUERY:
            queries = check_queries(where, rows)
            continue
        columns = _columns(where, part, rows.shape[1] - 1)
        table = Table(where, rows[:, 0], rows[:, 1:], columns, "row", 0)
        series = clean_part(part, table, faults)
        if part in REQUIRED:
            parts[part] = series
        elif series is not None:
            covariates[part] = series
    meta = meta or Meta()
    lost = with_wheels(name, name, parts, meta.robot, faults)
    run = replace(run_of_parts(name, parts, covariates), queries=queries, aside=lost)
    return completed(run, meta.command_hold, faults, meta.imu)


def _rows(where: str, given: ArrayLike) -> FloatArray:
    try:
        rows = np.asarray(given, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise Error(f"{where}: is not an array of numbers: {error}") from error
    if rows.ndim != 2 or rows.shape[1] < 2:
        raise Error(f"{where}: must have rows of t and at least one number; its shape is {rows.shape}")
    return rows


def _columns(where: str, part: str, count: int) -> tuple[str, ...]:
    """Return the names of a table's columns after t."""
    if part == "scan":
        return tuple(f"r{i}" for i in range(count))
    if part == "covariate":
        raise Error(f"{where}: give each covariate under its own name")
    required = REQUIRED.get(part, (part,))
    known = IMU if part == "imu" else (required, (*required, *OPTIONAL.get(part, ())))
    for columns in known:
        if len(columns) == count:
            return columns
    raise Error(f"{where}: must have the columns t, {', '.join(known[0])}; it has {count + 1} columns")
