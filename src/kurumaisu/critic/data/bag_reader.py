# SPDX-License-Identifier: BSD-3-Clause
"""Read a run from the topics of a bag."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from kurumaisu.critic.bags import messages
from kurumaisu.critic.bags.containers import bag_name
from kurumaisu.critic.bags.messages import ScanRow, serves_as, shown
from kurumaisu.critic.bags.survey import Found, listed, proposal, survey
from kurumaisu.critic.bags.topics import Convert, Topic, read_topics
from kurumaisu.critic.bags.transforms import TOPICS as TRANSFORMS
from kurumaisu.critic.bags.transforms import read_frame
from kurumaisu.critic.data.clean import Faults, Table, clean, clean_part
from kurumaisu.critic.data.csv_reader import IMU, OPTIONAL, REQUIRED
from kurumaisu.critic.data.meta import Meta
from kurumaisu.critic.data.odometry import COLUMNS, JOINTS, Spans, read_wheels
from kurumaisu.critic.rates.yaw_rate import UNUSED
from kurumaisu.critic.values.recording import PARTS, Fan, Run, Series, run_of_parts
from kurumaisu.errors import Error
from kurumaisu.geometry import wrap
from kurumaisu.names import hint
from kurumaisu.types import FloatArray, IntArray

# Topic of each part, where meta.yaml names no other.
TOPICS = {
    "command": "cmd_vel",
    "voltage": "voltages",
    "pose": "ground_truth",
    "odom": "odom",
    "imu": "imu",
    "scan": "scan",
    "battery": "battery",
    "temperature": "temperature",
}
SCRIPTED = "/experiment_vel"  # the command where there is no cmd_vel: critic experiment's
PutAside = Callable[[FloatArray, FloatArray | None], int]
# Stamps and times of receipt further apart than this do not come from one clock [s].
CLOCK_TOLERANCE = 1.0


def read_bag_run(
    path: Path,
    meta: Meta,
    faults: Faults,
    put_aside: PutAside | None = None,
    topics: Mapping[str, Topic] | None = None,
) -> Run:
    """Read the topics of a bag that meta names, by default name or by name of a covariate, its frames and its wheels.

    put_aside: takes the ranges and the intensities of each scan and returns their number, which the run's scan then has
    for its only column; None: it has the ranges. topics: what read_bag_topics returned, if it was called before.
    A message's time is its header's stamp, or where it has none, when the bag received it.
    Raise Error naming file, topic and type for what cannot be read.
    """
    wanted = wanted_of(path, meta, faults)
    read = read_bag_topics(path, meta, put_aside) if topics is None else topics
    found = {part: read[topic] for part, topic in wanted.items() if topic in read}
    if "command" not in found and SCRIPTED in read:
        found["command"] = read[SCRIPTED]
    _name_absent(path, sorted(set(_parts(meta.topics)) & set(wanted) - set(found)), wanted, faults)
    _check_clocks(path.name, {part: topic for part, topic in found.items() if part != "imu"}, faults)
    series: dict[str, Series | None] = {}
    fan, covariates = None, {}
    for part, topic in found.items():
        where = f"{path.name} {topic.name}"
        keep = _last_of_each_time(where, topic, faults)
        if part == "scan":
            series["scan"], fan = _scan(where, topic, keep, faults, aside=put_aside is not None)
        elif part in PARTS:
            columns, rows = _said(part, topic, keep)
            table = Table(where, topic.times()[keep], rows, columns, "message", 1)
            series[part] = clean_part(part, table, faults)
        else:
            covariates.update(_covariates(part, where, topic, keep, faults))
    lost = _work_out(path, meta, series, faults)
    return replace(run_of_parts(bag_name(path), series, covariates), fan=fan, aside=lost)


def _name_absent(path: Path, absent: Sequence[str], wanted: dict[str, str], faults: Faults) -> None:
    """Note topics of meta.yaml that are not there, with those that could serve in their place."""
    found = survey(path) if absent else []
    for part in absent:
        fitting = [topic for topic in found if part in topic.serves and topic.name not in wanted.values()]
        words = f"there are: {listed(fitting)}" if fitting else hint(wanted[part], [topic.name for topic in found])
        faults.add(f"{path.name}: there is no topic {wanted[part]}; {words}")


def _work_out(path: Path, meta: Meta, series: dict[str, Series | None], faults: Faults) -> Spans:
    """Add the parts that no topic has as they are: the reference out of tf, and odometry out of wheels.

    Return the spans of time [s] in which the wheels do not tell what was driven.
    """
    lost: Spans = ()
    if meta.frames is not None:
        where = f"{path.name} tf {meta.frames[1]} in {meta.frames[0]}"
        t, rows = read_frame(path, *meta.frames)
        series["pose"] = clean(Table(where, t, rows, COLUMNS[:3], "transform", 1), faults)
    if meta.wheels is not None:
        odom, lost = read_wheels(path, meta.wheels, faults)
        table = Table(f"{path.name} wheels", odom.t, odom.values, odom.columns, "message", 1)
        series["odom"] = clean(table, faults)
    return lost


def _said(part: str, topic: Topic, keep: IntArray) -> tuple[tuple[str, ...], FloatArray]:
    """Return the columns that the messages of a part have, and their rows, (n, columns)."""
    rows = topic.rows()[keep]
    if topic.type == messages.FIX:
        rows = _east_and_north(rows)
    # Fields at 0 throughout were not filled in.
    needed = {"voltage": 2, "odom": 3, "imu": 3}.get(part, rows.shape[1])
    if not np.nan_to_num(rows[:, needed:]).any():
        rows = rows[:, :needed]
    names = IMU[-1] if part == "imu" else (*REQUIRED[part], *OPTIONAL.get(part, ()))
    return names[: rows.shape[1]], rows


def _east_and_north(fixes: FloatArray) -> FloatArray:
    """Return metres east and north of the first fix, (n, 2), of latitudes and longitudes (n, 2) [rad].

    Along the ellipsoid WGS 84 at that latitude: a kilometre from there, a heading is off by less than 2e-4 rad.
    """
    known = fixes[np.isfinite(fixes).all(axis=1)]
    if not len(known):
        return fixes
    latitude, longitude = known[0]
    a, square = 6378137.0, 6.69437999014e-3
    bend = 1 - square * np.sin(latitude) ** 2
    east = a / np.sqrt(bend) * np.cos(latitude) * wrap(fixes[:, 1] - longitude)
    north = a * (1 - square) / bend**1.5 * (fixes[:, 0] - latitude)
    return np.stack([east, north], axis=1)


def read_bag_topics(
    path: Path, meta: Meta, put_aside: PutAside | None = None, also: Collection[str] = ()
) -> dict[str, Topic]:
    """Read the topics of a bag that meta names, and of others only their times, by absolute topic.

    put_aside: as read_bag_run has it. Raise Error naming file, topic and type for what cannot be read.
    """
    wanted = wanted_of(path, meta)
    shared = [topic for topic in wanted.values() if list(wanted.values()).count(topic) > 1]
    if shared:
        raise Error(f"topics: {shared[0]} is assigned to two parts of a run")

    def converter(part: str, kind: str) -> Convert:
        convert = messages.converter(part, kind)
        if part == "scan" and put_aside is not None:
            return lambda message: _aside(convert(message), put_aside)
        return convert

    def of_script(kind: str) -> Convert:
        return messages.converter("command", kind) if "command" in serves_as(kind) else lambda _: None

    times = dict.fromkeys(also, lambda _: lambda _: ())
    parts = {topic: partial(converter, part) for part, topic in wanted.items()}
    return read_topics(path, {**times, SCRIPTED: of_script, **parts})


def wanted_of(path: Path, meta: Meta, faults: Faults | None = None) -> dict[str, str]:
    """Return the absolute topic of each part and covariate that is read of a bag.

    The only Imu is that of the robot, whatever it is called; faults is told of several, of which none is taken.
    """
    own = _own(meta)
    if "imu" in _parts(meta.topics) and meta.imu != UNUSED:
        return own
    usual = own.pop("imu")
    found = [] if meta.imu == UNUSED else survey(path)
    some = [topic for topic in found if "imu" in topic.serves and topic.count and topic.name not in own.values()]
    chosen = some if len(some) == 1 else [topic for topic in some if topic.name == usual]
    if chosen:
        return {**own, "imu": chosen[0].name}
    if some and faults is not None:
        one = f"topics: {_yaml({**meta.topics, 'imu': some[0].name})}"
        which = "which imu is the robot's is not said, so none is used"
        faults.add(f"{path.name}: {which}: meta.yaml could say {one}; there are: {listed(some)}")
    return own


def _aside(row: ScanRow, put_aside: PutAside) -> ScanRow:
    return row._replace(ranges=np.array([put_aside(row.ranges, row.intensities)], dtype=np.float64), intensities=None)


def inventory(path: Path, meta: Meta) -> str:
    """Return in words what could be mapped in meta.yaml, and the topics that a bag has."""
    found = survey(path)
    return "; ".join(
        [*(f"meta.yaml could say {words}" for words in mappings(found, meta)), f"{path.name} has {listed(found)}"]
    )


def mappings(found: Sequence[Found], meta: Meta) -> list[str]:
    """Return what meta.yaml could say so that more of a bag's topics are used, ready to paste."""
    own = _own(meta)
    proposed = {TOPICS[part]: topic for part, topic in proposal(found, own).items()}
    words = [f"topics: {_yaml({**meta.topics, **proposed})}"] if proposed else []
    names = {topic.name for topic in found}
    if TRANSFORMS[0] in names and "pose" in own and own["pose"] not in names:
        words.append("reference: {tf: [map, base_link]}")
    joints = [topic.name for topic in found if topic.type == shown(JOINTS)]
    if joints and "odom" in own and own["odom"] not in names:
        words.append(f"wheels: {{topic: {joints[0]}, left: JOINT, right: JOINT, radius: METRES, track: METRES}}")
    return words


