# SPDX-License-Identifier: BSD-3-Clause
"""Command line: python3 -m motors OUT --kind KIND --seed N."""

import argparse
from pathlib import Path

from . import KINDS, make

parser = argparse.ArgumentParser(
    prog="motors", description="recordings of a simulated wheelchair with something hidden"
)
parser.add_argument("out", type=Path)
parser.add_argument("--kind", choices=KINDS, required=True)
parser.add_argument("--seed", type=int, required=True)
args = parser.parse_args()
make(args.out, args.kind, args.seed)
