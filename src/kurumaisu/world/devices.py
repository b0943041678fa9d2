# SPDX-License-Identifier: BSD-3-Clause
"""What typed models do: the properties of positions, rangers and other devices, with Stage's defaults."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from kurumaisu.types import FloatArray
from kurumaisu.world.model import Bumper, Camera, Device, Fan, Fiducial, Gripper, Position, Ranger
from kurumaisu.world.values import Values

_MOST_SAMPLES = 1_000_000  # of one fan; the largest scanners have some thousand
_MOST_PIXELS = 10_000_000  # of a camera
_MOST_STRIPS = 10_000  # of a bumper
_NEAREST = 1e-3  # [m]; a fan that sees less far is a mistake
_QUARTER = math.pi / 2


def device(values: Values) -> Device | None:
    """Return what a model does, by its type. Raise Error with the place of a value that makes no sense."""
    read = _READERS.get(values.entity.type)
    return read(values) if read else None


def _position(values: Values) -> Position:
    limits = (-1.0, 1.0, -1.0, 1.0, -1.0, 1.0, -_QUARTER, _QUARTER)
    wheelbase = values.length("wheelbase", 1.0)
    if wheelbase <= 0:
        raise values.error("wheelbase", f"wheelbase must be above 0, not {wheelbase:g}")

    def four(name: str) -> FloatArray | None:
        return np.array(values.several(name, "llla", ())) if values.has(name) else None

    accelerations = np.reshape(values.several("acceleration_bounds", "llllllaa", limits), (4, 2))
    velocity = four("velocity")
    return Position(
        drive=_one_of(values, "drive", ("diff", "omni", "car")),
        localization=_one_of(values, "localization", ("gps", "odom")),
        localization_origin=four("localization_origin"),
        odom_error=four("odom_error"),
        velocity_bounds=np.reshape(values.several("velocity_bounds", "llllllaa", limits), (4, 2)),
        acceleration_bounds=accelerations if values.has("acceleration_bounds") else None,
        wheelbase=wheelbase,
        velocity=np.zeros(4) if velocity is None else velocity,
    )


def _one_of(values: Values, name: str, words: tuple[str, ...]) -> str:
    """Return one of the words, the first if the file says something else, as Stage does."""
    word = values.text(name, words[0])
    if word in words:
        return word
    given = values.entity.properties[name].name
    values.notes.add(given, f"{name} must be one of {', '.join(words)}, not {word!r}: {words[0]} is used")
    return words[0]


def _ranger(values: Values) -> Ranger:
    sensors = [child for child in values.entity.children if child.type == "sensor"]
    if not sensors:
        values.notes.add(values.entity.name, "a ranger without a sensor measures nothing")
    return Ranger(tuple(_fan(Values(sensor, values.units, values.notes)) for sensor in sensors))


def _fan(values: Values) -> Fan:
    nearest, farthest = values.several("range", "ll", (0.0, 5.0))
    if farthest < _NEAREST or nearest > farthest:
        raise values.error("range", f"range must be [MIN MAX] with MAX of at least {_NEAREST:g} m and not below MIN")
    samples = values.whole("samples", 1)
    if not 1 <= samples <= _MOST_SAMPLES:
        raise values.error("samples", f"samples must be 1 to {_MOST_SAMPLES}, not {samples}")
    return Fan(
        pose=np.array(values.several("pose", "llla", (0.0,) * 4)),
        height=values.several("size", "lll", (0.02,) * 3)[2],
        range_min=nearest,
        range_max=farthest,
        fov=values.angle("fov", 0.1),
        samples=samples,
        noise=np.array(values.several("noise", "lfa", (0.0,) * 3)),
        place=values.entity.name.place,
    )


def _camera(values: Values) -> Camera:
    width, height = (int(value) for value in values.several("resolution", "ff", (32, 32)))
    if width < 1 or height < 1 or width * height > _MOST_PIXELS:
        raise values.error("resolution", f"resolution must be of 1 to {_MOST_PIXELS} pixels, not {width} x {height}")
    horizontal, vertical = values.several("fov", "ff", (70.0, 40.0))  # degrees, whatever unit_angle says
    if not (0 < horizontal < 180 and 0 < vertical < 180):
        raise values.error("fov", f"fov must be above 0 and below 180 degrees, not {horizontal:g}, {vertical:g}")
    near, far = values.several("range", "ll", (0.2, 8.0))
    if not 0 < near < far:
        raise values.error("range", f"range must be above 0 and ascending, not {near:g}, {far:g}")
    pan, tilt = values.several("pantilt", "ff", (0.0, 0.0))
    angles = (math.radians(angle) for angle in (horizontal, vertical, pan, tilt))
    horizontal, vertical, pan, tilt = angles
    return Camera(width, height, horizontal, vertical, near, far, pan, tilt)


def _fiducial(values: Values) -> Fiducial:
    return Fiducial(
        range_min=values.length("range_min", 0.0),
        range_max=values.length("range_max", 8.0),
        range_max_id=values.length("range_max_id", 5.0),
        fov=values.angle("fov", math.pi),
        ignore_zloc=values.whole("ignore_zloc", 0) != 0,
        key=values.whole("fiducial_key", 0),
    )


def _bumper(values: Values) -> Bumper:
    count = values.whole("bcount", 0)
    if not 0 <= count <= _MOST_STRIPS:
        raise values.error("bcount", f"bcount must be 0 to {_MOST_STRIPS}, not {count}")
    common = values.length("blength", 0.0)
    poses = [values.several(f"bpose[{i}]", "llla", (0.0,) * 4) for i in range(count)]
    lengths = [values.length(f"blength[{i}]", common) for i in range(count)]
    return Bumper(np.array(poses, dtype=np.float64).reshape(-1, 4), np.array(lengths, dtype=np.float64))


def _gripper(values: Values) -> Gripper:
    size = np.array(values.several("paddle_size", "lll", (0.66, 0.1, 0.4)))
    if (size <= 0).any() or (size > (1, 0.5, 1)).any():
        raise values.error("paddle_size", "paddle_size must be shares of the gripper's size: up to 1, 0.5 and 1")
    state = values.entity.properties.get("paddle_state")
    if state and len(state.values) < 2:
        raise state.name.error("paddle_state needs 2 strings: open or closed, up or down")
    return Gripper(size, values.text("paddle_state", "open") != "closed", values.whole("autosnatch", 0) != 0)


_READERS: dict[str, Callable[[Values], Device]] = {
    "position": _position,
    "ranger": _ranger,
    "camera": _camera,
    "fiducial": _fiducial,
    "bumper": _bumper,
    "gripper": _gripper,
}