def _own(meta: Meta) -> dict[str, str]:
    """Return the absolute topic of each part and covariate that is read from one."""
    own = resolve(meta.topics)
    if meta.frames is not None:
        del own["pose"]
    if meta.wheels is not None:
        del own["odom"]
    return own


def _yaml(mapping: dict[str, str]) -> str:
    """Return topics by name as YAML has it, in one line."""
    return f"{{{', '.join(f'{key}: {topic}' for key, topic in mapping.items())}}}"


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


def _last_of_each_time(where: str, topic: Topic, faults: Faults) -> IntArray:
    """Return which messages count, (n,); of a topic without stamps, the last for each time of receipt.

    The clock of receipt has ticks, those of a simulation or of a replay coarse ones: what comes within one is no copy.
    """
    received = np.sort(np.asarray(topic.received))
    if any(topic.stamps):
        return np.arange(len(received))
    keep = np.flatnonzero(np.r_[received[1:] != received[:-1], True])
    dropped = len(received) - len(keep)
    if dropped:
        are = "message was" if dropped == 1 else "messages were"
        faults.add(f"{where}: {dropped} {are} dropped: a later one has the same time of receipt")
    return keep


def _scan(where: str, topic: Topic, keep: IntArray, faults: Faults, *, aside: bool) -> tuple[Series | None, Fan | None]:
    scans = [topic.scans[i] for i in topic.order()[keep]]
    fan = scans[0].fan
    alike = [i for i, scan in enumerate(scans) if scan.fan == fan]
    if len(alike) < len(scans):
        faults.add(f"{where}: {len(scans) - len(alike)} scans dropped: their angles differ from those of the first")
    ranges = np.stack([scans[i].ranges for i in alike])
    columns = ("row",) if aside else tuple(f"r{i}" for i in range(fan.beams))
    times = topic.times()[keep][alike]
    return clean(Table(where, times, ranges, columns, "scan", 1), faults, ranges=not aside), fan


def _covariates(name: str, where: str, topic: Topic, keep: IntArray, faults: Faults) -> dict[str, Series]:
    if not topic.columns:
        raise Error(f"{where}: {topic.type} has no numeric field, so it cannot be a covariate")
    t, rows = topic.times()[keep], topic.rows()[keep]
    covariates = {}
    for key, values in zip(topic.columns, rows.T, strict=True):
        # A driver that does not measure a field leaves it at 0 or nan.
        if key and not np.nan_to_num(values).any():
            continue
        column = f"{name}.{key}" if key else name
        series = clean(Table(where, t, values[:, None], (column,), "message", 1), faults)
        if series is not None:
            covariates[column] = series
    return covariates
