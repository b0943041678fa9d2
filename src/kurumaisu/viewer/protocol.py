# SPDX-License-Identifier: BSD-3-Clause
"""What the server tells a page: text is JSON, numbers are SI and radians; scans and particles are binary."""

from __future__ import annotations

import dataclasses
import json
import math
import struct
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

VERSION = 1

Pose = tuple[float, float, float]  # x, y [m], heading [rad]
Kind = Literal["robot", "obstacle", "person", "wall"]
Point = tuple[float, float]
Segment = tuple[float, float, float, float]  # x, y [m] of both ends
Ranger = tuple[int, int]  # a robot's place in World.bodies, -1: no robot's; and which of its rangers

_SCAN, _PARTICLES = 1, 2
_HAS_ERROR, _HAS_INTENSITIES = 1, 2
_NO_BODY = 0xFFFF
_MOST = 0xFFFF  # count is 16 bits wide
_HEAD = struct.Struct("<BBHHH")  # kind, flags, count, body, which of its rangers
_FAN = struct.Struct("<7f")


@dataclass(frozen=True)
class Hello:
    """Says who serves what: mode sim, robot or bag; whether this client may command; limits: v, w of a full stick."""

    title: str
    mode: str
    control: bool
    abilities: tuple[str, ...]
    limits: Mapping[str, float] | None
    session: str | None = None  # only after a token
    report: str | None = None  # address of the critic's report, if there is one
    new_token: str | None = None  # command that prints an address with a token
    open: tuple[str, ...] = ()  # commands that need no control
    version: int = VERSION


@dataclass(frozen=True)
class Body:
    """A thing of the world: outlines in its own frame [m]; what is no polygon, as a bitmap, has segments.

    drivable: `drive` takes its id.
    """

    id: str
    name: str
    kind: Kind
    color: str  # #rrggbb
    movable: bool
    polygons: tuple[tuple[Point, ...], ...] = ()
    segments: tuple[Segment, ...] = ()
    drivable: bool = False


@dataclass(frozen=True)
class World:
    """All bodies, walls too; bounds: smallest x, y, largest x, y [m], or None where nothing is known.

    chair: id of the body that truth, odometry and estimate are about; None: the first robot.
    """

    bodies: tuple[Body, ...]
    bounds: tuple[float, float, float, float] | None
    chair: str | None = None


@dataclass(frozen=True)
class MapPicture:
    """Where the picture of a map lies: origin of its lower left corner, resolution [m] a pixel."""

    number: int
    url: str
    width: int
    height: int
    resolution: float
    origin: Pose


@dataclass(frozen=True)
class Estimate:
    """Where the robot believes to be; covariance: xx, xy, yy [m^2], aa [rad^2], None: it does not say."""

    pose: Pose
    covariance: tuple[float, float, float, float] | None


@dataclass(frozen=True)
class Note:
    """Something that a person should know; level: info, warning or error."""

    level: str
    text: str


@dataclass(frozen=True)
class Goal:
    """Where a robot is to go; body: which one the viewer drove there, driving: and does; text: how that stands."""

    pose: Pose
    body: str | None = None
    driving: bool = False
    text: str = ""


@dataclass(frozen=True)
class PlaybackState:
    """Where a recording is: times [s] by the run's own clock, rate: recorded seconds per second; run: one of runs."""

    begin: float
    end: float
    t: float
    rate: float
    playing: bool
    run: str = ""
    runs: tuple[str, ...] = ()


@dataclass(frozen=True)
class State:
    """A moment: t of the simulation or recording, wall: of the server's clock [s]; None: not known here.

    rtf: simulated seconds per second, speed: those that are wanted, 0: as many as possible; hit: bodies that something
    keeps from moving; contacts: how often that has begun, by body, so that none between two moments is missed; odom:
    in the world's frame; v [m/s], w [rad/s]: as they are; commanded: as asked for; volts: forward and steering, from
    neutral [V]; starting: a bag was begun that receives nothing yet; seed: of this run.
    """

    t: float
    wall: float
    rtf: float | None = None
    speed: float | None = None
    paused: bool = False
    poses: Mapping[str, Pose] = dataclasses.field(default_factory=dict)
    hit: tuple[str, ...] = ()
    contacts: Mapping[str, int] = dataclasses.field(default_factory=dict)
    truth: Pose | None = None
    odom: Pose | None = None
    estimate: Estimate | None = None
    v: float | None = None
    w: float | None = None
    commanded: tuple[float, float] | None = None
    volts: tuple[float, float] | None = None
    estop: bool | None = None
    recording: str | None = None
    starting: bool = False
    seed: int | None = None
    notes: tuple[Note, ...] = ()
    playback: PlaybackState | None = None
    driver: str | None = None  # the input that drives
    goal: Goal | None = None


