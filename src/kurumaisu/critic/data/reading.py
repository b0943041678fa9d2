# SPDX-License-Identifier: BSD-3-Clause
"""Read a recording, whatever it is made of: bags, CSV tables, or an MRPT rawlog."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import combinations
from pathlib import Path

import numpy as np

from kurumaisu.critic.bags.containers import SUFFIXES, bag_name, is_bag
from kurumaisu.critic.bags.parts import is_split
from kurumaisu.critic.bags.topics import Topic
from kurumaisu.critic.data.bag_reader import PutAside, inventory, read_bag_run, resolve
from kurumaisu.critic.data.clean import Faults
from kurumaisu.critic.data.completion import completed
from kurumaisu.critic.data.csv_reader import QUERY, is_csv_run, read_csv_run, read_queries
from kurumaisu.critic.data.excerpt import WHOLE, Excerpt, cut
from kurumaisu.critic.data.log_reader import is_carmen, is_rawlog, rawlog_name, read_carmen_run, read_rawlog_run
from kurumaisu.critic.data.meta import Meta, read_meta, recording_of_meta
from kurumaisu.critic.values.recording import LONGEST_HOLD, LaserMount, Recording, Run, Series
from kurumaisu.critic.values.selection import matching
from kurumaisu.errors import Error
from kurumaisu.names import hint
from kurumaisu.params import Robot

META = "meta.yaml"
# No laser of this kind sees further: ranges whose median is above it are millimetres.
FARTHEST_MEDIAN = 100.0


def read_recording(
    path: Path, wanted: Sequence[str] = (), excerpt: Excerpt = WHOLE, robot: Robot | None = None
) -> Recording:
    """Read a folder of runs, one folder of CSV tables, one bag or one log.

    NAME.bag may have been split into NAME_0.bag, NAME_1.bag, ...
    wanted: names of runs, or patterns like drive_*; only those are read and used; empty takes all.
    excerpt: what of each run is used. robot: which it is, in place of what meta.yaml says.
    Raise Error naming file, line and column, topic or key for anything that cannot be read, and saying what
    is missing when nothing can be done with what was read.
    """
    meta = meta_of(path, robot)
    faults = Faults()
    laser = meta.laser
    runs = []
    kept = chosen(sources(path), wanted)
    for source in kept:
        run, mount = read_run(source, meta, faults)
        run = cut(run, excerpt, faults)
        laser = laser or mount
        check_run(run, laser, faults)
        runs.append(run)
    require_use(path, runs, meta, faults, bags=[source for source in kept if is_bag(source) or is_split(source)])
    train, test = split(path / META, meta, [run.name for run in runs], partly=bool(wanted))
    name = path.resolve().name if path.is_dir() else path.resolve().stem
    return recording_of_meta(name, runs, replace(meta, laser=laser), faults, train=train, test=test)


def is_log(path: Path) -> bool:
    """Tell whether a file is a rawlog or a log of CARMEN."""
    return is_rawlog(path) or is_carmen(path)


def meta_of(path: Path, robot: Robot | None = None) -> Meta:
    """Return what meta.yaml says of a recording: the one inside a folder, else the one beside a bag or a rawlog.

    One beside it speaks of all that lies there: which runs are fitted does not concern a single one. robot: as
    read_meta has it.
    Raise Error naming file and key, and where there is no such recording.
    """
    if not path.exists() and not is_split(path):
        raise Error(f"{path}: there is no such file or folder")
    inside, beside = path / META, path.resolve().parent / META
    if path.is_dir() and inside.exists():
        return read_meta(inside, robot)
    alone = is_split(path) or is_bag(path) or is_log(path)
    if alone and beside.exists():
        return replace(read_meta(beside, robot), train=(), test=())
    return Meta(robot=robot)


def sources(path: Path) -> list[Path]:
    """Return what each run is read from: a bag, a log, or a folder of tables."""
    if is_bag(path):
        return [path]
    if not path.is_dir():
        if not is_log(path):
            kinds = f"a bag ({', '.join(SUFFIXES)}), a .rawlog or a log of CARMEN (.clf, .log)"
            raise Error(f"{path}: is not a recording: give a folder, {kinds}")
        return [path]
    inside = sorted(path.iterdir())
    bags = [item for item in inside if is_bag(item) or is_log(item)]
    folders = [item for item in inside if item.is_dir() and item not in bags and is_csv_run(item)]
    if is_csv_run(path):
        if bags or folders:
            raise Error(f"{path}: holds both tables and runs ({(bags + folders)[0].name}): one or the other")
        return [path]
    # The queries of a bag's run lie in a folder of its name, alone.
    names = [_run_name(bag) for bag in bags]
    for folder in [folder for folder in folders if folder.name in names]:
        others = [item.name for item in folder.glob("*.csv") if item.stem != QUERY]
        if others:
            raise Error(f"{folder / others[0]}: the run {folder.name} also exists as a bag")
        folders.remove(folder)
    twice = [name for name in names if names.count(name) > 1]
    if twice:
        raise Error(f"{path}: the run {twice[0]} exists twice")
    if not bags and not folders:
        raise Error(f"{path}: holds no run: neither a bag, nor a log, nor a folder with tables like pose.csv")
    return sorted(bags + folders, key=lambda item: item.stem)


def read_run(
    source: Path,
    meta: Meta,
    faults: Faults,
    put_aside: PutAside | None = None,
    topics: Mapping[str, Topic] | None = None,
) -> tuple[Run, LaserMount | None]:
    """Return a run, and the laser's mounting where the file itself states it.

    put_aside, topics: of a bag, as read_bag_run has them.
    """
    mount = None
    if source.is_dir() and not is_bag(source):
        run = read_csv_run(source, source.resolve().name, faults, meta.robot)
    elif is_rawlog(source):
        run, mount = read_rawlog_run(source, faults)
    elif is_carmen(source):
        run, mount = read_carmen_run(source, faults)
    else:
        run = read_bag_run(source, meta, faults, put_aside, topics)
        queries = (source if source.is_dir() else source.with_suffix("")) / f"{QUERY}.csv"
        run = replace(run, queries=read_queries(queries)) if queries.is_file() else run
    return completed(run, meta.command_hold, faults, meta.imu), mount


def chosen(sources: list[Path], wanted: Sequence[str]) -> list[Path]:
    """Return the sources of the runs that are wanted, in their own order."""
    if not wanted:
        return sources
    names = [_run_name(source) for source in sources]
    kept = {name for pattern in wanted for name in matching("--runs", pattern, names, "run")}
    return [source for source, name in zip(sources, names, strict=True) if name in kept]


def _run_name(source: Path) -> str:
    """Return the name that a run of this source has."""
    return rawlog_name(source) if is_rawlog(source) else bag_name(source)


def split(
    meta_file: Path | str, meta: Meta, names: list[str], *, partly: bool
) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return the runs to fit and the runs to judge by; partly: not all runs were read."""
    for key, chosen in (("train", meta.train), ("test", meta.test)):
        for name in chosen if not partly else ():
            if name not in names:
                raise Error(f"{meta_file}: {key}: there is no run {name!r}; {hint(name, names)}")
    train = tuple(name for name in meta.train or names if name in names and name not in meta.test)
    if not train:
        where = "--runs" if partly else f"{meta_file}: train"
        raise Error(f"{where}: no run is left to fit: all are in test")
    return train, tuple(name for name in meta.test if name in names)


