# SPDX-License-Identifier: BSD-3-Clause
"""How the simulator behaves: launch/simulator.yaml."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

from kurumaisu import settings
from kurumaisu.errors import Error
from kurumaisu.params import EffectSetting, effects_of

SEMANTICS = ("world", "stage", "physical")
COLLISIONS = ("cells", "cells_stale", "exact")
RAY_CASTING = ("exact", "cells")
TIMINGS = ("stage", "consistent")
DEVICES = ("bumper", "camera", "fiducial")
ALL_ROBOTS = "*"


@dataclass(frozen=True)
class OdometryWalk:
    """Random walk of integrated odometry: deviations after 1 m or 1 rad, growing with the root of the way.

    distance [m/sqrt(m)] along each axis; heading_per_metre [rad/sqrt(m)]; heading_per_radian [rad/sqrt(rad)].
    """

    distance: float
    heading_per_metre: float
    heading_per_radian: float

    @property
    def off(self) -> bool:
        """Whether it adds nothing."""
        return not (self.distance or self.heading_per_metre or self.heading_per_radian)


@dataclass(frozen=True)
class RobotEffects:
    """Effects on the robots of a name, or on all."""

    robot: str
    effects: tuple[EffectSetting, ...]


@dataclass(frozen=True)
class Options:
    """What a world file does not say.

    semantics: stage, physical, or world: what the world file says; collision: of stage semantics: cells (outlines
    collide where they share cells of the world's resolution, as in Stage), cells_stale (and robots that have not
    moved yet in a step are met where they were a step ago, as in Stage) or exact (where they cross); ray_casting: of
    stage semantics: exact, or cells (over cells of the world's resolution, by Stage's own arithmetic; rangers with
    effects see exactly); timing: stage (scans and odometry are from before the step's move, the truth from after it)
    or consistent (all from after it; physical semantics are always so); threads of the ray caster;
    limit_acceleration: heed acceleration_bounds, which Stage does not; scan_sweep [s] from a scan's first to its last
    beam, at most one step: beams leave from where the robot is then; 0: all at once. devices: types of models whose
    readings are wanted; effects: on robots and their rangers.
    """

    semantics: str
    collision: str
    ray_casting: str
    timing: str
    threads: int
    limit_acceleration: bool
    scan_sweep: float
    odometry_walk: OdometryWalk
    devices: tuple[str, ...]
    effects: tuple[RobotEffects, ...]

    def of_world(self, semantics: str) -> Options:
        """Return the options for a world file that asks for these semantics."""
        chosen = semantics if self.semantics == "world" else self.semantics
        return replace(self, semantics=chosen, timing="consistent" if chosen == "physical" else self.timing)


def read_options(section: settings.Section) -> Options:
    """Return the options of a section. Raise Error naming file and key."""
    options = Options(
        semantics=section.text("semantics", SEMANTICS),
        collision=section.text("collision", COLLISIONS),
        ray_casting=section.text("ray_casting", RAY_CASTING),
        timing=section.text("timing", TIMINGS),
        threads=section.integer("threads", at_least=1, at_most=1024),
        limit_acceleration=section.text("limit_acceleration", ("on", "off")) == "on",
        scan_sweep=section.number("scan_sweep", at_least=0),
        odometry_walk=_walk(section.section("odometry_walk")),
        devices=_devices(section),
        effects=tuple(_robot_effects(item) for item in section.items("effects")),
    )
    section.end()
    return options


def load_options(path: Path) -> Options:
    """Read a simulator.yaml. Raise Error naming file and key."""
    return read_options(settings.load(path))


def _walk(section: settings.Section) -> OdometryWalk:
    walk = OdometryWalk(
        distance=section.number("distance", at_least=0),
        heading_per_metre=section.number("heading_per_metre", at_least=0),
        heading_per_radian=section.number("heading_per_radian", at_least=0),
    )
    section.end()
    return walk


def _devices(section: settings.Section) -> tuple[str, ...]:
    kinds = section.take("devices")
    if not isinstance(kinds, list) or any(kind not in DEVICES for kind in kinds):
        raise section.error("devices", f"must be a list of some of {', '.join(DEVICES)}: {kinds!r}")
    return tuple(sorted(set(kinds)))


def _robot_effects(section: settings.Section) -> RobotEffects:
    from kurumaisu import effects  # most have none, and need not pay for the catalogue

    entry = RobotEffects(section.text("robot"), effects_of(section))
    section.end()
    try:
        effects.check(entry.effects)
    except Error as error:
        raise section.error("effects", str(error)) from error
    for effect in entry.effects:
        if issubclass(effects.by_id(effect.id), effects.WorldEffect):
            raise section.error("effects", f"{effect.id} acts on walls, not on a robot")
    return entry
