# SPDX-License-Identifier: BSD-3-Clause
"""rviz, if it is installed: for launch files, where roslaunch alone would not say how to get it."""

from __future__ import annotations

import os
import shutil
import sys
from pathlib import Path

from kurumaisu import program

_HELP = """
Start rviz, or say how to get it. Launch files take it with gui:=true.
"""


def main() -> int:
    """Become rviz; return 1 where it is not installed."""
    parser = program.node_parser("rviz", _HELP)
    parser.add_argument("-d", dest="config", type=Path, metavar="FILE.rviz", help="what it shows")
    parser.add_argument("-f", dest="frame", metavar="FRAME", help="the frame it is shown in, instead of the file's")
    parser.parse_args(program.words())
    found = shutil.which("rviz")
    if found is not None:
        os.execv(found, [found, *sys.argv[1:]])
    print("rviz is not installed. To get it: scripts/setup --gui, or apt-get install rviz.", file=sys.stderr)
    return 1
