# SPDX-License-Identifier: BSD-3-Clause
"""meta.yaml of a recording: every key may be left out, none may be misspelt."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

from kurumaisu import settings
from kurumaisu.critic.data.clean import Faults
from kurumaisu.critic.data.odometry import Wheels
from kurumaisu.critic.rates.yaw_rate import AXES, UNUSED
from kurumaisu.critic.values.recording import LaserMount, Recording, Run
from kurumaisu.errors import Error, told
from kurumaisu.params import MOST_BEAMS, Robot, robot_of, shipped


@dataclass(frozen=True)
class Meta:
    """What meta.yaml says. train, test: names of runs, empty where left out; topics: topic of each part.

    frames: of tf, the reference is where the second is in the first; command_hold [s]: for how long a command holds,
    None: until the next. imu: which axis of it is up, or UNUSED. notes: what was overridden, in words.
    """

    model: Path | None = None
    world: Path | None = None
    laser: LaserMount | None = None
    truth: tuple[float, float] | None = None
    train: tuple[str, ...] = ()
    test: tuple[str, ...] = ()
    topics: dict[str, str] = field(default_factory=dict)
    frames: tuple[str, str] | None = None
    wheels: Wheels | None = None
    command_hold: float | None = None
    robot: Robot | None = None
    imu: str | None = None
    notes: tuple[str, ...] = ()


def recording_of_meta(
    name: str, runs: Sequence[Run], meta: Meta, faults: Faults, *, train: tuple[str, ...], test: tuple[str, ...]
) -> Recording:
    """Return runs with what meta.yaml says of them; train, test: names of runs; faults: what was found wrong."""
    return Recording(
        name=name,
        runs=tuple(runs),
        train=train,
        test=test,
        model=meta.model,
        world=meta.world,
        laser=meta.laser,
        truth=meta.truth,
        robot=meta.robot,
        problems=(*meta.notes, *faults.notes),
        invalid=tuple(faults.invalid),
    )


def read_meta(path: Path, robot: Robot | None = None) -> Meta:
    """Read meta.yaml; a file named in it lies beside it. A model may also be one of the package's own.

    robot: holds in place of the one that it names. Raise Error naming file and key.
    """
    top = settings.load(path)
    own = robot_of(top, path.parent) if "robot" in top else None
    notes = () if robot is None or own in (None, robot) else (_overridden(path.name, own, robot),)
    robot = robot or own
    meta = Meta(
        model=_file(top, "model", path.parent, "launch") if "model" in top else None,
        world=_file(top, "world", path.parent, "") if "world" in top else None,
        laser=_laser(top.section("laser")) if "laser" in top else None,
        truth=_truth(top.section("truth")) if "truth" in top else None,
        train=_names(top, "train") if "train" in top else (),
        test=_names(top, "test") if "test" in top else (),
        topics=_topics(top.section("topics")) if "topics" in top else {},
        frames=_frames(top.section("reference")) if "reference" in top else None,
        wheels=_wheels(top.section("wheels"), robot) if "wheels" in top else None,
        command_hold=top.number("command_hold", above=0) if "command_hold" in top else None,
        robot=robot,
        imu=_imu(top.section("imu")) if "imu" in top else None,
        notes=notes,
    )
    top.end()
    both = sorted(set(meta.train) & set(meta.test))
    if both:
        raise top.error("test", f"{told(both[0])} is in train too: a run that was fitted cannot judge")
    return meta


def _overridden(name: str, own: Robot, robot: Robot) -> str:
    said = (", ".join(f"{key}: {value}" for key, value in each.said.items()) for each in (own, robot))
    return "{}: robot: {{{}}}: the command line says {{{}}}, which holds".format(name, *said)


def _file(top: settings.Section, key: str, folder: Path, package_folder: str) -> Path:
    name = top.text(key)
    path = folder / name
    try:
        if path.is_file():
            if any(
                place.resolve() in path.resolve().parents for place in (folder, shipped("launch"), shipped("worlds"))
            ):
                return path
            raise top.error(key, f"must be in the recording's folder, or a file of the package: {told(str(path))}")
    except (OSError, ValueError, RuntimeError):  # a name too long, or with a null byte; a loop of links
        raise top.error(key, f"is not a file: {told(str(path))}") from None
    if package_folder and Path(name).name == name:
        try:
            return shipped(f"{package_folder}/{name}")
        except Error:
            pass
    raise top.error(key, f"is not a file: {told(str(path))}")


def _laser(section: settings.Section) -> LaserMount:
    numbers = {name: section.number(name) for name in ("x", "y", "yaw", "angle_min", "angle_increment")}
    beams = section.integer("beams", at_least=1, at_most=MOST_BEAMS)
    time = section.number("time_increment", at_least=0.0) if "time_increment" in section else None
    laser = LaserMount(**numbers, beams=beams, time_increment=time)
    section.end()
    return laser


def _truth(section: settings.Section) -> tuple[float, float]:
    truth = section.number("position_sd", at_least=0), section.number("heading_sd", at_least=0)
    section.end()
    return truth


def _imu(section: settings.Section) -> str:
    axis = section.text("axis", (*AXES, UNUSED))
    section.end()
    return axis


def _names(top: settings.Section, key: str) -> tuple[str, ...]:
    names = top.take(key)
    if not isinstance(names, list) or not all(isinstance(name, str) and name for name in names):
        raise top.error(key, f"must be a list of names of runs: {told(names)}")
    twice = [name for name in names if names.count(name) > 1]
    if twice:
        raise top.error(key, f"{told(twice[0])} is listed twice")
    return tuple(names)


def _topics(section: settings.Section) -> dict[str, str]:
    return {name: section.text(name) for name in section.names()}


def _frames(section: settings.Section) -> tuple[str, str]:
    frames = section.take("tf")
    if not isinstance(frames, list) or len(frames) != 2 or not all(isinstance(name, str) and name for name in frames):
        raise section.error("tf", f"must be two frames, as in [map, base_link]: {told(frames)}")
    section.end()
    return frames[0].lstrip("/"), frames[1].lstrip("/")


def _wheels(section: settings.Section, robot: Robot | None) -> Wheels:
    topic = section.text("topic") if "topic" in section else ""
    sides = []
    for side in ("left", "right"):
        given = section.take(side)
        names = given if isinstance(given, list) else [given]
        if not names or not all(isinstance(name, str) and name for name in names):
            raise section.error(side, f"must be the name of a joint, or a list of them: {told(given)}")
        sides.append(tuple(names))
    # What is said of the robot need not be said again.
    known = {} if robot is None or robot.radius is None or robot.track is None else vars(robot)
    radius, track = (
        section.number(key, above=0) if key in section or not known else float(known[key])
        for key in ("radius", "track")
    )
    wheels = Wheels(sides[0], sides[1], radius, track, topic, known.get("ticks_per_turn"))
    section.end()
    return wheels
