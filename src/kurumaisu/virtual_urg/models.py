# SPDX-License-Identifier: BSD-3-Clause
"""What sensors are: launch/urg/*.yaml."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from kurumaisu import settings
from kurumaisu._core import UrgCodes, UrgModel
from kurumaisu.errors import Error
from kurumaisu.names import hint
from kurumaisu.params import shipped
from kurumaisu.types import FloatArray

_FOLDER = "launch/urg"
_TEXTS = ("name", "laser_on", "laser_off", "idle", "measuring", "healthy", "ill")


@dataclass(frozen=True)
class Sensor:
    """A kind of sensor: the core's model of it, and its fan.

    Steps count counter-clockwise from the rear; a measurement has those from first to last.
    """

    path: Path
    model: UrgModel
    first: int
    last: int
    front: int
    steps_per_turn: int
    scan_time: float  # [s] of a turn
    range_min: float  # [m]
    range_max: float  # [m]

    @property
    def steps(self) -> int:
        """Readings in a measurement."""
        return self.last - self.first + 1

    @property
    def increment(self) -> float:
        """Angle from step to step [rad]."""
        return 2 * np.pi / self.steps_per_turn

    @property
    def step_time(self) -> float:
        """Time from step to step [s]."""
        return self.scan_time / self.steps_per_turn

    @property
    def bearings(self) -> FloatArray:
        """Angles of the steps (steps,), counter-clockwise from the front [rad]."""
        return (np.arange(self.first, self.last + 1) - self.front) * self.increment


def sensor_names() -> list[str]:
    """Return the names of the sensors that are shipped."""
    return sorted(path.stem for path in shipped(_FOLDER).glob("*.yaml"))


def load_sensor(name: str | Path) -> Sensor:
    """Read a sensor that is shipped, by its name, or a file of one. Raise Error naming file and key."""
    if isinstance(name, str) and not name.endswith(".yaml"):
        if name not in sensor_names():
            raise Error(f"sensor: {name!r} is neither a file *.yaml nor a known one; {hint(name, sensor_names())}")
        name = shipped(_FOLDER) / f"{name}.yaml"
    path = Path(name)
    top = settings.load(path)
    model = UrgModel()
    for key in _TEXTS:
        setattr(model, key, top.text(key))
    model.version = _lines(top.section("version"))
    model.version_11 = _lines(top.section("version_11"))
    model.state = _lines(top.section("state"))
    sensor = _fan(path, model, top.section("parameters"))
    model.refused = dict(_lines(top.section("refused")))
    model.protocol = top.integer("protocol", at_least=1)
    model.baud = top.integer("baud", at_least=0)
    model.bauds = _bauds(top)
    model.end_step = top.integer("end_step", at_least=1)
    model.codes = _codes(top.section("codes"))
    model.boot_time = top.number("boot_time", at_least=0)
    model.output_delay = top.number("output_delay", at_least=0)
    model.bad_serial_sum = top.flag("bad_serial_sum")
    top.end()
    return sensor


def _lines(section: settings.Section) -> list[tuple[str, str]]:
    return [(key, section.text(key)) for key in section.names()]


def _fan(path: Path, model: UrgModel, section: settings.Section) -> Sensor:
    """Return the sensor that PP tells of; its lines go into the model in their order."""
    order = section.names()
    least = {"DMIN": 0, "DMAX": 1, "ARES": 1, "AMIN": 0, "AMAX": 0, "AFRT": 0, "SCAN": 1}
    number = {key: section.integer(key, at_least) for key, at_least in least.items()}
    texts = {"MODL": section.text("MODL"), **{key: str(value) for key, value in number.items()}}
    section.end()
    if number["AMAX"] < number["AMIN"]:
        raise section.error("AMAX", f"must not be below AMIN = {number['AMIN']}: {number['AMAX']}")
    model.parameters = [(key, texts[key]) for key in order]
    return Sensor(
        path=path,
        model=model,
        first=number["AMIN"],
        last=number["AMAX"],
        front=number["AFRT"],
        steps_per_turn=number["ARES"],
        scan_time=60 / number["SCAN"],
        range_min=number["DMIN"] / 1000,
        range_max=number["DMAX"] / 1000,
    )


def _bauds(section: settings.Section) -> list[int]:
    value = section.take("bauds")
    if not isinstance(value, list) or not all(type(item) is int and item > 0 for item in value):
        raise section.error("bauds", f"must be a list of integers above 0: {value!r}")
    return value


def _codes(section: settings.Section) -> UrgCodes:
    codes = UrgCodes()
    for name in ("no_return", "error", "too_near", "outside"):
        setattr(codes, name, section.integer(name, at_least=0))
    section.end()
    return codes
