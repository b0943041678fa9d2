# SPDX-License-Identifier: BSD-3-Clause
"""Private parameters of stageros, laid over launch/stageros.yaml."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from kurumaisu import settings
from kurumaisu.errors import Error
from kurumaisu.names import nearest
from kurumaisu.params import shipped
from kurumaisu.ros.stageros.rates import PublishRates, read_rates
from kurumaisu.settings import Section
from kurumaisu.sim.options import Options, read_options
from kurumaisu.sim.robots.state_folder import StateFolder


@dataclass(frozen=True)
class Frames:
    """The last part of the frames' names."""

    odom: str
    base_footprint: str
    base_link: str
    base_laser_link: str
    base_sonar_link: str
    camera: str
    ground_truth: str


@dataclass(frozen=True)
class StagerosSettings:
    """What stageros needs to know; see launch/stageros.yaml for units and meaning."""

    watchdog_timeout: float
    depth_canonical: bool
    frames: Frames
    strip_leading_slash: bool
    relative_topics: bool
    robot_prefix: str
    publish_tf: bool
    set_child_frame_id: bool
    pose_variances: tuple[float, ...]
    twist_variances: tuple[float, ...]
    scan_timing: bool
    all_sensors: bool
    sonar_as_range: bool
    publish_collision: bool
    publish_devices: tuple[str, ...]  # types of models: bumper, fiducial
    rates: PublishRates
    view_rate: float
    states: StateFolder
    headless_rate: float
    seed: int
    options: Options
    image_extents: bool
    parameters: dict[str, Any]
    unknown: tuple[str, ...]  # parameters nobody reads, in words; stage_ros starts with them, too


def read_settings(values: Any, where: str) -> StagerosSettings:
    """Return the settings of a parameter tree over the shipped ones. Raise Error naming the key and the value."""
    path = shipped("launch/stageros.yaml")
    tree, unknown = _over(settings.load(path), Section(values, where), where)
    top = Section(tree, where)
    filled = top.flag("fill_covariance")
    switches = ("bumper", "publish_bumpers"), ("fiducial", "publish_fiducials")
    devices = tuple(kind for kind, switch in switches if top.flag(switch))
    variances = [_variances(top, key, filled) for key in ("pose_variances", "twist_variances")]
    result = StagerosSettings(
        watchdog_timeout=top.number("base_watchdog_timeout"),
        depth_canonical=top.flag("is_depth_canonical"),
        frames=_frames(top),
        strip_leading_slash=top.flag("strip_leading_slash"),
        relative_topics=top.flag("relative_topics"),
        robot_prefix=top.text("robot_prefix", choices=("stage", "always", "never")),
        publish_tf=top.flag("publish_tf"),
        set_child_frame_id=top.flag("set_child_frame_id"),
        pose_variances=variances[0],
        twist_variances=variances[1],
        scan_timing=top.flag("scan_timing"),
        all_sensors=top.text("sensors", choices=("first", "all")) == "all",
        sonar_as_range=top.flag("sonar_as_range"),
        publish_collision=top.flag("publish_collision"),
        publish_devices=devices,
        rates=read_rates(top.section("rates")),
        view_rate=top.number("view_rate", above=0),
        states=StateFolder(Path(top.text("states"))),
        headless_rate=top.number("headless_rate", at_least=0),
        seed=top.integer("seed", at_least=0),
        options=_options(_mapping(top, "simulator"), where, devices),
        image_extents=top.flag("image_extents"),
        parameters=_mapping(top, "parameters"),
        unknown=unknown,
    )
    top.end()
    return result


def _options(values: dict[str, Any], where: str, devices: tuple[str, ...]) -> Options:
    """Return the simulator's options, with devices that are published, too.

    Unlike above, a key it does not know is an error: 1.8.0 had none of them.
    """
    tree, unknown = _over(settings.load(shipped("launch/simulator.yaml")), Section(values, where), f"{where}/simulator")
    if unknown:
        raise Error(unknown[0])
    options = read_options(Section(tree, where, "simulator"))
    return replace(options, devices=tuple(sorted({*options.devices, *devices})))


def _over(below: Section, above: Section, where: str) -> tuple[dict[str, Any], tuple[str, ...]]:
    """Return the shipped tree with what is given put in its place, and words about what has no place."""
    tree = {key: below.take(key) for key in below.names()}
    unknown = []
    for key in above.names():
        value = above.take(key)
        if key not in tree:
            close = nearest(key, tree)
            unknown.append(f"{where}/{key} is not a parameter" + (f"; did you mean {close[0]}?" if close else ""))
        elif isinstance(tree[key], dict) and isinstance(value, dict):
            tree[key] = {**tree[key], **value}
        else:
            tree[key] = value
    return tree, tuple(unknown)


def _mapping(section: Section, key: str) -> dict[str, Any]:
    value = section.take(key)
    if not isinstance(value, dict):
        raise section.error(key, f"must be a mapping: {value!r}")
    return value


def _variances(top: Section, key: str, filled: bool) -> tuple[float, ...]:
    """Return six variances; zeros, as in stage_ros, if they are not to be filled in."""
    values = top.numbers(key, 6)
    if min(values) < 0:
        raise top.error(key, f"must not be negative: {list(values)}")
    return values if filled else (0.0,) * 6


def _frames(top: Section) -> Frames:
    names = {
        "odom": _frame(top, "frame_odom"),
        "base_footprint": _frame(top, "frame_base_footprint"),
        "base_link": _frame(top, "frame_base_link"),
        "base_laser_link": _frame(top, "frame_base_laser_link"),
        "base_sonar_link": _frame(top, "frame_base_sonar_link"),
        "camera": _frame(top, "frame_camera"),
    }
    for key, name in names.items():
        if list(names.values()).count(name) > 1:
            raise top.error(f"frame_{key}", f"is the name of another frame, too: {name}")
    return Frames(**names, ground_truth=_frame(top, "frame_ground_truth"))


def _frame(top: Section, key: str) -> str:
    frame = top.text(key)
    if frame.startswith("/"):
        raise top.error(key, f"must not start with a slash, which comes with the robot's name: {frame}")
    return frame
