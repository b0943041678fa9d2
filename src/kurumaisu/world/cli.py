# SPDX-License-Identifier: BSD-3-Clause
"""The commands check-world and export-world."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from kurumaisu import program
from kurumaisu.errors import Error
from kurumaisu.maps import grid_pair
from kurumaisu.whole_files import write_whole
from kurumaisu.world.check import findings
from kurumaisu.world.contents import contents
from kurumaisu.world.drawing import to_svg
from kurumaisu.world.files import parse_values
from kurumaisu.world.occupancy import occupancy
from kurumaisu.world.world import World, load_world

_SURPRISES = 3  # exit code; 1 is an error, 2 a wrong command line, as everywhere


def check_world(arguments: list[str] | None = None) -> int:
    """Say what a world contains and what in it will surprise. Return 0, 3 with findings, 1 for a bad file."""
    parser = program.Parser(
        prog="check-world",
        description="Show what a world file contains, and what in it may surprise.",
        epilog="Exit code: 0 no surprises, 3 some, 1 a bad file, 2 wrong usage.",
    )
    _add_world(parser)
    options = parser.parse_args(arguments)
    try:
        world = _load(options)
    except Error as error:
        print(f"check-world: {error}", file=sys.stderr)
        return 1
    print("\n".join(contents(world)))
    surprises = list(dict.fromkeys([*world.warnings, *map(str, findings(world))]))  # a macro's are the same each time
    count = f"{len(surprises)} surprise{'s' if len(surprises) > 1 else ''}:" if surprises else "no surprises"
    print("\n".join(["", count, *surprises]))
    return _SURPRISES if surprises else 0


def export_world(arguments: list[str] | None = None) -> int:
    """Write a world as a map for map_server and as a drawing. Return 0, or 1 for bad input."""
    parser = program.Parser(
        prog="export-world", description="Write a world as a map_server pair (NAME.pgm, NAME.yaml) and as NAME.svg."
    )
    _add_world(parser)
    parser.add_argument("-o", "--output", type=Path, metavar="FOLDER", default=Path(), help="folder to write into (.)")
    parser.add_argument(
        "--resolution", type=float, default=0.05, metavar="M", help="size of the map's cells [m] (0.05)"
    )
    parser.add_argument(
        "--height", type=float, default=0.4, metavar="M", help="height of the map's plane [m] (0.4, a laser's)"
    )
    parser.add_argument(
        "--png", action="store_true", help="write the map as NAME.png: much smaller; map_server reads it too"
    )
    options = parser.parse_args(arguments)
    if not 1e-3 <= options.resolution <= 10:
        parser.error(f"--resolution: must be 0.001 to 10 m: {options.resolution:g}")
    try:
        world = _load(options)
        options.output.mkdir(parents=True, exist_ok=True)
        path = options.output / options.world.stem
        grid = occupancy(world, options.resolution, options.height)
        drawing, drawn = path.with_name(path.name + ".svg"), to_svg(world)
        pair = grid_pair(grid, path, ".png" if options.png else ".pgm")
        write_whole({**pair, drawing: drawn})
    except (Error, OSError) as error:
        print(f"export-world: {error}", file=sys.stderr)
        return 1
    print(f"written: {', '.join(map(str, [*pair, drawing]))}")
    return 0


def _add_world(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("world", type=Path, metavar="FILE", help="a Stage world, or a map_server YAML")
    parser.add_argument(
        "--image-extents",
        action="store_true",
        help="do not trim the margins of bitmaps, as Stage does",
    )
    parser.add_argument(
        "values", nargs="*", type=_value, metavar="NAME=VALUE", help="values for the world's parameters"
    )


def _load(options: argparse.Namespace) -> World:
    return load_world(options.world, image_extents=options.image_extents, values=dict(options.values))


def _value(text: str) -> tuple[str, str]:
    """Return the name and the value in NAME=VALUE."""
    try:
        ((name, value),) = parse_values([text]).items()
    except Error as error:
        raise argparse.ArgumentTypeError(str(error)) from error
    return name, value
