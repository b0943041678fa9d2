# SPDX-License-Identifier: BSD-3-Clause
"""Plays one of the paper's riddles through: python3 -m kurumaisu.riddles NAME [--seed N]."""

from __future__ import annotations

import importlib
import os
import sys
from collections.abc import Sequence

from kurumaisu import program
from kurumaisu.errors import Error, failed

NAMES = ("figure9", "offset", "equation2")


def main(arguments: Sequence[str]) -> int:
    """Print a riddle: question, hypotheses, what the critic says; return 0, or 1 where it cannot be played."""
    parser = program.Parser(prog="kurumaisu.riddles", description=__doc__)
    parser.add_argument("name", choices=NAMES, metavar="NAME", help=f"one of {', '.join(NAMES)}")
    parser.add_argument("--seed", type=int, default=1000, help="of the simulated noise")
    options = parser.parse_args(arguments)
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # the same sums, however many cores there are
    try:
        for line in importlib.import_module(f"kurumaisu.riddles.{options.name}").tell(options.seed):
            print(line, flush=True)
    except Error as error:
        return failed("kurumaisu.riddles", error)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