@dataclass(frozen=True)
class Line:
    """A way from above, whole: points [m], None where it is torn; body: whose, as truth, odom or a body's id."""

    body: str
    points: tuple[Point | None, ...]


@dataclass(frozen=True)
class Paths:
    """The ways of a recorded run, before and after the moment that is shown."""

    run: str
    lines: tuple[Line, ...]


@dataclass(frozen=True)
class Value:
    """A parameter of an effect, as a slider needs it; neutral: with it nothing happens; typical: with it something."""

    name: str
    description: str
    unit: str
    min: float
    max: float
    value: float
    neutral: float | None = None
    typical: float | None = None


@dataclass(frozen=True)
class Group:
    """An effect with its switch."""

    id: str
    title: str
    enabled: bool
    parameters: tuple[Value, ...]


@dataclass(frozen=True)
class Effects:
    """All effects that there are."""

    groups: tuple[Group, ...]


@dataclass(frozen=True)
class Reply:
    """The answer to a command; id: the one that the page gave it."""

    id: int | str | None
    ok: bool
    message: str
    result: str | None = None


@dataclass(frozen=True)
class Fan:
    """A scan: pose of the sensor in the world, ranges (n,) [m], NaN and infinite as they are.

    error (n,): range minus true range [m], NaN unknown; intensities (n,).
    """

    pose: Pose
    angle_min: float
    angle_increment: float
    range_min: float
    range_max: float
    ranges: ArrayLike
    error: ArrayLike | None = None
    intensities: ArrayLike | None = None


_TYPES: dict[type, str] = {
    Hello: "hello",
    World: "world",
    MapPicture: "map",
    State: "state",
    Effects: "effects",
    Paths: "paths",
    Reply: "reply",
}
_RENAMED = {"begin": "from", "end": "to"}  # `from` is a word of Python
Text = Hello | World | MapPicture | State | Effects | Paths | Reply


def text(message: Text) -> str:
    """Return a message as JSON; numbers that are none become null, as JSON has no others."""
    content = {"type": _TYPES[type(message)], **_plain(message)}
    return json.dumps(content, allow_nan=False, separators=(",", ":"))


def scan(fan: Fan, ranger: Ranger) -> bytes:
    """Return a scan in binary."""
    ranges = _floats(fan.ranges)
    flags, parts = 0, [ranges]
    for bit, further in ((_HAS_ERROR, fan.error), (_HAS_INTENSITIES, fan.intensities)):
        if further is not None:
            flags |= bit
            parts.append(_floats(further))
    if any(len(part) != len(ranges) for part in parts):
        raise ValueError(f"a scan's rows must be equally long: {[len(part) for part in parts]}")
    head = _head(_SCAN, flags, len(ranges), ranger)
    fixed = _FAN.pack(*fan.pose, fan.angle_min, fan.angle_increment, fan.range_min, fan.range_max)
    return b"".join([head, fixed, *(part.tobytes() for part in parts)])


def particles(poses: ArrayLike) -> bytes:
    """Return particles (n, 3) of x, y [m], heading [rad] in binary; of more than 65535 every k-th is shown."""
    rows = np.asarray(poses, dtype="<f4").reshape(-1, 3)
    rows = rows[:: max(1, math.ceil(len(rows) / _MOST))]
    return _head(_PARTICLES, 0, len(rows), (-1, 0)) + rows.tobytes()


def _head(kind: int, flags: int, count: int, ranger: Ranger) -> bytes:
    if count > _MOST:
        raise ValueError(f"{count} values: there is room for {_MOST}")
    body, number = ranger
    return _HEAD.pack(kind, flags, count, _NO_BODY if body < 0 else body, number)


def _floats(values: ArrayLike) -> NDArray[np.float32]:
    return np.asarray(values, dtype="<f4").reshape(-1)


def _plain(value: Any) -> Any:
    """Return a value as JSON can have it."""
    if dataclasses.is_dataclass(value):
        names = _RENAMED if isinstance(value, PlaybackState) else {}
        return {names.get(name, name): _plain(inner) for name, inner in vars(value).items()}
    if isinstance(value, Mapping):
        return {str(key): _plain(inner) for key, inner in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(inner) for inner in value]
    if isinstance(value, (np.floating, float)):
        return float(value) if math.isfinite(value) else None
    return int(value) if isinstance(value, np.integer) else value
