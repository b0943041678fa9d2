# SPDX-License-Identifier: BSD-3-Clause
"""How the simulator behaves: launch/simulator.yaml."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from kurumaisu import settings

SEMANTICS = ("stage", "physical")
COLLISIONS = ("cells", "cells_stale", "exact")
RAY_CASTING = ("exact", "cells")
TIMINGS = ("stage", "consistent")


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
class Options:
    """What a world file does not say.

    semantics: stage or physical; collision: of stage semantics: cells (outlines collide where they share cells of the
    world's resolution, as in Stage), cells_stale (and robots that have not moved yet in a step are met where they
    were a step ago, as in Stage) or exact (where they cross); ray_casting of rangers: exact, or cells (over cells of
    the world's resolution, with Stage's own rounding; of stage semantics); timing: stage (scans and odometry are from
    before the step's move, the truth from after it) or consistent (all from after it; physical semantics are always
    so); threads of the ray caster; limit_acceleration: heed acceleration_bounds, which Stage does not; scan_sweep [s]
    from a scan's first to its last beam, at most one step: beams leave from where the robot is then; 0: all at once.
    """

    semantics: str
    collision: str
    ray_casting: str
    timing: str
    threads: int
    limit_acceleration: bool
    scan_sweep: float
    odometry_walk: OdometryWalk


def read_options(section: settings.Section) -> Options:
    """Return the options of a section. Raise Error naming file and key."""
    options = Options(
        semantics=section.text("semantics", SEMANTICS),
        collision=section.text("collision", COLLISIONS),
        ray_casting=section.text("ray_casting", RAY_CASTING),
        timing=section.text("timing", TIMINGS),
        threads=section.integer("threads", at_least=1),
        limit_acceleration=section.text("limit_acceleration", ("on", "off")) == "on",
        scan_sweep=section.number("scan_sweep", at_least=0),
        odometry_walk=_walk(section.section("odometry_walk")),
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
