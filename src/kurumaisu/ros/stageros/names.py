# SPDX-License-Identifier: BSD-3-Clause
"""How stage_ros 1.8.0 names topics and frames, and the switches for those who want other names."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

from kurumaisu.errors import Error
from kurumaisu.ros.stageros.settings import StagerosSettings
from kurumaisu.world.model import Camera, Device, Model, Position, Ranger


@dataclass(frozen=True)
class Names:
    """Puts a robot's prefix in front of words; prefix None: one robot alone."""

    prefix: str | None
    strip_leading_slash: bool
    relative_topics: bool

    def topic(self, word: str, device: int | None = None) -> str:
        """Return a topic's name; device: the number of one of several sensors."""
        name = self._mapped(word, device)
        return name.lstrip("/") if self.relative_topics else name

    def frame(self, word: str, device: int | None = None) -> str:
        """Return a frame's name."""
        name = self._mapped(word, device)
        return name.lstrip("/") if self.strip_leading_slash else name

    def _mapped(self, word: str, device: int | None) -> str:
        numbered = word if device is None else f"{word}_{device}"
        if self.prefix is not None:
            return f"/{self.prefix}/{numbered}"
        return word if device is None else f"/{numbered}"  # absolute, though there is one robot: so it is in 1.8.0


def robots_of(models: Sequence[Model]) -> list[Model]:
    """Return the robots: every position model anywhere in the tree, in file order."""
    return [model for model in models if isinstance(model.device, Position)]


def names_of(models: Sequence[Model], settings: StagerosSettings, use_model_names: bool) -> list[Names]:
    """Return the names of each robot. Raise Error for a name that ROS does not take, or that two have, with places."""
    robots = robots_of(models)
    prefixes = [_prefix(number, robot, use_model_names) for number, robot in enumerate(robots)]
    _refuse_twins(robots, prefixes)
    if settings.robot_prefix != "always" and not use_model_names and len(robots) == 1:
        prefixes = [None]
    if settings.robot_prefix == "never":
        prefixes = _only_sensor_carrier_plain(models, robots, prefixes)
    return [Names(prefix, settings.strip_leading_slash, settings.relative_topics) for prefix in prefixes]


def devices_of(models: Sequence[Model], robot: Model, kind: type[Device]) -> list[Model]:
    """Return the rangers, cameras or others that stand directly on a robot; stage_ros sees no others."""
    return [model for model in models if model.parent == robot.index and isinstance(model.device, kind)]


def names_of_another(number: int, robot: Model, settings: StagerosSettings, use_model_names: bool) -> Names:
    """Return the names of a robot that came later, the number-th from 0; the others keep theirs."""
    return Names(_prefix(number, robot, use_model_names), settings.strip_leading_slash, settings.relative_topics)


def _prefix(number: int, robot: Model, use_model_names: bool) -> str | None:
    if not use_model_names or not robot.name or ":" in robot.name:  # Stage's own names, of the unnamed, have a colon
        return f"robot_{number}"
    if not re.fullmatch(r"[A-Za-z0-9_/]+", robot.name):
        raise Error(f"{robot.place}: with -u the name must be valid in a ROS topic: {robot.name!r}")
    return robot.name


def _refuse_twins(robots: Sequence[Model], prefixes: Sequence[str | None]) -> None:
    first: dict[str | None, Model] = {}
    for robot, prefix in zip(robots, prefixes, strict=True):
        twin = first.setdefault(prefix, robot)
        if twin is not robot:
            raise Error(
                f"{robot.place}: with -u its topics and frames would be those of the robot at {twin.place}: both are "
                f"{prefix!r}: robots must have different names"
            )


def _only_sensor_carrier_plain(
    models: Sequence[Model], robots: Sequence[Model], prefixes: list[str | None]
) -> list[str | None]:
    """Take the prefix from the only robot with sensors; the others are what it has to avoid."""
    carriers = [i for i, robot in enumerate(robots) if any(devices_of(models, robot, k) for k in (Ranger, Camera))]
    if len(robots) > 1 and len(carriers) != 1:
        raise Error(
            f"robot_prefix: never: needs exactly one robot with sensors; there are {len(carriers)} of {len(robots)}"
        )
    plain = carriers[0] if carriers else 0
    return [None if i == plain else prefix for i, prefix in enumerate(prefixes)]