def require_use(path: Path | str, runs: Sequence[Run], meta: Meta, faults: Faults, bags: Sequence[Path] = ()) -> None:
    """Raise Error unless a run says something about base or laser, with what is in the first of the bags.

    Note the runs that do not.
    """
    useless = [run for run in runs if not usable(run)]
    told = {f"{run.name}: is of no use: it has {_has(run)}" for run in useless}
    for words in sorted(told):
        faults.add(words)
    if len(useless) == len(runs):
        topic = resolve(meta.topics)
        raise Error(
            f"{path}: nothing to criticise a model with: {runs[0].name} has {_has(runs[0])}. "
            f"Needed are scans (scan.csv or {topic['scan']}), or commands or voltages "
            f"(command.csv, voltage.csv, {topic['command']} or {topic['voltage']}) "
            f"together with poses (pose.csv, odom.csv, {topic['pose']} or {topic['odom']}) "
            "or an imu (imu.csv, sensor_msgs/Imu)"
            + "".join(f"; {note}" for note in faults.notes if note not in told)
            + "".join(f"; {inventory(bag, meta)}" for bag in bags[:1])
        )


def _has(run: Run) -> str:
    parts = run.parts()
    return f"only {' and '.join(parts)}" if parts else "no part of a run"


def usable(run: Run) -> bool:
    """Tell whether a run says something about base or laser."""
    driven = run.command is not None or run.voltage is not None
    measured = run.pose is not None or run.imu is not None
    followed = measured or run.odom is not None or run.queries is not None
    return run.scan is not None or (driven and followed) or (run.odom is not None and measured)


def check_run(run: Run, laser: LaserMount | None, faults: Faults) -> None:
    """Report parts that do not fit together. Raise Error for scans that are not of the laser of meta.yaml."""
    _check_overlap(run, faults)
    if run.scan is not None:
        _check_scan(run, run.scan, laser, faults)


def _check_overlap(run: Run, faults: Faults) -> None:
    parts = run.parts("command", "voltage", "pose", "odom", "scan")
    ends = {n: float(part.t[-1]) + (LONGEST_HOLD if n in ("command", "voltage") else 0.0) for n, part in parts.items()}
    words = {name: f"{name} ({part.t[0]:.6g} to {part.t[-1]:.6g} s)" for name, part in parts.items()}
    for a, b in combinations(parts, 2):
        if parts[a].t[0] > ends[b] or parts[b].t[0] > ends[a]:
            faults.add(f"{run.name}: {words[a]} and {words[b]} were not recorded at the same time", fatal=True)


def _check_scan(run: Run, scan: Series, laser: LaserMount | None, faults: Faults) -> None:
    beams = scan.values.shape[1]
    if laser is not None and beams != laser.beams:
        raise Error(f"{run.name}: scans have {beams} beams, but meta.yaml says laser.beams: {laser.beams}")
    finite = scan.values[np.isfinite(scan.values)]
    if len(finite) and np.median(finite) > FARTHEST_MEDIAN:
        faults.add(f"{run.name}: ranges around {np.median(finite):.4g}: millimetres, not metres?", fatal=True)
    if laser is None or run.fan is None:
        return
    first = run.fan.angle_min - laser.angle_min
    last = first + (run.fan.angle_increment - laser.angle_increment) * (beams - 1)
    if max(abs(first), abs(last)) > abs(laser.angle_increment) / 4:
        faults.add(
            f"{run.name}: angles of the scans differ from those of meta.yaml by {first:.2g} rad at the first beam "
            f"and {last:.2g} rad at the last"
        )
