# SPDX-License-Identifier: BSD-3-Clause
"""The command check-world: what a world holds, and what in it will surprise."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from kurumaisu import program
from kurumaisu.errors import Error
from kurumaisu.params import shipped
from kurumaisu.sim.options import load_options
from kurumaisu.sim.robots.simulator import Simulator
from kurumaisu.types import FloatArray
from kurumaisu.world import World
from kurumaisu.world.check import findings
from kurumaisu.world.cli import add_world, load
from kurumaisu.world.contents import contents
from kurumaisu.world.findings import Finding, told
from kurumaisu.world.model import Place, Ranger

_SURPRISES = 3  # exit code; 1 is an error, 2 a wrong command line, as everywhere
_APART = 0.1  # [m] between a beam here and in Stage, and two cells, that count
_MOST = 1_000_000  # beams that are compared
_MANY = 0.05  # share of such beams: in 8 of 21 worlds that come with Stage and stage_ros


def check_world(arguments: list[str] | None = None) -> int:
    """Say what a world contains and what in it will surprise. Return 0, 3 with surprises, 1 for a bad file."""
    parser = program.Parser(
        prog="check-world",
        description="Show what a world file contains, and what in it may surprise: what hurts most first.",
        epilog="Exit code: 0 no surprises, 3 some, 1 a bad file, 2 wrong usage.",
    )
    add_world(parser)
    parser.add_argument("-v", "--verbose", action="store_true", help="also what most worlds have; it is no surprise")
    options = parser.parse_args(arguments)
    try:
        world = load(options)
        lines = list(contents(world))
        surprises, routine = _said(world)
    except Error as error:
        print(f"check-world: {error}", file=sys.stderr)
        return 1
    count = f"{len(surprises)} surprise{'s' if len(surprises) > 1 else ''}:" if surprises else "no surprises"
    lines += ["", count, *surprises]
    if routine:
        lines += ["", "as in most worlds:", *routine] if options.verbose else [f"{len(routine)} more with -v"]
    print("\n".join(lines))
    return _SURPRISES if surprises else 0


def _said(world: World) -> tuple[list[str], list[str]]:
    """Return the surprises and what is routine, a line each; a macro's are the same each time."""
    found = [*findings(world), *_rounded(world)]
    surprises = [
        *told(finding for finding in found if not finding.routine),
        *(warning for warning in world.warnings if warning not in world.routine),
    ]
    routine = [
        *told(finding for finding in found if finding.routine),
        *(warning for warning in world.warnings if warning in world.routine),
    ]
    return list(dict.fromkeys(surprises)), list(dict.fromkeys(routine))


def _rounded(world: World) -> Iterator[Finding]:
    """Say so if many beams are far from what Stage's cells make of them; other semantics have no cells."""
    fans = [fan for model in world.models if isinstance(model.device, Ranger) for fan in model.device.fans]
    if world.semantics != "stage" or not 0 < sum(fan.samples for fan in fans) <= _MOST:
        return
    farthest = np.concatenate([np.full(fan.samples, fan.range_max) for fan in fans])
    try:
        here, stage = (np.minimum(_seen(world, how), farthest) for how in ("exact", "cells"))
    except Error:  # too many cells
        return
    apart, limit = np.abs(here - stage), max(_APART, 2 * world.resolution)
    share = float((apart > limit).mean())
    if share > _MANY:
        words = (
            f"from the start poses {100 * share:.0f} % of the beams are more than {limit:g} m from what Stage reads, "
            f"up to {apart.max():.1f} m: its cells of {world.resolution:g} m thicken robots and thin things, and so "
            "does ray_casting: cells (docs/stageros.md)"
        )
        yield Finding(Place(world.path, 1, 1), "lasers", words)


def _seen(world: World, ray_casting: str) -> FloatArray:
    """Return what all fans see from their start [m], without the noise that the file gives them."""
    still = tuple(
        replace(m, device=Ranger(tuple(replace(fan, noise=np.zeros(3)) for fan in m.device.fans)))
        if isinstance(m.device, Ranger)
        else m
        for m in world.models
    )
    shipped_options = load_options(shipped("launch/simulator.yaml"))
    options = replace(shipped_options, semantics="stage", collision="exact", ray_casting=ray_casting)
    return Simulator(replace(world, models=still), options).reset(seed=1).scans.ranges
