# SPDX-License-Identifier: BSD-3-Clause
"""The model file (launch/md100.yaml): what the chair is."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from kurumaisu import settings
from kurumaisu._core import AxisLaw, Branch, LaserError
from kurumaisu.errors import Error, told
from kurumaisu.names import hint, nearest
from kurumaisu.types import FloatArray

MOST_BEAMS = 100_000  # of a laser
CHAIR, FOLLOWER = "md100", "velocity"  # robots that are taken where no file names one
_ROBOTS = "launch/robots"
IDENTITY = "identity"  # the voltage law of a robot that has no voltages


@dataclass(frozen=True)
class Chassis:
    """Footprint of the chair: metres, kilograms; base_link lies between the drive wheels, x forward."""

    length: float
    width: float
    height: float
    axle_to_front: float
    track: float
    mass: float


@dataclass(frozen=True)
class Mount:
    """base_from_laser: metres, radians."""

    x: float
    y: float
    z: float
    yaw: float


@dataclass(frozen=True)
class Laser:
    """Fan, timing and error of the laser: radians, seconds."""

    frame: str
    mount: Mount
    angle_min: float
    angle_increment: float
    beams: int
    scan_time: float
    time_increment: float
    error: LaserError
    range_min: float
    range_max: float

    @property
    def bearings(self) -> FloatArray:
        """Angles of the beams in the laser frame, (beams,) [rad]."""
        return self.angle_min + self.angle_increment * np.arange(self.beams)


@dataclass(frozen=True)
class Channel:
    """What a channel of the D/A converter can put out: volts, and volts per code (0: not rounded)."""

    min: float
    max: float
    resolution: float


@dataclass(frozen=True)
class Voltages:
    """What the joystick's plug can carry; V_f and V_s from neutral. knob: share of their bands that is left."""

    knob: float
    translation: Channel
    steering: Channel


@dataclass(frozen=True)
class EffectSetting:
    """One effect beyond equations (1)-(4): its id and parameters."""

    id: str
    parameters: dict[str, float]


@dataclass(frozen=True)
class Robot:
    """What a robot is driven by.

    kind: its file in launch/robots/; name, noun: what it is, and is called in sentences; voltages: whether it has any;
    radius, track [m]: of its wheels as its software has them, None where it has none or nobody needs to know; skids:
    whether its wheels must when it turns; ticks_per_turn: of a wheel's encoder, where wheels are recorded in ticks;
    fastest: rates that it can be asked for [m/s, rad/s], None: all that scripts ask for.
    """

    kind: str
    name: str
    noun: str
    voltages: bool
    radius: float | None = None
    track: float | None = None
    skids: bool = False
    ticks_per_turn: float | None = None
    fastest: tuple[float, float] | None = None

    @property
    def said(self) -> dict[str, object]:
        """Return what a file says of it."""
        known = {name: getattr(self, name) for name in ("kind", "radius", "track", "ticks_per_turn")}
        fastest = {} if self.fastest is None else {"fastest": dict(zip("vw", self.fastest, strict=True))}
        return {name: value for name, value in known.items() if value is not None} | fastest


@dataclass(frozen=True)
class Model:
    """The chair, or another robot: what the simulator runs and the critic criticises."""

    name: str
    law_name: str
    translation: AxisLaw
    steering: AxisLaw
    reference_voltage: float
    voltages: Voltages
    chassis: Chassis
    laser: Laser
    effects: tuple[EffectSetting, ...]
    robot: Robot


def shipped(name: str) -> Path:
    """Return the path of a file of launch/ or worlds/, in the source tree or installed.

    Raise Error when it is in neither.
    """
    here = Path(__file__).resolve()
    roots = [here.parents[2], *(parent / "share" / "kurumaisu" for parent in here.parents)]
    for root in roots:
        if (root / "package.xml").exists() and (root / name).exists():
            return root / name
    raise Error(f"{name}: is not a file of this package")


