# SPDX-License-Identifier: BSD-3-Clause
"""python3 -m cliff OUT --kind KIND --seed N."""

import argparse
from pathlib import Path

from . import KINDS, make

parser = argparse.ArgumentParser(prog="cliff")
parser.add_argument("out", type=Path)
parser.add_argument("--kind", choices=KINDS, required=True)
parser.add_argument("--seed", type=int, required=True)
options = parser.parse_args()
make(options.out, options.kind, options.seed)
