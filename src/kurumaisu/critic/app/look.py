# SPDX-License-Identifier: BSD-3-Clause
"""critic look RECORDING: what was recorded, what it could serve as, and what is missing, before anything is fitted."""

from __future__ import annotations

import argparse
from collections.abc import Generator, Iterator, Sequence
from pathlib import Path

import numpy as np

from kurumaisu import program
from kurumaisu.critic.app.display import aligned, printable
from kurumaisu.critic.app.options import add_robot, add_span, name_list
from kurumaisu.critic.bags.containers import is_bag
from kurumaisu.critic.bags.messages import shown
from kurumaisu.critic.bags.parts import is_split
from kurumaisu.critic.bags.survey import survey
from kurumaisu.critic.bags.topics import Topic
from kurumaisu.critic.data.bag_reader import TOPICS, mappings, read_bag_topics, wanted_of
from kurumaisu.critic.data.clean import Faults
from kurumaisu.critic.data.excerpt import WHOLE, Excerpt, cut
from kurumaisu.critic.data.meta import Meta
from kurumaisu.critic.data.odometry import JOINTS
from kurumaisu.critic.data.reading import check_run, chosen, meta_of, read_run, sources
from kurumaisu.critic.values.recording import Run
from kurumaisu.errors import Error, failed
from kurumaisu.params import Robot
from kurumaisu.types import FloatArray

_DESCRIPTION = """\
Say what a recording holds and what each part of it could serve as: types, counts,
rates, gaps, clocks; what meta.yaml could map; and what is missing for which
verdict. Nothing is fitted, and nothing written."""
_FASTER = 5.0  # times the usual interval is a gap
_ENOUGH = 60.0  # [s] of motion, below which small effects stay hidden


def main(arguments: Sequence[str] | None = None) -> int:
    """Print what there is; return 0, or 1 for what cannot be read or used."""
    options = _parser().parse_args(arguments)
    try:
        excerpt = Excerpt(options.start, options.stop)
        for line in look(options.recording, options.runs, excerpt, options.robot):
            print(printable(line), flush=True)
    except Error as error:
        return failed("critic look", error)
    return 0


def look(path: Path, wanted: Sequence[str] = (), excerpt: Excerpt = WHOLE, robot: Robot | None = None) -> Iterator[str]:
    """Yield lines for people about the runs of a recording; excerpt: what of each is used; robot: which it is.

    Raise Error for what cannot be read.
    """
    meta = meta_of(path, robot)
    faults = Faults()
    runs = []
    for source in chosen(sources(path), wanted):
        yield f"{source}:"
        topics = None
        if is_bag(source) or is_split(source):
            topics = yield from _topics(source, meta)
        run, mount = read_run(source, meta, faults, topics=topics)
        run = cut(run, excerpt, faults)
        check_run(run, meta.laser or mount, faults)
        runs.append(run)
        yield from _parts(run)
    yield ""
    yield from (f"data: {note}" for note in (*meta.notes, *faults.notes))
    yield from missing(runs, meta)


def missing(runs: Sequence[Run], meta: Meta) -> Iterator[str]:
    """Yield, for each verdict, whether the runs serve for it, or what is missing."""
    assumed = "not said: an MD-100, or one without voltages, is assumed; --robot, or `robot` in meta.yaml, says which"
    yield f"robot: {meta.robot.kind if meta.robot else assumed}"
    inputs = [run for run in runs if run.command or run.voltage]
    posed = [run for run in inputs if run.pose or run.odom]
    turned = bool(runs) and all(run.imu and not run.pose and not run.scan for run in runs)
    if turned:
        drives = "against the odometry" if all(run.odom for run in inputs) and inputs else "not known: that takes poses"
        yield f"base: how far it turns, against the imu; how far it drives: {drives}"
    elif posed:
        moving = _moving(posed)
        measured = all(run.pose for run in posed)
        source = "measured poses" if measured else "odometry: what the wheels do on the floor does not show"
        beside = ", whose headings the imu checks" if measured and all(run.imu for run in posed) else ""
        yield f"base: {moving:.0f} s of motion, against {source}{beside}"
        if moving < _ENOUGH:
            yield f"  small effects may stay hidden: {_ENOUGH:.0f} s of motion, both ways and both turns, show most"
    elif any(run.odom and run.pose for run in runs):
        yield "base: of odometry alone, against poses, over 2 s at a time; commands or voltages would show lags, too"
    else:
        yield f"base: not criticised: missing {'poses or odometry' if inputs else 'commands or voltages'}"
    scanned = [run for run in runs if run.scan]
    lacking = [
        words
        for words, there in (
            ("scans", scanned),
            ("a map (world: in meta.yaml)", meta.world),
            ("measured poses", any(run.pose for run in scanned or runs)),
        )
        if not there
    ]
    yield (
        f"laser: not criticised: missing {', '.join(lacking)}" if lacking else "laser: scans, a map and poses are there"
    )
    if len(runs) > 1:
        yield f"gain: on {'the test drives' if meta.test else 'each drive in turn'}"
    else:
        yield "gain: on each quarter of the only drive; a second drive would say more"


