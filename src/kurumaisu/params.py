# SPDX-License-Identifier: BSD-3-Clause
"""The model file (launch/md100.yaml): what the chair is."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from kurumaisu import settings
from kurumaisu._core import AxisLaw, Branch, LaserError
from kurumaisu.errors import Error
from kurumaisu.types import FloatArray

MOST_BEAMS = 100_000  # of a laser


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
class Model:
    """The chair: what the simulator runs and the critic criticises."""

    name: str
    law_name: str
    translation: AxisLaw
    steering: AxisLaw
    reference_voltage: float
    voltages: Voltages
    chassis: Chassis
    laser: Laser
    effects: tuple[EffectSetting, ...]


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
    )
    top.end()
    return model


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


def follow_commands(model: Model) -> Model:
    """Return the model for a robot of another make: 1 V stands for 1 m/s and 1 rad/s, no dead zone."""
    identity = identity_law()
    return replace(model, name="velocity follows command", law_name="identity", translation=identity, steering=identity)
