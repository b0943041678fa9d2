# SPDX-License-Identifier: BSD-3-Clause
"""Command line: python3 -m brook OUT --kind KIND --seed N."""

from __future__ import annotations

import argparse
from pathlib import Path

from . import KINDS, make

parser = argparse.ArgumentParser(description="Make one recording.")
parser.add_argument("out", type=Path)
parser.add_argument("--kind", choices=KINDS, required=True)
parser.add_argument("--seed", type=int, required=True)
given = parser.parse_args()
make(given.out, given.kind, given.seed)