def _moving(runs: Sequence[Run]) -> float:
    """Return for how long [s] the inputs asked for motion."""
    total = 0.0
    for run in runs:
        series = run.voltage or run.command
        assert series is not None
        still = series.values[:, :2] == (np.median(series.values[:, :2], axis=0) if run.voltage else 0.0)
        asked = ~still.all(axis=1)
        end = max(float(part.t[-1]) for part in (run.pose, run.odom, series) if part is not None)
        total += float(np.diff(np.append(series.t, end))[asked].clip(0).sum())
    return total


def _topics(source: Path, meta: Meta) -> Generator[str, None, dict[str, Topic]]:
    """Yield the table of a bag's topics, and what meta.yaml could map; return what was read of them, at once."""
    found = survey(source)
    roles = {topic: part for part, topic in wanted_of(source, meta).items()}
    topics: dict[str, Topic] = {}
    try:
        topics = read_bag_topics(source, meta, also=[topic.name for topic in found if topic.serves])
    finally:  # what there is helps where that cannot be read
        rows = [("topic", "type", "messages", "rate", "gaps", "clock", "serves as")]
        for topic in found:
            read = topics.get(topic.name)
            told = _timing(read.times(), read.lateness()) if read else (f"{topic.rate:.3g} Hz", "", "")
            could = [f"could be {TOPICS[part]}" for part in topic.serves]
            could = could or ["could be wheels"] * (topic.type == shown(JOINTS))
            role = f"is {roles[topic.name]}" if topic.name in roles else ", ".join(could)
            rows.append((topic.name, topic.type, str(topic.count), *told, role))
        yield from (f"  {line}" for line in aligned(rows))
        yield from (f"  meta.yaml could say  {words}" for words in mappings(found, meta))
    return topics


def _timing(t: FloatArray, late: float | None = None) -> tuple[str, str, str]:
    """Return rate, gaps and clock of rows at times (n,) [s], in words; late [s]: when received, None: not known."""
    steps = np.diff(np.unique(t))
    clock = "receipt" if late is None else f"stamp, {1e3 * late:+.3g} ms"
    if not len(steps):
        return "", "", clock
    usual = float(np.median(steps))
    gaps = steps[steps > _FASTER * usual]
    return f"{1 / usual:.3g} Hz", f"{len(gaps)}, up to {gaps.max():.3g} s" if len(gaps) else "none", clock


def _parts(run: Run) -> Iterator[str]:
    """Yield the table of what a run is made of."""
    rows = [("part", "rows", "from", "to", "rate", "gaps")]
    for name, series in {**run.parts(), **run.covariates}.items():
        rate, gaps, _ = _timing(series.t)
        rows.append((name, str(len(series.t)), f"{series.t[0]:.3f} s", f"{series.t[-1]:.3f} s", rate, gaps))
    yield from (f"  {line}" for line in aligned(rows))


def _parser() -> argparse.ArgumentParser:
    parser = program.Parser(prog="critic look", description=_DESCRIPTION, allow_abbrev=False)
    what = "a bag, a folder of runs or CSV tables, or a log of MRPT or CARMEN"
    parser.add_argument("recording", type=Path, metavar="RECORDING", help=what)
    words = "only these runs; patterns like drive_* are allowed"
    parser.add_argument("--runs", type=name_list, default=(), metavar="A,B", help=words)
    add_robot(parser)
    add_span(parser)
    return parser