def load_model(path: Path) -> Model:
    """Read a model file. Raise Error naming file and key for anything missing, unknown or senseless."""
    return read_model(settings.load(path))


def read_model(top: settings.Section) -> Model:
    """Take all keys of a model. Raise Error as load_model does."""
    laws = top.section("voltage_laws")
    law_name = top.text("voltage_law", choices=laws.names())
    parsed = {name: _voltage_law(laws.section(name)) for name in laws.names()}
    reference = top.number("reference_voltage")
    model = Model(
        name=top.text("name"),
        law_name=law_name,
        translation=parsed[law_name][0],
        steering=parsed[law_name][1],
        reference_voltage=reference,
        voltages=_voltages(top.section("voltages"), reference),
        chassis=_chassis(top.section("chassis")),
        laser=_laser(top.section("laser")),
        effects=effects_of(top),
        robot=robot_of(top) if "robot" in top else shipped_robot(CHAIR),
    )
    top.end()
    return model


def shipped_robot(kind: str) -> Robot:
    """Return a robot of this package of which nothing more need be said. Raise Error if there is none of that name."""
    return _robot(kind, settings.Section({}, kind))


def robot_of(top: settings.Section, folder: Path | None = None) -> Robot:
    """Take the key `robot`: a name of launch/robots/, a mapping with it as its kind, or a file with such a mapping.

    folder: where the file lies; None where no file may be named. Raise Error naming file and key.
    """
    said = top.text_or_section("robot", "kind")
    kind = said.text("kind")
    if folder is not None and kind.endswith(".yaml"):
        said.end()
        if (folder / kind).resolve().parent != folder.resolve():
            raise said.error("kind", f"must be a file in the recording's folder: {told(kind)}")
        said = settings.load(folder / kind)
        kind = said.text("kind")
    return _robot(kind, said)


def robot_called(word: str) -> Robot:
    """Return the robot that the command line says: as robot_of, but files are where it says.

    Raise Error naming the word, or file and key.
    """
    if word.endswith(".yaml"):
        said = settings.load(Path(word))
        return _robot(said.text("kind"), said)
    if word in robot_kinds() and settings.load(shipped(f"{_ROBOTS}/{word}.yaml")).text("driven_by") == "wheels":
        example = f"{{kind: {word}, radius: METRES, track: METRES}}"
        raise Error(f"{word}: its wheels are not known: give a .yaml file that says {example}")
    return _robot(word, settings.Section({}, told(word)))


def robot_kinds() -> list[str]:
    """Return the names of the robots of launch/robots/."""
    return sorted(path.stem for path in shipped(_ROBOTS).glob("*.yaml"))


def _robot(kind: str, said: settings.Section) -> Robot:
    names = robot_kinds()
    if kind not in names:
        near = f"{hint(kind, names)} " if nearest(kind, names) else ""
        raise said.error("kind", f"there is no robot {told(kind)}; {near}there are: {', '.join(names)}")
    file = settings.load(shipped(f"{_ROBOTS}/{kind}.yaml"))
    driven_by = file.text("driven_by", ("voltages", "rates", "wheels"))
    wheels = driven_by == "wheels"
    robot = Robot(
        kind,
        file.text("name"),
        file.text("noun"),
        voltages=driven_by == "voltages",
        radius=said.number("radius", above=0) if wheels else None,
        track=said.number("track", above=0) if wheels else None,
        skids=wheels and file.flag("skids"),
        ticks_per_turn=said.number("ticks_per_turn", above=0) if wheels and "ticks_per_turn" in said else None,
        fastest=_fastest(said.section("fastest")) if "fastest" in said else None,
    )
    for part in (file, said):
        part.end()
    return robot


def _fastest(section: settings.Section) -> tuple[float, float]:
    rates = section.number("v", above=0), section.number("w", above=0)
    section.end()
    return rates


def effects_of(section: settings.Section) -> tuple[EffectSetting, ...]:
    """Take a section's required list `effects: [{id: ..., parameters: {...}}]`. Raise Error naming file and key."""
    return tuple(_effect(item) for item in section.items("effects"))


