# SPDX-License-Identifier: BSD-3-Clause
"""launch/paper.yaml: how the experiments are evaluated; units and meaning are there."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from kurumaisu import settings
from kurumaisu.params import shipped

FILE = "launch/paper.yaml"


@dataclass(frozen=True)
class Bootstrap:
    """How intervals are drawn."""

    resamples: int
    level: float
    seed: int


@dataclass(frozen=True)
class DriveOptions:
    """How a drive is cut into samples, and what determines a coefficient."""

    window: float
    settle: float
    steady: float
    poses: int
    rest: float
    voltage_sd: float
    block: float
    least_blocks: int
    widest_slope: float
    widest_intercept: float
    bent: float
    mixed: float
    better: float


@dataclass(frozen=True)
class Wall:
    """How scans of a wall are looked at."""

    distances: tuple[float, ...]
    scans: int
    ahead: float
    square: float
    depth: float
    least_scans: int
    tape_sd: float
    gate: float
    agree: float
    chance: float


@dataclass(frozen=True)
class PaperOptions:
    """All of it."""

    drive: DriveOptions
    wall: Wall
    bootstrap: Bootstrap


def load_options(path: Path | None = None) -> PaperOptions:
    """Read a file of settings, or the package's own. Raise Error naming file and key."""
    top = settings.load(shipped(FILE) if path is None else path)
    options = PaperOptions(
        _drive(top.section("drive")), _wall(top.section("wall")), _bootstrap(top.section("bootstrap"))
    )
    top.end()
    return options


def _drive(section: settings.Section) -> DriveOptions:
    counts = {name: section.integer(name, at_least=3) for name in ("poses", "least_blocks")}
    names = (
        "window",
        "settle",
        "steady",
        "rest",
        "voltage_sd",
        "block",
        "widest_slope",
        "widest_intercept",
        "bent",
        "mixed",
        "better",
    )
    drive = DriveOptions(**counts, **{name: section.number(name, above=0) for name in names})  # type: ignore[arg-type]
    section.end()
    return drive


def _wall(section: settings.Section) -> Wall:
    names = ("ahead", "square", "depth", "tape_sd", "gate", "agree", "chance")
    wall = Wall(
        distances=section.numbers("distances", 5),
        scans=section.integer("scans", at_least=2),
        least_scans=section.integer("least_scans", at_least=2),
        **{name: section.number(name, above=0) for name in names},
    )
    section.end()
    return wall


def _bootstrap(section: settings.Section) -> Bootstrap:
    bootstrap = Bootstrap(
        resamples=section.integer("resamples", at_least=99),
        level=section.number("level", above=0),
        seed=section.integer("seed", at_least=0),
    )
    section.end()
    if bootstrap.level >= 1:
        raise section.error("level", f"must be below 1: {bootstrap.level}")
    return bootstrap
