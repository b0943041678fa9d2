# SPDX-License-Identifier: BSD-3-Clause
"""The command export-world, and the world that it and check-world are given."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from kurumaisu import program
from kurumaisu.errors import Error
from kurumaisu.maps import grid_pair
from kurumaisu.whole_files import write_whole
from kurumaisu.world.drawing import to_svg
from kurumaisu.world.files import parse_values
from kurumaisu.world.occupancy import occupancy
from kurumaisu.world.world import World, load_world


def export_world(arguments: list[str] | None = None) -> int:
    """Write a world as a map for map_server and as a drawing. Return 0, or 1 for bad input."""
    parser = program.Parser(
        prog="export-world", description="Write a world as a map_server pair (NAME.pgm, NAME.yaml) and as NAME.svg."
    )
    add_world(parser)
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
        world = load(options)
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


def add_world(parser: argparse.ArgumentParser) -> None:
    """Add the arguments that say which world."""
    parser.add_argument("world", type=Path, metavar="FILE", help="a Stage world, or a map_server YAML")
    parser.add_argument(
        "--image-extents",
        action="store_true",
        help="do not trim the margins of bitmaps, as Stage does",
    )
    parser.add_argument(
        "values", nargs="*", type=_value, metavar="NAME=VALUE", help="values for the world's parameters"
    )


def load(options: argparse.Namespace) -> World:
    """Return the world that the arguments say. Raise Error naming file, line and column."""
    return load_world(options.world, image_extents=options.image_extents, values=dict(options.values))


def _value(text: str) -> tuple[str, str]:
    """Return the name and the value in NAME=VALUE."""
    try:
        ((name, value),) = parse_values([text]).items()
    except Error as error:
        raise argparse.ArgumentTypeError(str(error)) from error
    return name, value
