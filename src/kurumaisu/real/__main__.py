# SPDX-License-Identifier: BSD-3-Clause
"""Criticises one real recording by its name: scripts/real NAME [--output FOLDER]."""

from __future__ import annotations

import importlib
import os
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

from kurumaisu import program
from kurumaisu.errors import Error, failed

# Module and what it is a recording of.
NAMES = {
    "warthog": "Clearpath Warthog on asphalt: wheel to ground",
    "warthog_command": "the same: command to wheel",
    "create": "two iRobot Create: commands and motion capture",
    "lego": "LEGO robot: odometry against a camera, and against scans",
    "mines": "rover of Mines ParisTech: ticks and scans",
    "urg": "URG-04LX on a bench, byte by byte",
    "handheld": "URG-04LX carried by hand",
    "sena": "SENA, a robotic wheelchair with a SICK: odometry and scans",
    "localization_demo": "37 scans and their odometry, of MRPT",
    "office": "two simulated drives with known odometry, as a check of the checker",
}


def main(arguments: Sequence[str]) -> int:
    """Print a recording's measures by hand and its verdict; return 0, or 1 where it is not there."""
    parser = program.Parser(prog="scripts/real", description=__doc__)
    parser.add_argument("name", choices=sorted(NAMES), metavar="NAME", help=f"one of {', '.join(sorted(NAMES))}")
    parser.add_argument("--data", type=Path, required=True, help="folder of the real recordings")
    parser.add_argument("--output", type=Path, help="folder for tables and reports; without it nothing is kept")
    options = parser.parse_args(arguments)
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # the same sums, however many cores there are
    module = importlib.import_module(f"kurumaisu.real.{options.name}")
    try:
        if options.output is not None:
            options.output.mkdir(parents=True, exist_ok=True)
            module.run(options.data, options.output)
            return 0
        with tempfile.TemporaryDirectory() as folder:
            module.run(options.data, Path(folder))
    except (Error, OSError) as error:
        return failed("scripts/real", error)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
