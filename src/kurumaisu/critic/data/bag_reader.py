# SPDX-License-Identifier: BSD-3-Clause
"""Read a run from the topics of a ROS 1 bag."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from kurumaisu.critic.data import messages
from kurumaisu.critic.data.bag_topics import Topic, read_topics
from kurumaisu.critic.data.clean import Faults, Table, clean
from kurumaisu.critic.values.recording import Fan, Run, Series, run_of_parts
from kurumaisu.errors import Error
from kurumaisu.types import FloatArray

# Topic of each part, where meta.yaml names no other.
TOPICS = {
    "command": "cmd_vel",
    "voltage": "voltages",
    "pose": "ground_truth",
    "odom": "odom",
    "scan": "scan",
    "battery": "battery",
    "temperature": "temperature",
}
SCRIPTED = "/experiment_vel"  # the command where there is no cmd_vel: critic experiment's
PARTS = messages.PARTS
PutAside = Callable[[FloatArray, FloatArray | None], int]
# Stamps and times of receipt further apart than this do not come from one clock [s].
CLOCK_TOLERANCE = 1.0


def read_bag_run(path: Path, topics: dict[str, str], faults: Faults, put_aside: PutAside | None = None) -> Run:
    """Read the topics of a bag. topics: from meta.yaml, by default name or by name of a covariate.

    put_aside: takes the ranges and the intensities of each scan and returns their number, which the run's scan then has
    for its only column; None: it has the ranges.
    A message's time is its header's stamp, or where it has none, when the bag received it.
    Raise Error naming file, topic and type for what cannot be read.
    """
    wanted = resolve(topics)
    shared = [topic for topic in wanted.values() if list(wanted.values()).count(topic) > 1]
    if shared:
        raise Error(f"topics: {shared[0]} is assigned to two parts of a run")

    def kept(row: tuple[Fan, FloatArray, FloatArray | None]) -> tuple[Fan, FloatArray]:
        fan, ranges, intensities = row
        return fan, ranges if put_aside is None else np.array([put_aside(ranges, intensities)], dtype=np.float64)

    found = read_topics(path, {topic: part for part, topic in wanted.items()}, {"scan": kept})
    if "command" not in found:
        found |= read_topics(path, {SCRIPTED: "command"})
    for part in sorted(set(_parts(topics)) - set(found)):
        faults.add(f"{path.name}: there is no topic {wanted[part]}")
    _check_clocks(path.name, found, faults)
    found = {part: _last_of_each_time(f"{path.name} {topic.name}", topic, faults) for part, topic in found.items()}
    series: dict[str, Series | None] = {}
    fan, covariates = None, {}
    for part, topic in found.items():
        where = f"{path.name} {topic.name}"
        if part == "scan":
            series["scan"], fan = _scan(where, topic, faults, aside=put_aside is not None)
        elif part in PARTS:
            columns, rows = messages.COLUMNS[part], np.asarray(topic.rows, dtype=np.float64)
            if part == "voltage" and not np.nan_to_num(rows[:, 2:]).any():
                columns, rows = columns[:2], rows[:, :2]
            series[part] = clean(Table(where, topic.times(), rows, columns, "message", 1), faults)
        else:
            covariates.update(_covariates(part, where, topic, faults))
    return replace(run_of_parts(path.stem, series, covariates), fan=fan)


def resolve(topics: dict[str, str]) -> dict[str, str]:
    """Return the absolute topic of each part and covariate."""
    names = {**TOPICS, **_parts(topics)}
    return {part: f"/{topic.strip('/')}" for part, topic in names.items()}


def _parts(topics: dict[str, str]) -> dict[str, str]:
    by_topic = {TOPICS[part]: part for part in PARTS}
    return {by_topic.get(name, name): topic for name, topic in topics.items()}


def _check_clocks(name: str, found: dict[str, Topic], faults: Faults) -> None:
    late = {topic.name: topic.lateness() for topic in found.values()}
    stamped = {topic: value for topic, value in late.items() if value is not None}
    # A topic without stamps lives on the clock of receipt.
    clocks = list(stamped.values()) + ([0.0] if len(stamped) < len(late) else [])
    if clocks and max(clocks) - min(clocks) > CLOCK_TOLERANCE:
        told = ", ".join(f"{topic} {value:+.3g} s" for topic, value in stamped.items())
        faults.add(f"{name}: stamps come from different clocks; receipt minus stamp: {told}", fatal=True)


def _last_of_each_time(where: str, topic: Topic, faults: Faults) -> Topic:
    """Return a topic without stamps with one message for each time of receipt: the last, which holds from then on.

    The clock of receipt has ticks, those of a simulation or of a replay coarse ones: what comes within one is no copy.
    """
    if any(topic.stamps):
        return topic
    received = np.array(topic.received)
    keep = np.flatnonzero(np.r_[received[1:] != received[:-1], True])
    dropped = len(received) - len(keep)
    if not dropped:
        return topic
    are = "message was" if dropped == 1 else "messages were"
    faults.add(f"{where}: {dropped} {are} dropped: a later one has the same time of receipt")
    rows, stamps = [topic.rows[i] for i in keep], [topic.stamps[i] for i in keep]
    return replace(topic, received=received[keep].tolist(), stamps=stamps, rows=rows)


def _scan(where: str, topic: Topic, faults: Faults, *, aside: bool) -> tuple[Series | None, Fan | None]:
    fan = topic.rows[0][0]
    keep = [i for i, (other, _) in enumerate(topic.rows) if other == fan]
    if len(keep) < len(topic.rows):
        faults.add(f"{where}: {len(topic.rows) - len(keep)} scans dropped: their angles differ from those of the first")
    ranges = np.stack([topic.rows[i][1] for i in keep])
    columns = ("row",) if aside else tuple(f"r{i}" for i in range(fan.beams))
    return clean(Table(where, topic.times()[keep], ranges, columns, "scan", 1), faults, ranges=not aside), fan


def _covariates(name: str, where: str, topic: Topic, faults: Faults) -> dict[str, Series]:
    fields = topic.rows[0].keys()
    t = topic.times()
    covariates = {}
    if not fields:
        raise Error(f"{where}: {topic.type} has no numeric field, so it cannot be a covariate")
    for key in fields:
        values = np.array([row[key] for row in topic.rows], dtype=np.float64)
        # A driver that does not measure a field leaves it at 0 or nan.
        if key and not np.nan_to_num(values).any():
            continue
        column = f"{name}.{key}" if key else name
        series = clean(Table(where, t, values[:, None], (column,), "message", 1), faults)
        if series is not None:
            covariates[column] = series
    return covariates
