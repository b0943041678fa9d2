# SPDX-License-Identifier: BSD-3-Clause
"""python3 -m dune OUT --kind KIND --seed N."""

import argparse
from pathlib import Path

from . import KINDS, make

parser = argparse.ArgumentParser(prog="dune", description="Make one recording with something hidden in it.")
parser.add_argument("out", type=Path)
parser.add_argument("--kind", choices=KINDS, required=True)
parser.add_argument("--seed", type=int, required=True)
given = parser.parse_args()
make(given.out, given.kind, given.seed)