def _effect(item: settings.Section) -> EffectSetting:
    parameters = item.section("parameters")
    setting = EffectSetting(item.text("id"), {name: parameters.number(name) for name in parameters.names()})
    item.end()
    return setting


def _voltage_law(law: settings.Section) -> tuple[AxisLaw, AxisLaw]:
    axes = _axis(law.section("translation")), _axis(law.section("steering"))
    law.end()
    return axes


def _axis(axis: settings.Section) -> AxisLaw:
    branches = []
    for side in ("positive", "negative"):
        branch = axis.section(side)
        branches.append(Branch(branch.number("slope"), branch.number("intercept")))
        branch.end()
    axis.end()
    try:
        return AxisLaw(*branches)
    except ValueError as error:
        raise axis.error("", str(error)) from error


def _voltages(section: settings.Section, reference: float) -> Voltages:
    knob = section.number("knob", above=0)
    voltages = Voltages(knob, _channel(section.section("translation")), _channel(section.section("steering")))
    band = section.section("reference")
    low, high = band.number("min"), band.number("max")
    for part in (band, section):
        part.end()
    if knob > 1:
        raise section.error("knob", f"must be at most 1: {knob}")
    if not low <= reference <= high:
        raise section.error("reference", f"reference_voltage {reference} V must lie from {low} to {high} V")
    return voltages


def _channel(section: settings.Section) -> Channel:
    channel = Channel(section.number("min"), section.number("max"), section.number("resolution", at_least=0))
    section.end()
    if not channel.min < 0 < channel.max:
        raise section.error("", f"neutral, 0 V, must lie inside its band: min {channel.min}, max {channel.max}")
    return channel


def _chassis(section: settings.Section) -> Chassis:
    names = ("length", "width", "height", "axle_to_front", "track", "mass")
    chassis = Chassis(**{name: section.number(name, above=0) for name in names})
    section.end()
    if chassis.axle_to_front >= chassis.length:
        raise section.error("axle_to_front", f"must be less than length: {chassis.axle_to_front}")
    return chassis


def _laser(section: settings.Section) -> Laser:
    mount = section.section("mount")
    error = section.section("error")
    range_min, range_max = error.number("range_min", at_least=0), error.number("range_max", above=0)
    try:
        law = LaserError(
            scale=error.number("scale"),
            datum_offset=error.number("datum_offset"),
            sigma=error.numbers("sigma", 3),
            resolution=error.number("resolution", at_least=0),
            range_min=range_min,
            range_max=range_max,
        )
    except ValueError as problem:
        raise error.error("", str(problem)) from problem
    laser = Laser(
        frame=section.text("frame"),
        mount=Mount(**{name: mount.number(name) for name in ("x", "y", "z", "yaw")}),
        angle_min=section.number("angle_min"),
        angle_increment=section.number("angle_increment"),
        beams=section.integer("beams", at_least=1, at_most=MOST_BEAMS),
        scan_time=section.number("scan_time", above=0),
        time_increment=section.number("time_increment", at_least=0),
        error=law,
        range_min=range_min,
        range_max=range_max,
    )
    for part in (mount, error, section):
        part.end()
    return laser


def identity_law() -> AxisLaw:
    """Return the law of a robot that has no voltages: 1 V stands for 1 m/s or 1 rad/s, no dead zone."""
    return AxisLaw(Branch(1.0, 0.0), Branch(1.0, 0.0))


def driven_as(model: Model, robot: Robot) -> Model:
    """Return the model of a robot; one without voltages follows its commands: 1 V stands for 1 m/s and 1 rad/s."""
    if robot.voltages:
        return replace(model, robot=robot)
    law = identity_law()
    chassis = model.chassis if robot.track is None else replace(model.chassis, track=robot.track)
    return replace(
        model, name=robot.name, law_name=IDENTITY, translation=law, steering=law, chassis=chassis, robot=robot
    )
